"""Recordings of the published rigs: small pictures, and the points that each LiDAR has of a road between walls."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from auditor.model.arrays import Image, Points
from auditor.recordings import schemas
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.writers.mcap_file import mcap_file
from auditor.recordings.writers.messages import MessageMaker
from tests.making.published_rigs import PublishedLidar, PublishedRig

START_NS = 1_700_000_000 * 10**9
PERIOD_NS = 10**8
WALLS_M = 14.0
VEHICLE = "base_link"


def write_published(
    path: Path,
    rig: PublishedRig,
    pictures: Sequence[Mapping[str, Image]],
    clouds: Sequence[Mapping[str, Points]],
    lasts: Mapping[str, int] | None = None,
) -> Path:
    """An MCAP file of a rig with a picture of each camera and a cloud of each LiDAR a frame, by their names.

    A camera that `lasts` for some frames only has no messages behind them.
    """
    maker = MessageMaker("cdr")
    with mcap_file(path, profile="ros2", compression="zstd") as file:

        def add(topic: str, schema: str, stamp_ns: int, data: bytes) -> None:
            definition = Definition("ros2msg", maker.definition(schema).encode())
            file.write(Topic(topic, schema, "cdr"), definition, stamp_ns, data)

        places = {camera.name: camera.vehicle_SE3_camera for camera in rig.cameras}
        places |= {lidar.name: lidar.vehicle_SE3_lidar for lidar in rig.lidars}
        add("/tf_static", schemas.TRANSFORMS, START_NS, maker.transforms(VEHICLE, places, START_NS))
        for number, (seen, points) in enumerate(zip(pictures, clouds, strict=True)):
            stamp_ns = START_NS + number * PERIOD_NS
            for camera in rig.cameras:
                if lasts and number >= lasts.get(camera.name, number + 1):
                    continue
                at = stamp_ns, camera.name
                P = np.hstack([camera.intrinsics, np.zeros((3, 1))])
                info = maker.camera_info(P, *camera.size_px, *at, camera.lens)
                add(f"/{camera.name}/camera_info", schemas.CAMERA_INFO, stamp_ns, info)
                schema, data = maker.image(seen[camera.name], *at, "raw")
                add(f"/{camera.name}/image_raw", schema, stamp_ns, data)
            for lidar in rig.lidars:
                xyz = points[lidar.name]
                data = maker.point_cloud(np.hstack([xyz, xyz[:, :1] * 0]).astype(np.float32), stamp_ns, lidar.name)
                add(f"/{lidar.name}/points", schemas.POINT_CLOUD, stamp_ns, data)
    return path


def write_standing(path: Path, rig: PublishedRig, frames: int = 6) -> Path:
    """A rig whose vehicle stands on a road between walls; its pictures are noise that does not change."""
    rng = np.random.default_rng(0)
    pictures = {c.name: rng.integers(0, 256, c.size_px[::-1]).astype(np.uint8) for c in rig.cameras}
    clouds = {lidar.name: road_points(lidar) for lidar in rig.lidars}
    return write_published(path, rig, [pictures] * frames, [clouds] * frames)


def road_points(lidar: PublishedLidar, step_deg: float = 1.0) -> Points:
    """(N, 3) the LiDAR's points, in its own frame, of flat ground and of a round wall about the vehicle."""
    ahead = lidar.directions(step_deg).reshape(-1, 3)
    R, at = lidar.vehicle_SE3_lidar[:3, :3], lidar.vehicle_SE3_lidar[:3, 3]
    ray = ahead @ R.T
    with np.errstate(divide="ignore"):
        to_ground = np.where(ray[:, 2] < 0, -at[2] / ray[:, 2], np.inf)
    away = np.maximum(np.hypot(ray[:, 0], ray[:, 1]), np.finfo(float).tiny)
    distance = np.minimum(to_ground, WALLS_M / away)
    kept = distance < lidar.reach_m
    return np.asarray(ahead[kept] * distance[kept, None], dtype=np.float32)
