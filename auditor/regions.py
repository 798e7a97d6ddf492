"""Regions: the damaged portion of an attacked sensor."""

from dataclasses import dataclass

from auditor.shared_parameters import REGION_MASK

REGION_STEP = REGION_MASK.step_px
"""A pixel of a region's mask is so many full-resolution pixels wide."""


@dataclass(frozen=True)
class Solid:
    """A box around LiDAR points, upright in the rig.

    `centre_m` is in the LiDAR frame; `size_m` is its width, height and depth, `yaw_deg` how far its depth points to the
    right of straight ahead.
    """

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    yaw_deg: float


@dataclass(frozen=True, eq=False)
class Region:
    """What one sensor's data would be without, were it the attacked one: found before it is known which one is.

    `view` is the camera whose image it lies in: the sensor itself, or a reference camera for the LiDAR. `box_px` is
    (left, top, right, bottom) in full-resolution pixels of that image, right and bottom not included. `share` is that
    of the image's area, or of the LiDAR's points in view. `mask` is a PNG, 255 where damaged, of pixels REGION_STEP
    full-resolution ones wide. `points` and `solid` are the LiDAR's.
    """

    sensor: int
    view: int
    box_px: tuple[int, int, int, int]
    share: float
    mask: bytes
    points: int | None = None
    solid: Solid | None = None
