"""The cost of the checks of the robust method: `OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.check_costs`.

CPU time per frame of each piece (LiDAR, cam1, cam3, reference cam2; images decoded) on frames of drive 0009, clean,
under an opaque facula of R = 375 px on the reference, and behind a bogus wall, as a ratio to two bare SGBM calls
on the same frames; rounds interleaved, medians. Needs AUDITOR_TEST_DATA.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import replace
from statistics import median
from time import process_time
from typing import Any

import cv2

from auditor.identification.scores import candidates
from auditor.identification.statistics import windowed_ratios
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.measurement import FaultFeatures, localise, measure, use_one_thread
from auditor.measurement.checks.brightness import coarse, compare_brightness
from auditor.measurement.checks.collect import collect_checks
from auditor.measurement.checks.count_grid import cells_of_consistency, cells_of_points
from auditor.measurement.checks.lidar_conflict import verify_conflicts
from auditor.measurement.checks.photometric_consistency import photometric_consistency
from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.lidar import lidar_view, visible_to_source
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.disparity.stereo import stereo_map, textured
from auditor.model.checks import rig_pair_checks
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from tests.benchmarks.real_drives import frames

ROUNDS = 3
EVERY = 5
KINDS = ("clean", "facula", "wall")
MATCHER = find_matcher("sgbm")

Seconds = dict[str, list[float]]


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
    found = windowed_ratios(rig_pair_checks(rig), measurement.cells, measurement.shares)
    timed(seconds, f"{kind}: regions", lambda: localise(evidence, candidates(rig_pair_checks(rig), found)))
    half_res = {n: halve(image.pixels) for n, image in frame.images.items()}
    texture = {n: textured(half) for n, half in half_res.items()}
    k = rig.n
    maps = {
        (i, k): stereo_map(MATCHER, frame.images[k].pixels, frame.images[i].pixels, texture[k], texture[i])
        for i in range(1, k)
    }
    assert frame.cloud is not None
    view = lidar_view(frame.cloud, rig, k)
    collected = timed(seconds, f"{kind}: all checks", lambda: collect_checks(half_res, maps, {k: view}, rig))
    pair_checks = rig_pair_checks(rig)
    timed(seconds, f"{kind}: windowed ratios", lambda: windowed_ratios(pair_checks, collected.cells, collected.shares))
    pair = timed(
        seconds,
        f"{kind}: photometric consistency, a pair",
        lambda: photometric_consistency(half_res[k], half_res[1], maps[1, k]),
    )
    d0 = view.disparity_px(1)
    timed(seconds, f"{kind}: visibility, a pair", lambda: visible_to_source(view, rig, 1, d0))
    points = timed(
        seconds,
        f"{kind}: verified conflicts, a pair",
        lambda: verify_conflicts(view, maps[1, k], pair, rig, 1, (half_res[k], half_res[1])),
    )
    camera = rig.camera(k)
    timed(
        seconds,
        f"{kind}: count grids, a pair",
        lambda: (cells_of_consistency(pair), cells_of_points(points, camera.height_px, camera.width_px)),
    )
    timed(seconds, f"{kind}: brightness, a pair", lambda: compare_brightness(coarse(half_res[1]), coarse(half_res[k])))


def main() -> None:
    """Measure and print."""
    use_one_thread()
    bare = cv2.StereoSGBM.create(0, 128, 5, 200, 800, mode=cv2.STEREO_SGBM_MODE_SGBM)
    seconds: Seconds = defaultdict(list)
    rig, stream = frames("0009")
    kept = list(stream)[::EVERY]
    watches = {kind: FaultFeatures() for kind in KINDS}
    for _ in range(ROUNDS):
        for frame in kept:
            left, right = frame.images[rig.n].pixels, frame.images[1].pixels
            timed(seconds, "bare SGBM call", lambda left=left, right=right: bare.compute(left, right))
            for kind, changed in kinds(frame, rig):
                pieces(seconds, kind, changed, rig, watches[kind])
    scale_of = 2 * median(seconds["bare SGBM call"])
    for piece, values in seconds.items():
        print(f"{piece:44} {1e3 * median(values):7.2f} ms  {median(values) / scale_of:.3f}")
    for kind in KINDS:
        whole = ("measure", "fault features", "regions", "windowed ratios")
        total = sum(median(seconds[f"{kind}: {piece}"]) for piece in whole)
        print(f"{kind + ': everything':44} {1e3 * total:7.2f} ms  {total / scale_of:.3f}")


if __name__ == "__main__":
    main()
