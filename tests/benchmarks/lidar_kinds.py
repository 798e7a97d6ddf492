"""How often each kind of attack on the LiDAR is found: `python -m tests.benchmarks.lidar_kinds --into FOLDER`.

Of the real drives (AUDITOR_TEST_DATA), or of streets, all frames are measured clean, and some of them under each kind.
Each drive is judged by thresholds of the others (streets: of other families), or by the prior, with all cameras and
with three of them, and again without the checks of ranges. What is in the folder is not measured again:

    python -m tests.benchmarks.lidar_kinds --into FOLDER [--streets 18 --first 6000] [--attacked 12] [--constant]

With --constant an attack is drawn once for a drive; `durations FOLDER` judges series of such frames.

Counted are frames: `found` are not clean; `named` name the attacked sensors and no other; `others` name another
sensor. Objects are removed only where something stands that looks like a car: `spoofing.find_object` says where.
"""

from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from auditor.identification.statistics import sensor_statistics
from auditor.lab.attacks.catalogue import ON_LIDAR
from auditor.lab.attacks.faults import lidar_axes
from auditor.lab.attacks.kinds import AttackDraw
from auditor.lab.attacks.paper import BogusWall, draw_wall, road_below_m
from auditor.lab.attacks.spoofing import find_object
from auditor.measurement import FaultFeatures, measure
from auditor.measurement.checks.collect import shares_of_ranges
from auditor.measurement.checks.false_ranges import directed_points, pair_ranges
from auditor.measurement.checks.lidar_conflict import cells_of_points, verify_conflicts
from auditor.measurement.checks.lost_returns import count_lost_returns, scanned_view
from auditor.measurement.checks.point_distribution import (
    isolated,
    isolated_ratio,
    isolated_shares,
    point_dropout,
    rough_ranges,
)
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.shared_view import FrameArrays
from auditor.model.arrays import Floats
from auditor.model.checks import Check, CountedPair, SensorCheck, rig_sensor_checks
from auditor.model.frames import Frame
from auditor.model.measurement import Measurement
from auditor.model.rig import LIDAR, Rig
from tests.benchmarks.clean_statistics import MATCHER, Source, case_of, kinds_of, options_of, scenes_of, spread
from tests.benchmarks.rates import Judged, counts, judge_all, misnamed, named, not_clean
from tests.benchmarks.scenes import Scene

KINDS: tuple[tuple[str, float | None] | tuple[str, float, float], ...] = (
    *(("ghost", points, metres) for points, metres in ((20, 8), (60, 8), (120, 12), (200, 8), (200, 20))),
    *(("jitter", metres) for metres in (0.3, 1)),
    ("shift", 1),
    *(("removed", metres) for metres in (12, 20, 28)),
    ("seen-through", 20),
    *(("hidden", degrees) for degrees in (4, 8, 20)),
    *(("saturated", degrees) for degrees in (8, 20)),
    *(("pulses", degrees) for degrees in (8, 20)),
    ("wall", None),
    *(("far-wall", metres) for metres in (15, 20, 25, 30)),
    *(("scattered", points) for points in (300, 1000, 2000)),
    ("rain", 25),
)
COPIED = "copied-wall"
OBJECTS = ("removed", "seen-through")
RANGES = (Check.FALSE_RANGES, Check.ROUGH_RANGES)
SETS = ((1, 2, 3, 4), (1, 2, 3), (1, 2, 4))


def copied_wall(frame: Frame, rig: Rig, wall: BogusWall, camera: int, reference: int) -> Frame:
    """The frame with a wall in the cloud, and its copy in the picture of one camera: both forged to agree.

    The camera shows at the wall's outline what the `reference` camera shows there, shifted by the wall's disparity: so
    the two cameras match at the wall's distance. The rig's cameras share a rectified view.
    """
    assert rig.lidar is not None
    assert frame.cloud is not None
    points = frame.cloud.xyz_m @ lidar_axes(rig).T
    bottom_m = road_below_m(points) - wall.bottom_m
    left_m, right_m = wall.lateral_m - wall.width_m / 2, wall.lateral_m + wall.width_m / 2
    corners = np.array([[left_m, bottom_m - wall.height_m, wall.range_m], [right_m, bottom_m, wall.range_m]])
    corners += rig.lidar.rig_SE3_lidar[:3, 3]
    there, here = (_box_px(rig.camera(number).projection, corners) for number in (reference, camera))
    height, width = rig.camera(camera).height_px, rig.camera(camera).width_px
    top, bottom = max(there[1], 0), min(there[3], height)
    shift = there[0] - here[0]
    left, right = max(there[0], shift, 0), min(there[2], width, width + shift)
    changed, shown = frame.images[camera].pixels.copy(), frame.images[reference].pixels
    patch = shown[top:bottom, left:right]
    levels = patch if patch.ndim == changed.ndim else patch.mean(axis=2) if patch.ndim == 3 else patch[:, :, None]
    changed[top:bottom, left - shift : right - shift] = levels
    images = {**frame.images, camera: replace(frame.images[camera], pixels=changed)}
    return replace(frame, cloud=wall.apply(frame.cloud, rig), images=images)


def _box_px(projection: Floats, corners_m: Floats) -> tuple[int, int, int, int]:
    """Left, top, right and bottom pixel of two opposite corners (2, 3) in the rig."""
    u, v, w = projection[:, :3] @ corners_m.T + projection[:, 3:]
    left, right = np.rint(u / w).astype(int).tolist()
    top, bottom = np.rint(v / w).astype(int).tolist()
    return left, top, right, bottom


def attacks_on(frame: Frame, rig: Rig, seed: Sequence[int], only: Collection[str]) -> Iterator[tuple[str, Frame]]:
    """The frame under the kinds of attack on the LiDAR alone; objects are removed only where a car stands."""
    assert frame.cloud is not None
    points = frame.cloud.xyz_m @ lidar_axes(rig).T
    for number, (kind, size, *away) in enumerate(KINDS):
        if kind not in only:
            continue
        if kind in OBJECTS and size is not None and not find_object(points, size).is_car:
            continue
        rng = np.random.default_rng([*seed, number])
        cloud = ON_LIDAR[kind](AttackDraw(rng, "mild", size, {"range_m": away[0]} if away else {})).apply(
            frame.cloud, rig
        )
        yield " ".join([kind, *(f"{one:g}" for one in (size, *away) if one is not None)]), replace(frame, cloud=cloud)


def statistics_of(frame: Frame, clean: Measurement, arrays: FrameArrays) -> Floats:
    """The statistics of a frame whose cloud alone was changed: what cameras see of each other is as it was.

    The LiDAR's range masks are those of the clean cloud.
    """
    assert frame.cloud is not None
    checks, rig = arrays.frame_checks, arrays.rig  # once rectified
    views = {k: lidar_view(frame.cloud, rig, k) for k in arrays.lidar}
    scanned = {k: scanned_view(view) for k, view in views.items()}
    cells, ranges = dict(clean.cells), {}
    shares = {check: share for check, share in clean.shares.items() if check.sensor != LIDAR}
    for j, k in checks.verified_conflicts:
        half_res = arrays.views[k], arrays.views[j]
        points = verify_conflicts(views[k], arrays.maps[j, k], checks.consistencies[j, k], rig, j, half_res)
        cells[CountedPair(Check.LIDAR_CONFLICT, j, k, LIDAR)] = cells_of_points(points, views[k])
        directed = directed_points(views[k], scanned[k].road_m)
        assert points.votes is not None
        ranges[j, k] = pair_ranges(directed, views[k], arrays.maps[j, k], points.votes, j)
        lost = count_lost_returns(views[k], scanned[k], arrays.maps[j, k], checks.consistencies[j, k], j, half_res)
        cells[CountedPair(Check.LOST_RETURNS, j, k, LIDAR)] = lost
    for k, view in views.items():
        camera = rig.camera(k)
        shares[SensorCheck(Check.POINT_DROPOUT, LIDAR, (k,))] = point_dropout(view, camera.width_px)
        alone = isolated_ratio(isolated_shares(view, isolated(view, camera.focal_px), camera.width_px))
        if alone is not None:
            shares[SensorCheck(Check.ISOLATED_POINTS, LIDAR, (k,))] = alone
        rough = rough_ranges(view, camera.focal_px)
        if rough is not None:
            shares[SensorCheck(Check.ROUGH_RANGES, LIDAR, (k,))] = rough
    shares |= shares_of_ranges(ranges)
    return np.array(sensor_statistics(rig_sensor_checks(rig), cells, shares), dtype=np.float64)


def measured(
    source: Source,
    name: str,
    family: str,
    most: int,
    *,
    only: Collection[str],
    constant: bool,
) -> Scene:
    """All frames of a source clean, and `most` of them, evenly spread, under some attacks, drawn anew or `constant`."""
    features, cases, seed = FaultFeatures(), [], len(name)
    with source.open() as [drive]:
        rig = drive.rig
        frames = [item for item in drive.frames if isinstance(item, Frame)]
        chosen = spread(frames, most)
        for frame in frames:
            clean, arrays = measure(frame, rig, MATCHER)
            case = case_of(replace(clean, fault_features=features.update(arrays)), rig)
            cases.append(case)
            if frame.number not in chosen:
                continue
            for kind, changed in attacks_on(frame, rig, [seed] if constant else [seed, frame.number], only):
                statistics = statistics_of(changed, clean, arrays)
                cases.append(replace(case, attack=kind, attacked=(LIDAR,), statistics=statistics))
            if COPIED not in only:
                continue
            wall = draw_wall(np.random.default_rng([seed, frame.number]))
            forged = copied_wall(frame, rig, wall, 1, rig.n)
            cases.append(case_of(measure(forged, rig, MATCHER)[0], rig, COPIED, (LIDAR, 1)))
        return Scene(name, family, rig, kinds_of(frames[0]), tuple(cases))


def unknown(scene: Scene, checks: Collection[Check]) -> Scene:
    """The scene as it is judged where some checks were not measured."""
    columns = np.array([one.check in checks for one in rig_sensor_checks(scene.rig)])
    cases = [replace(case, statistics=np.where(columns, np.nan, case.statistics)) for case in scene.cases]
    return replace(scene, cases=tuple(cases))


def report(after: Sequence[Judged], before: Sequence[Judged]) -> Iterator[str]:
    """A line for the clean frames and each kind: with the checks of ranges, and in brackets without them."""
    by_kind: dict[str, list[tuple[Judged, Judged]]] = defaultdict(list)
    for pair in zip(after, before, strict=True):
        by_kind[pair[0].case.attack].append(pair)
    for kind, pairs in by_kind.items():
        told = [
            "{} {:3} ({:3})".format(what, *(counts(some, is_so)[0] for some in zip(*pairs, strict=True)))
            for what, is_so in OUTCOMES.items()
        ]
        yield f"{kind or 'clean':20} {len(pairs):4} frames: " + ", ".join(told)


OUTCOMES = {"found": not_clean, "named": named, "others": misnamed}


def main() -> None:
    parser = options_of(__doc__, frames=4, attacked=6)
    parser.add_argument("--constant", action="store_true", help="an attack is the same in all frames of a drive")
    every = list(dict.fromkeys((*(kind for kind, *_ in KINDS), COPIED)))
    parser.add_argument("--only", nargs="+", choices=every, default=every, help="these kinds alone")
    parser.add_argument("--prior", action="store_true", help="judge by the prior alone")
    options = parser.parse_args()
    scenes = scenes_of(options, partial(measured, only=options.only, constant=options.constant))
    old = [unknown(scene, RANGES) for scene in scenes]
    for cameras in SETS:
        print(f"\nS_{LIDAR} and " + ", ".join(f"S_{camera}" for camera in cameras))
        after, before = (judge_all(those, cameras, options.r, prior=options.prior) for those in (scenes, old))
        print(*report(after, before), sep="\n")


if __name__ == "__main__":
    main()
