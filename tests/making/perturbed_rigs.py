"""Rigs whose cameras are not rectified."""

import numpy as np

from auditor.lab.simulation.vehicles import rotation
from auditor.model.optics.sensors import Lens
from auditor.model.rig import Camera, Rig


def perturbed(rig: Rig, lenses: tuple[Lens, ...], seed: int, turn_deg: float = 2.0) -> Rig:
    """The same cameras at the same places before rectification.

    Each is turned about every axis by up to `turn_deg` and looks through a lens of its own, as many as cameras. To see
    what the rectified one saw, their pictures are wider and higher by a fifth, at the same focal length.
    """
    rng = np.random.default_rng([seed, 8])
    cameras = []
    for camera, lens in zip(rig.cameras, lenses, strict=True):
        width_px, height_px = round(1.2 * camera.width_px), round(1.2 * camera.height_px)
        K = camera.intrinsics + np.array([[0, 0, 0.1 * camera.width_px], [0, 0, 0.1 * camera.height_px], [0, 0, 0]])
        R = rotation(*np.deg2rad(rng.uniform(-turn_deg, turn_deg, 3)))
        projection = K @ R @ np.column_stack([np.eye(3), -camera.centre_m])
        topic = f"/{camera.name}/image_raw"
        cameras.append(
            Camera(camera.number, camera.name, topic, width_px, height_px, projection, rectified=False, lens=lens)
        )
    return Rig(rig.lidar, tuple(cameras))
