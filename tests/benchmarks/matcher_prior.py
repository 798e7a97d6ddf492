"""Measures the same frames by SGBM and by the weights that come with auditor, and fits the prior of the latter.

python -m tests.benchmarks.matcher_prior measure FOLDER [--attacked 6 4 4] [--every 1] [--cameras 3]
python -m tests.benchmarks.matcher_prior measure FOLDER --streets 30 --first 2000

Clean frames of KITTI's drives 0009, 0001 and odometry 04 (AUDITOR_TEST_DATA), and some of each under the lights and the
wall of `matcher_audit`; or two frames of each street, half a second apart. What is in FOLDER is not measured again.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.experiments import Attacks
from auditor.lab.evaluation.sources import Street
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import Matcher, find_matcher
from auditor.measurement.disparity.matchers.interface import takes_pairs
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from tests.benchmarks.kinds import spread
from tests.benchmarks.matcher_audit import attacks_on, open_drive

MATCHERS = ("sgbm", "psmnet")
STREET_FRAMES = (0, 5)


class Source(NamedTuple):
    """Frames of a drive, the numbers of those that are measured, and of those that are attacked as well."""

    name: str
    family: str
    rig: Rig
    frames: Iterator[Frame]
    wanted: frozenset[int]
    attacked: frozenset[int]


def real(number: str, attacked: int, every: int) -> Source:
    """A drive with the LiDAR and three cameras; each so many frames are measured."""
    rig, frames = open_drive(number)
    listed = list(frames)
    wanted = frozenset(frame.number for frame in listed[::every])
    return Source(number, number, rig, iter(listed), wanted, frozenset(spread(listed, attacked) if attacked else ()))


def street(seed: int) -> Source:
    """A street of a vehicle with four cameras."""
    made = Street(seed, max(STREET_FRAMES) + 1, cameras=4)
    drive = made.drive
    return Source(f"street {seed}", made.family, drive.rig, drive.frames(), frozenset(STREET_FRAMES), frozenset())


def measure(source: Source, folder: Path) -> None:
    """Append to the source's file what it lacks, a line for each frame and attack."""
    path = folder / f"{source.name}.jsonl"
    known = {(row["frame"], row["case"]) for row in rows_of(path)}
    for frame in source.frames:
        if frame.number not in source.wanted:
            continue
        cases: list[tuple[str, Attacks]] = [("clean", {})]
        if frame.number in source.attacked:
            cases += [(f"{name} on {min(attacks)}", attacks) for name, attacks in attacks_on(frame, source.rig)]
        cases = [one for one in cases if (frame.number, one[0]) not in known]
        if not cases:
            continue
        found = {name: statistics_of(frame, source.rig, name, [attacks for _, attacks in cases]) for name in MATCHERS}
        with path.open("a") as file:
            for place, (case, attacks) in enumerate(cases):
                row = {"frame": frame.number, "stamp_ns": frame.stamp_ns, "case": case, "attacked": sorted(attacks)}
                row |= {name: found[name][place] for name in MATCHERS}
                file.write(json.dumps({"family": source.family, **row}) + "\n")
        print(source.name, frame.number, len(cases), flush=True)


def statistics_of(frame: Frame, rig: Rig, name: str, cases: Sequence[Attacks]) -> list[list[float | None]]:
    """The statistics of a frame under each attack, in the order of the rig's sensor checks."""
    matcher = _matcher(name)
    measured = AttackedFrame(frame, rig, matcher)
    if takes_pairs(matcher):
        measured.match_pairs(measured.pairs(), cases)
    return [list(measured.statistics(attacks)) for attacks in cases]


@cache
def _matcher(name: str) -> Matcher:
    """Of a name; weights are read once."""
    return find_matcher(name)


def rows_of(path: Path) -> list[dict]:
    """The lines of a file that were written whole."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text().splitlines() if line.endswith("}")]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("what", choices=["measure"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--attacked", type=int, nargs=3, default=(6, 4, 4))
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--streets", type=int, default=0)
    parser.add_argument("--first", type=int, default=2000)
    options = parser.parse_args()
    use_one_thread()
    options.folder.mkdir(parents=True, exist_ok=True)
    if options.streets:
        for seed in range(options.first, options.first + options.streets):
            measure(street(seed), options.folder)
        return
    for number, attacked in zip(("04", "0001", "0009"), reversed(options.attacked), strict=True):
        measure(real(number, attacked, options.every), options.folder)


if __name__ == "__main__":
    main()
