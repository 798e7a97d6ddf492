"""sensor_msgs/PointCloud2, and how its points lie in its data; and sensor_msgs/PointCloud, which came before it.

Drivers write headers that contradict the data: row_step 0 or that of another cloud, the number of points as count of a
field, the width of the cloud before it was filtered. Where the data leave one reading it is taken, with a sentence on
what was put right; where they leave several or none the cloud is refused.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, Literal, NamedTuple

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
_AXES = "xyz"


class PointRows(NamedTuple):
    """So many rows of so many points; `row_step` is the distance of two rows in bytes, `point_step` of two points."""

    height: int
    width: int
    point_step: int
    row_step: int


class Layout(NamedTuple):
    """The rows of a cloud, the type of one of its points, and what of its header had to be put right."""

    rows: PointRows
    dtype: np.dtype[np.void]
    repairs: tuple[str, ...]


class _Coordinate(NamedTuple):
    offset: int
    datatype: str
    ignores_count: bool


def layout_of(cloud: Any, *, of_any_unit: bool = False) -> Layout:  # noqa: ANN401  # the class is generated
    """The layout of a cloud's x, y and z, which may be whole numbers where their unit is known.

    Raises DecodingError where they cannot be read for sure.
    """
    coordinates = [_coordinate(cloud, axis, of_any_unit=of_any_unit) for axis in _AXES]
    axes = [one for one in coordinates if one is not None]
    if len(axes) != len(_AXES):
        raise DecodingError(f"the cloud has no fields x, y and z in points of {cloud.point_step} bytes")
    repairs = []
    if any(one.ignores_count for one in axes):
        repairs.append("the count of its fields x, y and z does not fit in a point: 1 was taken")
    if len({one.offset for one in axes}) == 1:
        axes = _one_behind_the_other(cloud, axes)
        repairs.append("its fields all have one offset: they were taken one behind the other, as they fill a point")
    rows, repair = _rows(cloud, max(one.offset + int(one.datatype[1]) for one in axes))
    order = ">" if cloud.is_bigendian else "<"
    dtype = np.dtype(
        {
            "names": list(_AXES),
            "formats": [order + one.datatype for one in axes],
            "offsets": [one.offset for one in axes],
            "itemsize": rows.point_step,
        }
    )
    return Layout(rows, dtype, (*repairs, *filter(None, [repair])))


def _coordinate(cloud: Any, axis: str, *, of_any_unit: bool) -> _Coordinate | None:  # noqa: ANN401
    """Where a coordinate lies; None where there is no such field, or where it is one of several numbers."""
    named = [field for field in cloud.fields if field.name == axis and field.datatype in DATATYPES]
    field = next(iter(named or [one for one in cloud.fields if one.name.strip().lower() == axis]), None)
    datatype = DATATYPES.get(field.datatype) if field is not None else None
    if field is None or datatype is None:
        return None
    behind = min((one.offset for one in cloud.fields if one.offset > field.offset), default=cloud.point_step)
    fits = field.offset + field.count * int(datatype[1]) <= behind
    if field.count > 1 and fits:
        return None
    if field.datatype not in _FLOATS and not of_any_unit:
        raise DecodingError(
            f"its field {field.name!r} holds whole numbers ({np.dtype(datatype).name}), and the message does not say "
            "of which unit; convert x, y and z to float32 metres, or give a rig.toml whose lidar has unit_m"
        )
    return _Coordinate(field.offset, datatype, ignores_count=field.count > 1)


def _one_behind_the_other(cloud: Any, axes: Sequence[_Coordinate]) -> list[_Coordinate]:  # noqa: ANN401
    """The coordinates where all fields follow each other, which all have one offset. Raises DecodingError."""
    sizes = [int(DATATYPES.get(field.datatype, "?0")[1]) for field in cloud.fields]
    if len({field.offset for field in cloud.fields}) > 1 or sum(sizes) != cloud.point_step or 0 in sizes:
        raise DecodingError("its fields x, y and z have one offset")
    offsets = dict(zip((field.name.strip().lower() for field in cloud.fields), np.cumsum([0, *sizes]), strict=False))
    return [one._replace(offset=int(offsets[axis])) for axis, one in zip(_AXES, axes, strict=True)]


def _rows(cloud: Any, extent: int) -> tuple[PointRows, str]:  # noqa: ANN401
    """The rows, and what of them had to be put right; `extent` bytes of a point hold the coordinates."""
    held, height, width, point_step = len(cloud.data), cloud.height, cloud.width, cloud.point_step
    # An unorganised cloud may leave the length of its only row empty.
    row_step = cloud.row_step if height > 1 else max(cloud.row_step, width * point_step)
    declared = PointRows(height, width, point_step, row_step)
    fits = extent <= point_step <= MAX_POINT_BYTES
    if fits and row_step >= width * point_step and held == height * row_step and bool(held) == bool(width * height):
        return _accepted(declared), ""
    readings = dict(_readings(declared._replace(row_step=cloud.row_step), held, extent))
    if len(readings) != 1:
        _accepted(declared)
        if not fits:
            raise DecodingError(f"its fields x, y and z lie outside points of {point_step} bytes")
        raise DecodingError(
            f"the cloud declares {height} rows of {width} points of {point_step} bytes, and holds {held} bytes"
        )
    [(rows, repair)] = readings.items()
    return _accepted(rows), repair


def _readings(declared: PointRows, held: int, extent: int) -> Iterator[tuple[PointRows, str]]:
    """What `held` bytes may be if one number of the header is wrong."""
    height, width, point_step, row_step = declared
    whole_rows = height > 0 and row_step > 0 and held == height * row_step
    if extent <= point_step <= MAX_POINT_BYTES:
        row_bytes = width * point_step
        if held and held == height * row_bytes:
            yield declared._replace(row_step=row_bytes), "its row_step does not fit the data: rows have no gaps"
        if whole_rows and row_step % point_step == 0:
            rows = declared._replace(width=row_step // point_step)
            yield rows, "its width does not fit the data: as many points were taken as they hold"
        if row_step == row_bytes > 0 and held % row_bytes == 0 and not 0 < height * row_bytes <= held:
            rows = declared._replace(height=held // row_bytes)
            yield rows, "its height does not fit the data: as many rows were taken as they hold"
    points = height * width
    derived = row_step == width * point_step  # a row_step that follows from a wrong point_step says nothing
    if held and points and held % points == 0 and (whole_rows or derived):
        step = held // points
        if extent <= step <= MAX_POINT_BYTES and step != point_step:
            rows = PointRows(height, width, step, step * width)
            yield rows, "its point_step does not fit the data: points of the size that fills them were taken"


def _accepted(rows: PointRows) -> PointRows:
    if rows.width * rows.height > MAX_POINTS:
        raise DecodingError(f"a cloud of {rows.width} x {rows.height} points is not accepted")
    return rows


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
