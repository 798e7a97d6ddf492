"""What one camera and the LiDAR find of light on the camera, by how long it lasts.

    python -m tests.benchmarks.lone_light --into FOLDER --drives DATA --camera 4 [--places 4]
    python -m tests.benchmarks.lone_light --into FOLDER --streets 12 --first 2000 [--frames 20] [--clean]
    python -m tests.benchmarks.lone_light --judge FOLDER...
    python -m tests.benchmarks.lone_light --cost DATA

The first two measure: faculas at drawn places for one frame, a second and all the drive, walls of 2.5 m at 10 m for a
second, and faults of one camera that are no attack. `--judge` judges them, each real drive by the others' clean frames
and streets', and by the prior: clean frames that are raised; attacks with an incident, with an incident or an alert,
and those whose findings name the attacked sensor and no other.
"""

import argparse
import pickle
import zlib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from time import process_time

import numpy as np

from auditor.lab.attacks.paper import PAPER_WIDTH_PX, BogusWall, Facula
from auditor.lab.evaluation.sources import RecordingSource
from auditor.measurement import FaultFeatures, measure_stream, use_one_thread
from auditor.measurement.checks.in_time.parallax_conflict import parallax_conflicts
from auditor.measurement.checks.in_time.still_light import OfThePast
from auditor.measurement.disparity.stereo import stereo_map, textured
from auditor.measurement.ego_motion import Motion
from auditor.measurement.moment import Moment
from auditor.measurement.own_past import _Way
from auditor.model.checks import Check
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import FINDINGS
from tests.benchmarks.benign import faults
from tests.benchmarks.clean_statistics import DRIVES, MATCHER, Source, case_of, sources_of
from tests.benchmarks.incident_series import MEASURED_HZ, Drive, Tally, drives_of
from tests.benchmarks.lasting_faults import on
from tests.benchmarks.lone_cameras import R, frames_of, moments
from tests.benchmarks.scenes import Case, Scene

FACULAS = {
    "R 187 mild": (255.0, 187.0),
    "R 280 mild": (255.0, 280.0),
    "R 375 mild": (255.0, 375.0),
    "R 280 opaque": (2000.0, 280.0),
    "R 75 mild": (255.0, 75.0),
}
SECOND = 10
REACH = 9
"""Frames around an attack that may look back on it, or that it may look back on."""
EVERY = 14


@dataclass(frozen=True, eq=False)
class Series:
    """What is measured in place of clean frames, by their places; `attacked` are those that were."""

    kind: str
    lasts: str
    who: tuple[int, ...]
    cases: Mapping[int, Case]
    attacked: Sequence[int]


def measured(frames: Sequence[Frame], rig: Rig, first: int = 0) -> dict[int, Case]:
    """By place the cases of frames in their order."""
    features, found = FaultFeatures(), {}
    for place, one in enumerate(measure_stream(frames, rig, MATCHER), first):
        if not isinstance(one, SkippedFrame):
            found[place] = case_of(replace(one[0], fault_features=features.update(one[1])), rig)
    return found


def stretches(count: int) -> Iterator[tuple[str, range]]:
    """How long an attack lasts, and its places in a drive."""
    yield "all", range(count)
    for start in range(3, count - SECOND + 1, EVERY):
        yield "a second", range(start, start + SECOND)
    for start in range(3, count, 3 * EVERY):
        yield "one frame", range(start, start + 1)


def lit(frame: Frame, facula: Facula) -> Frame:
    return replace(frame, images={1: facula.apply(frame.images[1])})


def walled(frame: Frame, wall: BogusWall, rig: Rig) -> Frame:
    assert frame.cloud is not None
    return replace(frame, cloud=wall.apply(frame.cloud, rig))


def happenings(rig: Rig, places: int, seed: int, count: int) -> Iterator[tuple[str, tuple[int, ...], object]]:
    """Each attack: its kind, who is attacked, and what changes a frame."""
    rng, camera = np.random.default_rng(seed), rig.camera(1)
    for _ in range(places):
        for kind, (amplitude, radius) in FACULAS.items():
            place = rng.uniform(0, camera.width_px), rng.uniform(0, camera.height_px)
            yield kind, (1,), Facula(amplitude, radius * camera.width_px / PAPER_WIDTH_PX, *place)
        yield "wall 2.5 m at 10 m", (LIDAR,), BogusWall(10.0, rng.uniform(-3, 3), seed=count)


def series_of(frames: Sequence[Frame], rig: Rig, places: int, seed: int) -> Iterator[Series]:
    def changed(frame: Frame, what: object) -> Frame:
        return lit(frame, what) if isinstance(what, Facula) else walled(frame, what, rig)  # type: ignore[arg-type]

    for kind, who, what in happenings(rig, places, seed, len(frames)):
        for lasts, attacked in stretches(len(frames)):
            first = max(attacked.start - REACH, 0)
            some = frames[first : attacked.stop + REACH]
            changes = [changed(one, what) if first + n in attacked else one for n, one in enumerate(some)]
            yield Series(kind, lasts, who, measured(changes, rig, first), list(attacked))
    for fault in faults(seed, rig.camera(1).width_px, rig.camera(1).height_px):
        if fault.together or (fault.coloured and frames[0].images[1].pixels.ndim < 3):
            continue
        for lasts, begins in (("all", 0), ("begins", len(frames) // 2)):
            change = on(1, fault.what, rig)
            changes = [change(one) if n >= begins else one for n, one in enumerate(frames)]
            yield Series(f"fault: {fault.name}", lasts, (), measured(changes, rig), range(begins, len(frames)))


def measure_into(path: Path, name: str, family: str, source: Source, options: argparse.Namespace) -> None:
    rig, frames = frames_of(source, options.camera)
    clean = tuple(measured(frames, rig).values())
    series = [] if options.clean else list(series_of(frames, rig, options.places, zlib.crc32(path.name.encode())))
    path.write_bytes(pickle.dumps((Scene(name, family, rig, "c", clean), series)))
    print(f"{path.name}: {len(clean)} frames, {len(series)} series", flush=True)


class Count(Tally):
    """Series of one kind that last as long."""

    def __str__(self) -> str:
        told = f"incident {self['incident']}/{self['series']}, found {self['found']}, named {self['by finding']}"
        return f"{told}, other named {self['others']}, frames {self['raised']}/{self['frames']}"


def judge(folders: Sequence[Path]) -> None:
    kept = [pickle.loads(path.read_bytes()) for folder in folders for path in sorted(folder.glob("*.lone"))]
    for how, prior in (("learnt from other families", False), ("by the prior", True)):
        drives = drives_of([scene for scene, _ in kept], (1,), R, prior=prior)
        for real in (True, False):
            some = [(d, s) for d, (scene, s) in zip(drives, kept, strict=True) if (scene.name in DRIVES) == real]
            if some:
                print(f"{how}, {'real drives' if real else 'streets'}", *told(some), sep="\n", flush=True)


def told(drives: Sequence[tuple[Drive, Sequence[Series]]]) -> Iterator[str]:
    judged = [drive.judged(drive.series({}, MEASURED_HZ)) for drive, _ in drives]
    raised = sum(verdict.kind in FINDINGS for one in judged for verdict in one)
    findings = sum(any(verdict.finding for verdict in one) for one in judged)
    yield (
        f"  clean: {raised}/{sum(map(len, judged))} frames raised, "
        f"{findings}/{len(judged)} drives with an incident or an alert"
    )
    counts: dict[tuple[str, str], Count] = defaultdict(Count)
    for drive, series in drives:
        for one in series:
            counts[one.kind, one.lasts].add(drive, one.cases, one.who, one.attacked)
    yield from (f"  {kind}, {lasts}: {count}" for (kind, lasts), count in sorted(counts.items()))


def cost(rig: Rig, frames: Sequence[Frame]) -> float:
    """The median ratio of what still light takes of a frame's CPU time to that of SGBM on two of its pictures."""
    ratios: list[float] = []
    way, took = _Way(), [0.0]

    def timed(now: Moment, before: Moment | None, motion: Motion | None) -> dict[Check, OfThePast]:
        begin = process_time()
        found = way.looked_back(now, before, motion)
        took.append(process_time() - begin)
        return found

    before: Moment | None = None
    for now in moments(frames, rig):
        motion = None if before is None else parallax_conflicts(now, before).motion
        timed(now, before, motion)
        if before is not None:
            begin = process_time()
            stereo_map(MATCHER, now.grey, before.grey, textured(now.half), textured(before.half))
            ratios.append(took[-1] / (process_time() - begin))
        before = now
    return float(median(ratios))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--into", type=Path)
    parser.add_argument("--judge", type=Path, nargs="*")
    parser.add_argument("--drives", type=Path, help="the folder of the test data")
    parser.add_argument("--cost", type=Path, metavar="DATA", help="print what it takes on the drives of the test data")
    parser.add_argument("--camera", type=int, default=1, help="of the drives")
    parser.add_argument("--places", type=int, default=4)
    parser.add_argument("--streets", type=int, default=0)
    parser.add_argument("--first", type=int, default=2000)
    parser.add_argument("--frames", type=int, default=20)
    parser.add_argument("--clean", action="store_true", help="without attacks and faults")
    options = parser.parse_args()
    use_one_thread()
    if options.cost:
        for name, path in DRIVES.items():
            calls = cost(*frames_of(RecordingSource(options.cost / path), options.camera))
            print(f"{name}: {calls:.2f} SGBM calls a frame")
        return
    if options.judge:
        judge(options.judge)
        return
    options.into.mkdir(parents=True, exist_ok=True)
    streets = range(options.first, options.first + options.streets)
    for name, family, source in sources_of(options.drives, streets, options.frames, 1):
        path = options.into / f"{name} {options.camera}.lone"
        if not path.exists():
            measure_into(path, name, family, source, options)


if __name__ == "__main__":
    main()
