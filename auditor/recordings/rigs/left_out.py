"""What is left out of a rig, and why: a sentence for people, and what decisions need of it.

Of many cameras those stay that can be compared: pairs grow with the square of cameras, triples faster.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice
from operator import itemgetter
from typing import Protocol, TypeVar

import numpy as np

from auditor.model.optics.common_view import NEAREST_AHEAD
from auditor.model.optics.geometry import Matrix
from auditor.model.parameters import COMMON_VIEW, PAIR_DEPTH
from auditor.model.rig import Camera
from auditor.recordings.formats.found import span_over
from auditor.recordings.parameters import RIG_LIMITS
from auditor.recordings.synchronisation.survey import CloudTopic, ImageTopic


@dataclass(frozen=True)
class Reason:
    """A sentence that says why; `of` is the name or topic of the one sensor that is left out for it, if it is one.

    `others` are names of sensors that it is a reason for as well: those of a group, or the one that `of` does not fit.
    """

    text: str
    of: str = ""
    others: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.text

    def tells_of(self, *names: str) -> bool:
        """Whether it is a reason for the sensor that has one of these names."""
        return not {self.of, *self.others}.isdisjoint(names)


class TooFew(Reason):
    """Cameras that look the same way are too few for a rig, and no LiDAR has a place beside them."""

    def __init__(self, names: Sequence[str], fact: str = "") -> None:
        fact = fact or ("there is 1 camera" if len(names) == 1 else f"{len(names)} cameras look the same way")
        lidar = f"no LiDAR has a place beside {'it' if len(names) == 1 else 'them'}"
        super().__init__(f"{fact} ({names_of(names)}), and {lidar}", others=tuple(names))


class AllApart(TooFew):
    """Cameras none of which can be compared with another one."""


class PlacedCamera(Protocol):
    """A camera that has its place."""

    @property
    def name(self) -> str:
        """What people call it; those of two vehicles may have one name."""

    @property
    def topic(self) -> str:
        """The topic of its pictures."""


class AtOnePlace(Reason):
    """A camera is at the place of another: they may be two topics of one."""

    def __init__(self, camera: PlacedCamera, other: PlacedCamera) -> None:
        names = (camera.name, other.name) if camera.name != other.name else (camera.topic, other.topic)
        super().__init__("{} lies where {} lies".format(*names), camera.name, (other.name,))


_MOST_NAMED = 100
_DIGITS = 9  # what differs by rounding alone overlaps alike

Some = TypeVar("Some")

Sensor = TypeVar("Sensor", bound=ImageTopic | CloudTopic)

_FEWEST_BEHIND = 2  # messages behind another topic's last one: a single one may only come first


def without_renamed(sensors: Sequence[Sensor], reasons: list[Reason]) -> list[Sensor]:
    """The topics, less those that go on where another of the same frame ends; `reasons` gets a sentence for each."""
    spans = [(span_over(sample.log_time_ns for sample in topic.samples), topic) for topic in sensors if topic.frame_id]
    in_turn = sorted(((*span, topic.topic.name, topic) for span, topic in spans if span), key=itemgetter(0, 2))
    last: dict[str, tuple[int, str]] = {}
    renamed: set[str] = set()
    for begins_ns, ends_ns, name, sensor in in_turn:
        ended_ns, before = last.get(sensor.frame_id, (begins_ns, ""))
        if ended_ns < begins_ns and len(sensor.samples) >= _FEWEST_BEHIND:
            why = f"{name} goes on where {before} ends, in the same frame"
            reasons.append(Reason(f"{why}: the recording renames it there: cut it there, and audit both parts", name))
            renamed.add(name)
        last[sensor.frame_id] = max((ended_ns, before), (ends_ns, name))
    return [sensor for sensor in sensors if sensor.topic.name not in renamed]


def overlapping_most(
    cameras: Sequence[Camera], reasons: list[Reason], most: int = RIG_LIMITS.most_cameras
) -> list[Camera]:
    """Of more than `most` cameras those that overlap most, in their order; `reasons` then gets what is left out.

    These are the one camera whose best partners overlap it most, and these partners. The work grows with the square of
    the cameras.
    """
    if len(cameras) <= most:
        return list(cameras)
    shared = _overlaps(cameras)
    best = np.sort(shared, axis=1)[:, -most:].sum(axis=1)
    chosen = set(np.argsort(-shared[int(np.argmax(best))], kind="stable")[:most].tolist())
    left_out = tuple(camera.name for index, camera in enumerate(cameras) if index not in chosen)
    why = f"{len(cameras)} cameras look the same way, and at most {most} are compared: those that overlap most. "
    reasons.append(Reason(f"{why}Left out: {names_of(left_out)}", others=left_out))
    return [cameras[index] for index in sorted(chosen)]


def first_ones(some: Sequence[Some], most: int, fact: str, names: Iterable[str], reasons: list[Reason]) -> list[Some]:
    """The first `most` of some things; `reasons` then gets the `names` of the others. There is one name for each."""
    if len(some) > most:
        left_out = tuple(names)[most:]
        why = f"{len(some)} {fact}, and at most {most} are looked at. Left out: {names_of(left_out)}"
        reasons.append(Reason(why, others=left_out))
    return list(some[:most])


def names_of(names: Sequence[str]) -> str:
    """Names as one list, the first 100 in full."""
    more = [f"and {len(names) - _MOST_NAMED} more"] if len(names) > _MOST_NAMED else []
    return ", ".join([*islice(names, _MOST_NAMED), *more])


def _overlaps(cameras: Sequence[Camera]) -> Matrix:
    """(n, n): of what two cameras see on a wall ahead, the share that both see; lenses and rolls are neglected."""
    low, high = np.array([_seen_m(camera) for camera in cameras]).transpose(1, 0, 2)
    both = np.clip(np.minimum(high[:, None], high) - np.maximum(low[:, None], low), 0, None).prod(axis=2)
    each = (high - low).prod(axis=1)
    shared: Matrix = both / np.maximum(each[:, None] + each - both, np.finfo(float).tiny)
    return np.round(shared, _DIGITS)


def _seen_m(camera: Camera) -> Matrix:
    """(2, 2): the lowest and highest x and y, in metres, of what a camera sees on a wall across the rig's z axis."""
    u, v = (0, camera.width_px), (0, camera.height_px)
    corners = np.array([(x, y, 1.0) for x in u for y in v]).T
    rays = camera.rotation.T @ np.linalg.solve(camera.intrinsics, corners)
    tangents = rays[:2] / np.maximum(rays[2], NEAREST_AHEAD)
    wall = camera.centre_m[:2, None] + PAIR_DEPTH.distance_m * np.clip(
        tangents, -COMMON_VIEW.widest, COMMON_VIEW.widest
    )
    return np.array([wall.min(axis=1), wall.max(axis=1)])
