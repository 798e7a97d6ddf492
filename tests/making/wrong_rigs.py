"""Rigs that are wrong, or cameras that are not as their rig says, and the warnings of the calibration check."""

from collections.abc import Callable, Iterable
from dataclasses import replace

import cv2
import numpy as np

from auditor.lab.simulation.vehicles import rotation
from auditor.measurement import CalibrationMonitor, FaultFeatures, measure
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.model.frames import Frame
from auditor.model.optics.geometry import Matrix, motion
from auditor.model.optics.sensors import NO_LENS, Lens
from auditor.model.rig import Rig

Case = Callable[[Rig, Frame], tuple[Rig, Frame]]

KITTI_LENS = Lens("plumb_bob", (-0.37, 0.2, 0.0009, 0.0018, -0.07))
OTHER_LENS = Lens("plumb_bob", (-0.34, 0.17, -0.001, 0.0005, -0.05))


def turned(x_deg: float = 0.0, y_deg: float = 0.0, z_deg: float = 0.0) -> Matrix:
    return rotation(*np.deg2rad([x_deg, y_deg, z_deg]))


def lidar(turn: Matrix | None = None, shift_m: tuple[float, float, float] = (0, 0, 0)) -> Case:
    """The rig believes the LiDAR to be turned or moved."""
    step = motion(np.eye(3) if turn is None else turn, np.array(shift_m, dtype=np.float64))

    def change(rig: Rig, frame: Frame) -> tuple[Rig, Frame]:
        return Rig(replace(rig.lidar, rig_SE3_lidar=step @ rig.lidar.rig_SE3_lidar), rig.cameras), frame

    return change


def baselines(scale: float) -> Case:
    """The rig believes all cameras to lie farther apart: an offset in P and again in tf doubles it."""
    chunk = np.array([1, 1, 1, scale])

    def change(rig: Rig, frame: Frame) -> tuple[Rig, Frame]:
        return Rig(rig.lidar, tuple(replace(c, projection=c.projection * chunk) for c in rig.cameras)), frame

    return change


def cameras(numbers: Iterable[int], lens: Lens = NO_LENS, turn: Matrix | None = None) -> Case:
    """Some cameras are really turned, or recorded through a lens that the rig knows nothing of."""
    R = np.eye(3) if turn is None else turn

    def change(rig: Rig, frame: Frame) -> tuple[Rig, Frame]:
        images = dict(frame.images)
        for number in numbers:
            K, pixels = rig.camera(number).intrinsics, images[number].pixels
            v, u = np.indices(pixels.shape[:2])
            x, y = lens.undistort((u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1])
            x, y, z = np.moveaxis(np.stack([x, y, np.ones_like(x)], axis=-1) @ R, -1, 0)
            column, row = K[0, 0] * x / z + K[0, 2], K[1, 1] * y / z + K[1, 2]
            bent = cv2.remap(pixels, *(a.astype(np.float32) for a in (column, row)), cv2.INTER_LINEAR)
            images[number] = replace(images[number], pixels=np.asarray(bent))
        return rig, replace(frame, images=images)

    return change


CASES: dict[str, Case] = {
    "as it is": lambda rig, frame: (rig, frame),
    "LiDAR yaw 0.3 deg": lidar(turned(y_deg=0.3)),
    "LiDAR yaw 1 deg": lidar(turned(y_deg=1)),
    "LiDAR yaw 2 deg": lidar(turned(y_deg=2)),
    "LiDAR pitch 0.5 deg": lidar(turned(x_deg=0.5)),
    "LiDAR 0.3 m aside": lidar(shift_m=(0.3, 0, 0)),
    "LiDAR 0.3 m lower": lidar(shift_m=(0, 0.3, 0)),
    "baselines x 2": baselines(2),
    "baselines x 1.1": baselines(1.1),
    "S_1 roll 0.5 deg": cameras([1], turn=turned(z_deg=0.5)),
    "S_1 pitch 0.25 deg": cameras([1], turn=turned(x_deg=0.25)),
    "S_1 yaw 0.5 deg": cameras([1], turn=turned(y_deg=0.5)),
    "all not rectified": cameras([1, 2, 3], KITTI_LENS),
    "S_1 not rectified": cameras([1], KITTI_LENS),
    "S_1 another lens": lambda rig, frame: cameras([1], OTHER_LENS)(*cameras([2, 3], KITTI_LENS)(rig, frame)),
}


def warnings(case: Case, rig: Rig, some: Iterable[Frame]) -> tuple[str, ...]:
    """The warnings for a rig and a few frames."""
    return checked(case, rig, some).warnings()


def checked(case: Case, rig: Rig, some: Iterable[Frame]) -> CalibrationMonitor:
    """The check of a rig by a few frames."""
    check = CalibrationMonitor()
    for frame in some:
        _, evidence = measure(*reversed(case(rig, frame)), SgbmMatcher())
        check.add(evidence, FaultFeatures().update(evidence))
    return check
