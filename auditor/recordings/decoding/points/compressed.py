"""point_cloud_interfaces/CompressedPointCloud2 of point_cloud_transport, of zlib, zstd, lz4, Draco or cloudini.

The form is recognised by its first bytes, since `format` names a transport and not a form. Draco (Draco Bitstream
Specification, 5 and 6) is decoded by DracoPy, the extra `lidar`.
"""

import struct
import zlib
from types import SimpleNamespace
from typing import Any

import lz4.block
import lz4.frame
import numpy as np
import zstandard
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.clouds import DATATYPES, PointCloudDecoder
from auditor.recordings.decoding.points.cloudini import MAGIC, of_cloudini
from auditor.safety.budget import CHUNKS, MAX_POINTS, OverBudgetError, Spending

_ZSTD = b"\x28\xb5\x2f\xfd"
_LZ4_FRAME = b"\x04\x22\x4d\x18"
_GZIP = b"\x1f\x8b"
_ZLIB = 0x78
_ANY_ZLIB_HEAD = 47
"""zlib's window bits for data with its own head or gzip's: point_cloud_transport writes the latter."""

_DRACO = b"DRACO"
_DRACO_HEAD = struct.Struct("<5xBxBBHi")
"""The major version, what it encodes, how, flags, and the number of points."""

_DRACO_SIZES = (0, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8, 1)
"""Bytes of a value by Draco's data types, none of an invalid one."""


class CompressedCloudDecoder(PointCloudDecoder):
    """Unpacks to no more bytes than the header of the cloud declares."""

    def decoded(self, message: Message) -> Any:  # noqa: ANN401  # like the class that is generated of PointCloud2
        """The cloud with the fields of sensor_msgs/PointCloud2."""
        cloud = self._types.decode(message)
        packed = bytes(cloud.compressed_data)
        if packed.startswith(_DRACO):
            return of_draco(packed, cloud.height * cloud.width, message.topic)
        if packed.startswith(MAGIC):
            return _cloud_of(of_cloudini(packed, cloud.height * cloud.width, message.topic))
        size = cloud.height * max(cloud.row_step, cloud.width * cloud.point_step)
        try:
            Spending(CHUNKS).allow(len(packed), size)
            data = _unpacked(packed, size, cloud.format)
        except (zlib.error, zstandard.ZstdError, lz4.block.LZ4BlockError, RuntimeError, EOFError) as error:
            raise DecodingError(f"its compressed data are damaged ({error})", where=message.topic) from error
        except OverBudgetError as error:
            raise DecodingError(f"it {error}", where=message.topic) from error
        fields = {name: getattr(cloud, name) for name in ("height", "width", "fields", "point_step", "row_step")}
        return SimpleNamespace(**fields, is_bigendian=cloud.is_bigendian, data=np.frombuffer(data, np.uint8))


def of_draco(packed: bytes, most_points: int, topic: str) -> Any:  # noqa: ANN401
    """The points, without their other fields; draco_point_cloud_transport may have left out some that are alike."""
    try:
        import DracoPy  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise DecodingError("points compressed by Draco need the package DracoPy: install auditor[lidar]") from error
    try:
        version, encoded, method, flags, count = _DRACO_HEAD.unpack_from(packed)
        if (version, encoded, flags) != (2, 0, 0) or not 0 <= count <= min(most_points, MAX_POINTS):
            raise DecodingError(f"its Draco data are no cloud of at most {most_points} points", where=topic)
        Spending(CHUNKS).allow(len(packed), count * _draco_point_bytes(packed, sequential=method == 0))
    except (struct.error, ValueError, IndexError) as error:
        raise DecodingError("its Draco data are damaged in their head", where=topic) from error
    except OverBudgetError as error:
        raise DecodingError(f"its Draco data hold points that {error}", where=topic) from error
    try:
        xyz = np.asarray(DracoPy.decode(packed).points)
    except (DracoPy.FileTypeException, ValueError, AttributeError, RuntimeError, MemoryError) as error:
        raise DecodingError(f"its Draco data are damaged ({type(error).__name__})", where=topic) from error
    if xyz.dtype.kind != "f" or xyz.shape != (count, 3):
        raise DecodingError("its Draco data hold no points of x, y and z", where=topic)
    return _cloud_of(xyz.astype("<f4"))


def _cloud_of(xyz: NDArray[np.floating[Any]]) -> Any:  # noqa: ANN401  # like the class that is generated of PointCloud2
    """A cloud of (N, 3) points of float32 or float64."""
    size = xyz.itemsize
    datatype = {code: number for number, code in DATATYPES.items()}[f"f{size}"]
    fields = [
        SimpleNamespace(name=axis, offset=size * place, datatype=datatype, count=1) for place, axis in enumerate("xyz")
    ]
    rows = {"height": 1, "width": len(xyz), "point_step": 3 * size, "row_step": 3 * size * len(xyz)}
    data = np.ascontiguousarray(xyz, f"<f{size}").reshape(-1).view(np.uint8)
    return SimpleNamespace(**rows, fields=fields, is_bigendian=False, data=data)


def _draco_point_bytes(packed: bytes, *, sequential: bool) -> int:
    """The bytes of a point by the attributes that the head declares (Draco Bitstream Specification, 5.4)."""
    position = _DRACO_HEAD.size

    def number() -> int:
        nonlocal position
        value = shift = 0
        while shift < 32:
            byte = packed[position]
            position, value, shift = position + 1, value | (byte & 0x7F) << shift, shift + 7
            if byte < 0x80:
                break
        return value

    size, decoders = 0, packed[position]
    position += 1
    for _ in range(decoders):
        attributes = number()
        for _ in range(attributes):
            _, kind, components, _ = packed[position : position + 4]
            position += 4
            number()
            size += _DRACO_SIZES[kind] * components
        position += attributes if sequential else 0
    return size


def _unpacked(packed: bytes, size: int, form: str) -> bytes:
    """At most one byte more than `size`, so that a cloud that holds more is seen."""
    if packed.startswith(_ZSTD):
        with zstandard.ZstdDecompressor(max_window_size=CHUNKS.most_bytes).stream_reader(packed) as reader:
            return bytes(reader.read(size + 1))
    if packed.startswith(_LZ4_FRAME):
        unpacked: bytes = lz4.frame.LZ4FrameDecompressor().decompress(packed, size + 1)
        return unpacked
    if packed.startswith(_GZIP) or (packed and packed[0] == _ZLIB):
        return zlib.decompressobj(_ANY_ZLIB_HEAD).decompress(packed, size + 1)
    if "lz4" in form.lower():
        block: bytes = lz4.block.decompress(packed, uncompressed_size=size)
        return block
    raise DecodingError(f"the form {form[:40]!r} of its compressed points is not known")
