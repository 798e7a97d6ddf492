"""Where a vehicle was, by what its recording says of it."""

from collections.abc import Mapping
from dataclasses import dataclass, field


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
