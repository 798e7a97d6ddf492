"""Attacks and faults beyond the paper's, on one sensor at a time."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from auditor.errors import DecodingError, SettingError
from auditor.evaluation.experiments import Case, Dice, Experiment, all_triples
from auditor.frames import Frame
from auditor.lab.faults import (
    DelayedCamera,
    DelayedLidar,
    HiddenSector,
    ScatteredPoints,
    ShiftedCamera,
    TurnedLidar,
)
from auditor.lab.patterns import LaserPattern, Stripes
from auditor.recordings.decoding.pictures import decode_picture
from auditor.rig import LIDAR, Rig

SECTORS_DEG = (10.0, 20.0, 30.0)
SECTOR_AZIMUTHS_DEG = (-25.0, 25.0)
POINTS = (500, 2000, 8000)
YAWS_DEG = (0.2, 0.5, 1.0)
ROWS_PX = (1, 2, 4)
DELAYS = (1, 3, 10)
STRIPES_PX = 40.0
STRIPE_LEVELS = (60.0, 120.0)


def cases(rig: Rig, dice: Dice, past: Sequence[Frame]) -> Iterator[Case]:
    """One sensor of each part: the LiDAR, the leftmost reference camera and the witness farthest from it.

    What is not left to chance comes with the first draw only, so that nothing counts twice.
    """
    if rig.lidar:
        yield from _drawn_on_lidar(dice)
    for sensor in (1, rig.n):
        phase = dice.of(sensor).uniform(0, STRIPES_PX)
        for level in STRIPE_LEVELS:
            yield Case({sensor: Stripes(level, STRIPES_PX, phase)}, "bright", level)
            yield Case({sensor: Stripes(-level, STRIPES_PX, phase)}, "dark", level)
    if dice.draw == 0:
        yield from _certain(rig, past)


def _drawn_on_lidar(dice: Dice) -> Iterator[Case]:
    rng = dice.of(LIDAR)
    azimuth, seed = float(rng.uniform(*SECTOR_AZIMUTHS_DEG)), int(rng.integers(1 << 31))
    for width in SECTORS_DEG:
        yield Case({LIDAR: HiddenSector(width, azimuth)}, size=width)
    for count in POINTS:
        yield Case({LIDAR: ScatteredPoints(count, seed)}, size=count)


def _certain(rig: Rig, past: Sequence[Frame]) -> Iterator[Case]:
    if rig.lidar:
        for yaw in YAWS_DEG:
            yield Case({LIDAR: TurnedLidar(yaw)}, size=yaw)
        for delay, frame in _earlier(past):
            if frame.cloud is not None:
                yield Case({LIDAR: DelayedLidar(delay, frame.cloud)}, size=delay)
    for sensor in (1, rig.n):
        for rows in ROWS_PX:
            yield Case({sensor: ShiftedCamera(rows)}, size=rows)
        for delay, frame in _earlier(past):
            if sensor in frame.images:
                yield Case({sensor: DelayedCamera(delay, frame.images[sensor])}, size=delay)


def _earlier(past: Sequence[Frame]) -> Iterator[tuple[int, Frame]]:
    """The frames of DELAYS ago, those that there are."""
    return ((delay, past[-delay]) for delay in DELAYS if delay <= len(past))


def read_patterns(paths: Sequence[Path]) -> tuple[LaserPattern, ...]:
    """Laser patterns from picture files, named by their paths. Raises SettingError where one is none."""
    patterns = []
    for path in paths:
        try:
            pixels = decode_picture(memoryview(path.read_bytes()), colour=True, size_px=None)
        except (OSError, DecodingError) as error:
            raise SettingError(f"it is no readable picture ({error})", where=path) from error
        patterns.append(LaserPattern("/".join(path.parts[-3:]), pixels if pixels.ndim == 3 else pixels[..., None]))
    return tuple(patterns)


def pattern_cases(patterns: Sequence[LaserPattern]) -> Callable[[Rig, Dice, Sequence[Frame]], Iterator[Case]]:
    """Each pattern on each camera."""

    def on_each(rig: Rig, _dice: Dice, _past: Sequence[Frame]) -> Iterator[Case]:
        for camera in rig.cameras:
            for pattern in patterns:
                yield Case({camera.number: pattern}, pattern.title)

    return on_each


FURTHER = Experiment("further", all_triples, cases)
