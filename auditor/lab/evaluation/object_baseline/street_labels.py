"""The vehicles of a synthetic street as labels: KITTI's form, made from the truth of the scene."""

import numpy as np

from auditor.lab.evaluation.object_baseline.detectors import CAR
from auditor.lab.evaluation.object_baseline.kitti_labels import ObjectLabel
from auditor.lab.simulation.drives import SyntheticDrive
from auditor.model.optics.geometry import Matrix
from auditor.model.rig import Camera

_LEAST_SEEN_BY_LEVEL = (0.8, 0.4, 0.1)
"""Of a vehicle that is seen less than this, the level of occlusion is one more; KITTI's levels are 0 to 3."""


def street_labels(drive: SyntheticDrive, number: int, camera: int) -> tuple[ObjectLabel, ...]:
    """The vehicles of a frame that lie at least in part in the picture of S_camera."""
    optics = drive.rig.camera(camera)
    labels = (_label(corners, seen, optics) for corners, seen in drive.vehicles_ahead(number, camera))
    return tuple(label for label in labels if label is not None)


def _label(corners_m: Matrix, seen_share: float, camera: Camera) -> ObjectLabel | None:
    u, v, depth = camera.projection @ np.append(corners_m, np.ones((8, 1)), axis=1).T
    ends = [(u / depth).min(), (v / depth).min(), (u / depth).max(), (v / depth).max()]
    inside = np.clip(ends, 0, [camera.width_px, camera.height_px] * 2)
    area, whole = (np.prod(np.subtract(box[2:], box[:2])) for box in (inside, ends))
    if area <= 0:
        return None
    x, z = corners_m[3, [0, 2]] - corners_m[0, [0, 2]]
    sides = corners_m[0] - corners_m[4], corners_m[1] - corners_m[0], corners_m[3] - corners_m[0]
    height, width, length = (float(np.linalg.norm(side)) for side in sides)
    return ObjectLabel(
        kind=CAR,
        truncated=float(1 - area / whole),
        occluded=sum(seen_share < least for least in _LEAST_SEEN_BY_LEVEL),
        box_px=(float(inside[0]), float(inside[1]), float(inside[2]), float(inside[3])),
        size_m=(height, width, length),
        place_m=(float(corners_m[:4, 0].mean()), float(corners_m[:4, 1].mean()), float(corners_m[:4, 2].mean())),
        yaw_rad=float(np.arctan2(-z, x)),
    )
