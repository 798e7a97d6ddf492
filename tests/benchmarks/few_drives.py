"""Clean frames raised after so many clean drives: what a calibration is worth that was learnt from few.

    python -m tests.benchmarks.few_drives REAL               scenes that `clean_statistics` measured
    python -m tests.benchmarks.few_drives --into FOLDER      vehicles on streets of their own, measured into the folder

Each drive is judged after each set of others of its vehicle, at most SETS of a size: with all its cameras, and with
some of them. Drives of KITTI's cars count as one vehicle's.
"""

import argparse
import random
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal
from itertools import combinations
from pathlib import Path

from auditor.lab.simulation.conditions import CONDITIONS
from auditor.lab.simulation.drives import make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.measurement import use_one_thread
from auditor.model.rig import Rig
from auditor.model.verdict import Verdict, VerdictKind
from tests.benchmarks.measured_series import Drive, Series, Watched, clean_of, judged, kept_drive, learn, measured
from tests.benchmarks.scenes import load

R = Decimal("0.01")
WITHOUT = ((), (4,), (1, 2), (2, 4))
"""Cameras that take no part."""
SETS = 4
FIRST, FRAMES = 61000, 10


def main() -> None:
    """Measure where asked, judge and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("real", type=Path, nargs="?", help="a folder of scenes")
    parser.add_argument("--into", type=Path, help="where streets are measured into, or were")
    parser.add_argument("--vehicles", type=int, default=8)
    parser.add_argument("--drives", type=int, default=5, help="of each vehicle")
    options = parser.parse_args()
    use_one_thread()
    vehicles: list[list[Drive]] = []
    if options.real:
        vehicles.append([_of(one.name, one.family, one.rig, clean_of(one)) for one in load(options.real)])
    if options.into:
        options.into.mkdir(parents=True, exist_ok=True)
        vehicles += [
            [kept_drive(options.into / f"{v}_{n}.series", lambda v=v, n=n: street(v, n)) for n in range(options.drives)]
            for v in range(options.vehicles)
        ]
    for D in range(max(map(len, vehicles))):
        print(report(D, verdicts(vehicles, D)), flush=True)


def street(vehicle: int, number: int) -> Drive:
    """A clean drive of a vehicle, in another style and condition than its last one."""
    style = list(STYLES)[(number + vehicle) % len(STYLES)]
    condition = list(CONDITIONS)[(number + 2 * vehicle) % len(CONDITIONS)]
    seed = FIRST + 10 * vehicle + number
    drive = make_drive(seed, FRAMES, n_cameras=4, style=style, vehicle=FIRST + vehicle, condition=condition)
    return _of(f"street {seed}", f"{style}, {condition}", drive.rig, measured(drive.frames(), drive.rig))


def _of(name: str, family: str, rig: Rig, frames: Watched) -> Drive:
    return Drive(name, family, rig, (Series("clean", None, None, frames),))


def verdicts(vehicles: Iterable[Sequence[Drive]], D: int) -> Iterator[Sequence[Verdict]]:
    """The verdicts of each drive after sets of D others of its vehicle."""
    for drives in vehicles:
        for drive in drives:
            sets = list(combinations([one.series[0].frames for one in drives if one is not drive], D))
            for clean in random.Random(D).sample(sets, min(len(sets), SETS)):
                for absent in WITHOUT:
                    learnt = learn(clean, drive.rig, R, absent)
                    yield list(judged(drive.series[0].frames, learnt, drive.rig, absent))


def report(D: int, recordings: Iterable[Sequence[Verdict]]) -> str:
    """A line: frames raised, attacked, and recordings with an incident and with an alert."""
    count: Counter[str] = Counter()
    for frames in recordings:
        kinds = [one.kind for one in frames if one.kind is not VerdictKind.NOT_AUDITABLE]
        findings = [one.finding for one in frames if one.finding is not None]
        count["frames"] += len(kinds)
        count["raised"] += sum(kind is not VerdictKind.CLEAN for kind in kinds)
        count["attacked"] += sum(kind is VerdictKind.ATTACKED for kind in kinds)
        count["recordings"] += 1
        count["incidents"] += any(not one.alert for one in findings)
        count["alerts"] += any(one.alert for one in findings)
    share = count["raised"] / max(count["frames"], 1)
    return f"after {D} drives: {share:.2%} raised; " + ", ".join(f"{count[name]} {name}" for name in count)


if __name__ == "__main__":
    main()
