"""sensor_msgs/PointCloud2, and sensor_msgs/PointCloud, which came before it."""

from collections.abc import Mapping
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings.decoding.interface import Header
from auditor.recordings.decoding.points.layouts import Layout, layout_of
from auditor.recordings.decoding.ros import RosTypes, end_of_header, read_header
from auditor.recordings.parameters import POINT_UNITS
from auditor.safety.budget import MAX_POINTS

_LOOKED_AT = 500  # points of a cloud that show whether its numbers are distances, evenly chosen: it bounds the work

_BEYOND_M = np.float32(1e9)
_OTHER_ORDER = "its byte order is not the one that is_bigendian says: only in the other one its points are distances"


class PointCloudDecoder:
    """Fields by name and datatype, in any order, with any padding, of either byte order."""

    kind: ClassVar[Literal["cloud"]] = "cloud"

    def __init__(self, types: RosTypes) -> None:
        self._types = types
        self.repairs: dict[str, None] = {}
        self.units_m: Mapping[str, float] = {}

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""
        return read_header(message)

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The finite points, (N, 3) float32 metres."""
        cloud = self.decoded(message)
        unit_m = self.units_m.get(message.topic)
        layout = layout_of(cloud, of_any_unit=unit_m is not None)
        points = points_of(cloud, layout)
        repairs = layout.repairs
        if not hold_distances(points):
            points, repairs = points.view(layout.dtype.newbyteorder()), (*repairs, _OTHER_ORDER)
            if not hold_distances(points):
                raise DecodingError("its fields x, y and z hold no distances: their datatype or byte order is wrong")
        for repair in repairs:
            self.repairs[f"{message.topic}: {repair}"] = None
        return finite(xyz_of(points) if unit_m is None else xyz_of(points) * np.float32(unit_m))

    def decoded(self, message: Message) -> Any:  # noqa: ANN401  # the class is generated from the definition
        """The cloud as an object with the fields of sensor_msgs/PointCloud2. Raises DecodingError."""
        return self._types.decode(message)


class OldPointCloudDecoder(PointCloudDecoder):
    """sensor_msgs/PointCloud: an array of geometry_msgs/Point32, which lies behind the header as it is in memory."""

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The finite points, (N, 3) float32 metres."""
        self._types.store(message.schema, message.encoding)  # raises where its definition is another one than ROS's
        start, order = end_of_header(message)
        [count] = np.frombuffer(message.data, f"{order}u4", 1, start) if start + 4 <= len(message.data) else [0]
        if count > MAX_POINTS or start + 4 + 12 * int(count) > len(message.data):
            raise DecodingError(f"the cloud declares {count} points, and the message has {len(message.data)} bytes")
        points = np.frombuffer(message.data, f"{order}f4", 3 * int(count), start + 4)
        return finite(points.reshape(-1, 3).astype(np.float32))


def points_of(cloud: Any, layout: Layout | None = None) -> NDArray[np.void]:  # noqa: ANN401  # a generated class
    """The points as a structured array, (N,), a view of the message wherever rows have no padding."""
    (height, width, point_step, row_step), dtype, _ = layout or layout_of(cloud)
    row_bytes = width * point_step
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


def hold_distances(points: NDArray[np.void]) -> bool:
    """False where the first points' coordinates are mostly no metres of any world; missing returns say nothing."""
    few = points[:: max(1, len(points) // _LOOKED_AT)]
    with np.errstate(invalid="ignore"):
        sizes = np.abs(np.concatenate([few[axis] for axis in "xyz"]).astype(np.float64))
    sizes = sizes[np.isfinite(sizes) & (sizes > 0)]
    within = np.count_nonzero((sizes > POINT_UNITS.smallest_m) & (sizes < POINT_UNITS.largest_m))
    return bool(within >= POINT_UNITS.least_distances * len(sizes))


def xyz_of(points: NDArray[np.void]) -> NDArray[np.float32]:
    """(N, 3) float32 of the points' x, y and z."""
    xyz_m = np.empty((len(points), 3), np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        for column, name in enumerate("xyz"):
            xyz_m[:, column] = points[name]
    return xyz_m
