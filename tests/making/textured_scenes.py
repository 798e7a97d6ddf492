"""A plane with texture that can be followed from camera to camera."""

from dataclasses import replace

import cv2
import numpy as np

from auditor.model.frames import CameraImage
from tests.making.scenes import HEIGHT, WIDTH, plane_frame, plane_rig

DEPTH_M = 9.0
RIG = plane_rig()


def scene(down_px=0, depth_m=DEPTH_M):
    """A plane whose texture corners can be followed, seen so many rows lower."""
    noise = np.random.default_rng(1).integers(0, 256, (HEIGHT + 40, 3 * WIDTH)).astype(np.float32)
    smooth = cv2.GaussianBlur(noise, (0, 0), 2.5)
    texture = np.clip((smooth - smooth.mean()) * 5 + 128, 0, 255).astype(np.uint8)[20 - down_px : 20 - down_px + HEIGHT]
    frame = plane_frame(RIG, depth_m)
    images = {}
    for camera in RIG.cameras:
        left = WIDTH + round(300 * float(camera.centre_m[0]) / depth_m)
        images[camera.number] = CameraImage(camera.number, 0, np.ascontiguousarray(texture[:, left : left + WIDTH]))
    return replace(frame, images=images)
