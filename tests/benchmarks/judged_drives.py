"""Drives under faults and attacks, measured once, and their verdicts counted: what `benign` and `causes` share.

    python -m tests.benchmarks.benign --into FOLDER --drives DATA --streets 12
    python -m tests.benchmarks.causes --into FOLDER --drives DATA --streets 5 --first 4101 [--attacks]

Thresholds come from clean frames of other drives: of real drives from those of the other two, of streets from three
drives of their vehicle elsewhere; with --learn, from folders of `clean_statistics` without the drive's own family. With
--prior nothing is learnt. --without CAMERA judges without it. What is in the folder is not measured again.

Counted are frames: `attacked` by their verdicts; others, where the sensors named are the wrong ones; not clean;
suspect; right cause, the likeliest cause is the fault in its sensor. The strongest checks of attacked frames and other
likeliest causes end a line.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from typing import Protocol

from auditor.lab.evaluation.sources import RecordingSource, Street
from auditor.measurement import use_one_thread
from auditor.model.calibration import RobustThresholds
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.model.verdict import Cause, Verdict, VerdictKind
from tests.benchmarks.clean_statistics import DRIVES
from tests.benchmarks.lasting_faults import Happening
from tests.benchmarks.measured_series import (
    Drive,
    Watched,
    clean_of,
    elsewhere,
    judged,
    kept_drive,
    learn,
    measured_drive,
)
from tests.benchmarks.scenes import Scene, load

EVERY = {"0009": 5, "0001": 2, "04": 2}
SUCCESSIVE = 8
LISTED = 0.5

Rows = Mapping[tuple[bool, str], Counter[str]]


class Happenings(Protocol):
    """What happens to the frames of a drive: the clean ones first; to each sensor, or to one in turn."""

    def __call__(self, kept: Sequence[Frame], rig: Rig, seed: int, *, each: bool) -> Iterator[Happening]: ...


def run(description: str, happenings: Happenings, *, successive: bool = False) -> None:
    """Measure, judge and print; of real drives every few frames, or the first ones where they must be `successive`."""
    options = _options(description)
    use_one_thread()
    options.into.mkdir(parents=True, exist_ok=True)
    makers: dict[str, Callable[[], Drive]] = {}
    for name, path in DRIVES.items() if options.drives else ():
        chosen = slice(SUCCESSIVE) if successive else slice(None, None, EVERY[name])
        makers[name] = lambda name=name, path=path, chosen=chosen: real(name, options.drives / path, happenings, chosen)
    for seed in range(options.first, options.first + options.streets):
        source = Street(seed, (options.frames - 1) * options.apart + 1, options.cameras)
        makers[str(source)] = lambda source=source: street(source, happenings, options.apart)
    drives = [kept_drive(options.into / f"{name}.series", make) for name, make in makers.items()]
    rows: dict[tuple[bool, str], Counter[str]] = defaultdict(Counter)
    scenes = [scene for folder in options.learn for scene in load(folder)]
    for drive in drives:
        clean = [] if options.prior else calibrated_by(drive, drives, scenes)
        count(drive, learn(clean, drive.rig, options.r, options.without), options.without, rows)
    print(*report(rows), sep="\n")


def _options(description: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=description.splitlines()[0])
    parser.add_argument("--into", type=Path, required=True)
    parser.add_argument("--drives", type=Path, help="the folder of the test data")
    parser.add_argument("--streets", type=int, default=0)
    parser.add_argument("--first", type=int, default=4000)
    parser.add_argument("--frames", type=int, default=4)
    parser.add_argument("--apart", type=int, default=1, help="tenths of a second between the frames of a street")
    parser.add_argument("--cameras", type=int, default=4)
    parser.add_argument("--learn", type=Path, nargs="*", default=[], help="folders of clean scenes")
    parser.add_argument("--prior", action="store_true", help="learn from nothing")
    parser.add_argument("--without", type=int, nargs="*", default=[], help="cameras that take no part")
    parser.add_argument("--r", type=Decimal, default=Decimal("0.01"))
    return parser.parse_args()


def real(name: str, path: Path, happenings: Happenings, chosen: slice) -> Drive:
    """A real drive, each sensor in turn."""
    with RecordingSource(path).open() as [drive]:
        kept = [frame for frame in drive.frames if isinstance(frame, Frame)][chosen]
        return measured_drive(name, name, drive.rig, happenings(kept, drive.rig, 1, each=True))


def street(source: Street, happenings: Happenings, apart: int) -> Drive:
    """A street, every so many of its frames, and drives of its vehicle elsewhere of as many."""
    with source.open() as [drive]:
        kept = [frame for frame in drive.frames if isinstance(frame, Frame)][::apart]
        happened = happenings(kept, drive.rig, source.seed, each=False)
        found = measured_drive(str(source), source.family, drive.rig, happened)
    return replace(found, elsewhere=tuple(elsewhere(source.seed, len(kept), source.cameras)))


def calibrated_by(drive: Drive, drives: Sequence[Drive], learnt: Sequence[Scene]) -> list[Watched]:
    """The clean frames that a drive is judged by."""
    others = [clean_of(scene) for scene in learnt if scene.family != drive.family]
    clean = [one.series[0].frames for one in drives if not one.elsewhere and one.family != drive.family]
    return others or list(drive.elsewhere) or clean


def count(drive: Drive, learnt: RobustThresholds, absent: Sequence[int], rows: Rows) -> None:
    """Add the verdicts on a drive to the rows."""
    for one in drive.series:
        if one.sensor not in absent:
            for verdict in judged(one.frames, learnt, drive.rig, absent):
                rows[bool(drive.elsewhere), one.name].update(outcome(verdict, one.cause, one.sensor))


def outcome(verdict: Verdict, cause: Cause | None, sensor: int | None) -> Counter[str]:
    """What one verdict counts for."""
    first = verdict.causes[0] if verdict.causes and verdict.causes[0].score >= LISTED else None
    right = first is not None and (first.cause, first.sensor) == (cause, sensor)
    attacked = verdict.kind is VerdictKind.ATTACKED
    found = Counter(
        {
            "frames": 1,
            "attacked": attacked,
            "others": attacked and verdict.attacked != (sensor,),
            "not clean": verdict.kind is not VerdictKind.CLEAN,
            "suspect": verdict.kind is VerdictKind.SUSPECT,
            "right cause": right,
            "another": first is not None and not right,
        }
    )
    found.update([f"by {verdict.evidence[0].check_name}"] if attacked else [])
    found.update([f"as {first.cause.value}"] if first is not None and not right else [])
    return found


def report(rows: Rows) -> Iterator[str]:
    """A line for each fault or attack, real drives and streets apart."""
    for (synthetic, name), n in sorted(rows.items(), key=lambda row: row[0][0]):
        counted = ", ".join(
            f"{key} {n[key]:3}" for key in ("attacked", "others", "not clean", "suspect", "right cause")
        )
        why = ", ".join(f"{key} {value}" for key, value in sorted(n.items()) if key[:3] in {"by ", "as "})
        yield f"{'street' if synthetic else 'real':6} {name:34} {n['frames']:4} frames: {counted}; {why}"
