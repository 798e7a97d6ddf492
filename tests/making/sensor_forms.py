"""A drive as cameras with regions of interest, binned sensors and more than 8 bits write it."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.model.frames import Frame
from auditor.model.optics.geometry import Matrix
from auditor.model.rig import Camera, Rig
from auditor.recordings import schemas
from auditor.recordings.decoding.interface import ImageRegion
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.writers.mcap_file import mcap_file
from auditor.recordings.writers.messages import MessageMaker

Pixels = NDArray[np.uint8]
Deep = NDArray[np.uint16]
WHOLE = ImageRegion()


@dataclass(frozen=True)
class Sensor:
    """How a camera records: what part of its sensor, binned by how much, and which size its camera info has.

    `written_for` is the region whose K and P the driver writes: ROS wants those of the whole sensor.
    """

    region: ImageRegion = WHOLE
    binning: tuple[int, int] = (0, 0)
    info_px: tuple[int, int] | None = None
    written_for: ImageRegion = WHOLE

    def picture(self, pixels: Pixels) -> Pixels:
        """What is recorded of a picture of the whole sensor."""
        region = self.region
        if region.width_px:
            below, right = region.top_px + region.height_px, region.left_px + region.width_px
            pixels = pixels[region.top_px : below, region.left_px : right]
        across, down = (max(by, 1) for by in self.binning)
        height, width = pixels.shape[0] // down, pixels.shape[1] // across
        return np.asarray(
            cv2.resize(pixels[: height * down, : width * across], (width, height), None, 0, 0, cv2.INTER_AREA)
        )


@dataclass(frozen=True)
class Values:
    """How pixels become a message: the encoding of the image, or "png"; and the values that are written."""

    encoding: str = "mono8"
    of: Callable[[Pixels], Pixels | Deep] = lambda pixels: pixels
    big_endian: bool = False


def write_sensors(
    path: Path, rig: Rig, frames: Iterable[Frame], sensor: Sensor = Sensor(), values: Values = Values()
) -> Path:
    """An MCAP file of a rig's frames; the offsets of the cameras are in P, and the LiDAR is placed by tf."""
    maker = MessageMaker("cdr")
    with mcap_file(path, profile="ros2", compression="zstd") as file:

        def add(topic: str, schema: str, stamp_ns: int, data: bytes) -> None:
            definition = Definition("ros2msg", maker.definition(schema).encode())
            file.write(Topic(topic, schema, "cdr"), definition, stamp_ns, data)

        for frame in frames:
            at = frame.stamp_ns
            if rig.lidar:
                tree = {rig.lidar.name: rig.lidar.rig_SE3_lidar}
                add("/tf_static", schemas.TRANSFORMS, at, maker.transforms("cameras", tree, at))
            for camera in rig.cameras:
                name = f"/{camera.name.replace(' ', '_')}"
                add(f"{name}/camera_info", schemas.CAMERA_INFO, at, _camera_info(maker, camera, sensor, at))
                pixels = values.of(sensor.picture(frame.images[camera.number].pixels))
                add(f"{name}/image_rect", *_image(maker, pixels, values, at))
            if rig.lidar and frame.cloud:
                points = np.column_stack([frame.cloud.xyz_m, np.zeros(len(frame.cloud.xyz_m))]).astype(np.float32)
                add("/points", schemas.POINT_CLOUD, at, maker.point_cloud(points, at, rig.lidar.name))
    return path


def _camera_info(maker: MessageMaker, camera: Camera, sensor: Sensor, stamp_ns: int) -> bytes:
    types, region = maker.store.types, sensor.region
    P: Matrix = np.array(camera.projection)
    P[0, :] -= sensor.written_for.left_px * P[2, :]
    P[1, :] -= sensor.written_for.top_px * P[2, :]
    width, height = sensor.info_px or (camera.width_px, camera.height_px)
    roi = types["sensor_msgs/msg/RegionOfInterest"](
        x_offset=region.left_px,
        y_offset=region.top_px,
        height=region.height_px,
        width=region.width_px,
        do_rectify=region != WHOLE,
    )
    info = types[schemas.CAMERA_INFO](
        header=maker.header(stamp_ns, "cameras"),
        height=height,
        width=width,
        distortion_model="plumb_bob",
        d=np.zeros(0),
        k=P[:, :3].ravel(),
        r=np.eye(3).ravel(),
        p=P.ravel(),
        binning_x=sensor.binning[0],
        binning_y=sensor.binning[1],
        roi=roi,
    )
    return maker.serialise(schemas.CAMERA_INFO, info)


def _image(maker: MessageMaker, pixels: Pixels | Deep, values: Values, stamp_ns: int) -> tuple[str, int, bytes]:
    if values.encoding == "png":
        data = cv2.imencode(".png", pixels)[1].tobytes()
        return schemas.COMPRESSED_IMAGE, stamp_ns, maker.compressed_image(data, "png", stamp_ns, "cameras")
    height, width = pixels.shape
    order = ">" if values.big_endian else "<"
    data = np.ascontiguousarray(pixels.astype(pixels.dtype.newbyteorder(order))).view(np.uint8).ravel()
    image = maker.store.types[schemas.IMAGE](
        header=maker.header(stamp_ns, "cameras"),
        height=height,
        width=width,
        encoding=values.encoding,
        is_bigendian=int(values.big_endian),
        step=data.size // height,
        data=data,
    )
    return schemas.IMAGE, stamp_ns, maker.serialise(schemas.IMAGE, image)
