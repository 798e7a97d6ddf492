"""Frames of the real drives with one camera turned little by little, measured as a scan would.

`python -m tests.benchmarks.turned_frames FOLDER` keeps them in FOLDER. The turned camera's picture is resampled (Lanczos)
at every angle, also where nothing is turned, so that resampling is no difference between nights.
"""

import pickle
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from auditor.identification.statistics import sensor_statistics
from auditor.lab.simulation.vehicles import rotation
from auditor.measurement import FaultFeatures, measure, use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import CameraImage, Frame
from auditor.model.measurement import Measurement
from auditor.model.rig import Camera, Rig
from tests.benchmarks.real_drives import frames

DRIVES = ("0001", "0009")
TURNED = 1
STEP_DEG = 0.02
STEPS = 16
AXES = {"pitch": (1, 0, 0), "yaw": (0, 1, 0), "roll": (0, 0, 1)}
RESAMPLED_DEG = 0.005
"""Every picture of the camera is turned by this at least."""


@dataclass(frozen=True, eq=False)
class TurnedFrame:
    """One frame with the camera turned `step` steps about an axis: what was measured, and its statistics."""

    place: str
    axis: str
    step: int
    measurement: Measurement
    statistics: tuple[float, ...]


def turned(image: CameraImage, camera: Camera, angles_deg: Sequence[float]) -> CameraImage:
    """What a camera sees that has turned by angles about x (down), y (to the right) and z since it was calibrated."""
    K = camera.intrinsics
    moved = K @ rotation(*np.deg2rad(angles_deg)) @ np.linalg.inv(K)
    size = image.pixels.shape[1], image.pixels.shape[0]
    pixels = cv2.warpPerspective(image.pixels, moved, size, flags=cv2.INTER_LANCZOS4, borderMode=cv2.BORDER_REPLICATE)
    return CameraImage(image.sensor, image.stamp_ns, pixels)


def turned_frame(frame: Frame, rig: Rig, axis: str, step: int) -> Frame:
    """The frame with one camera turned."""
    angles = (np.array(AXES[axis]) * step * STEP_DEG + RESAMPLED_DEG).tolist()
    image = turned(frame.images[TURNED], rig.camera(TURNED), angles)
    return replace(frame, images={**frame.images, TURNED: image})


def measured_frames(number: str) -> Iterator[TurnedFrame]:
    """All frames of a drive at every angle; what is alike without an angle is measured once."""
    matcher = find_matcher("sgbm")
    rig, stream = frames(number, colour=True)
    checks = rig_sensor_checks(rig)
    for place, frame in enumerate(stream):
        for axis in AXES:
            for step in range(0 if axis == "pitch" else 1, STEPS + 1):
                found, arrays = measure(turned_frame(frame, rig, axis, step), rig, matcher)
                found = replace(found, fault_features=FaultFeatures().update(arrays))
                statistics = tuple(sensor_statistics(checks, found.cells, found.shares))
                yield TurnedFrame(f"{number}.{place // 5}", axis, step, replace(found, cells={}), statistics)


def main() -> None:
    """Measure what is not kept yet."""
    use_one_thread()
    folder = Path(sys.argv[1])
    for number in DRIVES:
        kept = folder / f"turned_{number}.pickle"
        if not kept.exists():
            kept.write_bytes(pickle.dumps([frames(number)[0], list(measured_frames(number))]))
            print(f"measured {number}", flush=True)


if __name__ == "__main__":
    main()
