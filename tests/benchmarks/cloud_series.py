"""What is found of attacks on the LiDAR that begin in a drive and last, learnt and by the prior.

    python -m tests.benchmarks.cloud_series --into FOLDER [--places 2] [--only ghost jitter] [--alone 4] [--beams 16]

All frames of the three real drives (AUDITOR_TEST_DATA) are measured clean, and with each attack in their clouds: of
each kind at some drawn places, the same in all frames. A series is a drive in which the attack lasts one frame, a
second, the last quarter, the last half, or all of it, from several beginnings on; what conflicts with the last scan is
measured for each of them. Each is judged by thresholds of the two other drives, and by the prior alone: printed are the
attacked frames that name the LiDAR alone, the series with an incident that does, and those that are found at all (a
scan ends in 1). Objects are removed where something stands that looks like a car. With --alone 4 camera S_4 and the
LiDAR are measured; there the frames before an attack are attacked alike. What is in the folder is not measured again.
"""

import argparse
import os
import zlib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace
from decimal import Decimal
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from auditor.lab.attacks.catalogue import ON_LIDAR
from auditor.lab.attacks.faults import lidar_axes
from auditor.lab.attacks.kinds import AttackDraw
from auditor.lab.attacks.spoofing import find_object
from auditor.measurement import FaultFeatures, use_one_thread
from auditor.measurement.checks.found import measuring
from auditor.measurement.checks.free_space_conflict import OwnScans
from auditor.model.arrays import Floats
from auditor.model.checks import rig_sensor_checks
from auditor.model.checks.kind import Of
from auditor.model.frames import Frame, PointCloud
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import FINDINGS
from tests.benchmarks import lone_cameras
from tests.benchmarks.clean_statistics import Source, case_of, kinds_of, measure_all, sources_of
from tests.benchmarks.durations import LASTS, SHARES, cell
from tests.benchmarks.incident_series import MEASURED_HZ, RIGS, Drive, Tally, drives_of
from tests.benchmarks.lidar_kinds import statistics_of
from tests.benchmarks.scenes import Scene, keep, load

R = Decimal("0.01")
KINDS: tuple[tuple[str, float] | tuple[str, float, float], ...] = (
    *(("ghost", points, metres) for points, metres in ((20, 8), (60, 8), (120, 12), (200, 8), (200, 20))),
    *(("far-wall", metres) for metres in (20, 25, 30)),
    *(("jitter", metres) for metres in (0.3, 1)),
    *(("saturated", degrees) for degrees in (8, 20)),
    ("pulses", 8),
    ("hidden", 8),
    *(("removed", metres) for metres in (12, 20)),
    ("shift", 1),
)
BEAMS, LOWEST_DEG, FIELD_DEG = 64, -24.9, 26.9
A_SECOND = "a second"
LASTING = (LASTS[0], A_SECOND, *LASTS[1:])
FRAMES_OF_A_SECOND, EVERY = 10, 4
"""A second at ten frames a second, and how many frames lie between two beginnings."""


class Change(Protocol):
    """What becomes of a cloud; None where it cannot be done there."""

    def __call__(self, cloud: PointCloud, rig: Rig) -> PointCloud | None: ...


def attack(
    kind: str, size: float, away: Sequence[float], seed: Sequence[int], cloud: PointCloud, rig: Rig
) -> PointCloud | None:
    """The cloud under one kind of attack; None where an object is removed and none stands there."""
    if kind == "removed" and not find_object(cloud.xyz_m @ lidar_axes(rig).T, size).is_car:
        return None
    options = {"range_m": away[0]} if away else {}
    return ON_LIDAR[kind](AttackDraw(np.random.default_rng(seed), "mild", size, options)).apply(cloud, rig)


def attacks(places: int, only: Sequence[str], seed: int) -> dict[str, Change]:
    """The attacks of some kinds, each at so many places."""
    return {
        f"{' '.join([kind, f'{size:g}', *(f'{one:g}' for one in away)])} #{place}": partial(
            attack, kind, size, away, [seed, number, place]
        )
        for number, (kind, size, *away) in enumerate(KINDS)
        if kind in only
        for place in range(places)
    }


def stretches(frames: int) -> Iterator[tuple[str, range]]:
    """The frames that an attack lasts for, by name."""
    for start in range(1, frames, EVERY):
        yield LASTS[0], range(start, start + 1)
    last = max(frames - FRAMES_OF_A_SECOND, 1)
    for start in sorted({*range(1, last, EVERY), last}) if frames > FRAMES_OF_A_SECOND else [1]:
        yield A_SECOND, range(start, min(start + FRAMES_OF_A_SECOND, frames))
    for name, share in SHARES.items():
        yield name, range(frames - round(share * frames), frames)


def measured(
    source: Source,
    name: str,
    family: str,
    changes: Mapping[str, Change],
    lasts: Sequence[str] = LASTING,
    camera: int | None = None,
    beams: int = BEAMS,
) -> Scene:
    """All frames of a source clean, and with each change of their clouds, for each stretch that it lasts."""
    rig, frames = frames_of(source, camera, beams)
    lasting = [(how_long, stretch) for how_long, stretch in stretches(len(frames)) if how_long in lasts]
    cases, features, scans = [], FaultFeatures(), OwnScans()
    series: dict[tuple[str, int], OwnScans] = {}
    alike = {what: _measured_alike(frames, rig, change) for what, change in changes.items()} if camera else {}
    for place, (frame, (clean, arrays)) in enumerate(zip(frames, measure_all(frames, rig), strict=True)):
        case = case_of(replace(clean, fault_features=features.update(arrays)), rig)
        cases.append(case)
        assert frame.cloud is not None
        for what, change in changes.items():
            cloud = change(frame.cloud, rig)
            if cloud is None:
                continue
            statistics = alike[what][place] if camera else statistics_of(replace(frame, cloud=cloud), clean, arrays)
            for number, (how_long, stretch) in enumerate(lasting):
                if place not in stretch:
                    continue
                own = series.setdefault((what, number), copy(scans))
                told = with_scans(statistics, own.conflicts(cloud, rig), [*arrays.lidar], rig)
                called = f"{what}|{how_long}|{stretch.start}"
                cases.append(replace(case, attack=called, attacked=(LIDAR,), statistics=told))
        scans.conflicts(frame.cloud, rig)
    return Scene(name, family, rig, kinds_of(frames[0]), tuple(cases))


def frames_of(source: Source, camera: int | None, beams: int) -> tuple[Rig, list[Frame]]:
    """The frames of a source that have a cloud, of so many beams; of one camera alone."""
    if camera is None:
        with source.open() as [drive]:
            rig, frames = drive.rig, [item for item in drive.frames if isinstance(item, Frame)]
    else:
        rig, frames = lone_cameras.frames_of(source, camera)
    return rig, [replace(one, cloud=of_beams(one.cloud, beams)) for one in frames if one.cloud is not None]


def of_beams(cloud: PointCloud, beams: int) -> PointCloud:
    """The points of every so many of the LiDAR's beams."""
    x, y, z = cloud.xyz_m.T
    ring = np.floor((np.rad2deg(np.arctan2(z, np.hypot(x, y))) - LOWEST_DEG) / (FIELD_DEG / BEAMS))
    return PointCloud(cloud.stamp_ns, cloud.xyz_m[ring % (BEAMS // beams) == 0])


def _measured_alike(frames: Sequence[Frame], rig: Rig, change: Change) -> list[Floats]:
    """The statistics of frames that all are changed where they can be."""
    assert rig.lidar is not None
    clouds = [None if one.cloud is None else change(one.cloud, rig) for one in frames]
    changed = [replace(one, cloud=cloud or one.cloud) for one, cloud in zip(frames, clouds, strict=True)]
    return [case_of(one, rig).statistics for one, _ in measure_all(changed, rig)]


def with_scans(statistics: Floats, points: np.ndarray | None, views: Sequence[int], rig: Rig) -> Floats:
    """The statistics of a frame with those of what conflicts with the last scan, (K, 3) points; None: no scan."""
    told = statistics.copy()
    for column, check in enumerate(rig_sensor_checks(rig)):
        if check.check.kind.of is Of.OWN_SCANS and check.others[0] in views and points is not None:
            told[column] = measuring(check.check)(points, rig, *check.others)
    return told


def tallies(drives: Sequence[Drive]) -> dict[str, dict[str, Tally]]:
    """By attack and duration, over drives, places and beginnings."""
    found: dict[str, dict[str, Tally]] = defaultdict(lambda: defaultdict(Tally))
    for drive in drives:
        for called, of_sensors in drive.attacks.items():
            what, lasts, _ = called.split("|")
            for who, cases in of_sensors.items():
                found[what.partition(" #")[0]][lasts].add(drive, cases, who)
    return found


def counted(n: Tally) -> str:
    """The cell of series of one attack and one duration, and how many they are."""
    shown = cell(n, "by incident").rstrip()
    return f"{shown} ({n['series']})" if n["series"] else shown


def report(scenes: Sequence[Scene], cameras: Sequence[int], *, prior: bool) -> Iterator[str]:
    """A line for the clean drives and one for each attack."""
    how = "by the prior" if prior else "learnt from other drives"
    yield f"\nLiDAR and {len(cameras)} camera(s), {how}: frames named / incidents / found, % (series)"
    drives = drives_of(scenes, cameras, R, prior=prior)
    clean = [drive.judged(drive.series({}, MEASURED_HZ)) for drive in drives]
    found = sum(any(one.finding for one in each) for each in clean)
    raised = sum(one.kind in FINDINGS for each in clean for one in each)
    yield f"clean: {found} of {len(clean)} drives found, {raised} of {sum(map(len, clean))} frames raised"
    yield f"{'':18}" + "".join(f"{lasts:>28}" for lasts in LASTING)
    every = tallies(drives)
    for what, by_duration in every.items():
        yield f"{what:18}" + "".join(f"{counted(by_duration[lasts]):>28}" for lasts in LASTING)
    yield f"series whose finding names others: {sum(one['others'] for of in every.values() for one in of.values())}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--into", type=Path, required=True)
    parser.add_argument("--places", type=int, default=2)
    every = list(dict.fromkeys(kind for kind, *_ in KINDS))
    parser.add_argument("--only", nargs="+", choices=every, default=every, help="these kinds alone")
    parser.add_argument("--alone", type=int, help="the camera that is measured with the LiDAR alone")
    parser.add_argument("--beams", type=int, default=BEAMS, help="so many of the LiDAR's beams are left")
    options = parser.parse_args()
    use_one_thread()
    for name, family, source in sources_of(Path(os.environ["AUDITOR_TEST_DATA"]), range(0), 0):
        changes = attacks(options.places, options.only, zlib.crc32(name.encode()))
        how = {"camera": options.alone, "beams": options.beams}
        keep(options.into, name, partial(measured, source, name, family, changes, **how))
    scenes = load(options.into)
    for cameras in RIGS if options.alone is None else ((1,),):
        for prior in (False, True):
            print(*report(scenes, cameras, prior=prior), sep="\n", flush=True)


if __name__ == "__main__":
    main()
