"""Poses of the vehicle: GPS fixes, odometry and poses, in ROS messages, in Foxglove's, and in KITTI's oxts files.

They say where an incident was, and decide nothing else. So they are no kind of `Decoders`: what reads sensors and
calibrations does not see them.
"""

from collections.abc import Callable, Iterator, Mapping
from math import atan2, degrees, hypot, isfinite
from typing import Any, NamedTuple

from auditor.errors import DecodingError
from auditor.model.frames import Message, Pose
from auditor.recordings import schemas
from auditor.recordings.decoding import kitti
from auditor.recordings.decoding.foxglove import FoxgloveMessages, stamp_ns
from auditor.recordings.decoding.foxglove_layouts import (
    FRAME_TRANSFORM,
    FRAME_TRANSFORMS,
    LOCATION_FIX,
    POSE_IN_FRAME,
    POSES_IN_FRAME,
)
from auditor.recordings.decoding.geometry import ABSURD, numbers_of
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.recording import Topic

NO_FIX = "no fix"
OUT_OF_RANGE = "not finite or out of range"
DAMAGED = "damaged"
SEVERAL = "several poses of one moment"
TOO_LARGE = "too large"
_MOST_MESSAGE_BYTES = 2**20  # of a message with poses: it bounds the work
_MOST_NAME_CHARACTERS = 256  # of a frame's name: it bounds the memory

_WORLD_FRAMES = frozenset({"map", "odom"})
_VEHICLE_FRAME = "base_link"
"""Frames of tf by ROS's convention (REP 105): the vehicle, and those in which it moves."""


class PoseError(DecodingError):
    """A message gives no pose; `what` is the reason, one of few."""


class StampedPose(NamedTuple):
    """A pose with its stamp; 0: it has none."""

    stamp_ns: int
    pose: Pose


class PoseDecoder:
    """Decodes the messages of one recording that hold poses."""

    def __init__(self, types: RosTypes) -> None:
        self._types = types
        self._foxglove = FoxgloveMessages(types)

    def poses(self, message: Message) -> Iterator[StampedPose]:
        """The poses of a message, which of transforms may be none. Raises PoseError, whose `what` is the reason."""
        if len(message.data) > _MOST_MESSAGE_BYTES:
            raise PoseError(TOO_LARGE, where=message.topic)
        try:
            yield from _READ[message.schema].read(self, message)
        except PoseError:
            raise
        except (DecodingError, AttributeError, TypeError, ValueError, OverflowError) as error:
            raise PoseError(DAMAGED, where=message.topic) from error

    def fix(self, message: Message) -> Iterator[StampedPose]:
        """sensor_msgs/NavSatFix."""
        fix = self._types.decode(message)
        if fix.status.status < 0:
            raise PoseError(NO_FIX, where=message.topic)
        stamp = fix.header.stamp
        yield _fix(
            int(stamp.sec) * 10**9 + int(stamp.nanosec), fix.header.frame_id, fix.latitude, fix.longitude, fix.altitude
        )

    def odometry(self, message: Message) -> Iterator[StampedPose]:
        """nav_msgs/Odometry and geometry_msgs/PoseWithCovarianceStamped."""
        stamped = self._types.decode(message)
        yield _placed(stamped.header, stamped.pose.pose.position, stamped.pose.pose.orientation)

    def pose(self, message: Message) -> Iterator[StampedPose]:
        """geometry_msgs/PoseStamped."""
        stamped = self._types.decode(message)
        yield _placed(stamped.header, stamped.pose.position, stamped.pose.orientation)

    def transform(self, message: Message) -> Iterator[StampedPose]:
        """geometry_msgs/TransformStamped, whatever its frames."""
        stamped = self._types.decode(message)
        yield _placed(stamped.header, stamped.transform.translation, stamped.transform.rotation)

    def transforms(self, message: Message) -> Iterator[StampedPose]:
        """tf2_msgs/TFMessage: where the vehicle is in the map or by odometry; mountings are left out."""
        for stamped in self._types.decode(message).transforms:
            if _is_of_vehicle(stamped.header.frame_id, stamped.child_frame_id):
                yield _placed(stamped.header, stamped.transform.translation, stamped.transform.rotation)

    def location_fix(self, message: Message) -> Iterator[StampedPose]:
        """foxglove.LocationFix."""
        fix = self._foxglove.decode(message)
        yield _fix(stamp_ns(fix), fix["frame_id"], fix["latitude"], fix["longitude"], fix["altitude"])

    def pose_in_frame(self, message: Message) -> Iterator[StampedPose]:
        """foxglove.PoseInFrame."""
        stamped = self._foxglove.decode(message)
        yield _in_frame(stamped, stamped["pose"])

    def poses_in_frame(self, message: Message) -> Iterator[StampedPose]:
        """foxglove.PosesInFrame: one pose is a place, several are a path."""
        stamped = self._foxglove.decode(message)
        if len(stamped["poses"]) > 1:
            raise PoseError(SEVERAL, where=message.topic)
        for pose in stamped["poses"]:
            yield _in_frame(stamped, pose)

    def frame_transforms(self, message: Message) -> Iterator[StampedPose]:
        """foxglove.FrameTransform and foxglove.FrameTransforms, as those of tf."""
        values = self._foxglove.decode(message)
        for entry in values["transforms"] if message.schema == FRAME_TRANSFORMS else [values]:
            if _is_of_vehicle(entry["parent_frame_id"], entry["child_frame_id"]):
                place, turn = entry["translation"], entry["rotation"]
                yield StampedPose(stamp_ns(entry), _local(entry["parent_frame_id"], _vector(place), _turn(turn)))

    def oxts(self, message: Message) -> Iterator[StampedPose]:
        """A file of KITTI's oxts folder."""
        latitude, longitude, altitude, _, _, yaw_rad = kitti.oxts_numbers(message)
        yield _fix(message.log_time_ns, "oxts", latitude, longitude, altitude, degrees(yaw_rad))


class _Kind(NamedTuple):
    """How messages of a schema are read, in which encodings, and which go first where there are too many."""

    rank: int
    encodings: frozenset[str]
    read: Callable[[PoseDecoder, Message], Iterator[StampedPose]]


_ROS = frozenset({"cdr", "ros1"})
_FOXGLOVE = frozenset({"protobuf", "json"})

_READ: Mapping[str, _Kind] = {
    schemas.GPS_FIX: _Kind(0, _ROS, PoseDecoder.fix),
    LOCATION_FIX: _Kind(0, _FOXGLOVE, PoseDecoder.location_fix),
    kitti.OXTS: _Kind(0, frozenset({"txt"}), PoseDecoder.oxts),
    schemas.ODOMETRY: _Kind(1, _ROS, PoseDecoder.odometry),
    schemas.POSE_WITH_COVARIANCE: _Kind(2, _ROS, PoseDecoder.odometry),
    schemas.POSE: _Kind(2, _ROS, PoseDecoder.pose),
    POSE_IN_FRAME: _Kind(2, _FOXGLOVE, PoseDecoder.pose_in_frame),
    POSES_IN_FRAME: _Kind(2, _FOXGLOVE, PoseDecoder.poses_in_frame),
    schemas.TRANSFORM: _Kind(3, _ROS, PoseDecoder.transform),
    schemas.TRANSFORMS: _Kind(4, _ROS, PoseDecoder.transforms),
    schemas.TRANSFORMS_OLD: _Kind(4, _ROS, PoseDecoder.transforms),
    FRAME_TRANSFORM: _Kind(4, _FOXGLOVE, PoseDecoder.frame_transforms),
    FRAME_TRANSFORMS: _Kind(4, _FOXGLOVE, PoseDecoder.frame_transforms),
}

_ONLY_MOUNTINGS = "tf_static"


def pose_rank(topic: Topic) -> int | None:
    """Which topics of poses go first, the lowest rank; None for a topic that holds none."""
    kind = _READ.get(topic.schema)
    if kind is None or topic.encoding not in kind.encodings or topic.name.endswith(_ONLY_MOUNTINGS):
        return None
    return kind.rank


def _fix(
    stamp_ns: int, frame_id: str, latitude: float, longitude: float, altitude: float, heading: float | None = None
) -> StampedPose:
    """Raises PoseError where the coordinates are none; an altitude or heading that is none is unknown."""
    if not (abs(latitude) <= 90 and abs(longitude) <= 180):
        raise PoseError(OUT_OF_RANGE)
    height = float(altitude) if abs(altitude) < ABSURD else None
    turn = float(heading) if heading is not None and isfinite(heading) else None
    pose = Pose(_frame(frame_id), float(latitude), float(longitude), height, heading_deg=turn)
    return StampedPose(stamp_ns, pose)


def _placed(header: Any, position: object, orientation: object) -> StampedPose:  # noqa: ANN401  # classes are generated
    place = _local(header.frame_id, numbers_of(position, "xyz"), numbers_of(orientation, "xyzw"))
    return StampedPose(_stamp_ns(header), place)


def _stamp_ns(header: Any) -> int:  # noqa: ANN401  # the class is generated
    return int(header.stamp.sec) * 10**9 + int(header.stamp.nanosec)


def _in_frame(stamped: Mapping[str, Any], pose: Mapping[str, Any] | None) -> StampedPose:
    parts = pose or {}
    place = _local(stamped["frame_id"], _vector(parts.get("position")), _turn(parts.get("orientation")))
    return StampedPose(stamp_ns(dict(stamped)), place)


def _local(frame_id: str, place_m: tuple[float, ...], quaternion: tuple[float, ...]) -> Pose:
    """Raises PoseError where the place is none."""
    if not all(abs(number) < ABSURD for number in place_m):
        raise PoseError(OUT_OF_RANGE)
    x_m, y_m, z_m = place_m
    return Pose(_frame(frame_id), x_m=x_m, y_m=y_m, z_m=z_m, heading_deg=_heading_deg(*quaternion))


def _heading_deg(x: float, y: float, z: float, w: float) -> float | None:
    """The turn about z of a quaternion of any length; None where it is none."""
    length = hypot(x, y, z, w)
    if not 0 < length < ABSURD:
        return None
    x, y, z, w = x / length, y / length, z / length, w / length
    return degrees(atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def _is_of_vehicle(parent: str, child: str) -> bool:
    return _frame(parent) in _WORLD_FRAMES and _frame(child) == _VEHICLE_FRAME


def _frame(frame_id: str) -> str:
    """The name of a frame, which a hostile file may make of any length."""
    return frame_id.lstrip("/")[:_MOST_NAME_CHARACTERS]


def _vector(values: Mapping[str, float] | None) -> tuple[float, ...]:
    return tuple(values[axis] for axis in "xyz") if values else (0.0, 0.0, 0.0)


def _turn(values: Mapping[str, float] | None) -> tuple[float, ...]:
    """A quaternion that is not there is unknown, not none."""
    return tuple(values[axis] for axis in "xyzw") if values else (0.0, 0.0, 0.0, 0.0)
