"""Every number that can change a verdict on what was measured.

A changed value asks for a new JUDGING_VERSION. z is the normalised score of a check or of a fault: how far it lies
above its threshold theta.
"""

from dataclasses import dataclass
from typing import NamedTuple

from auditor.model.parameter import BY_HAND, canonical_json, digest, parameter
from auditor.model.parameters import (
    DISPARITY_ERROR_SAMPLES,
    PAIR_DEPTH,
    POINT_EXCESS,
    RIG_KIND_TOLERANCE,
    STORED_RESIDUALS,
)

_CHECKS = "chosen on KITTI drives 0009 and 0001 and 18 streets (docs/method.md)"
_PRIOR = "fitted by benchmark prior to real drives and streets (docs/method.md)"
_METHOD = "docs/method.md, few drives"
_THREE_DRIVES = "62 frames of KITTI drives 0009, 0001 and odometry 04: chosen on them"
_FAULTS = "chosen on faulty frames of KITTI drive 0009 (docs/causes.md)"
_FAULTS_ON_STREETS = "chosen on twelve streets, benchmark causes --synthetic 4 --first 700 (docs/causes.md)"
_RAIN = "chosen on drives 0009 and 0001 and streets 0 and 3 of each style (docs/causes.md)"
_FEWER_BEAMS = "docs/decisions.md, a frame's own grid says how many points a window needs: 64, 32 and 16 beams tried"


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


class Prior(NamedTuple):
    """What is known before any drive of a rig kind: mean, and standard deviations within and between drives."""

    mean: float
    within: float
    between: float


def _prior(mean: float, within: float, between: float, source: str) -> Prior:
    return parameter(Prior(mean, within, between), unit="mean, deviation within and between drives", source=source)


@dataclass(frozen=True)
class CheckPriors:
    """Of the logarithm of a statistic and the offset, by check and by how many cameras take part."""

    conflict: Prior = _prior(-1.2, 0.25, 0.3, _PRIOR)
    conflict_of_a_pair: Prior = _prior(-1.2, 0.3, 0.35, _PRIOR)
    light: Prior = _prior(-2.6, 0.3, 0.3, _PRIOR)
    light_of_two: Prior = _prior(-2.3, 0.3, 0.3, _PRIOR)
    light_of_one: Prior = _prior(-1.8, 0.3, 0.4, _PRIOR)
    darkness: Prior = _prior(-2.8, 0.3, 0.3, _PRIOR)
    darkness_of_two: Prior = _prior(-2.4, 0.3, 0.3, _PRIOR)
    inconsistency: Prior = _prior(-3.5, 0.4, 0.4, _PRIOR)
    inconsistency_of_two: Prior = _prior(-3.0, 0.4, 0.4, _PRIOR)
    inconsistency_of_one: Prior = _prior(-2.0, 0.4, 0.4, _PRIOR)
    point_dropout: Prior = _prior(-0.7, 0.2, 0.2, _PRIOR)
    isolated_points: Prior = _prior(-2.0, 0.3, 0.3, _PRIOR)


@dataclass(frozen=True)
class CausePriors:
    """Of fault scores, by cause; 1 is just enough."""

    late_camera: Prior = _prior(-1.0, 0.5, 0.3, _PRIOR)
    late_lidar: Prior = _prior(-1.0, 0.5, 0.3, _PRIOR)
    displaced_camera: Prior = _prior(-0.2, 0.2, 0.2, _PRIOR)
    displaced_lidar: Prior = _prior(-1.0, 0.5, 0.5, _PRIOR)
    exposure: Prior = _prior(0.0, 0.15, 0.3, _PRIOR)
    others: Prior = _prior(-1.0, 0.5, 0.5, _PRIOR)


@dataclass(frozen=True)
class Hierarchy:
    """How drives, rig kinds and the prior weigh."""

    offset: float = parameter(0.02, unit="added to a statistic before its logarithm", source=_PRIOR)
    rig_kind: float = parameter(1.0, unit="drives that the prior's mean weighs", source=BY_HAND)
    prior_drives: float = parameter(
        10.0, unit="drives that the prior's deviation between drives weighs", source=_METHOD
    )
    prior_frames: float = parameter(
        20.0, unit="independent frames that the prior's deviation within weighs", source=BY_HAND
    )
    farthest: float = parameter(3.0, unit="deviations from the prior's mean that a drive counts with", source=_METHOD)
    widest: float = parameter(2.0, unit="times the prior's deviation within drives", source=BY_HAND)
    fewest_frames: int = parameter(4, unit="frames, fewer are worth one", source=BY_HAND)


@dataclass(frozen=True)
class JointTail:
    """The largest z of all checks of a clean frame."""

    independent_share: float = parameter(0.5, unit="share of the checks that count as independent", source=_PRIOR)
    stretch: float = parameter(1.0, unit="times the normal distribution's quantile", source=_PRIOR)
    smallest_r: float = parameter(
        1e-5, unit="rate: a smaller one is taken for it", source="no clean frames reach further"
    )


@dataclass(frozen=True)
class ScoreLimits:
    """Between these every normalised score z is kept: one frame cannot outweigh its neighbours."""

    lowest: float = parameter(-4.0, unit="standard deviations", source=BY_HAND)
    highest: float = parameter(12.0, unit="standard deviations", source=BY_HAND)


@dataclass(frozen=True)
class LocalisedFrom:
    """From which statistics on the damaged portion of a sensor is looked for: it is stored, and decides nothing."""

    lidar_conflict: float = parameter(0.4, unit="mean of a window", source=BY_HAND)
    light: float = parameter(0.1, unit="mean residual of a window", source=BY_HAND)
    inconsistency: float = parameter(0.1, unit="share of a window", source=BY_HAND)


@dataclass(frozen=True)
class FaultScale:
    """How what is expected of a fault's score becomes theta and the scale of z."""

    least_theta: float = parameter(1.0, unit="fault score: just enough", source="the unit of fault scores")
    scale: float = parameter(0.25, unit="share of theta", source=BY_HAND)
    highest: float = parameter(3.0, unit="scales above theta at which a fault is certain", source=BY_HAND)


@dataclass(frozen=True)
class TemporalWindow:
    """Means over time: attacks last, most mistakes do not."""

    seconds: float = parameter(0.5, unit="s around a frame", source=BY_HAND)
    soiled_seconds: float = parameter(2.0, unit="s around a frame: dirt stays", source=BY_HAND)
    incident_gap_s: float = parameter(0.5, unit="s that frames of one incident are apart at most", source=BY_HAND)
    gap_periods: float = parameter(2.5, unit="median periods from which on a step is a gap", source=BY_HAND)


@dataclass(frozen=True)
class Naming:
    """How sensors are named."""

    most_sets: int = parameter(20_000, unit="attack sets", source="bounds the work; no experiment recorded")
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
    dark_from: float = parameter(80.0, unit="mean grey level where darkness begins", source=_FAULTS)
    dark: float = parameter(40.0, unit="mean grey level", source=_FAULTS)
    glare: float = parameter(0.25, unit="share of saturated pixels", source=_FAULTS)
    exposure: float = parameter(0.2, unit="logarithm of a level against the other cameras'", source=BY_HAND)
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
CHECK_PRIORS = CheckPriors()
CAUSE_PRIORS = CausePriors()
HIERARCHY = Hierarchy()
JOINT_TAIL = JointTail()
SCORE_LIMITS = ScoreLimits()
LOCALISED_FROM = LocalisedFrom()
FAULT_SCALE = FaultScale()
TEMPORAL_WINDOW = TemporalWindow()
NAMING = Naming()
FAULT_SCORES = FaultScores()
FAULT_HYPOTHESES = FaultHypotheses()
FROZEN = Frozen()

JUDGING = (
    DISPARITY_ERROR_SAMPLES,
    PAIR_DEPTH,
    STORED_RESIDUALS,
    WINDOWED_MEAN,
    CHECK_PRIORS,
    CAUSE_PRIORS,
    HIERARCHY,
    JOINT_TAIL,
    SCORE_LIMITS,
    NAMING,
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
