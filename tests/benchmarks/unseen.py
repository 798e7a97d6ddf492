"""The largest attack that stays unseen, by what its maker knows: `python -m tests.benchmarks.unseen DATA`.

Frames of drive 0009 are judged at r = 1 % by thresholds of the other two real drives and of its own clean frames. On
each camera a facula of every radius is made brighter until its frame is a finding; in the cloud a bogus wall at every
range is made wider. Who knows nothing aims anywhere: half of the places drawn stay unseen up to the level of that row.
Who knows the thresholds, and can measure the frame beforehand, takes the best of the places: the levels and widths of
the second column. In time, the largest share of frames that can hold an attack of full strength and be no incident.
"""

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path

import numpy as np

from auditor.identification.drive_level import for_clean_drive
from auditor.identification.incidents.sequential import events, evidence_of, incident_limit, periods_of
from auditor.identification.naming import attack_scores
from auditor.identification.parameters import SCORE_LIMITS
from auditor.identification.scores import normalised_scores
from auditor.identification.statistics import runs_of, sensor_statistics
from auditor.identification.systems import System
from auditor.lab.attacks.paper import BogusWall, Facula, draw_wall
from auditor.lab.evaluation.sources import RecordingSource
from auditor.measurement import measure, use_one_thread
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from tests.benchmarks.clean_statistics import DRIVES, MATCHER, case_of, kinds_of
from tests.benchmarks.likelihood import R
from tests.benchmarks.rates import clean_frames, system_of, thresholds_of
from tests.benchmarks.scenes import Scene

TARGET = "0009"
RADII_PX = (20.0, 40.0, 75.0, 112.0)
LEVELS = (15.0, 30.0, 60.0, 120.0, 255.0, 510.0, 2000.0)
RANGES_M = (8.0, 15.0, 25.0)
WIDTHS_M = (0.25, 0.5, 0.75, 1.0, 1.5, 2.5, 4.0)
NOBODY: frozenset[int] = frozenset()
HZ, SECONDS = 10.0, 60
PERIODS = range(2, 61)


def frames_of(path: Path, count: int) -> tuple[Rig, list[Frame]]:
    """The rig of a drive and some of its frames, spread over it."""
    with RecordingSource(path).open() as drives:
        frames = [item for item in drives[0].frames if isinstance(item, Frame)]
        return drives[0].rig, frames[:: max(len(frames) // count, 1)][:count]


def clean_scene(name: str, path: Path, count: int) -> tuple[Scene, list[Frame]]:
    """The clean frames of a drive as a scene."""
    rig, frames = frames_of(path, count)
    cases = tuple(case_of(measure(frame, rig, MATCHER)[0], rig) for frame in frames)
    return Scene(name, name, rig, kinds_of(frames[0]), cases), frames


class Judge:
    """Whether an attacked frame of the target is a finding."""

    def __init__(self, scenes: Sequence[Scene], target: Scene) -> None:
        self.rig = target.rig
        self.system: System = system_of(target, [camera.number for camera in target.rig.cameras])
        learnt, _ = thresholds_of([clean_frames(one, self.system) for one in scenes], self.system, R)
        self._thresholds = for_clean_drive(learnt, self.system.sensor_checks, clean_frames(target, self.system))
        self._expected = [self._thresholds.expected.get(check) for check in self.system.sensor_checks]

    def sees(self, frame: Frame) -> bool:
        """Whether the frame is a finding."""
        found = measure(frame, self.rig, MATCHER)[0]
        statistics = sensor_statistics(rig_sensor_checks(self.rig), found.cells, found.shares)
        z = normalised_scores(np.array([statistics], dtype=np.float64), self._expected)
        return bool(attack_scores(z, self.system, [NOBODY])[0] > self._thresholds.limit)


def largest_unseen(strengths: Sequence[float], sees: Callable[[float], bool]) -> float:
    """The largest of ascending strengths that is not seen, 0 where all are; stronger ones are taken for seen."""
    low, high = 0, len(strengths)
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if sees(strengths[middle]) else (middle + 1, high)
    return strengths[low - 1] if low else 0.0


def faculas(judge: Judge, frames: Sequence[Frame], places: int, rng: np.random.Generator) -> Iterator[str]:
    """A line for each camera and radius."""
    for camera in judge.rig.cameras:
        for radius in RADII_PX:
            unseen = np.array(
                [[_facula(judge, frame, camera.number, radius, rng) for _ in range(places)] for frame in frames]
            )
            yield f"| S_{camera.number}, R = {radius:.0f} px | {np.median(unseen):.0f} | {_best(unseen):.0f} |"


def _facula(judge: Judge, frame: Frame, number: int, radius: float, rng: np.random.Generator) -> float:
    camera = judge.rig.camera(number)
    at = rng.uniform(0, camera.width_px), rng.uniform(0, camera.height_px)

    def sees(level: float) -> bool:
        lit = Facula(level, radius, *at).apply(frame.images[number])
        return judge.sees(replace(frame, images={**frame.images, number: lit}))

    return largest_unseen(LEVELS, sees)


def walls(judge: Judge, frames: Sequence[Frame], places: int, rng: np.random.Generator) -> Iterator[str]:
    """A line for each range."""
    for range_m in RANGES_M:
        unseen = np.array([[_wall(judge, frame, range_m, rng) for _ in range(places)] for frame in frames])
        yield f"| S_0, wall at {range_m:.0f} m | {np.median(unseen):.2f} m | {_best(unseen):.2f} m |"


def _wall(judge: Judge, frame: Frame, range_m: float, rng: np.random.Generator) -> float:
    wall: BogusWall = replace(draw_wall(rng), range_m=range_m)
    if frame.cloud is None:
        return 0.0
    cloud = frame.cloud

    def sees(width: float) -> bool:
        return judge.sees(replace(frame, cloud=replace(wall, width_m=width).apply(cloud, judge.rig)))

    return largest_unseen(WIDTHS_M, sees)


def _best(unseen: np.ndarray) -> float:
    """What is unseen at the best place of a frame, the median over the frames."""
    return float(np.median(unseen.max(axis=1)))


def densest_unseen(checks: int) -> str:
    """The shortest period of strong frames, one at a time among quiet ones, that is no incident."""
    stamps = (np.arange(int(HZ * SECONDS)) * (10**9 / HZ)).astype(np.int64)
    for period in PERIODS:
        scores = np.where(np.arange(len(stamps)) % period == 0, SCORE_LIMITS.highest, 0.0)
        runs = runs_of(stamps)
        evidence = evidence_of(scores, checks, periods_of(stamps, runs), runs)
        if not events(evidence, scores > 1, incident_limit()):
            return f"one frame in {period} ({100 / period:.0f} % of the frames at {HZ:.0f} Hz), as alerts"
    return "none of those tried"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path, help="the folder of the test data")
    parser.add_argument("--clean", type=int, default=10, help="clean frames of each drive")
    parser.add_argument("--frames", type=int, default=2, help="frames that are attacked")
    parser.add_argument("--places", type=int, default=3, help="places of each attack in each frame")
    options = parser.parse_args()
    use_one_thread()
    scenes = {name: clean_scene(name, options.data / path, options.clean) for name, path in DRIVES.items()}
    target, frames = scenes.pop(TARGET)
    judge = Judge([scene for scene, _ in scenes.values()], target)
    chosen = list(islice(frames[1::2], options.frames))
    rng = np.random.default_rng(0)
    print("| attack | knows nothing: unseen in half | knows the thresholds |", "|---|---|---|", sep="\n", flush=True)
    for line in chain(faculas(judge, chosen, options.places, rng), walls(judge, chosen, options.places, rng)):
        print(line, flush=True)
    print(densest_unseen(judge.system.judged_together))


if __name__ == "__main__":
    main()
