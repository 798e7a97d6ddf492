"""How evenly the LiDAR's points fill a camera's view: an attack that removes points leaves a strip without any."""

import numpy as np

from auditor.evidence.lidar import LidarView
from auditor.evidence.parameters import POINT_DROPOUT

_STEP_PX = POINT_DROPOUT.step_px


def emptiness(view: LidarView, width_px: int) -> float:
    """The share of its usual points that the emptiest upright strip of the view lacks, 0 to 1.

    Strips are 104 px wide, every 8 px one; usual is the median strip's number of points. 1 where the view is empty.
    """
    steps = np.bincount(view.column // _STEP_PX, minlength=-(-width_px // _STEP_PX))[: width_px // _STEP_PX]
    strips = np.convolve(steps, np.ones(min(POINT_DROPOUT.strip_steps, steps.size)), mode="valid")
    usual = float(np.median(strips))
    return max(1.0 - float(strips.min()) / usual, 0.0) if usual > 0 else 1.0
