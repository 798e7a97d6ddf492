"""Messages of recordings, the synchronised frames that are made of them, and where the vehicle was in each."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from auditor.model.arrays import Image, Points
from auditor.model.rig import LIDAR


@dataclass(frozen=True, eq=False)
class Message:
    """One record of a topic: its bytes as recorded, not decoded."""

    topic: str
    schema: str
    encoding: str
    log_time_ns: int
    data: bytes | memoryview


@dataclass(frozen=True, eq=False)
class CameraImage:
    """The data of one camera: `pixels` is (H, W) grey or (H, W, 3) BGR, uint8."""

    sensor: int
    stamp_ns: int
    pixels: Image


@dataclass(frozen=True, eq=False)
class PointCloud:
    """The data of the LiDAR: `xyz_m` is (N, 3) float32, finite, in metres in the LiDAR frame."""

    stamp_ns: int
    xyz_m: Points


class SensorState(StrEnum):
    """What a frame holds of one sensor."""

    PRESENT = "present"
    MISSING = "missing"
    DAMAGED = "damaged"


@dataclass(frozen=True)
class Presence:
    """State of one sensor in one frame; `skew_ns` is its stamp, less its estimated offset, minus the frame's stamp."""

    state: SensorState
    skew_ns: int | None = None
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Frame:
    """D: one synchronised set of all sensors' data. `presence` has an entry for each sensor of the rig.

    `others` are the clouds of LiDARs beside S_0, by their numbers.
    """

    number: int
    stamp_ns: int
    presence: Mapping[int, Presence]
    cloud: PointCloud | None
    images: Mapping[int, CameraImage]
    others: Mapping[int, PointCloud] = field(default_factory=dict)

    @property
    def clouds(self) -> dict[int, PointCloud]:
        """The clouds of all LiDARs that are there, by their numbers."""
        return {**({} if self.cloud is None else {LIDAR: self.cloud}), **self.others}


@dataclass(frozen=True)
class SkippedFrame:
    """A frame that could not be put together: a value with its reason, not an exception."""

    number: int
    stamp_ns: int
    reason: str
    sensor: int | None = None


@dataclass(frozen=True)
class TopicBalance:
    """Where the messages of one topic went: read = used + unused + damaged + the skipped of every reason."""

    topic: str
    schema: str
    sensor: int | None
    read: int = 0
    used: int = 0
    unused: int = 0
    damaged: int = 0
    skipped: Mapping[str, int] = field(default_factory=dict)

    @property
    def adds_up(self) -> bool:
        """True where no message is unaccounted for."""
        return self.read == self.used + self.unused + self.damaged + sum(self.skipped.values())


@dataclass(frozen=True)
class Pose:
    """One place of a vehicle: of a GPS fix in degrees (WGS 84), of anything else in metres in the frame `frame_id`.

    `heading_deg` is the turn from x to y of that frame, counter-clockwise; of a fix from east to north. None: unknown.
    """

    frame_id: str
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    altitude_m: float | None = None
    x_m: float | None = None
    y_m: float | None = None
    z_m: float | None = None
    heading_deg: float | None = None


@dataclass(frozen=True)
class FramePose:
    """The pose of one topic that lies nearest to a frame in time, `offset_ns` behind it; before it where negative."""

    frame: int
    stamp_ns: int
    offset_ns: int
    topic: str
    schema: str
    pose: Pose


@dataclass(frozen=True)
class PoseTopic:
    """What became of the messages of one topic of poses: `frames` have one of it, `dropped` ones by reason."""

    topic: str
    schema: str
    read: int = 0
    frames: int = 0
    dropped: Mapping[str, int] = field(default_factory=dict)
