"""Foxglove messages as recorders write them: by mcap-protobuf-support, and as JSON by mcap's own writer."""

import json
from base64 import b64encode
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import foxglove_schemas_protobuf as schemas
import numpy as np
from mcap.writer import CompressionType, Writer
from mcap_protobuf.writer import Writer as ProtobufWriter

from auditor.model.frames import Frame
from auditor.model.optics.geometry import (
    Matrix,
    invert,
    motion,
    quaternion_from_rotation,
    rotation_from_quaternion,
)
from auditor.model.rig import Rig
from auditor.recordings.decoding.pictures import encode_picture


class FoxgloveMessage(NamedTuple):
    """One message before it is serialised: bytes and (sec, nsec) as in Python."""

    topic: str
    schema: str
    time_ns: int
    fields: dict[str, Any]


def stamp(time_ns: int) -> dict[str, int]:
    return {"sec": time_ns // 10**9, "nsec": time_ns % 10**9}


def xyz(values: Matrix) -> dict[str, float]:
    return dict(zip("xyz", (float(value) for value in values), strict=True))


def transform(parent: str, child: str, matrix: Matrix, time_ns: int) -> dict[str, Any]:
    rotation = dict(zip("xyzw", quaternion_from_rotation(matrix[:3, :3]), strict=True))
    return {
        "timestamp": stamp(time_ns),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": xyz(matrix[:3, 3]),
        "rotation": rotation,
    }


def cloud_fields(points: np.ndarray, time_ns: int, frame_id: str, **other: Any) -> dict[str, Any]:
    return {
        "timestamp": stamp(time_ns),
        "frame_id": frame_id,
        "pose": {"position": xyz(np.zeros(3)), "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}},
        "point_stride": points.itemsize * 3,
        "fields": [{"name": name, "offset": points.itemsize * n, "type": 7} for n, name in enumerate("xyz")],
        "data": points.tobytes(),
        **other,
    }


def messages_of(
    rig: Rig, frames: list[Frame], form: str = "raw", *, one_transform_a_message: bool = False
) -> Iterator[FoxgloveMessage]:
    first = frames[0].stamp_ns
    placed = {f"cam{c.number}": motion(np.eye(3), c.centre_m) for c in rig.cameras}
    if rig.lidar:
        placed["top"] = rig.lidar.rig_SE3_lidar
    transforms = [transform("rig", child, matrix, first) for child, matrix in placed.items()]
    if one_transform_a_message:
        yield from (FoxgloveMessage("/tf_static", "foxglove.FrameTransform", first, one) for one in transforms)
    else:
        yield FoxgloveMessage("/tf_static", "foxglove.FrameTransforms", first, {"transforms": transforms})
    for frame in frames:
        for number, image in sorted(frame.images.items()):
            camera, at = rig.camera(number), image.stamp_ns
            head = {"timestamp": stamp(at), "frame_id": f"cam{number}"}
            size = {"width": camera.width_px, "height": camera.height_px}
            matrices = {
                "K": camera.projection[:, :3].ravel().tolist(),
                "R": np.eye(3).ravel().tolist(),
                "P": camera.projection.ravel().tolist(),
            }
            calibration = {**head, **size, "distortion_model": "plumb_bob", "D": [], **matrices}
            yield FoxgloveMessage(f"/cam{number}/camera_info", "foxglove.CameraCalibration", at, calibration)
            pixels = np.ascontiguousarray(image.pixels)
            if form == "raw":
                raw = {
                    "encoding": "mono8" if pixels.ndim == 2 else "bgr8",
                    "step": pixels.strides[0],
                    "data": pixels.tobytes(),
                }
                yield FoxgloveMessage(camera.topic, "foxglove.RawImage", at, {**head, **size, **raw})
            else:
                picture = {**head, "format": form, "data": encode_picture(pixels, form)}
                yield FoxgloveMessage(camera.topic, "foxglove.CompressedImage", at, picture)
        if frame.cloud and rig.lidar:
            fields = cloud_fields(frame.cloud.xyz_m, frame.cloud.stamp_ns, "top")
            yield FoxgloveMessage(rig.lidar.topic, "foxglove.PointCloud", frame.cloud.stamp_ns, fields)


def nuscenes(folder: Path) -> Iterator[FoxgloveMessage]:
    """The frame of six cameras and a LiDAR in a folder, as nuScenes' own converter lays it out."""
    calibration_file = json.loads((folder / "calibration.json").read_text())
    at = round(calibration_file["timestamp"] * 1e9)
    for name, camera in calibration_file["images"].items():
        topic, frame = f"/{name.lower()}", {"frame_id": name, "timestamp": stamp(round(camera["timestamp"] * 1e9))}
        K = np.array(camera["cam2img"])[:3, :3]
        P = np.hstack([K, np.zeros((3, 1))])
        matrices = {"K": K.ravel().tolist(), "R": np.eye(3).ravel().tolist(), "P": P.ravel().tolist()}
        placed = transform("top", name, invert(np.array(camera["lidar2cam"])), at)
        picture = {"data": (folder / camera["img_path"]).read_bytes(), "format": "jpeg"}
        calibration = {"width": 1600, "height": 900, "D": [], "distortion_model": "", **matrices}
        yield FoxgloveMessage("/tf", "foxglove.FrameTransform", at, placed)
        yield FoxgloveMessage(f"{topic}/camera_info", "foxglove.CameraCalibration", at, {**frame, **calibration})
        yield FoxgloveMessage(f"{topic}/image_rect_compressed", "foxglove.CompressedImage", at, {**frame, **picture})
    points = np.fromfile(next(folder.glob("*.pcd.bin")), np.float32).reshape(-1, 5)
    fields = [{"name": name, "offset": 4 * n, "type": 7} for n, name in enumerate(("x", "y", "z", "intensity", "ring"))]
    cloud = cloud_fields(points[:, :3], at, "top", data=points.tobytes(), point_stride=20, fields=fields)
    yield FoxgloveMessage("/lidar_top", "foxglove.PointCloud", at, cloud)


def ddad(folder: Path) -> Iterator[FoxgloveMessage]:
    """The three frames of three cameras and a LiDAR in a folder of the DGP layout: the vehicle stands."""
    calibration = json.loads(next((folder / "calibration").glob("*.json")).read_text())
    for name, inner, outer in zip(*(calibration[key] for key in ("names", "intrinsics", "extrinsics")), strict=True):
        turn, at_m = outer["rotation"], outer["translation"]
        rotation = rotation_from_quaternion(*(turn[f"q{axis}"] for axis in "xyzw"))
        placed = motion(rotation, np.array([at_m[axis] for axis in "xyz"]))
        K = np.array([[inner["fx"], inner["skew"], inner["cx"]], [0, inner["fy"], inner["cy"]], [0, 0, 1]])
        P = np.hstack([K, np.zeros((3, 1))])
        matrices = {"K": K.ravel().tolist(), "R": np.eye(3).ravel().tolist(), "P": P.ravel().tolist()}
        for file in sorted((folder / "rgb" / name).glob("*.jpg")):
            at, frame = _ddad_ns(file), {"frame_id": name, "timestamp": stamp(_ddad_ns(file))}
            known = {"width": 1936, "height": 1216, "D": [], "distortion_model": "", **matrices}
            picture = {"data": file.read_bytes(), "format": "jpeg"}
            topic = f"/{name.lower()}"
            yield FoxgloveMessage("/tf", "foxglove.FrameTransform", at, transform("LIDAR", name, placed, at))
            yield FoxgloveMessage(f"{topic}/camera_info", "foxglove.CameraCalibration", at, {**frame, **known})
            yield FoxgloveMessage(
                f"{topic}/image_rect_compressed", "foxglove.CompressedImage", at, {**frame, **picture}
            )
    for file in sorted((folder / "point_cloud" / "LIDAR").glob("*.npz")):
        points = np.load(file)["data"][:, :3].astype(np.float32)
        yield FoxgloveMessage(
            "/lidar", "foxglove.PointCloud", _ddad_ns(file), cloud_fields(points, _ddad_ns(file), "LIDAR")
        )


def _ddad_ns(file: Path) -> int:
    """Files are named by tenths of microseconds."""
    return int(file.stem) * 100


def protobuf_message(schema: str, fields: dict[str, Any]) -> Any:
    name = schema.rpartition(".")[2]
    kind = getattr(__import__(f"{schemas.__name__}.{name}_pb2", fromlist=[name]), name)
    return _fill(kind(), fields)


def _fill(message: Any, fields: dict[str, Any]) -> Any:
    for name, value in fields.items():
        if name == "timestamp":
            message.timestamp.seconds, message.timestamp.nanos = value["sec"], value["nsec"]
        elif isinstance(value, dict):
            _fill(getattr(message, name), value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            for one in value:
                _fill(getattr(message, name).add(), one)
        elif isinstance(value, list):
            getattr(message, name).extend(value)
        else:
            setattr(message, name, value)
    return message


def write_protobuf(path: Path, messages: Iterator[FoxgloveMessage], compression: str = "ZSTD") -> None:
    with path.open("wb") as out, ProtobufWriter(out, compression=CompressionType[compression]) as writer:
        for one in messages:
            message = protobuf_message(one.schema, one.fields)
            writer.write_message(one.topic, message, log_time=one.time_ns, publish_time=one.time_ns)


def json_text(fields: dict[str, Any]) -> bytes:
    return json.dumps(fields, default=lambda data: b64encode(data).decode()).encode()


def write_json(path: Path, messages: Iterator[FoxgloveMessage]) -> None:
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start("")
        channels: dict[str, int] = {}
        for one in messages:
            if one.topic not in channels:
                schema = writer.register_schema(one.schema, "jsonschema", b"{}")
                channels[one.topic] = writer.register_channel(one.topic, "json", schema)
            writer.add_message(channels[one.topic], one.time_ns, json_text(one.fields), one.time_ns)
        writer.finish()
