"""How often two cameras alone are raised on real stereo pairs of many cameras and days, by the prior alone.

python -m tests.benchmarks.real_pairs DATA/real_pairs [--r 0.01]
"""

import argparse
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path

import cv2
import numpy as np

from auditor.identification.scores import normalised_scores, thresholds_from
from auditor.identification.statistics import sensor_statistics
from auditor.identification.systems import System
from auditor.measurement.checks.collect import collect_checks
from auditor.measurement.disparity.half_resolution import grey, halve
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.disparity.stereo import stereo_map, textured
from auditor.model.arrays import Image
from auditor.model.checks import sensor_checks_of
from auditor.model.rig import Camera, Rig

CHECKS = sensor_checks_of(((1, 2),), (), ())


def statistics_of(left: Image, right: Image) -> tuple[float | None, ...]:
    """The statistics of two rectified images, (H, W) or (H, W, 3): the left one is S_2, as in a rig."""
    pictures = {2: left, 1: right}
    half = {camera: halve(grey(one)) for camera, one in pictures.items()}
    colours = {camera: halve(one) for camera, one in pictures.items() if one.ndim > 2}
    texture = {camera: textured(one) for camera, one in half.items()}
    stereo = stereo_map(find_matcher("sgbm"), grey(left), grey(right), texture[2], texture[1])
    checks = collect_checks(half, colours, {(1, 2): stereo}, {}, two_cameras(left))
    return sensor_statistics(CHECKS, checks.cells, {})


def two_cameras(image: Image) -> Rig:
    """A rig of two cameras; where there is no LiDAR only their sizes matter."""
    height, width = image.shape[:2]
    K = np.array([[width, 0, width / 2], [0, width, height / 2], [0, 0, 1]], dtype=np.float64)
    places = {1: 0.5, 2: 0.0}
    return Rig(
        None,
        tuple(
            Camera(number, f"S_{number}", "", width, height, K @ np.eye(3, 4) - np.outer(K[:, 0], [0, 0, 0, x]))
            for number, x in places.items()
        ),
    )


def pairs_in(folder: Path) -> Iterator[tuple[str, str, Image, Image]]:
    """Family, name, left and right image of each pair."""
    for meta in sorted(folder.glob("*/*/meta.json")):
        for left in sorted(meta.parent.glob("*_left.*")):
            right = next(meta.parent.glob(left.name.replace("_left", "_right").rsplit(".", 1)[0] + ".*"))
            images = [cv2.imread(str(path), cv2.IMREAD_UNCHANGED) for path in (left, right)]
            a, b = (
                np.asarray(one[..., :3] if one.ndim > 2 else one, dtype=np.uint8) for one in images if one is not None
            )
            yield meta.parent.parent.name, f"{meta.parent.name}/{left.stem.removesuffix('_left')}", a, b


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--r", type=Decimal, default=Decimal("0.01"))
    options = parser.parse_args()
    system = System(CHECKS, (), (1, 2))
    thresholds = thresholds_from([], CHECKS, system.judged_together, options.r)
    raised = count = 0
    for family, name, left, right in pairs_in(options.folder):
        found = np.array([statistics_of(left, right)], dtype=np.float64)
        z = normalised_scores(found, [thresholds.expected[check] for check in CHECKS])[0]
        count, raised = count + 1, raised + bool(np.nanmax(z) > thresholds.limit)
        shown = " ".join(f"{v:.2f} ({s:.1f})" for v, s in zip(found[0], z, strict=True))
        mark = "  RAISED" if np.nanmax(z) > thresholds.limit else ""
        print(f"{family:28} {name:32} {'x'.join(map(str, left.shape)):14} {shown}{mark}")
    print(f"{raised} of {count} raised at r = {options.r}, limit {thresholds.limit:.2f}")


if __name__ == "__main__":
    main()
