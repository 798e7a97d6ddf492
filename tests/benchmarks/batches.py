"""What a first scan of several recordings finds: a batch of which two are attacked in all frames, nothing learnt.

Reads scenes that `python -m tests.benchmarks.clean_statistics --attacked --constant` measured, all of one rig kind, and
cuts them into recordings of some frames. All are judged by the prior; those that show nothing teach the calibrations
by which each recording is judged again, until none more is found, as `auditor.pipeline.calibrations.batch` does:

    python -m tests.benchmarks.batches FOLDER [--frames 10]

Printed are, by attack, the attacked recordings with an incident, those in which an incident names exactly what is
attacked, and those that end a scan in 1; and the same of the recordings beside them that are clean.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from pathlib import Path

from auditor.identification.systems import System
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.verdict import Verdict
from auditor.pipeline.calibrations.batch import FEWEST_CLEAN, MOST_PASSES
from tests.benchmarks.durations import R
from tests.benchmarks.incident_series import MEASURED_HZ, RIGS, Drive, Tally, drives_of
from tests.benchmarks.rates import frames_of, thresholds_of
from tests.benchmarks.scenes import Case, Scene, load

ATTACKED = 2


class Recordings(Tally):
    """Recordings, those with an incident, those whose attacked sensors it names, and those found at all."""

    def __str__(self) -> str:
        named = f"named {self['by incident']}"
        return f"incident {self['incident']}, {named}, found {self['found']} of {self['series']}"


def cut(scene: Scene, frames: int) -> Iterator[Scene]:
    """A scene's recordings of so many frames each, and of what is left at its end with the last."""
    clean = [case.frame for case in scene.cases if not case.attack]
    count = max(len(clean) // frames, 1)
    for number in range(count):
        chosen = set(clean[number * frames : None if number == count - 1 else (number + 1) * frames])
        cases = tuple(case for case in scene.cases if case.frame in chosen)
        yield replace(scene, name=f"{scene.name}, {number}", cases=cases)


def batch(recordings: Sequence[Sequence[Case]], drives: Sequence[Drive]) -> list[list[Verdict]]:
    """The verdicts on the cases of each recording, by all that show nothing, itself left out, until none is found."""
    verdicts = [_judged(drive, cases) for drive, cases in zip(drives, recordings, strict=True)]
    clean = set(range(len(drives)))
    for number in range(MOST_PASSES):
        quiet = {place for place in clean if not any(one.finding for one in verdicts[place])}
        if len(quiet) < FEWEST_CLEAN or (number and quiet == clean):
            break
        clean = quiet
        seen = {place: frames_of(drives[place].scene, drives[place].system, recordings[place]) for place in clean}
        verdicts = [
            _judged(replace(drive, thresholds=_learnt(seen, place, drive.system)), recordings[place])
            for place, drive in enumerate(drives)
        ]
    return verdicts


def _learnt(seen: Mapping[int, CleanFrames], without: int, system: System) -> RobustThresholds:
    return thresholds_of([frames for place, frames in seen.items() if place != without], system, R)[0]


def _judged(drive: Drive, cases: Sequence[Case]) -> list[Verdict]:
    return drive.judged(drive.series(dict(enumerate(cases)), MEASURED_HZ))


def tallies(drives: Sequence[Drive]) -> dict[str, tuple[Recordings, Recordings]]:
    """By attack, over all pairs of attacked recordings, and all sensors of them alike: attacked, and clean beside."""
    found: dict[str, tuple[Recordings, Recordings]] = defaultdict(lambda: (Recordings(), Recordings()))
    for attack, of_sensors in drives[0].attacks.items():
        for who in of_sensors:
            for pair in combinations(range(len(drives)), ATTACKED):
                recordings = [
                    [*drive.attacks[attack][who].values()] if place in pair else drive.clean
                    for place, drive in enumerate(drives)
                    if attack in drive.attacks and who in drive.attacks[attack]
                ]
                if len(recordings) < len(drives):
                    continue
                for place, verdicts in enumerate(batch(recordings, drives)):
                    attacked = place in pair
                    found[attack][not attacked].count(verdicts, who if attacked else ())
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path, help="the scenes")
    parser.add_argument("--frames", type=int, default=10, help="of a recording")
    options = parser.parse_args()
    scenes = [part for scene in load(options.folder) for part in cut(scene, options.frames)]
    for cameras in RIGS:
        drives = drives_of(scenes, cameras, R, prior=True)
        print(f"LiDAR and {len(cameras)} cameras: {len(drives)} recordings, of which {ATTACKED} are attacked")
        clean = Recordings()
        for verdicts in batch([drive.clean for drive in drives], drives):
            clean.count(verdicts, ())
        print(f"{'none attacked':22} {clean}")
        for attack, (attacked, beside) in sorted(tallies(drives).items()):
            print(f"{attack:22} {attacked}; clean ones beside: {beside}", flush=True)


if __name__ == "__main__":
    main()
