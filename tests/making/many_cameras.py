"""Recordings of vehicles with very many cameras: small files that ask for much work."""

from pathlib import Path
from typing import Literal

import numpy as np

from auditor.model.optics.geometry import Matrix, motion
from auditor.model.optics.sensors import NO_LENS, POLYNOMIAL, Lens
from auditor.recordings import schemas
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.writers.mcap_file import mcap_file
from auditor.recordings.writers.messages import MessageMaker

START_NS = 1_700_000_000 * 10**9
PERIOD_NS = 10**8
SIZE_PX = (160, 120)
SPACING_M = 0.1
BENT = Lens(POLYNOMIAL, (-0.05, 0.01, 0.0, 0.0))

Placing = Literal["line", "around", "front"]


def write_many_cameras(
    path: Path, count: int, placing: Placing = "line", *, rectified: bool = False, lidar: bool = True, frames: int = 12
) -> Path:
    """An MCAP file of `count` cameras, placed by tf, with noise for pictures: see `_place`."""
    maker, rng = MessageMaker("cdr"), np.random.default_rng(0)
    width, height = SIZE_PX
    K = np.array([[100.0, 0, width / 2], [0, 100, height / 2], [0, 0, 1]])
    P = np.hstack([K, np.zeros((3, 1))])
    image = "image_rect" if rectified else "image_raw"
    places = {f"cam{number:03}": _place(number, count, placing) for number in range(count)}
    pixels = {name: rng.integers(0, 256, (height, width), np.uint8) for name in places}
    points = rng.normal(0, 10, (200, 4)).astype(np.float32)
    with mcap_file(path, profile="ros2", compression="none") as file:

        def add(topic: str, schema: str, stamp_ns: int, data: bytes) -> None:
            definition = Definition("ros2msg", maker.definition(schema).encode())
            file.write(Topic(topic, schema, "cdr"), definition, stamp_ns, data)

        tree = {**places, **({"top": np.eye(4)} if lidar else {})}
        add("/tf_static", schemas.TRANSFORMS, START_NS, maker.transforms("base", tree, START_NS))
        for stamp_ns in range(START_NS, START_NS + frames * PERIOD_NS, PERIOD_NS):
            for name in places:
                lens = NO_LENS if rectified else BENT
                info = maker.camera_info(P, width, height, stamp_ns, name, lens)
                add(f"/{name}/camera_info", schemas.CAMERA_INFO, stamp_ns, info)
                add(f"/{name}/{image}", *_image(maker, pixels[name], stamp_ns, name))
            if lidar:
                add("/top/points", schemas.POINT_CLOUD, stamp_ns, maker.point_cloud(points, stamp_ns, "top"))
    return path


def _image(maker: MessageMaker, pixels: np.ndarray, stamp_ns: int, name: str) -> tuple[str, int, bytes]:
    schema, data = maker.image(pixels, stamp_ns, name, "raw")
    return schema, stamp_ns, data


def _place(number: int, count: int, placing: Placing) -> Matrix:
    """On a line, in rows above each other, or around the car; each looks along its z axis. `base` has z ahead."""
    if placing == "line":
        return motion(np.eye(3), np.array([SPACING_M * number, 0, 0]))
    if placing == "front":
        return motion(np.eye(3), np.array([SPACING_M * (number % 10), SPACING_M * (number // 10), 0]))
    angle = 2 * np.pi * number / count
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    return motion(turn, turn @ np.array([0, 0, 1.5]))
