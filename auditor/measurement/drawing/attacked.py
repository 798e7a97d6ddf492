"""Small pictures of attacked data: a camera's image, and a cloud from above."""

import cv2
import numpy as np

from auditor.measurement.drawing.clouds import seen_from_above
from auditor.measurement.localisation.points import among
from auditor.model.arrays import Image, Points
from auditor.model.optics.geometry import Matrix

_WIDTH_PX = 640
_JPEG_QUALITY = 80


def small_jpeg(pixels: Image) -> bytes:
    """An image (H, W) or (H, W, 3) BGR as a JPEG, at most 640 px wide."""
    height, width = pixels.shape[:2]
    if width > _WIDTH_PX:
        size = _WIDTH_PX, max(1, round(height * _WIDTH_PX / width))
        pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return data.tobytes()


def changed_cloud(before: Points, after: Points, rig_SE3_lidar: Matrix) -> Image:
    """(S, S, 3) BGR: both clouds from above; points that are in one of them alone are red."""
    removed = before[~among(before, after)]
    changed = np.concatenate([~among(after, before), np.ones(len(removed), dtype=np.bool_)])
    return seen_from_above(np.concatenate([after, removed]), changed, rig_SE3_lidar)
