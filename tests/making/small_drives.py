"""Small recordings made with the real writers, for tests of the whole chain: a textured plane that comes nearer."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from auditor.model.frames import CameraImage, Frame, PointCloud, Presence, SensorState
from auditor.model.rig import Rig
from auditor.recordings import write_bag, write_db3, write_mcap
from tests.making.scenes import HEIGHT, WIDTH, plane_cloud, plane_images, plane_rig

START_NS = 1_700_000_000 * 10**9
PERIOD_NS = 10**8
DAY_NS = 86_400 * 10**9
"""Drives of one vehicle that differ begin days apart: at the same stamps they are in conflict."""
FOUR_CAMERAS = (0.6, 0.45, 0.3, 0.0)
THREE_CAMERAS = (0.6, 0.3, 0.0)
"""Beside a LiDAR they name one attacked sensor, and take half the time to measure."""
WRITERS = {".mcap": write_mcap, ".bag": write_bag, ".db3": write_db3}


def drive_frames(
    rig: Rig, count: int, *, seed: int = 0, start_ns: int = START_NS, attacked: dict[int, range] | None = None
) -> Iterator[Frame]:
    """`count` frames; cameras have a little noise of their own, so that no E is exactly zero.

    `attacked` maps a sensor to the frames in which half of its image is blind, or its points stand too near.
    """
    rng = np.random.default_rng(seed)
    for number in range(count):
        stamp = start_ns + number * PERIOD_NS
        depth_m = 15.0 - 9.0 * number / max(count, 2)
        hit = {sensor for sensor, during in (attacked or {}).items() if number in during}
        images = {}
        for sensor, pixels in plane_images(rig, depth_m, seed=seed + number).items():
            noisy = np.clip(pixels + rng.normal(0, 12, pixels.shape), 0, 255).astype(np.uint8)
            if sensor in hit:
                noisy[:, noisy.shape[1] // 6 :] = 255
            images[sensor] = CameraImage(sensor, stamp, noisy)
        cloud = None
        if rig.lidar:
            points = plane_cloud(depth_m) * rng.normal(1, 0.002, (1, 1)).astype(np.float32)
            cloud = PointCloud(stamp, points * np.float32(0.45 if 0 in hit else 1.0))
        yield Frame(number, stamp, {s: Presence(SensorState.PRESENT, 0) for s in rig.sensors}, cloud, images)


def write_drive(
    path: Path,
    count: int = 20,
    *,
    positions_m: tuple[float, ...] = FOUR_CAMERAS,
    lidar: bool = True,
    size_px: tuple[int, int] = (WIDTH, HEIGHT),
    **how: object,
) -> Path:
    """A recording of that many frames, in the format of the path's ending."""
    rig = plane_rig(positions_m, lidar, size_px)
    WRITERS[path.suffix](path, rig, drive_frames(rig, count, **how))
    return path
