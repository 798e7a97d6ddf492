"""What each rule of measuring the LiDAR is for: the figures without it, one rule at a time.

Frames of real drives are measured, with attacks on the LiDAR and without, and clean frames of streets; then the
LiDAR's statistics alone are worked out anew without a rule (AUDITOR_TEST_DATA; 10 minutes and 3 GB):

    python -m tests.benchmarks.measuring_ablations [--since WORD]

A row: attacked frames named, by four cameras, of four kinds; clean frames raised of the real drives, and of streets;
the largest statistics of clean frames, of the real drives and of streets.
"""

import argparse
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from auditor.lab.evaluation.sources import RecordingSource, Street
from auditor.measurement import FaultFeatures, measure, use_one_thread
from auditor.measurement import parameters as measuring
from auditor.measurement import point_parameters as of_points
from auditor.measurement.shared_view import FrameArrays
from auditor.model.checks import Check, rig_sensor_checks
from auditor.model.frames import Frame
from auditor.model.measurement import Measurement
from auditor.model.rig import LIDAR
from auditor.model.verdict import VerdictKind
from tests.benchmarks import lidar_kinds
from tests.benchmarks.ablations import FOUR, INF, THREE, R, Rule, both, left_out, numbers
from tests.benchmarks.clean_statistics import MATCHER, case_of, drives_in, kinds_of
from tests.benchmarks.rates import judge_all
from tests.benchmarks.scenes import Case, Scene

STREETS = (*range(7000, 7024), *range(9800, 9816), *range(12000, 12016))
KINDS = {
    "ghosts": ("ghost 60 8", "ghost 120 12", "ghost 200 8", "ghost 200 20"),
    "walls": ("wall", "far-wall 20", "far-wall 25"),
    "gone": ("removed 12", "removed 20", "hidden 4", "hidden 8", "saturated 8"),
    "others": ("jitter 0.3", "shift 1", "scattered 1000"),
}
OF_RANGES = (Check.FALSE_RANGES, Check.LOST_RETURNS, Check.LIDAR_CONFLICT, Check.ISOLATED_POINTS, Check.ROUGH_RANGES)
_EVERY = {"0009": 4, "0001": 2, "04": 2}  # of the real drives' frames one in so many is attacked
_FORK = get_context("fork")


@dataclass(frozen=True, eq=False)
class Kept:
    """A measured frame of a drive or street, and its clouds under attack."""

    name: str
    family: str
    kinds: str
    frame: Frame
    clean: Measurement
    arrays: FrameArrays
    case: Case
    attacked: Sequence[tuple[str, Frame]]


def rules() -> Iterator[Rule]:
    """The rules, by what they are of."""
    lost, false, rough = of_points.LOST_RETURNS, of_points.FALSE_RANGES, of_points.ROUGH_RANGES
    conflict, seen, alone = measuring.LIDAR_CONFLICT, measuring.LIDAR_PROJECTION, of_points.ISOLATED_POINTS
    yield Rule("as it ships", lambda stack: None)
    yield Rule("projection: occluded points", numbers(seen, nearer_by_px=INF))
    yield Rule("projection: the field's sides", numbers(seen, beside_span=0.0))
    yield Rule("conflict: clearly less", numbers(conflict, clearly_less=-2.0))
    yield Rule("conflict: a beam that passes over", numbers(conflict, passes_over_px=INF))
    yield Rule("isolated: less those nearby", numbers(alone, near_weight=0.0))
    yield Rule("lost: a disc of 0.2 m", numbers(lost, hole_m=0.2))
    yield Rule("lost: a surface matches", numbers(lost, consistent=-1.0))
    yield Rule("lost: less at the sky's disparity", numbers(lost, less_at_infinity=-2.0))
    yield Rule("lost: it stands on something", numbers(lost, foot_behind_m=INF, foot_nearer=0.0))
    yield Rule("lost: its own upper edge", numbers(lost, as_far=0.0))
    yield Rule("lost: beside a patch", numbers(lost, beside_patch=-1.0))
    yield Rule("lost: the usual gap", numbers(lost, gaps=0.0))
    yield Rule("lost: above the road", numbers(lost, above_road_m=-INF))
    yield Rule("lost: steeply below", numbers(lost, steeply=0.0))
    yield Rule("lost: rows that are scanned", numbers(lost, least_crossed=0.0))
    sky = numbers(lost, less_at_infinity=-2.0, foot_behind_m=INF, foot_nearer=0.0, beside_patch=-1.0)
    of_surfaces = numbers(lost, consistent=-1.0, as_far=0.0, gaps=0.0, above_road_m=-INF, least_crossed=0.0)
    yield Rule("lost: all of these but the disc", both(sky, of_surfaces))
    yield Rule("false: a surface matches", numbers(false, consistent=-1.0))
    yield Rule("false: clearly less", numbers(false, clearly_less=-2.0))
    yield Rule("false: not nearby", numbers(false, nearest_m=0.0))
    yield Rule("false: above the road", numbers(false, above_road_m=-INF))
    yield Rule("false: what is above counts", numbers(false, over_m=0.0))
    yield Rule("false: what is undecided counts", numbers(false, undecided=0.0))
    yield Rule("false: half of a clean surface", numbers(false, clean_share=0.5))
    yield Rule("false: 8 clusters", numbers(false, most_clusters=8))
    yield Rule("shift: a pixel's metres", numbers(false, most_of_a_pixel_m=INF))
    yield Rule("shift: of near points", numbers(false, sector_ranges_m=(0.0, INF)))
    yield Rule("shift: both of these", numbers(false, most_of_a_pixel_m=INF, sector_ranges_m=(0.0, INF)))
    yield Rule("shift: another surface", numbers(false, most_m=INF))
    yield Rule("shift: what is usual", numbers(false, usual_m=0.0))
    yield Rule("rough: between neighbours", numbers(rough, gap=INF))
    yield Rule("rough: the farthest", numbers(rough, farthest_m=INF))
    yield Rule("rough: the median", numbers(rough, quantile=0.5))


def kept_frames() -> Iterator[Kept]:
    """The frames, measured once."""
    data = Path(os.environ["AUDITOR_TEST_DATA"])
    sources: list[tuple[str, RecordingSource | Street]] = [*drives_in(data, 1.0).items()]  # type: ignore[list-item]
    sources += [(f"street {seed}", Street(seed, 2, len(FOUR), 0.5)) for seed in STREETS]
    wanted = {kind.split()[0] for kinds in KINDS.values() for kind in kinds}
    for name, source in sources:
        with source.open() as [drive]:
            features = FaultFeatures()
            for place, frame in enumerate(one for one in drive.frames if isinstance(one, Frame)):
                clean, arrays = measure(frame, drive.rig, MATCHER)
                case = case_of(replace(clean, fault_features=features.update(arrays)), drive.rig)
                real = name in _EVERY
                on = real and place % _EVERY[name] == 0
                attacked = [*lidar_kinds.attacks_on(frame, drive.rig, [len(name)], wanted)] if on else []
                family = name if isinstance(source, RecordingSource) else source.family
                yield Kept(name, family, kinds_of(frame), frame, clean, arrays, case, attacked)


def scenes(frames: Sequence[Kept]) -> list[Scene]:
    """The scenes with the LiDAR's statistics worked out anew."""
    cases: dict[str, list[Case]] = {}
    for one in frames:
        every = cases.setdefault(one.name, [])
        for attack, frame in (("", one.frame), *one.attacked):
            statistics = lidar_kinds.statistics_of(frame, one.clean, one.arrays)
            every.append(replace(one.case, attack=attack, attacked=(LIDAR,) if attack else (), statistics=statistics))
    first = {one.name: one for one in reversed(frames)}
    return [
        Scene(name, first[name].family, first[name].arrays.rig, first[name].kinds, tuple(of))
        for name, of in cases.items()
    ]


def row(name: str) -> str:
    """The row without one rule."""
    with left_out(next(rule for rule in rules() if rule.name == name)):
        every = scenes(_FRAMES)
    real, streets = ([one for one in every if (one.name in _EVERY) is is_real] for is_real in (True, False))
    four = judge_all(real, FOUR, R)
    named = Counter(one.case.attack for one in four if one.case.attack and one.robust.attacked == (LIDAR,))
    cells = [str(sum(named[kind] for kind in kinds)) for kinds in KINDS.values()]
    for some, prior in ((real, False), (streets, True)):
        judged = [one for cameras in (FOUR, THREE) for one in judge_all(some, cameras, R, prior=prior)]
        cells.append(str(sum(one.robust.kind is not VerdictKind.CLEAN for one in judged if not one.case.attack)))
    cells += [" ".join(f"{_largest(some, check):.2f}" for some in (real, streets)) for check in OF_RANGES]
    return " | ".join(["", name, *cells, ""]).strip()


def _largest(some: Sequence[Scene], check: Check) -> float:
    return max(
        float(np.nanmax(case.statistics[[one.check is check for one in rig_sensor_checks(scene.rig)]], initial=0.0))
        for scene in some
        for case in scene.cases
        if not case.attack
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--since", default="", help="rules from the one with this word on")
    options = parser.parse_args()
    use_one_thread()
    _FRAMES.extend(kept_frames())
    names = [rule.name for rule in rules()]
    for name in names[next(place for place, one in enumerate(names) if options.since in one) :]:
        with _FORK.Pool(1) as pool:  # nothing that a rule's absence left behind reaches the next
            print(pool.apply(row, (name,)), flush=True)


_FRAMES: list[Kept] = []
"""Measured before a process is forked for each rule."""


if __name__ == "__main__":
    main()
