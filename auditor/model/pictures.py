"""Which pictures and cells are kept in a store, or shown on a page."""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from auditor.model.stamps import NANOSECONDS


class Pictures(StrEnum):
    """How many pictures: people and number plates stand in them."""

    NONE = "none"
    INCIDENTS = "incidents"
    ALL = "all"


class CellRetention(StrEnum):
    """The frames whose cells are kept: those that may belong to an incident, with some of the others, or all."""

    INCIDENTS = "incidents"
    ALL = "all"


_SAMPLED_NS = 5 * NANOSECONDS


class Sampling:
    """Takes one in five seconds of frames in which nothing is unusual, to keep its cells or its picture."""

    def __init__(self) -> None:
        self._last_ns = -_SAMPLED_NS

    def takes(self, stamp_ns: int) -> bool:
        """Whether the next frame is taken."""
        if abs(stamp_ns - self._last_ns) < _SAMPLED_NS:
            return False
        self._last_ns = stamp_ns
        return True


LIDAR_COLOURS = ("c8ebff", "2878ff", "5abe5a", "be5ac8", "e6c83c", "969696")
"""RGB of the LiDARs of a rig in pictures of all; the first two differ in their greys as well, 227 and 112 of 255."""


DAMAGED_COLOUR = "ff3c3c"
"""RGB of damaged points seen from above."""


class Content(StrEnum):
    """What a picture of a frame shows.

    COLOUR: what a camera recorded. OVERLAY: the rectified image with the damaged portion of its camera, and that of the
    LiDAR where it lies in this view. ABOVE: the cloud from above, of several LiDARs all of them. RANGE: the cloud as
    a range image. In both of the cloud the damaged points are marked.
    """

    COLOUR = "colour"
    OVERLAY = "overlay"
    ABOVE = "above"
    RANGE = "range"


@dataclass(frozen=True)
class Picture:
    """One frame as small files ready to be shown: what each camera saw (JPEG), by sensor.

    `mask_png` holds the inconsistent pixels, transparent elsewhere, and lies over the view of the `reference` camera.
    """

    frame: int
    reference: int
    views: Mapping[int, bytes]
    mask_png: bytes


@dataclass(frozen=True)
class FramePicture:
    """One picture of a frame at full resolution: `data` is a file of the `form` jpg or png."""

    frame: int
    sensor: int
    content: Content
    form: str
    data: bytes

    @property
    def name(self) -> str:
        """The file's name, such as 120_S1.overlay.jpg."""
        return f"{self.frame}_S{self.sensor}.{self.content.value}.{self.form}"
