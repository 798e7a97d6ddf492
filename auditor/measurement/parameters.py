"""Numbers of cameras and matching that can change a count or a measured statistic.

Those of points and of a camera's past have files of their own beside this one, and a check may have its own in its
module, as NUMBERS; `checks.found` lists all of them, by what a rig compares. A changed value asks for a new one of
COUNTING_VERSIONS, of the rigs that it measures. Images are compared at half resolution: "half px" are pixels of it, px
those of the full image.
"""

from dataclasses import dataclass

from auditor.measurement.point_parameters import (
    FALSE_RANGES,
    ISOLATED_POINTS,
    LOST_RETURNS,
    POINT_DROPOUT,
    POINT_SPACING,
    ROUGH_RANGES,
)
from auditor.measurement.time_parameters import EGO_MOTION, PARALLAX_CONFLICT, STILL_LIGHT
from auditor.model.parameters import BY_HAND, COMMON_VIEW, PAIR_DEPTH, RIG_GEOMETRY, parameter

_CHECKS = "chosen on KITTI drives 0009 and 0001 and 18 streets (docs/method.md)"
_FEATURES = "stands in docs/method.md; no experiment recorded"
_LIGHT = "62 frames of KITTI drives 0009, 0001 and odometry 04 (docs/method.md): chosen on them"


@dataclass(frozen=True)
class Texture:
    """Where an image has enough texture to be matched."""

    fewest_levels: float = parameter(
        2.0,
        unit="grey levels a half px, root mean square",
        source="docs/decisions.md, the texture gate: 1.5, 2.0 and 2.5 tried on drives 0009 and 0001",
    )
    window_px: tuple[int, int] = parameter((5, 5), unit="half px", source="docs/decisions.md, the texture gate")


@dataclass(frozen=True)
class Sgbm:
    """Semi-global matching; in pixels of the grid that it matches on, the range apart."""

    range_px: int = parameter(128, unit="px of disparity, at most", source=BY_HAND)
    nearest_m: float = parameter(
        2.0,
        unit="m of depth; no pair searches nearer",
        source="docs/decisions.md, a pair is searched no nearer than 2 m",
    )
    block_px: int = parameter(5, unit="grid px", source=BY_HAND)
    smoothness_1: int = parameter(8, unit="P1 a pixel of the block", source="OpenCV's recommendation for StereoSGBM")
    smoothness_2: int = parameter(32, unit="P2 a pixel of the block", source="OpenCV's recommendation for StereoSGBM")


@dataclass(frozen=True)
class Equalising:
    """Levels of two images made alike before semi-global matching."""

    quantiles: int = parameter(33, unit="quantiles that both then share", source=_LIGHT)
    first_quantile: float = parameter(0.02, unit="the first of them; the last is 1 less it", source=_LIGHT)


@dataclass(frozen=True)
class MatcherRange:
    """The range of a matcher: towards its end disparities are wrong already."""

    margin_px: float = parameter(3.0, unit="px of disparity below the range", source=BY_HAND)
    comparable_share: float = parameter(0.9, unit="share of the range", source=_CHECKS)
    around_px: tuple[int, int] = parameter((17, 17), unit="half px masked around what is out of range", source=_CHECKS)


@dataclass(frozen=True)
class Rectification:
    """How recorded images become rectified ones."""

    shrunk_first_from: float = parameter(1.5, unit="recorded px a rectified px", source=BY_HAND)
    border_px: tuple[int, int] = parameter(
        (17, 17), unit="px, window", source="the size of a matcher's windows; no experiment recorded"
    )


@dataclass(frozen=True)
class LidarProjection:
    """Which LiDAR points a camera sees: much nearer points beside one occlude it."""

    nearest_m: float = parameter(1.0, unit="m of depth", source=BY_HAND)
    beside_span: float = parameter(
        0.002, unit="share of the points ahead, beside the field on either side", source=BY_HAND
    )
    baseline_m: float = parameter(0.6, unit="m, at which nearer_by_px is meant", source=BY_HAND)
    nearer_by_px: float = parameter(3.0, unit="px of disparity", source=BY_HAND)
    reference_window_px: tuple[int, int] = parameter((15, 9), unit="px, rows and columns", source=BY_HAND)
    source_window_px: tuple[int, int] = parameter((7, 3), unit="half px, rows and columns", source=_CHECKS)


@dataclass(frozen=True)
class DisparityError:
    """Eq. 2: when two disparities disagree."""

    absolute_px: float = parameter(3.0, unit="px of disparity", source="paper, Eq. 2, after the KITTI stereo benchmark")
    relative: float = parameter(0.05, unit="share of the smaller one", source="paper, Eq. 2, after the same benchmark")


@dataclass(frozen=True)
class PatchCorrelation:
    """Zero-mean normalised cross-correlation (NCC) of two images' patches."""

    radius_px: int = parameter(3, unit="half px: patches of 7 x 7", source=_CHECKS)
    norm_floor: float = parameter(9.0, unit="grey levels added to a patch's norm", source=_CHECKS)
    consistent: float = parameter(0.7, unit="NCC above which two patches show the same", source=_CHECKS)
    oversampling: int = parameter(2, unit="steps a half px where disparities are given", source=_CHECKS)
    steps_beside: int = parameter(1, unit="oversampled steps either way", source=_CHECKS)


@dataclass(frozen=True)
class PhotometricConsistency:
    """Where two cameras do not see the same, whatever stereo chose."""

    textured_norm: float = parameter(40.0, unit="grey levels, norm of a patch: 5.7 a half px", source=_CHECKS)
    inconsistent: float = parameter(0.2, unit="NCC below which no patch nearby shows the same", source=_CHECKS)
    nearby_px: tuple[int, int] = parameter((5, 5), unit="half px", source=_CHECKS)
    lands_left_px: float = parameter(2.0, unit="half px from which on a pixel is occluded", source=_CHECKS)
    around_occluded_px: tuple[int, int] = parameter((3, 3), unit="half px", source=_CHECKS)
    beside_invalid_px: int = parameter(25, unit="half px, window", source=_CHECKS)


@dataclass(frozen=True)
class ToneCurve:
    """Which level of one camera goes with which of another."""

    bins: int = parameter(32, unit="bins of the source's levels", source=_LIGHT)
    fewest: int = parameter(15, unit="samples of a bin", source=_LIGHT)
    nearly_saturated: float = parameter(
        0.85,
        unit="of a camera's saturation, predicted where most of it saturates",
        source="gains of 1.3 to 2.0 and lights on three real drives: 0.65 to 0.9 tried (docs/decisions.md)",
    )


@dataclass(frozen=True)
class Chroma:
    """Classes of colour, with a tone curve each: by how much red, and blue, exceed green."""

    edges: tuple[float, ...] = parameter((-0.12, -0.04, 0.04, 0.12), unit="share of all three", source=_LIGHT)
    dark: float = parameter(24.0, unit="grey levels added to all three", source=_LIGHT)
    fewest: int = parameter(150, unit="samples of a class", source=_LIGHT)


@dataclass(frozen=True)
class Saturation:
    """From which level on an image saturates."""

    level: int = parameter(250, unit="grey levels", source=_CHECKS)
    crowded_share: float = parameter(0.002, unit="share of the pixels at the two top levels", source=_LIGHT)
    below_top: int = parameter(3, unit="grey levels below a crowded top level", source=_LIGHT)


@dataclass(frozen=True)
class Light:
    """Light that a camera alone sees, or lacks: a residual relative to what the other camera predicts."""

    mean_px: tuple[int, int] = parameter((7, 7), unit="half px", source=_LIGHT)
    nearby_px: tuple[int, int] = parameter((5, 5), unit="half px", source=_LIGHT)
    fitted_step: int = parameter(4, unit="half px between those that curves are fitted to", source=_LIGHT)
    level: float = parameter(12.0, unit="grey levels of residual 1 in the dark", source=_LIGHT)
    share: float = parameter(0.25, unit="of the prediction, more", source=_LIGHT)


@dataclass(frozen=True)
class LidarConflict:
    """Where two cameras agree with each other and not with the LiDAR."""

    clearly_less: float = parameter(0.3, unit="NCC at stereo's less that at the LiDAR's disparity", source=_CHECKS)
    passes_over_px: float = parameter(3.0, unit="px of disparity by which a beam passes over", source=_CHECKS)
    most_verified: int = parameter(
        1000, unit="inconsistent points a pair", source="bounds the work; no experiment recorded"
    )
    smallest_px: float = parameter(
        1e-3, unit="px of disparity that is divided by", source="guards against division by zero"
    )


@dataclass(frozen=True)
class CountGrid:
    """The grids whose counts are stored: of images, and of the LiDAR's directions in the rig's axes."""

    cell_px: int = parameter(
        8, unit="px, width and height", source="docs/decisions.md, what the checks count is stored as grids of bytes"
    )
    lidar_cell: float = parameter(
        8 / 721, unit="radians: cell_px at KITTI's focal length", source="62 frames of three drives; chosen on them"
    )
    lidar_cells: tuple[int, int] = parameter((80, 160), unit="rows and columns, straight ahead midst", source=BY_HAND)


@dataclass(frozen=True)
class RowAlignment:
    """Corners followed to the other camera and to the frame before."""

    blocks: tuple[int, int] = parameter((6, 20), unit="rows and columns, one corner each", source=_FEATURES)
    kept_share: float = parameter(0.7, unit="share of the corners, the strongest", source=_FEATURES)
    corner_px: int = parameter(7, unit="half px, block", source=BY_HAND)
    window_px: tuple[int, int] = parameter((13, 13), unit="half px, of Lucas and Kanade", source=BY_HAND)
    largest_residue: float = parameter(30.0, unit="grey levels a half px", source=BY_HAND)
    same_row_px: float = parameter(0.5, unit="half px", source=_FEATURES)


@dataclass(frozen=True)
class LidarAgreement:
    """LiDAR points compared with stereo over the whole view."""

    points: int = parameter(2500, unit="points, about", source=_FEATURES)
    agree_px: int = parameter(1, unit="px of disparity", source=_FEATURES)
    differ_px: int = parameter(2, unit="px of disparity", source=_FEATURES)
    bias_window_px: int = parameter(3, unit="px of disparity: a whole one and its neighbours", source=BY_HAND)
    tolerated_px: int = parameter(
        2,
        unit="px right or down: a LiDAR that agrees as well once moved by so little has not turned",
        source="docs/decisions.md, a LiDAR has not turned: 2 and 3 tried on three real drives and a street",
    )
    shifts_px: tuple[int, ...] = parameter(
        (-16, -12, -8, 8, 12, 16),
        unit="px right or down",
        source="half a degree at least, as LiDARs lie up to a quarter beside their calibration; no experiment recorded",
    )


TEXTURE = Texture()
SGBM = Sgbm()
EQUALISING = Equalising()
MATCHER_RANGE = MatcherRange()
RECTIFICATION = Rectification()
LIDAR_PROJECTION = LidarProjection()
DISPARITY_ERROR = DisparityError()
PATCH_CORRELATION = PatchCorrelation()
PHOTOMETRIC_CONSISTENCY = PhotometricConsistency()
TONE_CURVE = ToneCurve()
CHROMA = Chroma()
SATURATION = Saturation()
LIGHT = Light()
LIDAR_CONFLICT = LidarConflict()
COUNT_GRID = CountGrid()
ROW_ALIGNMENT = RowAlignment()
LIDAR_AGREEMENT = LidarAgreement()

HALF = 2
"""Pixels of the full image that a half px is wide (docs/decisions.md, half resolution)."""

OF_ANY_RIG = (
    RIG_GEOMETRY,
    PAIR_DEPTH,
    COMMON_VIEW,
    TEXTURE,
    SGBM,
    RECTIFICATION,
    LIDAR_PROJECTION,
    PATCH_CORRELATION,
    SATURATION,
    TONE_CURVE,
    LIDAR_CONFLICT,
    POINT_DROPOUT,
    ISOLATED_POINTS,
    LOST_RETURNS,
    POINT_SPACING,
    ROUGH_RANGES,
    COUNT_GRID,
)
OF_PAIRS = (
    EQUALISING,
    MATCHER_RANGE,
    DISPARITY_ERROR,
    PHOTOMETRIC_CONSISTENCY,
    CHROMA,
    LIGHT,
    FALSE_RANGES,
    ROW_ALIGNMENT,
    LIDAR_AGREEMENT,
)
OF_THE_PAST = (EGO_MOTION, PARALLAX_CONFLICT, STILL_LIGHT)
