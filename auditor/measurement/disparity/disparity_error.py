"""The disparity error E (Eq. 2): two disparity maps of one view, compared pixel by pixel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.lidar import LidarView
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.parameters import DISPARITY_ERROR, MATCHER_RANGE
from auditor.model.measurement import Counts

Indices = NDArray[np.signedinteger]


@dataclass(frozen=True, eq=False)
class Comparison:
    """The counts of one triple and where its gated inconsistent pixels lie.

    `row` and `column` are (M,) indices into a grid whose pixels are `step` full-resolution ones wide.
    """

    counts: Counts
    row: Indices
    column: Indices
    step: int


def inconsistent(d1: NDArray[np.float32], d2: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Eq. 2: |d1 - d2| > 3 px and |d1 - d2| / min(d1, d2) > 0.05, where a minimum of zero or less counts as over.

    d1 and d2 have one shape, are in full-resolution pixels and at one baseline; NaN is never inconsistent.
    """
    difference = np.abs(d1 - d2)
    relative = DISPARITY_ERROR.relative * np.minimum(d1, d2)
    return np.asarray((difference > DISPARITY_ERROR.absolute_px) & (difference > relative))


def compare_cameras(
    first: StereoMap, second: StereoMap, first_baseline_m: float, second_baseline_m: float
) -> Comparison:
    """E_{i,j,k} between two cameras' maps, at the smaller baseline.

    Every pixel counts whose match lies inside both source images. At the smaller baseline a pair of cameras 6 cm apart
    keeps its own resolution; scaled up its noise would be multiplied.
    """
    common_m = min(first_baseline_m, second_baseline_m)
    valid = first.valid & second.valid
    over = valid & inconsistent(
        first.disparity_px * np.float32(common_m / first_baseline_m),
        second.disparity_px * np.float32(common_m / second_baseline_m),
    )
    gate = first.textured | second.textured
    gated_over = over & gate
    row, column = np.divmod(np.flatnonzero(gated_over), gated_over.shape[1])
    counts = Counts(
        valid_px=int(np.count_nonzero(valid)),
        inconsistent_px=int(np.count_nonzero(over)),
        gated_valid_px=int(np.count_nonzero(valid & gate)),
        gated_inconsistent_px=row.size,
        out_of_range_px=0,
    )
    return Comparison(counts, row, column, first.step)


def compare_with_lidar(view: LidarView, stereo: StereoMap, source: int) -> Comparison:
    """E_{0,j,k}: DM_{0,k} at source camera j and DM_{j,k}, compared at the pixels that hold a LiDAR point.

    LiDAR points nearer than the matcher's range are valid: they are inconsistent where the matcher finds them farther.
    """
    width = stereo.disparity_px.shape[1]
    place, d0 = view.place(stereo.step, width), view.disparity_px(source)
    valid = stereo.valid.take(place) & (view.u_px - d0 >= 0)
    over = valid & inconsistent(d0, stereo.disparity_px.take(place))
    gate = stereo.textured.take(place)
    gated_over = over & gate
    counts = Counts(
        valid_px=int(np.count_nonzero(valid)),
        inconsistent_px=int(np.count_nonzero(over)),
        gated_valid_px=int(np.count_nonzero(valid & gate)),
        gated_inconsistent_px=int(np.count_nonzero(gated_over)),
        out_of_range_px=int(np.count_nonzero(valid & (d0 > stereo.range_px - MATCHER_RANGE.margin_px))),
    )
    return Comparison(counts, *np.divmod(place[gated_over], width), stereo.step)
