"""The contents of a message, and the interface of each kind of decoder. All raise DecodingError and nothing else."""

from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from auditor.model.frames import Message
from auditor.model.optics.geometry import Matrix

SizePx = tuple[int, int]
"""Width and height."""


@dataclass(frozen=True)
class Header:
    """When the data was captured (0: unknown) and in which coordinate frame it is."""

    stamp_ns: int
    frame_id: str


@dataclass(frozen=True)
class ImageRegion:
    """The part of the sensor that pictures show, in pixels of the whole sensor; of no size: all of it."""

    left_px: int = 0
    top_px: int = 0
    width_px: int = 0
    height_px: int = 0


@dataclass(frozen=True, eq=False)
class CameraInfo:
    """The camera calibration that a recording carries (sensor_msgs/CameraInfo).

    `intrinsics` K and `rotation` R are (3, 3), `projection` P is (3, 4), `distortion` D has any length and is of the
    `distortion_model`, which may be empty. Pictures show the `region`, and one pixel of theirs is `binning` (across,
    down) pixels of the sensor; 0 is 1.
    """

    header: Header
    width_px: int
    height_px: int
    distortion: tuple[float, ...]
    intrinsics: Matrix
    rotation: Matrix
    projection: Matrix
    distortion_model: str = ""
    region: ImageRegion = ImageRegion()
    binning: tuple[int, int] = (1, 1)

    @property
    def is_blank(self) -> bool:
        """True where nothing is said: drivers publish zeros until they have read their calibration."""
        return not (self.intrinsics.any() or self.projection.any())


@dataclass(frozen=True, eq=False)
class Transform:
    """Where the child frame lies: `parent_SE3_child` is (4, 4). With a `problem` its numbers are no motion."""

    parent: str
    child: str
    parent_SE3_child: Matrix
    problem: str = ""


class ImageDecoder(Protocol):
    """Decodes the images of one schema."""

    kind: ClassVar[Literal["image"]]

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""

    def size_px(self, message: Message) -> SizePx:
        """The size that the message declares, without decoding its pixels."""

    def pixels(self, message: Message, *, colour: bool, size_px: SizePx | None = None) -> NDArray[np.uint8]:
        """(H, W) grey, or with `colour` (H, W, 3) BGR where the image has colours; the size is checked first."""


@runtime_checkable
class FollowingDecoder(Protocol):
    """An image decoder that must see every message of a topic, since its pictures hold only changes."""

    def follow(self, message: Message) -> None:
        """Note a message, in the order of the recording."""


@runtime_checkable
class DeepImageDecoder(Protocol):
    """An image decoder whose pictures may have values of more than 8 bits, and which has to be told of how many."""

    def largest_value(self, message: Message) -> int | None:
        """The largest value of a picture of more than 8 bits a value; None for any other."""

    def use_depth(self, topic: str, bits: int) -> None:
        """Take the values of a topic's pictures as of so many bits, from here on: the full scale becomes 255."""


class CloudDecoder(Protocol):
    """Decodes the point clouds of one schema."""

    kind: ClassVar[Literal["cloud"]]

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""

    def xyz_m(self, message: Message) -> NDArray[np.float32]:
        """The finite points, (N, 3) float32 metres."""


@runtime_checkable
class PartDecoder(Protocol):
    """A cloud decoder whose messages are parts of sweeps, and say where they look, whatever came back from there."""

    def looks(self, message: Message) -> NDArray[np.float32]:
        """(N, 3) directions into which it looked, in the frame of the points."""


@runtime_checkable
class RepairingDecoder(Protocol):
    """A decoder that reads messages whose header contradicts their data, where the data leave one reading.

    `repairs` are sentences on what it had to put right so far, each with its topic.
    """

    repairs: dict[str, None]


class CameraInfoDecoder(Protocol):
    """Decodes the camera calibrations of one schema."""

    kind: ClassVar[Literal["camera_info"]]

    def header(self, message: Message) -> Header:
        """The header, without decoding the rest."""

    def camera_info(self, message: Message) -> CameraInfo:
        """The calibration."""


class TransformsDecoder(Protocol):
    """Decodes the transforms of one schema."""

    kind: ClassVar[Literal["transforms"]]

    def transforms(self, message: Message) -> tuple[Transform, ...]:
        """All of the message."""


Decoder = ImageDecoder | CloudDecoder | CameraInfoDecoder | TransformsDecoder
