"""The cost of the checks of the robust method: `OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.check_costs`.

CPU time per frame of each piece (LiDAR, cam1, cam3, reference cam2; images decoded) on frames of drive 0009, clean,
under an opaque facula of R = 375 px on the reference, and behind a bogus wall, as a ratio to two bare SGBM calls
on the same frames; rounds interleaved, medians. Of the clean frames, and of the same with two colour cameras: measuring
with three matchings, and with two, without the pair of the fallback. Of those in colour what the LATEST checks take.
With --measuring that of clean frames alone, with --latest what the LATEST checks take. Needs AUDITOR_TEST_DATA.
"""

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from statistics import median
from time import process_time
from typing import Any
from unittest.mock import patch

import cv2

from auditor.identification.scores import standing_out
from auditor.identification.statistics import sensor_statistics
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.measurement import FaultFeatures, localise, measure, use_one_thread
from auditor.measurement.checks import collect, false_ranges, light, lost_returns, point_distribution
from auditor.measurement.checks.collect import collect_checks
from auditor.measurement.checks.free_space_conflict import OwnScans
from auditor.measurement.checks.lidar_conflict import cells_of_points, verify_conflicts
from auditor.measurement.checks.light import CameraLevels, LightDifference, light_difference
from auditor.measurement.checks.lost_returns import count_lost_returns, scanned_view
from auditor.measurement.checks.photometric_consistency import PairConsistency, Patches, photometric_consistency
from auditor.measurement.checks.striped_light import RowExcess
from auditor.measurement.count_grid import ImageGrid, places_of, sums_of_pair
from auditor.measurement.disparity.half_resolution import grey, halve
from auditor.measurement.disparity.lidar import lidar_view, visible_to_source
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.disparity.matchers.sgbm import equalised
from auditor.measurement.disparity.stereo import stereo_map, textured
from auditor.model.arrays import Image
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import Frame
from auditor.model.measurement import LIGHT_STEPS
from auditor.model.rig import Rig
from tests.benchmarks.real_drives import frames

ROUNDS = 3
EVERY = 5
KINDS = ("clean", "facula", "wall")
LATEST: dict[str, tuple[tuple[Any, str], ...]] = {
    "lost returns": ((lost_returns, "scanned_view"), (lost_returns, "count_lost_returns")),
    "light of one colour": ((light, "coloured_light"),),
    "false ranges": ((false_ranges, "directed_points"), (collect, "pair_ranges"), (collect, "false_ranges")),
    "rough ranges": ((point_distribution, "rough_ranges"),),
    "light in rows": ((RowExcess, "of"), (RowExcess, "above")),
}
"""The functions of each check, and where they are called from."""
OF_CLOUDS = ("lost returns", "false ranges", "rough ranges")
FREE_SPACE = "free-space conflict, a frame"
MATCHER = find_matcher("sgbm")

Seconds = dict[str, list[float]]


class TwoMatchings(Rig):
    """LiDAR and three cameras, of which only those pairs are matched that the rig cannot be judged without."""

    fallback = None


def kinds(frame: Frame, rig: Rig) -> Iterator[tuple[str, Frame]]:
    """The frame clean and strongly attacked."""
    yield "clean", frame
    facula = Facula(2000.0, 375.0, 621.0, 187.0)
    yield "facula", replace(frame, images={**frame.images, rig.n: facula.apply(frame.images[rig.n])})
    assert frame.cloud is not None
    yield "wall", replace(frame, cloud=BogusWall(6.0, 0.0).apply(frame.cloud, rig))


def timed(seconds: Seconds, piece: str, work: Callable[[], Any]) -> Any:
    """Call `work` and keep its CPU time."""
    started = process_time()
    result = work()
    seconds[piece].append(process_time() - started)
    return result


def pieces(seconds: Seconds, kind: str, frame: Frame, rig: Rig, watch: FaultFeatures) -> None:
    """Time measuring with all checks, fault features and regions; then the parts of the checks for one pair."""
    measurement, evidence = timed(seconds, f"{kind}: measure", lambda: measure(frame, rig, MATCHER))
    timed(seconds, f"{kind}: fault features", lambda: watch.update(evidence))
    checks = rig_sensor_checks(rig)
    found = timed(
        seconds, f"{kind}: statistics", lambda: sensor_statistics(checks, measurement.cells, measurement.shares)
    )
    timed(seconds, f"{kind}: regions", lambda: localise(evidence, standing_out(checks, found).sensors, rig))
    greys = {n: grey(image.pixels) for n, image in frame.images.items()}
    colours = {n: halve(image.pixels) for n, image in frame.images.items() if image.pixels.ndim > 2}
    half_res = {n: halve(pixels) for n, pixels in greys.items()}
    texture = {n: textured(half) for n, half in half_res.items()}
    k = rig.n
    maps = {(i, k): stereo_map(MATCHER, greys[k], greys[i], texture[k], texture[i]) for i in range(1, k)}
    timed(seconds, f"{kind}: equalising, a pair", lambda: equalised(half_res[1], half_res[k]))
    assert frame.cloud is not None
    view = timed(seconds, f"{kind}: LiDAR projection, a view", lambda: lidar_view(frame.cloud, rig, k))
    timed(seconds, f"{kind}: all checks, two pairs", lambda: collect_checks(half_res, colours, maps, {k: view}, rig))
    pair = timed(
        seconds,
        f"{kind}: photometric consistency, a pair",
        lambda: photometric_consistency(Patches.of(half_res[k]), half_res[1], maps[1, k]),
    )
    lights = timed(seconds, f"{kind}: light, a pair", lambda: _light(half_res, colours, pair, k))
    d0 = view.disparity_px(1)
    timed(seconds, f"{kind}: visibility, a pair", lambda: visible_to_source(view, rig, 1, d0))
    points = timed(
        seconds,
        f"{kind}: verified conflicts, a pair",
        lambda: verify_conflicts(view, maps[1, k], pair, rig, 1, (half_res[k], half_res[1])),
    )
    scanned = timed(seconds, f"{kind}: scanned directions, a view", lambda: scanned_view(view))
    timed(
        seconds,
        f"{kind}: lost returns, a pair",
        lambda: count_lost_returns(view, scanned, maps[1, k], pair, 1, (half_res[k], half_res[1])),
    )
    places = timed(
        seconds, f"{kind}: places, a pair", lambda: places_of(pair.matches, ImageGrid.of(*half_res[k].shape))
    )
    timed(
        seconds,
        f"{kind}: count grids, a pair",
        lambda: (
            [one.cells for one in sums_of_pair(places, lights.comparable, [lights.residual], LIGHT_STEPS)],
            [one.cells for one in sums_of_pair(places, pair.comparable, [pair.inconsistent])],
            cells_of_points(points, view),
        ),
    )


def measuring(seconds: Seconds, kind: str, frame: Frame, rig: Rig) -> None:
    """Time measuring a frame with three matchings and with two."""
    timed(seconds, f"{kind}: measure", lambda: measure(frame, rig, MATCHER))
    two = TwoMatchings(rig.lidar, rig.cameras)
    timed(seconds, f"{kind}: measure, two matchings", lambda: measure(frame, two, MATCHER))


def of_colours(seconds: Seconds, frame: Frame, rig: Rig) -> None:
    """Time what the latest checks take of measuring a frame with colour cameras."""
    _, arrays = measure(frame, rig, MATCHER)
    spent: Seconds = defaultdict(list)
    with ExitStack() as stack:
        for check, functions in LATEST.items():
            for place, name in functions:
                stack.enter_context(patch.object(place, name, _clocked(spent, check, getattr(place, name))))
        measure(frame, rig, MATCHER)
    for pair, difference in arrays.frame_checks.lights.items():
        if difference.coloured is not None:
            matches = arrays.frame_checks.consistencies[pair].matches
            places = places_of(matches, ImageGrid.of(*matches.seen.shape))
            sums = partial(sums_of_pair, places, difference.comparable, steps=LIGHT_STEPS)
            # Its amounts are summed beside those of added light, of the same pixels.
            timed(spent, "light of one colour", partial(sums, [difference.residual, difference.coloured]))
            timed(spent, "added light", partial(sums, [difference.residual]))
            spent["light of one colour"].append(-spent.pop("added light")[0])
    for check in LATEST:
        seconds[f"colour: {check}, a frame"].append(sum(spent[check]))
    clouds = sum(sum(spent[check]) for check in OF_CLOUDS)
    seconds["colour: of clouds alone, a frame"].append(clouds + seconds[FREE_SPACE][-1])
    seconds["colour: latest checks, a frame"].append(sum(map(sum, spent.values())))


def free_space(seconds: Seconds, frame: Frame, before: Frame, rig: Rig) -> None:
    """Time what is compared with the last scan."""
    scans = OwnScans()
    scans.conflicts(before.cloud, rig)
    timed(seconds, FREE_SPACE, partial(scans.conflicts, frame.cloud, rig))


def _clocked(spent: Seconds, check: str, function: Callable[..., Any]) -> Callable[..., Any]:
    def call(*given: Any, **named: Any) -> Any:
        return timed(spent, check, lambda: function(*given, **named))

    return call


def _light(
    half_res: Mapping[int, Image], colours: Mapping[int, Image], seen: PairConsistency, k: int
) -> LightDifference:
    reference, source = (CameraLevels(half_res[camera], colours.get(camera)) for camera in (k, 1))
    return light_difference(reference, source, seen.matches.column, seen.matches.seen)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    only = parser.add_mutually_exclusive_group()
    only.add_argument("--measuring", action="store_true", help="measure whole clean frames alone, not the pieces")
    only.add_argument("--latest", action="store_true", help="measure the latest checks alone")
    options = parser.parse_args()
    use_one_thread()
    bare = cv2.StereoSGBM.create(0, 128, 5, 200, 800, mode=cv2.STEREO_SGBM_MODE_SGBM)
    seconds: Seconds = defaultdict(list)
    rig, stream = frames("0009")
    kept = list(stream)[::EVERY]
    every = list(frames("0009", colour=True)[1])
    coloured = list(zip(every[1::EVERY], every[::EVERY], strict=False))
    watches = {kind: FaultFeatures() for kind in KINDS}
    for _ in range(ROUNDS):
        for frame, (in_colour, before) in zip(kept, coloured, strict=True):
            left, right = (grey(frame.images[n].pixels) for n in (rig.n, 1))
            timed(seconds, "bare SGBM call", lambda left=left, right=right: bare.compute(left, right))
            free_space(seconds, in_colour, before, rig)
            if options.latest:
                of_colours(seconds, in_colour, rig)
                continue
            measuring(seconds, "clean", frame, rig)
            measuring(seconds, "colour", in_colour, rig)
            if options.measuring:
                continue
            for kind, changed in kinds(frame, rig):
                pieces(seconds, kind, changed, rig, watches[kind])
            of_colours(seconds, in_colour, rig)
    scale_of = 2 * median(seconds["bare SGBM call"])
    for piece, values in seconds.items():
        print(f"{piece:44} {1e3 * median(values):7.2f} ms  {median(values) / scale_of:.3f}")
    for kind in () if options.measuring or options.latest else KINDS:
        whole = ("measure", "fault features", "regions", "statistics")
        total = sum(median(seconds[f"{kind}: {piece}"]) for piece in whole)
        print(f"{kind + ': everything':44} {1e3 * total:7.2f} ms  {total / scale_of:.3f}")


if __name__ == "__main__":
    main()
