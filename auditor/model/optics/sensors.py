"""The sensors of a vehicle: cameras and LiDARs, each at its place."""

from dataclasses import dataclass
from functools import cached_property

from auditor.model.optics.geometry import Matrix, camera_centre, intrinsics_and_rotation
from auditor.model.optics.lenses import NO_LENS, Lens

LIDAR = 0
"""The number of the LiDAR S_0."""

PIXEL_BITS, MOST_BITS = 8, 16
"""The bits of a pixel that is measured, and the most that a recorded value has."""


@dataclass(frozen=True, eq=False)
class Camera:
    """One camera S_number.

    `projection` is the full (3, 4) matrix P = K [R | t]: points of the rig frame in metres to pixels, if no `lens` bent
    their rays. Images are `rectified` where none does and the camera looks straight along the rig's z axis. `offset_ns`
    is how far its stamps lie behind the leftmost camera's; None: to be learnt from the recording. Of recorded values
    of `depth_bits` (None: 8) the upper 8 are the pixels.
    """

    number: int
    name: str
    topic: str
    width_px: int
    height_px: int
    projection: Matrix
    rectified: bool = True
    lens: Lens = NO_LENS
    offset_ns: int | None = None
    depth_bits: int | None = None

    @property
    def focal_px(self) -> float:
        """Horizontal focal length in pixels."""
        return float(self.intrinsics[0, 0])

    @cached_property
    def intrinsics(self) -> Matrix:
        """K, (3, 3): the camera frame's directions to pixels."""
        return intrinsics_and_rotation(self.projection)[0]

    @cached_property
    def rotation(self) -> Matrix:
        """R, (3, 3): directions of the rig frame to those of the camera frame (x right, y down, z forward)."""
        return intrinsics_and_rotation(self.projection)[1]

    @cached_property
    def centre_m(self) -> Matrix:
        """Optical centre, (3,) metres in the rig frame."""
        return camera_centre(self.projection)


@dataclass(frozen=True)
class Sweep:
    """How the clouds of a LiDAR, of another sector each, make sweeps. Angles are around its z axis, from its x axis.

    A sweep begins at the seam, turns in the `direction` (1: from x to y) by a step a cloud, and has so many `parts` at
    least. Its time is that of the part nearest to `time_rad`, which looks ahead as the cameras do.
    """

    seam_rad: float
    step_rad: float
    time_rad: float
    direction: int
    parts: int


@dataclass(frozen=True, eq=False)
class Lidar:
    """The LiDAR S_0; `rig_SE3_lidar` (4, 4) takes its points into the rig frame. `offset_ns`: see Camera.

    `sweep` says how its clouds are put together; None: each is whole. `unit_m` is that of its points; None: metres.
    """

    name: str
    topic: str
    rig_SE3_lidar: Matrix
    offset_ns: int | None = None
    sweep: Sweep | None = None
    unit_m: float | None = None
