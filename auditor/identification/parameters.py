"""Every number that can change a verdict on what was measured.

A changed value asks for a new JUDGING_VERSION. z is the normalised score of a check or of a fault: how far it lies
above its threshold theta.
"""

from dataclasses import dataclass
from decimal import Decimal

from auditor.model.parameter import BY_HAND, canonical_json, digest, parameter
from auditor.model.parameters import DISPARITY_ERROR_SAMPLES, PAIR_DEPTH, POINT_EXCESS, RIG_KIND_TOLERANCE, SCORE_LIMITS

_CHECKS = "chosen on KITTI drives 0009 and 0001 and 18 streets (docs/method.md)"
_BRIGHTNESS = "chosen on drives 0009 and 0001, 18 streets and 84 others (docs/method.md)"
_THREE_DRIVES = "62 frames of KITTI drives 0009, 0001 and odometry 04: chosen on them"
_FAULTS = "chosen on faulty frames of KITTI drive 0009 (docs/causes.md)"
_FAULTS_ON_STREETS = "chosen on twelve streets, benchmark causes --synthetic 4 --first 700 (docs/causes.md)"
_RAIN = "chosen on drives 0009 and 0001 and streets 0 and 3 of each style (docs/causes.md)"
_FEWER_BEAMS = "docs/decisions.md, a frame's own grid says how many points a window needs: 64, 32 and 16 beams tried"
_FALSE_ALARMS = "docs/decisions.md, causes have thresholds from clean frames"


@dataclass(frozen=True)
class WindowedMean:
    """Windows of the count grids, to each of which consistent pixels are added as a pseudo-count."""

    conflict_window: tuple[int, int] = parameter((6, 6), unit="cells, rows and columns", source=_CHECKS)
    conflict_pseudo_count: int = parameter(40, unit="LiDAR points: half of what 64 beams give", source=_CHECKS)
    conflict_fewest: int = parameter(20, unit="LiDAR points of a pair", source=_THREE_DRIVES)
    image_window: tuple[int, int] = parameter((6, 8), unit="cells, rows and columns", source=_CHECKS)
    image_pseudo_count: int = parameter(200, unit="half px", source=_CHECKS)
    image_fewest: int = parameter(200, unit="half px of a pair", source=_THREE_DRIVES)
    smallest_pseudo_count: int = parameter(15, unit="LiDAR points, however few beams", source=_FEWER_BEAMS)
    dense_quantile: float = parameter(0.9, unit="quantile of the windows that hold points", source=_FEWER_BEAMS)
    share_of_dense: float = parameter(0.5, unit="share of a dense window's points", source=_FEWER_BEAMS)


@dataclass(frozen=True)
class ThetaFloor:
    """theta is never smaller: a few easy drives must not make the thresholds of all others."""

    lidar_conflict: float = parameter(0.48, unit="windowed ratio", source=_CHECKS)
    photometric: float = parameter(0.25, unit="windowed ratio", source=_CHECKS)
    brightness: float = parameter(0.3, unit="share of a window's cells", source=_BRIGHTNESS)
    point_dropout: float = parameter(0.85, unit="share of a strip's points", source=_CHECKS)
    isolated_points: float = parameter(
        0.4, unit="of the statistic", source="docs/decisions.md, scattered points: three drives and 18 streets"
    )


@dataclass(frozen=True)
class ThetaCeiling:
    """theta is never larger: attacked frames among the clean ones must not switch a check off.

    The LiDAR's own checks have no ceiling: some LiDARs never fill the view, and of some all points lie far apart.
    """

    lidar_conflict: float = parameter(0.6, unit="windowed ratio", source=_CHECKS)
    photometric: float = parameter(
        0.5,
        unit="windowed ratio",
        source="docs/decisions.md, light is looked for both ways: 0.45 and 0.5 tried on 42 streets",
    )
    brightness: float = parameter(0.5, unit="share of a window's cells", source=_BRIGHTNESS)
    point_dropout: float = parameter(1.0, unit="share of a strip's points: none", source="no ceiling")
    isolated_points: float = parameter(1.0, unit="of the statistic: none", source="no ceiling")


@dataclass(frozen=True)
class CheckScale:
    """How a check's clean samples become theta and the scale of z."""

    added_share: float = parameter(0.1, unit="share of what is left to 1, added to theta", source=_CHECKS)
    spread_quantile: float = parameter(0.95, unit="quantile, less the median: the scale", source=BY_HAND)
    smallest_scale: float = parameter(0.25, unit="share of theta", source=BY_HAND)


@dataclass(frozen=True)
class FaultScale:
    """How a fault's clean scores become theta and the scale of z."""

    least_theta: float = parameter(1.0, unit="fault score: just enough", source="the unit of fault scores")
    added_share: float = parameter(
        0.25, unit="share of theta, added to it", source=f"{_FALSE_ALARMS}; no experiment recorded"
    )
    largest_r: Decimal = parameter(Decimal("0.01"), unit="false-alarm rate", source=_FALSE_ALARMS)  # noqa: RUF009 - immutable
    scale: float = parameter(0.25, unit="share of theta", source=BY_HAND)


@dataclass(frozen=True)
class TemporalWindow:
    """Means over time: attacks last, most mistakes do not."""

    seconds: float = parameter(0.5, unit="s around a frame", source=BY_HAND)
    soiled_seconds: float = parameter(2.0, unit="s around a frame: dirt stays", source=BY_HAND)
    incident_gap_s: float = parameter(0.5, unit="s that frames of one incident are apart at most", source=BY_HAND)
    gap_periods: float = parameter(2.5, unit="median periods from which on a step is a gap", source=BY_HAND)


@dataclass(frozen=True)
class AttackSetCost:
    """How badly an attack set fits the normalised scores of all pair checks."""

    penalty_per_sensor: float = parameter(0.02, unit="z a sensor", source=BY_HAND)
    most_sets: int = parameter(20_000, unit="attack sets", source="bounds the work; no experiment recorded")
    conflict_by_a_camera: float = parameter(
        0.9, unit="share of a LiDAR conflict that an attacked camera covers", source=BY_HAND
    )
    photometric_expected: float = parameter(
        0.5, unit="how surely an attacked camera makes its pairs fire, 0 to 1", source=BY_HAND
    )
    most_uncovered: float = parameter(1.0, unit="z that the best attack set leaves uncovered", source=BY_HAND)
    alternatives: int = parameter(2, unit="attack sets listed beside the best", source=BY_HAND)


@dataclass(frozen=True)
class FaultScores:
    """What is just enough for a fault: its score is 1 there."""

    lagging_camera: float = parameter(0.1, unit="share of points, more", source=_FAULTS)
    lagging_lidar: float = parameter(0.2, unit="excess of points of the frame before", source=_FAULTS_ON_STREETS)
    tilted: float = parameter(0.35, unit="share of points, more", source=_FAULTS)
    tilted_by_px: float = parameter(2.0, unit="rows", source=_FAULTS)
    biased: float = parameter(0.25, unit="share of LiDAR points, more", source=_FAULTS)
    biased_by_px: float = parameter(3.0, unit="px of disparity", source=_FAULTS)
    rotated_lidar: float = parameter(0.2, unit="excess of points once rotated", source=_FAULTS_ON_STREETS)
    soiled: float = parameter(4.0, unit="grey levels darker", source=_FAULTS)
    soiled_fewest: int = parameter(200, unit="inconsistent half px", source=BY_HAND)
    soiled_partner: float = parameter(
        0.5, unit="share of the inconsistent half px of a pair", source=_FAULTS_ON_STREETS
    )
    dark_from: float = parameter(80.0, unit="mean grey level where darkness begins", source=_FAULTS)
    dark: float = parameter(40.0, unit="mean grey level", source=_FAULTS)
    glare: float = parameter(0.25, unit="share of saturated pixels", source=_FAULTS)
    rain: float = parameter(0.01, unit="share of isolated points nearby, less those beyond", source=_RAIN)
    rain_beyond: float = parameter(2.0, unit="times the share of isolated points beyond", source=_RAIN)


@dataclass(frozen=True)
class FaultHypotheses:
    """When a fault stands beside a verdict, or in its place."""

    enough: float = parameter(0.5, unit="score at z = 0", source="definition of the score")
    least_listed: float = parameter(0.2, unit="score: z = -1.8", source=BY_HAND)
    clear_gap: float = parameter(
        1.0,
        unit="z by which an attack exceeds a fault",
        source="docs/decisions.md, an attack whose largest margin leads",
    )
    least_covered: float = parameter(0.5, unit="share of the fired checks' z", source=_FAULTS)
    rain_highest: float = parameter(
        -0.75,
        unit="z that rain counts with",
        source="docs/causes.md, rain: 0 tried, walls in rain of drive 0009 compared",
    )


@dataclass(frozen=True)
class Frozen:
    """When a sensor repeats its data."""

    least_repeats: int = parameter(
        2, unit="frames equal to the one before", source="frames may tick faster than a sensor"
    )


WINDOWED_MEAN = WindowedMean()
THETA_FLOOR = ThetaFloor()
THETA_CEILING = ThetaCeiling()
CHECK_SCALE = CheckScale()
FAULT_SCALE = FaultScale()
TEMPORAL_WINDOW = TemporalWindow()
ATTACK_SET_COST = AttackSetCost()
FAULT_SCORES = FaultScores()
FAULT_HYPOTHESES = FaultHypotheses()
FROZEN = Frozen()

JUDGING = (
    DISPARITY_ERROR_SAMPLES,
    PAIR_DEPTH,
    WINDOWED_MEAN,
    THETA_FLOOR,
    THETA_CEILING,
    CHECK_SCALE,
    SCORE_LIMITS,
    ATTACK_SET_COST,
    TEMPORAL_WINDOW,
    FROZEN,
    POINT_EXCESS,
    FAULT_SCORES,
    FAULT_SCALE,
    FAULT_HYPOTHESES,
    RIG_KIND_TOLERANCE,
)
"""All that can change a verdict, given the measurement, the calibration and r."""


def judging_settings() -> str:
    """The values of JUDGING as canonical JSON."""
    return canonical_json(*JUDGING)


def judging_digest() -> str:
    """The digest of JUDGING: equal digests judge alike."""
    return digest(*JUDGING)
