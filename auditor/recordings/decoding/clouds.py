"""sensor_msgs/PointCloud2, and sensor_msgs/PointCloud, which came before it."""

from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.interface import Header
from auditor.recordings.decoding.ros import RosTypes, end_of_header, read_header
from auditor.recordings.parameters import POINT_UNITS
from auditor.safety.budget import MAX_POINTS

DATATYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
"""The datatype numbers of sensor_msgs/PointField."""

_FLOATS = {7, 8}
"""Those of coordinates in metres: whole numbers are centimetres, millimetres or ticks, and no message says which."""

MAX_POINT_BYTES = 4096
_BEYOND_M = np.float32(1e9)


class PointCloudDecoder:
    """Fields by name and datatype, in any order, with any padding, of either byte order."""

    kind: ClassVar[Literal["cloud"]] = "cloud"

    def __init__(self, types: RosTypes) -> None:
        self._types = types

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""
        return read_header(message)

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The finite points, (N, 3) float32 metres."""
        cloud = self._types.decode(message)
        return finite(xyz_of(points_of(cloud)))


class OldPointCloudDecoder(PointCloudDecoder):
    """sensor_msgs/PointCloud: an array of geometry_msgs/Point32, which lies behind the header as it is in memory."""

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The finite points, (N, 3) float32 metres."""
        self._types.store(message.schema)  # raises where its definition is another one than ROS's
        start, order = end_of_header(message)
        [count] = np.frombuffer(message.data, f"{order}u4", 1, start) if start + 4 <= len(message.data) else [0]
        if count > MAX_POINTS or start + 4 + 12 * int(count) > len(message.data):
            raise DecodingError(f"the cloud declares {count} points, and the message has {len(message.data)} bytes")
        points = np.frombuffer(message.data, f"{order}f4", 3 * int(count), start + 4)
        return finite(points.reshape(-1, 3).astype(np.float32))


def points_of(cloud: Any) -> NDArray[np.void]:  # noqa: ANN401  # the class is generated from the recording's definition
    """The points as a structured array, (N,), a view of the message wherever rows have no padding."""
    dtype = _point_type(cloud)
    width, height = cloud.width, cloud.height
    if width * height > MAX_POINTS:
        raise DecodingError(f"a cloud of {width} x {height} points is not accepted")
    row_bytes = width * cloud.point_step
    # An unorganised cloud may leave the length of its only row empty.
    row_step = cloud.row_step if height > 1 else max(cloud.row_step, row_bytes)
    if row_step < row_bytes or len(cloud.data) != height * row_step:
        raise DecodingError(
            f"the cloud declares {height} rows of {width} points of {cloud.point_step} bytes, "
            f"and holds {len(cloud.data)} bytes"
        )
    data = cloud.data.reshape(height, row_step)[:, :row_bytes] if row_step != row_bytes else cloud.data
    points: NDArray[np.void] = np.ascontiguousarray(data).reshape(-1).view(dtype)
    return points


def finite(xyz_m: NDArray[np.float32]) -> NDArray[np.float32]:
    """The points without NaN and infinity: LiDARs write them where no pulse returned.

    What lies beyond any world counts as infinite: its square would overflow where ranges are computed.
    """
    # A sum is below the limit only where all three are numbers below it.
    with np.errstate(invalid="ignore", over="ignore"):
        good = np.abs(xyz_m[:, 0]) + np.abs(xyz_m[:, 1]) + np.abs(xyz_m[:, 2]) < _BEYOND_M
    return xyz_m if good.all() else xyz_m[good]


def check_unit(xyz_m: NDArray[np.float32]) -> None:
    """Raise DecodingError where the ranges of (N, 3) points are none of a LiDAR in metres."""
    range_m = np.linalg.norm(xyz_m, axis=1)
    range_m = range_m[range_m > 0]  # missing returns may be written as zeros
    if range_m.size < POINT_UNITS.fewest_points:
        return
    median_m = float(np.median(range_m))
    if not POINT_UNITS.nearest_m <= median_m <= POINT_UNITS.farthest_m:
        raise DecodingError(
            f"half of its points would lie {'beyond' if median_m > 1 else 'within'} {median_m:.3g} m, so that x, y and "
            "z are not metres; convert them to metres"
        )


def _point_type(cloud: Any) -> np.dtype[np.void]:  # noqa: ANN401  # the class is generated
    order = ">" if cloud.is_bigendian else "<"
    names, formats, offsets = [], [], []
    for field in cloud.fields:
        datatype = DATATYPES.get(field.datatype)
        if field.name not in {"x", "y", "z"} or field.name in names or datatype is None or field.count > 1:
            continue
        if field.datatype not in _FLOATS:
            kind = np.dtype(datatype).name
            raise DecodingError(
                f"its field {field.name!r} holds whole numbers ({kind}), and the message does not say of which unit; "
                "convert x, y and z to float32 metres"
            )
        if field.offset + int(datatype[1]) > cloud.point_step:
            raise DecodingError(f"the field {field.name!r} lies outside its point")
        names.append(field.name)
        formats.append(order + datatype)
        offsets.append(field.offset)
    if len(names) != 3 or not 0 < cloud.point_step <= MAX_POINT_BYTES:
        raise DecodingError(f"the cloud has no fields x, y and z in points of {cloud.point_step} bytes")
    return np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": cloud.point_step})


def xyz_of(points: NDArray[np.void]) -> NDArray[np.float32]:
    """(N, 3) float32 of the points' x, y and z."""
    xyz_m = np.empty((len(points), 3), np.float32)
    with np.errstate(over="ignore"):
        for column, name in enumerate("xyz"):
            xyz_m[:, column] = points[name]
    return xyz_m
