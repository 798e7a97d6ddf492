"""Messages that are written: of ROS, from pixels, points and geometry, for either version of it, and Foxglove's as
protobuf, by the layouts that reading knows.
"""

import struct
from collections.abc import Mapping
from math import nan
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from auditor.model.frames import Pose
from auditor.model.optics.geometry import Matrix, quaternion_from_rotation
from auditor.model.optics.sensors import NO_LENS, POLYNOMIAL, Lens
from auditor.model.stamps import NANOSECONDS
from auditor.recordings import schemas
from auditor.recordings.decoding.foxglove_layouts import DESCRIPTORS, LAYOUTS, TIMESTAMP, Field, FieldType
from auditor.recordings.decoding.pictures import encode_picture
from auditor.recordings.decoding.ros import known_types

Form = Literal["raw", "png", "jpeg"]

CLOUD_FIELDS = ("x", "y", "z", "intensity")
_FLOAT32 = 7


class MessageMaker:
    """Makes serialised messages of one version of ROS."""

    def __init__(self, encoding: Literal["cdr", "ros1"]) -> None:
        self.encoding = encoding
        self.store = known_types(encoding)
        self._definitions: dict[str, str] = {}

    def serialise(self, schema: str, message: object) -> bytes:
        """The bytes of a message object."""
        if self.encoding == "ros1":
            return bytes(self.store.serialize_ros1(message, schema))
        return bytes(self.store.serialize_cdr(message, schema))

    def definition(self, schema: str) -> str:
        """The text that defines a schema and all it is made of."""
        if schema not in self._definitions:
            version = 1 if self.encoding == "ros1" else 2
            self._definitions[schema] = self.store.generate_msgdef(schema, ros_version=version)[0]
        return self._definitions[schema]

    def image(self, pixels: NDArray[np.uint8], stamp_ns: int, frame_id: str, form: Form) -> tuple[str, bytes]:
        """Schema and bytes of an image, (H, W) grey or (H, W, 3) BGR: raw, or as a PNG or JPEG file."""
        if form == "raw":
            encoding = "mono8" if pixels.ndim == 2 else "bgr8"
            return schemas.IMAGE, self.raw_image(pixels, encoding, self.header(stamp_ns, frame_id))
        return schemas.COMPRESSED_IMAGE, self.compressed_image(encode_picture(pixels, form), form, stamp_ns, frame_id)

    def raw_image(self, pixels: NDArray[np.uint8], encoding: str, header: object) -> bytes:
        """sensor_msgs/Image, its rows without padding."""
        height, width = pixels.shape[:2]
        image = self._made(
            schemas.IMAGE,
            header=header,
            height=height,
            width=width,
            encoding=encoding,
            is_bigendian=0,
            step=pixels.size // height,
            data=np.ascontiguousarray(pixels).reshape(-1),
        )
        return self.serialise(schemas.IMAGE, image)

    def compressed_image(self, data: bytes | memoryview, form: str, stamp_ns: int, frame_id: str) -> bytes:
        """sensor_msgs/CompressedImage holding a picture file."""
        image = self._made(
            schemas.COMPRESSED_IMAGE,
            header=self.header(stamp_ns, frame_id),
            format=form,
            data=np.frombuffer(data, np.uint8),
        )
        return self.serialise(schemas.COMPRESSED_IMAGE, image)

    def camera_info(
        self, projection: Matrix, width_px: int, height_px: int, stamp_ns: int, frame_id: str, lens: Lens = NO_LENS
    ) -> bytes:
        """sensor_msgs/CameraInfo: the whole (3, 4) P, K = P[:, :3], R = I; D is empty without lens distortion.

        D and K are as the lens model is published.
        """
        names = "DKRP" if self.encoding == "ros1" else "dkrp"
        coefficients, K = lens.as_published(projection[:, :3])
        D = np.array(coefficients, dtype=np.float64)
        matrices = (D, K.reshape(-1), np.eye(3).reshape(-1), projection.reshape(-1))
        region = self._made(
            "sensor_msgs/msg/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False
        )
        info = self._made(
            schemas.CAMERA_INFO,
            header=self.header(stamp_ns, frame_id),
            height=height_px,
            width=width_px,
            distortion_model=POLYNOMIAL if lens == NO_LENS else lens.model,
            **{name: np.ascontiguousarray(matrix) for name, matrix in zip(names, matrices, strict=True)},
            binning_x=0,
            binning_y=0,
            roi=region,
        )
        return self.serialise(schemas.CAMERA_INFO, info)

    def point_cloud(self, points: NDArray[np.float32], stamp_ns: int, frame_id: str) -> bytes:
        """sensor_msgs/PointCloud2 of (N, 4) float32: x, y, z in metres and intensity."""
        fields = [
            self._made("sensor_msgs/msg/PointField", name=name, offset=4 * place, datatype=_FLOAT32, count=1)
            for place, name in enumerate(CLOUD_FIELDS)
        ]
        cloud = self._made(
            schemas.POINT_CLOUD,
            header=self.header(stamp_ns, frame_id),
            height=1,
            width=len(points),
            fields=fields,
            is_bigendian=False,
            point_step=16,
            row_step=16 * len(points),
            data=np.ascontiguousarray(points, dtype="<f4").view(np.uint8).reshape(-1),
            is_dense=True,
        )
        return self.serialise(schemas.POINT_CLOUD, cloud)

    def transforms(self, parent: str, children: Mapping[str, Matrix], stamp_ns: int) -> bytes:
        """tf2_msgs/TFMessage: each child's (4, 4) parent_SE3_child."""
        made = [
            self._made(
                "geometry_msgs/msg/TransformStamped",
                header=self.header(stamp_ns, parent),
                child_frame_id=child,
                transform=self._transform(matrix),
            )
            for child, matrix in children.items()
        ]
        return self.serialise(schemas.TRANSFORMS, self._made(schemas.TRANSFORMS, transforms=made))

    def fix(self, pose: Pose, stamp_ns: int) -> bytes:
        """sensor_msgs/NavSatFix of a pose with latitude and longitude; an unknown altitude is NaN, as ROS says."""
        fix = self._made(
            schemas.GPS_FIX,
            header=self.header(stamp_ns, pose.frame_id),
            status=self._made("sensor_msgs/msg/NavSatStatus", status=0, service=1),
            latitude=pose.latitude_deg,
            longitude=pose.longitude_deg,
            altitude=nan if pose.altitude_m is None else pose.altitude_m,
            position_covariance=np.zeros(9),
            position_covariance_type=0,
        )
        return self.serialise(schemas.GPS_FIX, fix)

    def string(self, text: str) -> bytes:
        """std_msgs/String."""
        return self.serialise(schemas.STRING, self._made(schemas.STRING, data=text))

    def header(self, stamp_ns: int, frame_id: str) -> object:
        """std_msgs/Header."""
        seconds, nanoseconds = divmod(stamp_ns, NANOSECONDS)
        stamp = self._made("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        counter = {"seq": 0} if self.encoding == "ros1" else {}
        return self._made("std_msgs/msg/Header", **counter, stamp=stamp, frame_id=frame_id)

    def _transform(self, matrix: Matrix) -> object:
        x, y, z = (float(value) for value in matrix[:3, 3])
        qx, qy, qz, qw = quaternion_from_rotation(matrix[:3, :3])
        return self._made(
            "geometry_msgs/msg/Transform",
            translation=self._made("geometry_msgs/msg/Vector3", x=x, y=y, z=z),
            rotation=self._made("geometry_msgs/msg/Quaternion", x=qx, y=qy, z=qz, w=qw),
        )

    def _made(self, schema: str, **fields: Any) -> Any:  # noqa: ANN401  # rosbags generates the classes
        return self.store.types[schema](**fields)


_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5
_OPTIONAL, _REPEATED = 1, 3
_ENUM = "foxglove.PackedElementField.NumericType"
_NUMERIC_TYPES = ("UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32", "FLOAT64")
FLOAT32 = _NUMERIC_TYPES.index("FLOAT32")
"""As `type` of a foxglove.PackedElementField."""

_WRITTEN = {
    **DESCRIPTORS,
    "FileDescriptorProto": {
        1: Field("name", FieldType.STRING),
        **DESCRIPTORS["FileDescriptorProto"],
        3: Field("dependency", FieldType.STRING, repeated=True),
        12: Field("syntax", FieldType.STRING),
    },
    "DescriptorProto": {
        **DESCRIPTORS["DescriptorProto"],
        4: Field("enum_type", FieldType.MESSAGE, "EnumDescriptorProto", repeated=True),
    },
    "EnumDescriptorProto": {
        1: Field("name", FieldType.STRING),
        2: Field("value", FieldType.MESSAGE, "EnumValueDescriptorProto", repeated=True),
    },
    "EnumValueDescriptorProto": {1: Field("name", FieldType.STRING), 2: Field("number", FieldType.INT32)},
}
"""What a descriptor needs beyond what is compared when one is read."""


def protobuf(name: str, values: Mapping[str, Any], layouts: Mapping[str, Mapping[int, Field]] = LAYOUTS) -> bytes:
    """A message of a known layout; `values` are as `decode_protobuf` gives them, and what they lack is left out."""
    written = bytearray()
    for number, field in layouts[name].items():
        value = values.get(field.name)
        for part in value or () if field.repeated else () if value is None else (value,):
            written += _field(number, field, part, layouts)
    return bytes(written)


def descriptors(name: str) -> bytes:
    """The FileDescriptorSet of a message and of those inside it, as MCAP keeps it beside the messages."""
    wanted = [TIMESTAMP, *sorted(_inside(name) - {TIMESTAMP})]
    packages = {
        package: [one for one in wanted if one.startswith(package)] for package in ("google.protobuf", "foxglove")
    }
    files = [_file(package, names) for package, names in packages.items()]
    files[1]["dependency"] = [files[0]["name"]]
    return protobuf("FileDescriptorSet", {"file": files}, _WRITTEN)


def _field(number: int, field: Field, value: Any, layouts: Mapping[str, Mapping[int, Field]]) -> bytes:  # noqa: ANN401
    match field.kind:
        case FieldType.DOUBLE:
            return _varint(number << 3 | _FIXED64) + struct.pack("<d", value)
        case FieldType.FIXED32:
            return _varint(number << 3 | _FIXED32) + struct.pack("<I", value)
        case FieldType.INT64 | FieldType.INT32 | FieldType.ENUM:
            return _varint(number << 3 | _VARINT) + _varint(value % 2**64)
        case FieldType.MESSAGE:
            data = protobuf(field.message, value, layouts)
        case _:
            data = value.encode() if isinstance(value, str) else bytes(value)
    return _varint(number << 3 | _BYTES) + _varint(len(data)) + data


def _varint(value: int) -> bytes:
    written = bytearray()
    while value > 0x7F:
        written.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*written, value])


def _inside(name: str) -> set[str]:
    """A message and all that its fields hold."""
    parts = [field.message for field in LAYOUTS[name].values() if field.kind is FieldType.MESSAGE]
    return {name}.union(*map(_inside, parts))


def _file(package: str, names: list[str]) -> dict[str, Any]:
    described = [_described(name) for name in names]
    return {
        "name": f"{package.replace('.', '/')}.proto",
        "package": package,
        "message_type": described,
        "syntax": "proto3",
    }


def _described(name: str) -> dict[str, Any]:
    fields = [
        {
            "name": field.name,
            "number": number,
            "label": _REPEATED if field.repeated else _OPTIONAL,
            "type": field.kind,
            "type_name": f".{field.message or _ENUM}" if field.kind in (FieldType.MESSAGE, FieldType.ENUM) else None,
        }
        for number, field in LAYOUTS[name].items()
    ]
    values = [{"name": one, "number": number} for number, one in enumerate(_NUMERIC_TYPES)]
    enums = [{"name": _ENUM.rpartition(".")[2], "value": values}] if _ENUM.startswith(f"{name}.") else []
    return {"name": name.rpartition(".")[2], "field": fields, "enum_type": enums}
