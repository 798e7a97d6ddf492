"""What the checks of one frame are made of; what several of them need is made once."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeVar, cast

from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import StereoMap
from auditor.model.arrays import Image, Mask
from auditor.model.checks import Pair
from auditor.model.rig import Rig

Made = TypeVar("Made")


@dataclass(frozen=True, eq=False)
class FrameViews:
    """One frame, as checks see it.

    `half_res` are the half-resolution grey images (h, w) of the cameras present, `colours` (h, w, 3) those of colour
    cameras, `maps` the stereo maps by (source, reference), `views` the LiDAR's views by reference. Of
    their full-resolution pixels cameras see only their `valid_masks` (H, W); one without a mask sees all.
    """

    half_res: Mapping[int, Image]
    colours: Mapping[int, Image]
    maps: Mapping[Pair, StereoMap]
    views: Mapping[int, LidarView]
    rig: Rig
    valid_masks: Mapping[int, Mask] = field(default_factory=dict)
    _made: dict[tuple[object, ...], object] = field(default_factory=dict)

    def once(self, make: Callable[..., Made], *which: int) -> Made:
        """What a function makes of this frame and of these cameras; it is asked once."""
        key = (make, *which)
        if key not in self._made:
            self._made[key] = make(self, *which)
        return cast(Made, self._made[key])

    def halves(self, j: int, k: int) -> tuple[Image, Image]:
        """The half-resolution images of the reference k and the source j."""
        return self.half_res[k], self.half_res[j]
