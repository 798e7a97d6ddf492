"""What an attacker who writes the log can do to it, so that an attack in it is not seen.

Each way changes the messages of a log from the moment on at which its attack begins.
"""

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace

import numpy as np

from tests.making.logs_of_strangers import (
    DAY_NS,
    PERIOD_NS,
    START_NS,
    Attack,
    Calibration,
    Cloud,
    Log,
    Mounts,
    Picture,
    Sent,
    Unknown,
    record,
)
from tests.making.vehicles_of_strangers import LIDAR_FRAME, WAGON, Vehicle

BEGINS, MOMENTS, SEED = 2, 5, 13
HIT = range(BEGINS, MOMENTS)
SPOT, WALL = Attack(("right",), moments=HIT), Attack(wall=True, moments=HIT)
SENSOR_BODIES = (Picture, Cloud)


@dataclass(frozen=True)
class Way:
    """One way to hide; `attack` is what the log would show without it."""

    name: str
    attack: Attack
    hide: Callable[[Log], Log]
    vehicle: Vehicle = WAGON

    def log(self) -> Log:
        return self.hide(record(self.vehicle, range(MOMENTS), attack=self.attack, seed=SEED))


def of_sensors(sent: Sent) -> bool:
    return isinstance(sent.body, SENSOR_BODIES)


def from_the_attack_on(change: Callable[[Sent], Sent | None]) -> Callable[[Log], Log]:
    """Messages of sensors are changed, or left out, from the moment on at which the attack begins."""

    def hide(log: Log) -> Log:
        changed = (change(sent) if of_sensors(sent) and sent.moment >= BEGINS else sent for sent in log)
        return [sent for sent in changed if sent is not None]

    return hide


def everywhere(change: Callable[[Sent], Sent | None]) -> Callable[[Log], Log]:
    return lambda log: [changed for sent in log if (changed := change(sent)) is not None]


def repeated(log: Log) -> Log:
    """Every attacked message bears the last clean stamp of its topic."""
    last = {sent.topic: sent.stamp_ns for sent in log if sent.moment < BEGINS}
    return from_the_attack_on(lambda sent: sent.restamped(last[sent.topic]))(log)


def all_equal(log: Log) -> Log:
    """A clock that stands still: every message of a topic bears the stamp of its first one."""
    first: dict[str, int] = {}
    return [sent.restamped(first.setdefault(sent.topic, sent.stamp_ns)) for sent in log]


def shifted(by_ns: int) -> Callable[[Sent], Sent]:
    return lambda sent: sent.restamped(sent.stamp_ns + by_ns)


def a_camera_between(log: Log) -> Log:
    """The attacked camera's stamps fall between the frames of all others."""
    half = shifted(PERIOD_NS // 2)
    return from_the_attack_on(lambda sent: half(sent) if sent.topic == WAGON.topic("right") else sent)(log)


def cut(form: str) -> Callable[[Sent], Sent]:
    """Images of the attacked camera hold 20 % of their bytes."""

    def change(sent: Sent) -> Sent:
        if sent.topic == WAGON.topic("right") and isinstance(sent.body, Picture):
            return replace(sent, body=replace(sent.body, form=form, kept=0.2))
        return sent

    return change


def lying(sent: Sent) -> Sent:
    """Clouds say that they hold one point more than they do."""
    if isinstance(sent.body, Cloud):
        return replace(sent, body=replace(sent.body, width=len(sent.body.xyz_m) + 1))
    return sent


def without(topics: Collection[str]) -> Callable[[Sent], Sent | None]:
    return lambda sent: None if sent.topic in topics else sent


def without_frame(frame: str) -> Callable[[Sent], Sent]:
    """The mounts do not say where a sensor sits."""

    def change(sent: Sent) -> Sent:
        if isinstance(sent.body, Mounts):
            places = {name: place for name, place in sent.body.places.items() if name != frame}
            return replace(sent, body=replace(sent.body, places=places))
        return sent

    return change


def of_another_type(topic: str, schema: str) -> Callable[[Sent], Sent]:
    """The messages of a topic get a type that only its maker knows."""

    def change(sent: Sent) -> Sent:
        if sent.topic != topic:
            return sent
        data = sent.body.xyz_m if isinstance(sent.body, Cloud) else sent.body.pixels
        return replace(sent, body=Unknown(schema, np.ascontiguousarray(data).tobytes()))

    return change


def swapped_infos(log: Log) -> Log:
    """In the middle of the log two cameras change places in what calibrates them."""
    other = {"right": "inner_left", "inner_left": "right"}
    named = {WAGON.info(camera): WAGON.projection(swapped) for camera, swapped in other.items()}

    def change(sent: Sent) -> Sent:
        if isinstance(sent.body, Calibration) and sent.topic in named and sent.moment >= BEGINS:
            return replace(sent, body=replace(sent.body, projection=named[sent.topic]))
        return sent

    return [change(sent) for sent in log]


def elsewhere(camera: str, moved_m: float) -> Callable[[Sent], Sent]:
    """The calibration says that a camera sits elsewhere."""

    def change(sent: Sent) -> Sent:
        if isinstance(sent.body, Calibration) and sent.topic == WAGON.info(camera):
            return replace(sent, body=replace(sent.body, projection=WAGON.projection(camera, moved_m)))
        if isinstance(sent.body, Mounts):
            places = dict(sent.body.places)
            places[f"{camera}_optical"] = places[f"{camera}_optical"].copy()
            places[f"{camera}_optical"][1, 3] -= moved_m
            return replace(sent, body=replace(sent.body, places=places))
        return sent

    return change


def smaller(sent: Sent) -> Sent:
    """The attacked camera's images become half as wide."""
    if sent.topic == WAGON.topic("right") and isinstance(sent.body, Picture):
        return replace(sent, body=replace(sent.body, pixels=np.ascontiguousarray(sent.body.pixels[:, ::2])))
    return sent


def with_a_hole(log: Log) -> Log:
    """The attacked part is left out; half a minute later the log goes on for some frames."""
    later = record(WAGON, range(BEGINS), seed=SEED, start_ns=START_NS + 30 * 10**9)
    return [sent for sent in log if sent.moment < BEGINS] + later[1:]


def at_the_end(log: Log) -> Log:
    """The attacked camera's messages are written behind all others, as if they had been late."""
    behind = [sent for sent in log if sent.topic == WAGON.topic("right") and sent.moment >= BEGINS]
    return [sent for sent in log if sent not in behind] + behind


def behind_a_decoy(topic: str) -> Callable[[Log], Log]:
    """Beside the attacked camera's topic there is another one of the same camera, with clean images."""

    def hide(log: Log) -> Log:
        clean = record(WAGON, range(MOMENTS), seed=SEED)
        decoys = [
            replace(sent, topic=topic, body=replace(sent.body, form="raw"))
            for sent in clean
            if sent.topic == WAGON.topic("right") and isinstance(sent.body, Picture)
        ]
        return sorted([*log, *decoys], key=lambda sent: sent.log_ns)

    return hide


def moved_away(log: Log) -> Log:
    """The attacked camera's messages get another topic, and clean ones take their place."""
    clean = [sent for sent in record(WAGON, range(MOMENTS), seed=SEED) if sent.topic == WAGON.topic("right")]
    moved = [replace(sent, topic="/right/raw") if sent.topic == WAGON.topic("right") else sent for sent in log]
    return sorted([*moved, *clean], key=lambda sent: sent.log_ns)


def between_frames(log: Log) -> Log:
    """The cameras are twice as fast as the LiDAR; only the images between two sweeps are attacked."""
    clean = record(WAGON, range(MOMENTS), seed=SEED)
    cameras = [sent for sent in log if isinstance(sent.body, Picture)]
    half = [
        replace(sent, stamp_ns=sent.stamp_ns + PERIOD_NS // 2, log_ns=sent.log_ns + PERIOD_NS // 2) for sent in cameras
    ]
    return sorted([*clean, *half], key=lambda sent: sent.log_ns)


def beside_clean_twins(log: Log) -> Log:
    """Each attacked image has a clean one of the same topic 2 ms from it."""
    clean = record(WAGON, range(MOMENTS), seed=SEED)
    twins = [
        replace(sent, stamp_ns=sent.stamp_ns + 2_000_000, log_ns=sent.log_ns + 2_000_000)
        for sent in log
        if sent.topic == WAGON.topic("right") and sent.moment >= BEGINS
    ]
    return sorted([*clean, *twins], key=lambda sent: sent.log_ns)


def in_turn(*attacks: Attack) -> Callable[[Log], Log]:
    """The sensors are attacked one after the other, a moment each, and then anew."""

    def hide(_: Log) -> Log:
        logs = [record(WAGON, range(MOMENTS), attack=replace(one, moments=HIT), seed=SEED) for one in attacks]
        return [sent for sents in zip(*logs, strict=True) for sent in (sents[sents[0].moment % len(logs)],)]

    return hide


def frozen(topics: Collection[str] | None = None) -> Callable[[Log], Log]:
    """From the attack on topics, or all of sensors, have the data of their last clean message under new stamps."""

    def hide(log: Log) -> Log:
        last = {sent.topic: sent.body for sent in log if of_sensors(sent) and sent.moment < BEGINS}
        chosen = last.keys() if topics is None else topics
        change = from_the_attack_on(lambda sent: replace(sent, body=last[sent.topic]) if sent.topic in chosen else sent)
        return change(log)

    return hide


def again(change: Callable[[Sent], Sent], moments: Collection[int]) -> Callable[[Log], Log]:
    """What calibrates the vehicle is published again, and changed, right before these moments."""

    def hide(log: Log) -> Log:
        said = [sent for sent in log if isinstance(sent.body, Calibration | Mounts) and sent.moment == 0]
        later = []
        for moment in moments:
            first = min(sent.log_ns for sent in log if sent.moment == moment)
            later += [replace(change(sent), stamp_ns=first, log_ns=first - 1, moment=moment) for sent in said]
        kept = [sent for sent in log if not isinstance(sent.body, Calibration) or sent.moment == 0]
        return sorted([*kept, *later], key=lambda sent: sent.log_ns)

    return hide


def nudged(sent: Sent) -> Sent:
    """The LiDAR sits a millimetre beside its place."""
    if not isinstance(sent.body, Mounts):
        return sent
    places = {name: place.copy() for name, place in sent.body.places.items()}
    places[LIDAR_FRAME][0, 3] += 0.001
    return replace(sent, body=replace(sent.body, places=places))


def projected(change: Callable[[np.ndarray], np.ndarray], size: float = 1.0) -> Callable[[Sent], Sent]:
    """Camera infos say another projection, and images of another size."""

    def changed(sent: Sent) -> Sent:
        if not isinstance(sent.body, Calibration):
            return sent
        width, height = sent.body.size_px
        own = Calibration(change(sent.body.projection), (round(width * size), round(height * size)))
        return replace(sent, body=own)

    return changed


def points(change: Callable[[np.ndarray], np.ndarray]) -> Callable[[Sent], Sent]:
    """The LiDAR's points are said otherwise than they are."""

    def changed(sent: Sent) -> Sent:
        if not isinstance(sent.body, Cloud):
            return sent
        return replace(sent, body=Cloud(np.ascontiguousarray(change(sent.body.xyz_m), dtype=np.float32)))

    return changed


def renamed(topic: str, name: str) -> Callable[[Sent], Sent]:
    return lambda sent: replace(sent, topic=name) if sent.topic == topic else sent


def out_of_phase(log: Log) -> Log:
    """Every camera is thinned to half its rate: one half has the even moments, the other half the odd ones."""
    odd = {WAGON.topic(camera) for camera in ("right", "left")}
    return [sent for sent in log if not isinstance(sent.body, Picture) or sent.moment % 2 == int(sent.topic in odd)]


def of_topic(topic: str, change: Callable[[Sent], Sent]) -> Callable[[Sent], Sent]:
    return lambda sent: change(sent) if sent.topic == topic else sent


ALL_ALONG = range(MOMENTS)
MIRRORED = np.diag([1.0, -1.0, 1.0])
RIGHT, LIDAR = WAGON.topic("right"), WAGON.lidar_topic

WAYS = (
    Way("stamps that repeat", SPOT, repeated),
    Way("all stamps equal", SPOT, all_equal),
    Way("negative stamps", SPOT, everywhere(shifted(-START_NS - 60 * 10**9))),
    Way("stamps that jump a day ahead", SPOT, from_the_attack_on(shifted(DAY_NS))),
    Way("stamps that jump a day back", SPOT, from_the_attack_on(shifted(-DAY_NS))),
    Way("stamps of one camera between all others", SPOT, a_camera_between),
    Way("one camera's messages behind all others", SPOT, at_the_end),
    Way("cut PNG images", SPOT, from_the_attack_on(cut("png"))),
    Way("cut JPEG images", SPOT, from_the_attack_on(cut("jpg"))),
    Way("images of half the width", SPOT, from_the_attack_on(smaller)),
    Way("clouds that lie about their width", WALL, from_the_attack_on(lying)),
    Way("a camera's topic ends", SPOT, from_the_attack_on(without({RIGHT}))),
    Way("a camera's topic is removed", SPOT, everywhere(without({RIGHT}))),
    Way("the LiDAR's topic ends", WALL, from_the_attack_on(without({LIDAR}))),
    Way("the LiDAR's topic is removed", WALL, everywhere(without({LIDAR}))),
    Way("the reference camera ends", WALL, from_the_attack_on(without({WAGON.topic("left")}))),
    Way("a camera without its camera info", SPOT, everywhere(without({WAGON.info("right")}))),
    Way("a LiDAR that nobody mounted", WALL, everywhere(without_frame(LIDAR_FRAME))),
    Way("camera infos change places", SPOT, swapped_infos),
    Way("a camera said to sit 12 cm beside its place", SPOT, everywhere(elsewhere("right", -0.12))),
    Way("a camera's type is unknown", SPOT, everywhere(of_another_type(RIGHT, "makers_msgs/Picture"))),
    Way("the LiDAR's type is Livox's", WALL, everywhere(of_another_type(LIDAR, "livox_ros_driver2/CustomMsg"))),
    Way("mostly empty", SPOT, with_a_hole),
    Way("attacked images beside clean twins", SPOT, beside_clean_twins),
    Way("a spot that is always there", replace(SPOT, moments=ALL_ALONG), list),
    Way("a wall that is always there", replace(WALL, moments=ALL_ALONG), list),
    Way("a spot in one moment", replace(SPOT, moments=range(3, 4)), list),
    Way("a wall in one moment", replace(WALL, moments=range(3, 4)), list),
    Way("a spot in two moments", replace(SPOT, moments=range(3, 5)), list),
    Way("a spot at the very end", replace(SPOT, moments=range(MOMENTS - 1, MOMENTS)), list),
    Way("cameras attacked in turn", SPOT, in_turn(*(Attack((one,)) for one in ("right", "left", "inner_left")))),
    Way("a camera and the LiDAR in turn", SPOT, in_turn(Attack(("right",)), Attack(wall=True))),
    Way("an attacked camera whose data stand still", SPOT, frozen({RIGHT})),
    Way("a LiDAR whose data stand still", SPOT, frozen({LIDAR})),
    Way("all data stand still", SPOT, frozen()),
    Way("mounts said again within the attack", WALL, again(nudged, [3])),
    Way("mounts said again before every moment", SPOT, again(nudged, range(1, MOMENTS))),
    Way("the LiDAR's type is called diagnostics", WALL, everywhere(of_another_type(LIDAR, "acme_msgs/Diagnostics"))),
    Way("the LiDAR is called a radar", WALL, everywhere(renamed(LIDAR, "/radar/points"))),
    Way("a camera is called a mask", SPOT, everywhere(renamed(RIGHT, "/segmentation/mask/compressed"))),
    Way("all baselines of the other sign", SPOT, everywhere(projected(lambda P: P * [[1, 1, 1, -1]]))),
    Way("all baselines ten times as long", SPOT, everywhere(projected(lambda P: P * [[1, 1, 1, 10]]))),
    Way("camera infos of twice the size", SPOT, everywhere(projected(lambda P: P * [[2], [2], [1]], size=2))),
    Way("focal lengths of half the size", WALL, everywhere(projected(lambda P: P * [[0.5, 1, 1, 0.5]]))),
    Way("points in millimetres", SPOT, everywhere(points(lambda xyz: xyz * 1000))),
    Way("points that are mirrored", SPOT, everywhere(points(lambda xyz: xyz @ MIRRORED))),
    Way("points with other axes", SPOT, everywhere(points(lambda xyz: xyz[:, [1, 2, 0]]))),
    Way("points that all lie at one place", SPOT, everywhere(points(lambda xyz: xyz * 0 + 1))),
    Way("points that are not numbers", WALL, everywhere(points(lambda xyz: xyz * np.nan))),
    Way("cameras out of phase", SPOT, out_of_phase),
    Way("the LiDAR 37 s ahead", WALL, everywhere(of_topic(LIDAR, shifted(37 * 10**9)))),
    Way("one camera's stamps since its start", SPOT, everywhere(of_topic(RIGHT, shifted(-START_NS + 10**9)))),
    Way("stamps of zero from the attack on", SPOT, from_the_attack_on(lambda sent: sent.restamped(0))),
)

UNKNOWABLE = (
    (Way("a raw decoy beside the compressed topic", SPOT, behind_a_decoy("/right/image_rect")), RIGHT),
    (Way("a clean topic in the attacked one's place", SPOT, moved_away), "/right/raw"),
)
"""Two topics of one camera: no recording says which of them the vehicle used. The one that is not audited is named."""

BETWEEN_SWEEPS = Way("attacked between the LiDAR's sweeps", SPOT, between_frames)
"""A frame takes one message a sensor: what a faster sensor says between two frames is compared with nothing."""
