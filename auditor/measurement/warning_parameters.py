"""Every number that decides a warning beside the counts: no count and no verdict follows from them."""

from dataclasses import dataclass

from auditor.model.parameters import BY_HAND, parameter

_DECISIONS = "docs/decisions.md"
_WARNINGS = "docs/decisions.md, a rig that does not fit: clean frames and false geometry (benchmark of commit 2f670669)"

_LENSES = "docs/decisions.md, a lens by the angle with coefficients of 0: the right reading 0.5 to 0.7, the wrong 0.1"

_FIT = "docs/decisions.md, verdicts withheld: between clean, attacked and wrong geometry (benchmark geometry_fit)"


@dataclass(frozen=True)
class CalibrationCheck:
    """Warnings where a rig does not fit its recording: no count follows from them."""

    least_aligned: float = parameter(0.45, unit="share of points on one row", source=_WARNINGS)
    least_agreeing: float = parameter(0.5, unit="share of LiDAR points", source=_WARNINGS)
    least_excess: float = parameter(0.3, unit="excess of the points that agree once moved", source=_WARNINGS)
    clear_offset_px: float = parameter(1.5, unit="px", source=BY_HAND)
    wrong_scale: float = parameter(0.05, unit="share", source=BY_HAND)
    fewest_points: int = parameter(50, unit="LiDAR points", source=BY_HAND)
    smallest_px: float = parameter(8.0, unit="px of disparity, for a scale", source=BY_HAND)
    fewest_successive: int = parameter(4, unit="of those that can be compared", source=BY_HAND)
    least_ground: float = parameter(
        0.67, unit="share of directions with returns that have the ground's", source=f"{_DECISIONS}, no ground"
    )
    better_before: float = parameter(
        0.08, unit="share by which the frame before fits better, the median", source=f"{_DECISIONS}, a period early"
    )


@dataclass(frozen=True)
class GeometryFit:
    """Where images and points fit a rig at all: no verdict is given where they do not, and no count follows."""

    regions: tuple[int, int] = parameter((4, 8), unit="rows and columns of a view", source=BY_HAND)
    least_width: float = parameter(0.5, unit="share of the widest baseline that a pair has", source=_FIT)
    fewest_points: int = parameter(15, unit="compared LiDAR points a region", source=BY_HAND)
    fewest_pixels: int = parameter(100, unit="comparable half-resolution pixels a region", source=BY_HAND)
    fewest_regions: int = parameter(6, unit="regions: light on a reference camera leaves three", source=_FIT)
    better_quantile: float = parameter(0.75, unit="quantile of the shares of regions, and of frames", source=_FIT)
    at_chance: float = parameter(0.18, unit="share of points that agree by chance, at most", source=_FIT)
    in_doubt: float = parameter(0.7, unit="share of points below which other axes are tried", source=_FIT)
    fits: float = parameter(0.5, unit="share from which on a way to read a calibration fits", source=_FIT)
    better_by: float = parameter(0.12, unit="share by which it has to fit better than the standard's", source=_FIT)
    fewest_in_view: int = parameter(20, unit="LiDAR points in the view of a camera", source=BY_HAND)
    side_columns: int = parameter(2, unit="columns of regions at each side, where lenses differ", source=_LENSES)
    sides_better_by: float = parameter(0.25, unit="share of the sides' points by which a lens fits", source=_LENSES)


_FEWER = "drives 0009, 0001, 04, whole, thinned, of 16 beams, and 10 streets: 0.75 of any sector is left at least"


@dataclass(frozen=True)
class FewerReturnsOfScans:
    """Where scans have far fewer returns than those just before: they count as not audited."""

    scans: int = parameter(5, unit="scans, whose fewest are compared with the most of the next ones", source=_FEWER)
    most_apart_s: float = parameter(0.25, unit="s between two scans", source="scans at 5 Hz and more; by hand")
    every: int = parameter(8, unit="points, of which one is counted", source="bounds the work; by hand")
    sector_deg: int = parameter(12, unit="degrees, a sector", source=_FEWER)
    steps: int = parameter(3, unit="sectors that overlap a sector's width", source=_FEWER)
    beyond_m: tuple[float, ...] = parameter(
        (10.0, 20.0, 40.0), unit="m, beyond which returns are counted", source=_FEWER
    )
    fewest: int = parameter(12, unit="counted points of a part", source=_FEWER)
    least_share: float = parameter(0.01, unit="of all returns in a part", source=_FEWER)
    left_of_all: float = parameter(0.6, unit="of all returns, below which they are far fewer", source=_FEWER)
    left_of_part: float = parameter(0.25, unit="of those of a sector or a band of beams", source=_FEWER)
    left_beyond: float = parameter(0.1, unit="of those beyond a range, which walls cut off as well", source=_FEWER)
    missing: float = parameter(0.5, unit="of a part's lost returns that all returns lack too", source=_FEWER)
    again: float = parameter(0.8, unit="of the returns of before, at which they are there again", source=BY_HAND)


CALIBRATION_CHECK = CalibrationCheck()
FEWER_RETURNS = FewerReturnsOfScans()
GEOMETRY_FIT = GeometryFit()

WARNING = (CALIBRATION_CHECK, FEWER_RETURNS, GEOMETRY_FIT)
"""What decides warnings and where verdicts are withheld, and no count."""
