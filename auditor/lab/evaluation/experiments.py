"""The experiments as lists of cases: the paper's, attacks and faults beyond it, attacks that last, and ladders."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product
from pathlib import Path

import numpy as np

from auditor.errors import DecodingError, SettingError
from auditor.lab.attacks.catalogue import ON_CAMERA
from auditor.lab.attacks.coloured_light import COLOURS, Veil
from auditor.lab.attacks.faults import (
    DelayedCamera,
    DelayedLidar,
    HiddenSector,
    ScatteredPoints,
    ShiftedCamera,
    TurnedLidar,
)
from auditor.lab.attacks.interference import LaserPattern, Stripes
from auditor.lab.attacks.kinds import AttackDraw, OnCamera, OnLidar
from auditor.lab.attacks.paper import PAPER_WIDTH_PX, STRENGTHS, BogusWall, Facula, draw_facula, draw_wall
from auditor.model.checks import Pair
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig, Triple
from auditor.recordings.decoding.pictures import decode_picture
from auditor.store.evaluation_tables import INTERVAL_FRAMES, LASTING

Attack = OnCamera | OnLidar
Attacks = Mapping[int, Attack]
"""The attack on each attacked sensor. Attacks are hashable, and equal ones do the same."""


def parameters_of(attacks: Attacks) -> dict[str, dict[str, object]]:
    """Everything that decides the effect of some attacks, by sensor."""
    return {f"S_{s}": {"attack": a.name, **a.parameters} for s, a in sorted(attacks.items())}


def of_two(attacks: Attacks, pair: Pair) -> Attacks:
    """The attacks on the LiDAR and on a pair's cameras, under the numbers that these have in a rig of two."""
    return {number: attacks[sensor] for number, sensor in enumerate((LIDAR, *pair)) if sensor in attacks}


WALL_WIDTHS_M = (0.5, 1.0, 1.5, 2.0, 2.5)
"""Fig. 11."""

RADII_PX = (37.5, 75.0, 112.5, 150.0, 187.5, 225.0)
"""Fig. 12, on images of the paper's width."""

SENSITIVITY_STRENGTHS = ("mild", "opaque")

MOST_ATTACKED = 2
"""Sets that are only identified, not detected by one triple, have this many sensors at most."""

SECTORS_DEG = (10.0, 20.0, 30.0)
SECTOR_AZIMUTHS_DEG = (-25.0, 25.0)
POINTS = (500, 2000, 8000)
YAWS_DEG = (0.2, 0.5, 1.0)
ROWS_PX = (1, 2, 4)
DELAYS = (1, 3, 10)
STRIPES_PX = 40.0
STRIPE_LEVELS = (60.0, 120.0)

LIGHTS = sorted((kind for kind, one in ON_CAMERA.items() if one.evaluated), key=lambda kind: kind not in COLOURS)
"""Kinds of the catalogue on cameras, each at its own size, lasers of one colour first."""

VEILS_LEVELS = (30.0, 60.0)

STRENGTH = "mild"
"""The strength of the faculas of intervals: the weakest of the combinations."""


@dataclass(frozen=True)
class AttackCase:
    """One way to attack a frame.

    `strength` names the amplitude of its faculas, None where it has none to choose. `size` is the quantity that a
    sensitivity experiment varies: a wall's width in metres, or a facula's radius in pixels on an image of the paper's
    width; `visible_share` is then the share of the image within that radius.
    """

    attacks: Mapping[int, Attack] = field(default_factory=dict)
    strength: str | None = None
    size: float | None = None
    visible_share: float | None = None

    @property
    def attacked(self) -> tuple[int, ...]:
        """The attacked sensors, ascending."""
        return tuple(sorted(self.attacks))

    @property
    def attack(self) -> str | None:
        """The kind of attack; None where there is none, or several."""
        kinds = {attack.name for attack in self.attacks.values()}
        return kinds.pop() if len(kinds) == 1 else None


@dataclass(frozen=True)
class SeededDraws:
    """Random draws that depend only on these numbers: a repeated evaluation draws the same attacks."""

    seed: int
    recording: int
    frame: int
    draw: int

    def of(self, sensor: int) -> np.random.Generator:
        """The generator of one sensor's attack."""
        return np.random.default_rng([self.seed, self.recording, self.frame, self.draw, sensor])


@dataclass(frozen=True)
class Experiment:
    """Cases for every frame and draw; `triples` are the ones that they are measured for.

    `cases` also gets the frames before, the latest last. `drawn` is False where the cases are not random, so that there
    is one draw; `inputs` identifies the files that its attacks are made from. `attacks` is False where frames stay
    clean; `together` is the number of frames that are attacked one after the other, `each` how many of those that the
    other experiments attack there are for one of its own.
    """

    name: str
    triples: Callable[[Rig], tuple[Triple, ...]]
    cases: Callable[[Rig, SeededDraws, Sequence[Frame]], Iterator[AttackCase]]
    drawn: bool = True
    inputs: str | None = None
    attacks: bool = True
    together: int = 1
    each: int = 1

    def takes(self, frame: int, every: int) -> bool:
        """True where it uses the frame of this number and each `every`-th is attacked; all frames are used clean."""
        return not self.attacks or frame // self.together % (every * self.each) == 0


def scenario_1(rig: Rig) -> Triple | None:
    """The LiDAR, the leftmost camera and the one farthest from it; None without a LiDAR."""
    return Triple(LIDAR, 1, rig.n) if rig.lidar else None


def attacked_sets(rig: Rig) -> tuple[tuple[int, ...], ...]:
    """Every set that attacks some triple of the leftmost reference, and every one and two that can be identified."""
    sets = {
        attacked
        for triple in rig.triples
        if triple.k == rig.n
        for size in (1, 2, 3)
        for attacked in combinations(triple, size)
    }
    for size in range(1, min(rig.max_attacked, MOST_ATTACKED) + 1):
        sets.update(combinations(rig.sensors, size))
    return tuple(sorted(sets, key=lambda attacked: (len(attacked), attacked)))


def all_triples(rig: Rig) -> tuple[Triple, ...]:
    """All triples that a scan measures."""
    return rig.measured_triples


def _scenario_1_only(rig: Rig) -> tuple[Triple, ...]:
    triple = scenario_1(rig)
    return () if triple is None else (triple,)


def _clean(_rig: Rig, _draws: SeededDraws, _past: Sequence[Frame]) -> Iterator[AttackCase]:
    yield AttackCase()


def _combinations(rig: Rig, draws: SeededDraws, _past: Sequence[Frame]) -> Iterator[AttackCase]:
    """Each sensor has one attack in a draw, whatever others are attacked with it; strengths change nothing else."""
    for strength in STRENGTHS:
        attacks = {sensor: drawn_attack(rig, sensor, strength, draws.of(sensor)) for sensor in rig.sensors}
        for attacked in attacked_sets(rig):
            yield AttackCase({sensor: attacks[sensor] for sensor in attacked}, strength)


def drawn_attack(rig: Rig, sensor: int, strength: str, rng: np.random.Generator) -> Facula | BogusWall:
    """The paper's attack on a sensor: a wall on the LiDAR, a facula on a camera."""
    if sensor == LIDAR:
        return draw_wall(rng)
    camera = rig.camera(sensor)
    return draw_facula(rng, camera.width_px, camera.height_px, strength)


def _sensitivity(rig: Rig, draws: SeededDraws, _past: Sequence[Frame]) -> Iterator[AttackCase]:
    """Walls of several widths on S_0; faculas of several radii on the reference camera, then on the source camera."""
    triple = scenario_1(rig)
    if triple is None:
        return
    wall = draw_wall(draws.of(LIDAR))
    for width in WALL_WIDTHS_M:
        yield AttackCase({LIDAR: replace(wall, width_m=width)}, size=width)
    for sensor, strength in product((triple.k, triple.j), SENSITIVITY_STRENGTHS):
        camera = rig.camera(sensor)
        drawn = draw_facula(draws.of(sensor), camera.width_px, camera.height_px, strength)
        for radius in RADII_PX:
            facula = replace(drawn, radius_px=radius * camera.width_px / PAPER_WIDTH_PX)
            yield AttackCase({sensor: facula}, strength, radius, disc_share(facula, camera.width_px, camera.height_px))


def disc_share(facula: Facula, width_px: int, height_px: int) -> float:
    """The share of an image's pixels that lie within R of a facula's centre."""
    across = (np.arange(width_px) - facula.u_px) ** 2
    down = (np.arange(height_px) - facula.v_px) ** 2
    return float(np.mean(down[:, None] + across[None, :] <= facula.radius_px**2))


def further_cases(rig: Rig, draws: SeededDraws, past: Sequence[Frame]) -> Iterator[AttackCase]:
    """One sensor of each part: the LiDAR, the leftmost reference camera and the source camera farthest from it.

    Cases that are not random come with the first draw only, so that they count once.
    """
    if rig.lidar:
        yield from _drawn_on_lidar(draws)
    for sensor in (1, rig.n):
        phase = draws.of(sensor).uniform(0, STRIPES_PX)
        for level in STRIPE_LEVELS:
            yield AttackCase({sensor: Stripes(level, STRIPES_PX, phase)}, "bright", level)
            yield AttackCase({sensor: Stripes(-level, STRIPES_PX, phase)}, "dark", level)
        for kind in LIGHTS:
            drawing = AttackDraw(draws.of(sensor), STRENGTH, None)
            yield AttackCase({sensor: ON_CAMERA[kind](drawing, rig.camera(sensor))}, kind)
    if draws.draw == 0:
        yield from _certain(rig, past)


def _drawn_on_lidar(draws: SeededDraws) -> Iterator[AttackCase]:
    rng = draws.of(LIDAR)
    azimuth, seed = float(rng.uniform(*SECTOR_AZIMUTHS_DEG)), int(rng.integers(1 << 31))
    for width in SECTORS_DEG:
        yield AttackCase({LIDAR: HiddenSector(width, azimuth)}, size=width)
    for count in POINTS:
        yield AttackCase({LIDAR: ScatteredPoints(count, seed)}, size=count)


def _certain(rig: Rig, past: Sequence[Frame]) -> Iterator[AttackCase]:
    if rig.lidar:
        for yaw in YAWS_DEG:
            yield AttackCase({LIDAR: TurnedLidar(yaw)}, size=yaw)
        for delay, frame in _earlier(past):
            if frame.cloud is not None:
                yield AttackCase({LIDAR: DelayedLidar(delay, frame.cloud)}, size=delay)
    for sensor in (1, rig.n):
        for level in VEILS_LEVELS:
            yield AttackCase({sensor: Veil(level)}, size=level)
        for rows in ROWS_PX:
            yield AttackCase({sensor: ShiftedCamera(rows)}, size=rows)
        for delay, frame in _earlier(past):
            if sensor in frame.images:
                yield AttackCase({sensor: DelayedCamera(delay, frame.images[sensor])}, size=delay)


def _earlier(past: Sequence[Frame]) -> Iterator[tuple[int, Frame]]:
    """The frames of DELAYS ago, as far as they exist."""
    return ((delay, past[-delay]) for delay in DELAYS if delay <= len(past))


def read_patterns(paths: Sequence[Path]) -> tuple[LaserPattern, ...]:
    """Laser patterns from picture files, named by their paths. Raises SettingError where a file is not a picture."""
    patterns = []
    for path in paths:
        try:
            pixels = decode_picture(memoryview(path.read_bytes()), colour=True, size_px=None)
        except (OSError, DecodingError) as error:
            raise SettingError(f"it is not a readable picture ({error})", where=path) from error
        patterns.append(LaserPattern("/".join(path.parts[-3:]), pixels if pixels.ndim == 3 else pixels[..., None]))
    return tuple(patterns)


def pattern_cases(
    patterns: Sequence[LaserPattern],
) -> Callable[[Rig, SeededDraws, Sequence[Frame]], Iterator[AttackCase]]:
    """Each pattern on each camera."""

    def on_each(rig: Rig, _draws: SeededDraws, _past: Sequence[Frame]) -> Iterator[AttackCase]:
        for camera in rig.cameras:
            for pattern in patterns:
                yield AttackCase({camera.number: pattern}, pattern.title)

    return on_each


def interval_cases(rig: Rig, draws: SeededDraws, _past: Sequence[Frame]) -> Iterator[AttackCase]:
    """One sensor at a time, then the first and the last together.

    Still attacks are drawn once for the interval, lasting ones once for the recording, of which they attack each
    interval that is attacked at all.
    """
    fixed = replace(draws, frame=draws.frame - draws.frame % INTERVAL_FRAMES)
    together = (LIDAR if rig.lidar else 1, rig.n)
    for variant, drawn in (("still", fixed), ("moving", draws), (LASTING, replace(draws, frame=0))):
        attacks = {sensor: drawn_attack(rig, sensor, STRENGTH, drawn.of(sensor)) for sensor in rig.sensors}
        for attacked in (*((sensor,) for sensor in rig.sensors), together):
            yield AttackCase({sensor: attacks[sensor] for sensor in attacked}, variant)


EXPERIMENTS = (
    Experiment("clean", all_triples, _clean, drawn=False, attacks=False),
    Experiment("combinations", all_triples, _combinations),
    Experiment("sensitivity", _scenario_1_only, _sensitivity),
)
"""The paper's experiments, in the order in which they are measured."""

FURTHER = Experiment("further", all_triples, further_cases)
INTERVALS = Experiment("intervals", all_triples, interval_cases, together=INTERVAL_FRAMES)


LADDER_RADII_PX = (10.0, 20.0, 40.0, 56.0, 75.0, 112.0, 150.0)
LADDER_LEVELS = (15.0, 30.0, 60.0, 90.0, 120.0, 255.0)
OF_RADIUS_PX = 112.0
LADDER_DUTIES = (0.025, 0.05, 0.1, 0.2)
STRIPE_LEVEL = 120.0
LADDER_WIDTHS_M = (0.25, 0.5, 0.75, 1.0, 1.5, 2.5)
LADDER_RANGES_M = (8.0, 25.0)
LADDER_SECTORS_DEG = (1.0, 2.0, 4.0, 8.0)
LADDERS_EACH = 10

Step = tuple[str, float, Attack]


def ladder_cases(rig: Rig, draws: SeededDraws, _past: Sequence[Frame]) -> Iterator[AttackCase]:
    """Attacks from weak to strong, on one sensor at a time, by which the largest that stays unseen is found.

    Each ladder varies one thing that an attacker chooses, and draws the rest, its place above all, once for the frame.
    `size` is what is varied, `strength` says what that is.
    """
    for sensor in rig.sensors:
        for attack_kind, size, attack in _on_lidar(draws) if sensor == LIDAR else _on_camera(rig, sensor, draws):
            yield AttackCase({sensor: attack}, attack_kind, size)


def _on_camera(rig: Rig, sensor: int, draws: SeededDraws) -> Iterator[Step]:
    camera, rng = rig.camera(sensor), draws.of(sensor)
    place = float(rng.uniform(0, camera.width_px)), float(rng.uniform(0, camera.height_px))
    phase, scale = float(rng.uniform(0, STRIPES_PX)), camera.width_px / PAPER_WIDTH_PX
    for strength in ("mild", "opaque"):
        for radius in LADDER_RADII_PX:
            yield f"{strength}, R in px", radius, Facula(STRENGTHS[strength], radius * scale, *place)
    for level in LADDER_LEVELS:
        yield f"R = {OF_RADIUS_PX:g} px, grey levels", level, Facula(level, OF_RADIUS_PX * scale, *place)
    for level in LADDER_LEVELS:
        yield "grey levels", level, Veil(level)
    for duty in LADDER_DUTIES:
        yield f"{STRIPE_LEVEL:g} levels, share of the rows", duty, Stripes(STRIPE_LEVEL, STRIPES_PX, phase, duty)


def _on_lidar(draws: SeededDraws) -> Iterator[Step]:
    rng = draws.of(LIDAR)
    wall, azimuth = draw_wall(rng), float(rng.uniform(-25, 25))
    for range_m in LADDER_RANGES_M:
        for width in LADDER_WIDTHS_M:
            yield f"{range_m:g} m away, m wide", width, replace(wall, range_m=range_m, width_m=width)
    for width in LADDER_SECTORS_DEG:
        yield "degrees", width, HiddenSector(width, azimuth)


LADDERS = Experiment("unseen", all_triples, ladder_cases, each=LADDERS_EACH)
