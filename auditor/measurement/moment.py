"""A moment: what a lone camera's frame holds for the next ones."""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.parameters import HALF
from auditor.measurement.time_parameters import PARALLAX_CONFLICT
from auditor.measurement.tone_curve import saturation_level
from auditor.model.arrays import Floats32, Image
from auditor.model.optics.geometry import Matrix
from auditor.model.rig import Camera
from auditor.model.stamps import NANOSECONDS

_NEARBY = np.ones(PARALLAX_CONFLICT.nearby_px, dtype=np.uint8)
_SMOOTH = PARALLAX_CONFLICT.smooth_px, PARALLAX_CONFLICT.smooth_px


@dataclass(frozen=True, eq=False)
class Moment:
    """What one frame holds for the next: a camera's grey image (H, W), and the LiDAR's view of that camera."""

    stamp_ns: int
    grey: Image
    view: LidarView

    @property
    def camera(self) -> Camera:
        """The camera."""
        return self.view.rig.camera(self.view.reference)

    def after_s(self, before: "Moment") -> float:
        """The seconds from another moment to this one."""
        return (self.stamp_ns - before.stamp_ns) / NANOSECONDS

    def follows(self, before: "Moment") -> bool:
        """Whether the other moment is earlier, and not too long ago to be compared with."""
        return 0 < self.after_s(before) <= PARALLAX_CONFLICT.most_s

    @cached_property
    def half(self) -> Image:
        """(h, w) the image at half resolution."""
        return halve(self.grey)

    @cached_property
    def _smooth(self) -> dict[int, Image]:
        return {}

    def halved(self, times: int) -> Image:
        """The image, halved so many times."""
        return self.grey if not times else self.half if times == 1 else halve(self.halved(times - 1))

    def smooth(self, times: int) -> Image:
        """The image, halved so many times, without its details; each is made once."""
        if times not in self._smooth:
            self._smooth[times] = np.asarray(cv2.blur(self.halved(times), _SMOOTH), dtype=np.uint8)
        return self._smooth[times]

    @cached_property
    def point_m(self) -> Matrix:
        """(M, 3) the view's points in the camera's frame."""
        assert self.view.rig.lidar is not None
        rig_m = self.view.point_m.astype(np.float64) @ self.view.rig.lidar.rig_SE3_lidar[:3, :3].T
        rig_m += self.view.rig.lidar.rig_SE3_lidar[:3, 3] - self.camera.centre_m
        return np.asarray(rig_m @ self.camera.rotation.T)

    @property
    def white_share(self) -> float:
        """The share of the view's points where the picture saturates; 0 where there is no point."""
        there = self.half.ravel()[self.view.place(HALF, self.half.shape[1])]
        return float(np.mean(there >= saturation_level(self.half))) if there.size else 0.0

    @cached_property
    def nearest_m(self) -> Floats32:
        """(h, w) the depth of the nearest point around each half px; inf where there is none."""
        depth = np.full(self.half.shape, np.inf, dtype=np.float32)
        place = self.view.place(HALF, self.half.shape[1])
        np.minimum.at(depth.ravel(), place, self.point_m[:, 2].astype(np.float32))
        return np.asarray(cv2.erode(depth, _NEARBY), dtype=np.float32)
