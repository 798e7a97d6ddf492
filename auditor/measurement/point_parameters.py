"""The numbers of the checks of the LiDAR's points that can change a count; part of `checks.found.MEASURING`."""

from dataclasses import dataclass

from auditor.model.parameters import BY_HAND, parameter

_CHECKS = "chosen on KITTI drives 0009 and 0001 and 18 streets (docs/method.md)"
_FEATURES = "stands in docs/method.md; no experiment recorded"
_DECISIONS = "docs/decisions.md"
_HOLES = "three real drives, streets 2000 to 2039, 5000 to 5041 and 6000 to 6017 (docs/decisions.md)"
_FEET = "three real drives, streets 7000 to 7039, 7200 to 7239, 9800 to 9845 and 9900 to 9939 (docs/decisions.md)"
_CLUSTERS = "three real drives and streets 30000 to 30013, clean and attacked: chosen on them (docs/decisions.md)"
_REMOVED = "KITTI drives 0009, 0001 and odometry 04, streets 2000 to 2017: chosen on them (docs/attacks.md)"
_PLUMES = "dust, wet roads, noise and saturation in KITTI drives 0009, 0001 and 04 (docs/decisions.md)"
_WET = "wet roads, noise and saturation in KITTI drives 0009, 0001 and 04 (docs/decisions.md)"
_FEWER_BEAMS = "KITTI drives 0009, 0001 and 04, with beams of eight other LiDARs (docs/decisions.md)"
_ROUNDED = "62 frames of KITTI drives 0009, 0001 and 04, rounded to 2 to 20 cm (docs/decisions.md)"
_THINNED = "KITTI drives 0009, 0001 and 04, every 4th and 8th point, a random 4th, voxels (docs/decisions.md)"


@dataclass(frozen=True)
class PointDropout:
    """Upright strips of the LiDAR's view that lack points."""

    step_px: int = parameter(8, unit="px", source=_CHECKS)
    strip_steps: int = parameter(13, unit="steps: 104 px", source=_CHECKS)


@dataclass(frozen=True)
class IsolatedPoints:
    """LiDAR points without neighbours at their range."""

    cell: float = parameter(
        0.011, unit="focal lengths: 0.6 degrees", source="one or two beams of 64; no experiment recorded"
    )
    range_step: float = parameter(0.08, unit="of the natural logarithm of the range", source=_FEATURES)
    ranges_m: tuple[float, float] = parameter((1.0, 100.0), unit="m, nearest and farthest", source=BY_HAND)
    most_together: int = parameter(2, unit="points in 3 x 3 x 3 cells", source=_FEATURES)
    near_m: float = parameter(8.0, unit="m", source="docs/method.md, rain: drops lie 1.5 to 6 m away")
    far_m: float = parameter(40.0, unit="m", source=_FEATURES)
    parts_across: int = parameter(8, unit="parts of the view, each with two halves", source=_FEATURES)
    fewest: int = parameter(200, unit="points in view", source=BY_HAND)
    near_quantile: float = parameter(0.25, unit="quantile of the parts' shares", source=_FEATURES)
    near_weight: float = parameter(
        0.5, unit="of the near share, taken off", source=f"{_DECISIONS}, scattered points: rain"
    )
    half_share: float = parameter(
        0.005,
        unit="share of the view's points at which the statistic is a half",
        source=f"{_DECISIONS}, scattered points",
    )
    above_road_m: float = parameter(0.25, unit="m above the road, of those beyond, at least", source=BY_HAND)
    rises: float = parameter(0.02, unit="m a metre that the road may rise", source=_WET)
    usual_above: int = parameter(3, unit="points above it in a part of the view, that no others count for", source=_WET)
    lower_each: float = parameter(5.0, unit="points lower in that part that count for each more above", source=_WET)
    together_m: float = parameter(4.0, unit="m around one of those beyond, in which a plume's lie", source=_PLUMES)
    together_share: float = parameter(0.5, unit="of those beyond that lie there: more are a plume's", source=_PLUMES)
    together_fewest: int = parameter(
        16, unit="points there that count all the same: clean frames have up to 18", source=_PLUMES
    )
    together_most: int = parameter(
        50, unit="of them that do not count at most: dust has 34, noise spoofed in 40 degrees 57", source=_PLUMES
    )
    together_asked: int = parameter(500, unit="points beyond that are asked", source="bounds the work; by hand")


@dataclass(frozen=True)
class LostReturns:
    """Surfaces that cameras see where the LiDAR has no return."""

    farthest_m: float = parameter(30.0, unit="m of depth", source=_REMOVED)
    consistent: float = parameter(0.4, unit="NCC at stereo's disparity above which it is a surface", source=_HOLES)
    hole_m: float = parameter(0.35, unit="m, radius of a disc without any return around a surface", source=_HOLES)
    narrowest: float = parameter(
        0.018, unit="radians, radius of that disc at least; the narrowest that is looked for", source=_HOLES
    )
    wider: float = parameter(1.15, unit="times the next narrower disc that is looked for", source=_HOLES)
    discs: int = parameter(12, unit="discs that are looked for: up to 0.084 radians", source=_HOLES)
    above_road_m: float = parameter(0.25, unit="m above the road, at least", source=BY_HAND)
    steeply: float = parameter(0.1, unit="metres below a metre away: there most returns are the road's", source=BY_HAND)
    beside_patch: float = parameter(
        0.0075,
        unit="radians of that disc beside a patch's radius, at least: a cell, and a LiDAR's mounting",
        source="streets at half size, whose patches are twice as wide (docs/decisions.md)",
    )
    gaps: float = parameter(
        2.5, unit="times the distance between two beams there, radius of that disc at least", source=_FEWER_BEAMS
    )
    less_at_infinity: float = parameter(
        0.1,
        unit="NCC at stereo's disparity less that at 0, where the sky is: it is no sky",
        source="streets 5000 to 5016, 6000 to 6017 and three real drives: 0.05, 0.1 and 0.2 tried (docs/decisions.md)",
    )
    foot_behind_m: float = parameter(
        5.0, unit="m from a surface back to what returns next below it, at most: a car's length", source=_FEET
    )
    foot_nearer: float = parameter(
        0.8, unit="of a surface's range: under an open sky the next return below it is as far at least", source=_FEET
    )
    foot_columns: int = parameter(3, unit="columns in which the next return below is looked for", source=BY_HAND)
    as_far: float = parameter(0.07, unit="of a surface's range: within it a return is the surface's own", source=_FEET)
    least_crossed: float = parameter(0.25, unit="share of a cell row's columns with returns: scanned", source=_REMOVED)
    finer: int = parameter(2, unit="cells a cell of the count grid, and samples of surfaces", source=BY_HAND)


@dataclass(frozen=True)
class FalseRanges:
    """Clusters of LiDAR points, and sectors, whose ranges pairs of cameras contradict."""

    consistent: float = parameter(
        0.4, unit="NCC at stereo's disparity, above which cameras see a surface", source=_CLUSTERS
    )
    clearly_less: float = parameter(0.2, unit="NCC less at the LiDAR's disparity: contradicted", source=_CLUSTERS)
    nearest_m: float = parameter(6.0, unit="m, nearest of a cluster", source="docs/method.md, rain: drops lie nearer")
    above_road_m: float = parameter(0.25, unit="m above the road, at least", source=BY_HAND)
    half_size_m: tuple[float, float] = parameter((1.1, 0.8), unit="m across and down: a car's back", source=_CLUSTERS)
    over_m: float = parameter(
        1.0, unit="m above and below it, in which what cameras confirm counts", source=f"{_CLUSTERS}, docs/ablations.md"
    )
    as_far: float = parameter(0.1, unit="of the natural logarithm of the range, either way", source=_CLUSTERS)
    undecided: float = parameter(0.07, unit="of a confirmed point, that an undecided one counts", source=_CLUSTERS)
    clean_share: float = parameter(
        0.7, unit="contradicted share of a surface that is there: glass, dark paint", source=_CLUSTERS
    )
    most_clusters: int = parameter(32, unit="clusters that are tested, evenly chosen", source=BY_HAND)
    half_ratio: float = parameter(10.0, unit="logarithm of a likelihood ratio that is a half", source=_CLUSTERS)
    strip: float = parameter(0.0375, unit="radians, step of the sectors", source=BY_HAND)
    sector_strips: int = parameter(4, unit="steps of a sector: 8.6 degrees", source=_CLUSTERS)
    sector_ranges_m: tuple[float, float] = parameter(
        (4.0, 15.0), unit="m, of the points of a sector: farther away stereo is less precise", source=_CLUSTERS
    )
    most_of_a_pixel_m: float = parameter(
        0.6, unit="m that a pixel of disparity is, of a sector's points: stereo is off by one", source=_CLUSTERS
    )
    most_m: float = parameter(3.0, unit="m farther or nearer, of a point: more is another surface", source=BY_HAND)
    sector_fewest: int = parameter(60, unit="points of a sector and pair", source=BY_HAND)
    not_shifted: float = parameter(
        0.25, unit="share of a shifted sector's points that need not be", source=f"{_CLUSTERS}: puddles mirror"
    )
    usual_m: float = parameter(0.6, unit="m that a sector may be shifted", source=_CLUSTERS)
    half_m: float = parameter(0.3, unit="m beyond it that are a half", source=_CLUSTERS)


@dataclass(frozen=True)
class RoughRanges:
    """Sectors of the LiDAR's view in which neighbouring ranges differ."""

    gap: float = parameter(
        0.035, unit="focal lengths between the outer two of three neighbours: 2 degrees", source=BY_HAND
    )
    farthest_m: float = parameter(100.0, unit="m", source=BY_HAND)
    strip: float = parameter(0.05, unit="focal lengths, step of the sectors", source=BY_HAND)
    sector_strips: int = parameter(2, unit="steps of a sector: 6 degrees", source=_CLUSTERS)
    fewest: int = parameter(40, unit="points of the median sector", source=BY_HAND)
    fewest_of_sector: int = parameter(
        7, unit="points of a sector: of noise few are left, as near ones hide others", source=_CLUSTERS
    )
    quantile: float = parameter(
        0.25, unit="quantile of a sector's differences: leaves and edges are rough, the road is not", source=_CLUSTERS
    )
    least_usual_m: float = parameter(0.001, unit="m, the frame's median sector at least", source=BY_HAND)
    coarsest_m: float = parameter(
        0.09, unit="m that coordinates are rounded to, at most: else neither it nor isolated points", source=_ROUNDED
    )
    half_m: float = parameter(
        0.5, unit="m of roughness, times how much more it is than usual, that is a half", source=_CLUSTERS
    )


@dataclass(frozen=True)
class PointSpacing:
    """How far the points of a beam lie apart in a cloud that is thinned."""

    beam: float = parameter(0.00175, unit="radians of elevation that are one beam: 0.1 degrees", source=BY_HAND)
    quantile: float = parameter(0.75, unit="quantile of the steps", source=_THINNED)
    widest: float = parameter(0.0105, unit="radians of a step, at most: 0.6 degrees", source=_THINNED)


POINT_DROPOUT = PointDropout()
ISOLATED_POINTS = IsolatedPoints()
LOST_RETURNS = LostReturns()
POINT_SPACING = PointSpacing()
FALSE_RANGES = FalseRanges()
ROUGH_RANGES = RoughRanges()
