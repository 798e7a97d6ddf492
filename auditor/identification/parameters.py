"""Numbers that can change a verdict on what was measured, and those that say what is kept beside it (`StandsOut`).

Other numbers of verdicts are those of evidence (`evidence_parameters`) and the priors of checks, which are declared
with them (`model.checks.kinds`); JUDGING has all. A changed value asks for a new JUDGING_VERSION. z is the normalised
score of a check or of a fault: how far it lies above its threshold theta.

The network that comes with auditor has a prior of its own, as the statistics of its disparities are not those of
SGBM's; checks that are not named there have the prior declared with them. It gives every pixel a disparity, also
where nothing matches: clean images are as inconsistent by it as attacked ones are by SGBM, light by two others and
conflicts with the LiDAR vary more from frame to frame, and false ranges are seen now and then. Tails are SGBM's.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, make_dataclass
from enum import StrEnum
from typing import TYPE_CHECKING

from auditor.identification.evidence_parameters import (
    ALERTS,
    CURVES,
    DRIVE_LEVEL,
    INCIDENTS,
    LIKELIHOOD,
    STRETCHES,
    THROWN_LIGHT,
)
from auditor.identification.transfer_parameters import LIKE_CAMERAS, OTHER_LIDAR
from auditor.model.checks import Check
from auditor.model.measurement import Procedure
from auditor.model.parameters import (
    ADDED_LIGHT,
    BY_HAND,
    DISPARITY_ERROR_SAMPLES,
    IMAGE_WINDOW,
    PAIR_DEPTH,
    POINT_EXCESS,
    RIG_KIND_TOLERANCE,
    canonical_values,
    digest,
    parameter,
)

_PSMNET = "benchmark matcher_prior: three real drives and streets 2000 to 2017, by both matchers (docs/decisions.md)"
_FALSE = "widened by hand: 0.46 in a clean frame of drive 0009 with four cameras (docs/psmnet.md)"
_UNIT = "mean, deviation within and between drives; the tail is that of check_priors"
_DECLARED = {one.name: one.values for check in Check for one in check.kind.priors}


class FittedOn(StrEnum):
    """The matcher whose disparities a prior was fitted on."""

    SGBM = "sgbm"
    PSMNET = "psmnet"


@dataclass(frozen=True)
class PsmnetPriors:
    """Of the log odds of a statistic, as `check_priors`, by the weights that come with auditor."""

    light_of_two: tuple[float, ...] = parameter((-2.2, 0.41, 0.33), unit=_UNIT, source=_PSMNET)
    conflict: tuple[float, ...] = parameter((-1.4, 0.71, 0.33), unit=_UNIT, source=_PSMNET)
    inconsistency_of_one: tuple[float, ...] = parameter((-0.53, 0.66, 0.4), unit=_UNIT, source=_PSMNET)
    inconsistency_of_two: tuple[float, ...] = parameter((-0.87, 0.65, 0.31), unit=_UNIT, source=_PSMNET)
    inconsistency: tuple[float, ...] = parameter((-1.08, 0.61, 0.3), unit=_UNIT, source=_PSMNET)
    false_ranges: tuple[float, ...] = parameter((-3.88, 0.65, 0.15), unit=_UNIT, source=_FALSE)
    scattered_ranges: tuple[float, ...] = parameter(
        (-3.88, 0.92, 0.21), unit=_UNIT, source="by hand: as wide as false_ranges with its tail"
    )


PSMNET_PRIORS = PsmnetPriors()

OTHERS: Mapping[FittedOn, Mapping[str, tuple[float, float, float, float]]] = {
    FittedOn.SGBM: {},
    FittedOn.PSMNET: {
        one.name: (*getattr(PSMNET_PRIORS, one.name), _DECLARED[one.name][-1]) for one in fields(PSMNET_PRIORS)
    },
}
"""By matcher and name the priors that are not those declared with the checks, tails included."""

SHIPPED: Mapping[str, object] = {
    "align_corners": False,
    "colour": False,
    "precision": "fp32",
    "range_px": 192,
    "step": 2,
    "weights_sha256": "33ddd15e26eda19eb3c906a9fe5ed97dfc358d5548b3bc970cebed1f575a5f4d",
}
"""The settings of PSMNet that its prior was fitted on: the weights that come with auditor, as they are used unasked."""


def fitted_on(procedure: Procedure) -> FittedOn:
    """The matcher whose prior the statistics of a procedure have: SGBM's where there is none of its own."""
    if procedure.matcher == FittedOn.PSMNET and SHIPPED.items() <= json.loads(procedure.settings).items():
        return FittedOn.PSMNET
    return FittedOn.SGBM


def has_prior(procedure: Procedure) -> bool:
    """Whether the prior judges what was measured so: it was fitted on disparities of the same matcher."""
    return procedure.matcher == FittedOn.SGBM or fitted_on(procedure) is FittedOn.PSMNET


if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_CHECKS = "chosen on KITTI drives 0009 and 0001 and 18 streets (docs/method.md)"
_PRIOR = "fitted by benchmark prior to real drives and streets (docs/method.md)"
_POISONED = "docs/decisions.md, no drive moves a threshold without end"
_FAULTS = "chosen on faulty frames of KITTI drive 0009 (docs/method.md)"
_BLURRED = (
    "three real drives: 0.96 of the least other camera's or more; blurred by 8 px 0.60 or less (docs/decisions.md)"
)
_BLIND = "three real drives, four cameras: 0.40 at most; white, black or grey from one frame on 3.6 to 4.4"
_FAULTS_ON_STREETS = "chosen on twelve streets, benchmark causes --synthetic 4 --first 700 (docs/method.md)"
_LEVELS = "three real drives, and streets of one vehicle: 0.03 within and 0.04 between drives, over 0.2"
_WARMTH = "three real drives: within drives 0.03, between them 0.065, between the two cameras of one 0.02"
_TILTED = (
    "benchmark prior; 0.5 between drives, not 0.37: of twelve vehicles one has a tilt that its drives must teach; "
    "a tail of 1.2: of 142 streets two have a LiDAR turned by 0.19 degrees beside near edges (docs/decisions.md)"
)
_ONE_COLOUR = "lasers of one colour on three real drives, against benchmark benign (docs/attacks.md)"
_BENIGN = "benchmarks benign and causes on real drives and streets (docs/method.md)"
_RAIN = "chosen on drives 0009 and 0001 and streets 0 and 3 of each style (docs/method.md)"
_REMOVED = "KITTI drives 0009, 0001 and odometry 04, streets 2000 to 2017: chosen on them (docs/attacks.md)"
_TAIL = "streets 7000 to 7159 and 9800 to 9845 at r = 0.1, 1, 5 and 20 %, and real drives (docs/decisions.md)"
_STRETCHES = "streets 9800 to 9845, of ten seconds, and real drives: chosen on them (docs/decisions.md)"
_FEWER_BEAMS = "docs/decisions.md, a frame's own grid says how many points a window needs: 64, 32 and 16 beams tried"


@dataclass(frozen=True)
class WindowedMean:
    """Windows of the count grids, to each of which consistent pixels are added as a pseudo-count."""

    directions: tuple[int, int] = parameter((6, 6), unit="cells of directions, rows and columns", source=_CHECKS)
    conflict_pseudo_count: int = parameter(
        40, unit="LiDAR points: half of what 64 beams give; half as many are the fewest of a pair", source=_CHECKS
    )
    lost_pseudo_count: int = parameter(
        36, unit="samples of surfaces: a quarter of what a window holds; half as many are the fewest", source=_REMOVED
    )
    smallest_pseudo_count: int = parameter(15, unit="LiDAR points, however few beams", source=_FEWER_BEAMS)
    dense_quantile: float = parameter(0.9, unit="quantile of the windows that hold points", source=_FEWER_BEAMS)
    share_of_dense: float = parameter(0.5, unit="share of a dense window's points", source=_FEWER_BEAMS)


_LASTING = "benchmarks benign, attack_kinds, held_light: 0.3 to 1 a second tried (docs/decisions.md)"
_STANDS_OUT = "62 clean real frames and those of their attacks that are named (docs/decisions.md)"
_OF_PRIOR = "mean, deviation within and between drives, tail"


@dataclass(frozen=True)
class CausePriors:
    """Of fault scores, by cause; 1 is just enough."""

    late_camera: tuple[float, ...] = parameter((-6.5, 0.4, 0.6), unit=_OF_PRIOR, source=_PRIOR)
    late_lidar: tuple[float, ...] = parameter((-2.1, 0.4, 0.37), unit=_OF_PRIOR, source=_PRIOR)
    displaced_camera: tuple[float, ...] = parameter((0.0, 0.1, 0.1), unit=_OF_PRIOR, source=_PRIOR)
    displaced_lidar: tuple[float, ...] = parameter((-2.0, 0.25, 0.5, 1.15), unit=_OF_PRIOR, source=_TILTED)
    exposure: tuple[float, ...] = parameter((0.0, 0.15, 0.2), unit=_OF_PRIOR, source=_LEVELS)
    white_balance: tuple[float, ...] = parameter((0.0, 0.15, 0.3), unit=_OF_PRIOR, source=_WARMTH)
    others: tuple[float, ...] = parameter((-0.3, 0.2, 0.3), unit=_OF_PRIOR, source=_PRIOR)


@dataclass(frozen=True)
class Hierarchy:
    """How drives, rig kinds and the prior weigh."""

    offset: float = parameter(0.02, unit="added to a statistic, and to what is left to 1", source=_PRIOR)
    rig_kind: float = parameter(0.5, unit="drives that the prior's mean weighs", source=BY_HAND)
    prior_drives: float = parameter(4.0, unit="drives that the prior's deviation between drives weighs", source=_PRIOR)
    prior_frames: float = parameter(
        20.0, unit="independent frames that the prior's deviation within weighs", source=BY_HAND
    )
    farthest: float = parameter(
        1.5, unit="deviations from the prior's mean that one drive counts with at most", source=_POISONED
    )
    farther: float = parameter(0.5, unit="deviations more for each further drive", source=_POISONED)
    widest_values: float = parameter(
        3.0, unit="deviations within drives from its median that a frame counts with at most", source=_POISONED
    )
    narrowest: float = parameter(
        0.75,
        unit="times the prior's deviations, at least: within drives, and of frames of any drive after many",
        source=_STRETCHES,
    )
    fewest_frames: int = parameter(4, unit="frames, fewer are worth one", source=BY_HAND)
    most_learnt: float = parameter(
        0.9,
        unit="share of the variance between drives that a drive's own frames can say at most",
        source="streets 2000 to 2053: 0.7, 0.85, 0.9 and 1 tried (docs/decisions.md)",
    )
    stretch_s: float = parameter(5.0, unit="s, of a stretch of road", source=_STRETCHES)
    of_stretches: float = parameter(
        0.9, unit="quantile of the medians of a drive's stretches, that is its own level", source=_STRETCHES
    )


@dataclass(frozen=True)
class JointTail:
    """The largest z of all checks of a clean frame."""

    stretch: float = parameter(1.25, unit="times the normal distribution's quantile", source=_TAIL)
    independent: float = parameter(
        0.47, unit="power of the number of checks that so many independent ones are", source=_TAIL
    )
    fall: float = parameter(
        0.7,
        unit="of what the quantile falls below that of the tail's rate, at larger r",
        source="streets 7000 to 7059 at r = 2 to 20 %; 12100 to 12107 and real drives alike (docs/figures.md)",
    )


@dataclass(frozen=True)
class ScoreLimits:
    """Between these every normalised score z is kept: one frame cannot outweigh its neighbours."""

    lowest: float = parameter(-4.0, unit="standard deviations", source=BY_HAND)
    highest: float = parameter(12.0, unit="standard deviations", source=BY_HAND)


@dataclass(frozen=True)
class StandsOut:
    """Which frames are worth more than their statistics, while they are measured: it decides no verdict."""

    localised: float = parameter(
        2.0, unit="z by the prior, from which on the damaged portion is looked for", source=_STANDS_OUT
    )
    cells: float = parameter(3.0, unit="z by the prior, from which on cells are kept", source=_STANDS_OUT)


@dataclass(frozen=True)
class FaultScale:
    """How what is expected of a fault's score becomes theta and the scale of z."""

    shown_quantile: float = parameter(
        0.99, unit="quantile of the clean scores that theta lies above", source="docs/decisions.md, a flaw of the rig"
    )
    scale: float = parameter(0.25, unit="share of theta", source=BY_HAND)
    highest: float = parameter(3.0, unit="scales above theta at which a fault is certain", source=BY_HAND)


@dataclass(frozen=True)
class TemporalWindow:
    """Means of fault features over time, and where a run of frames ends."""

    seconds: float = parameter(0.5, unit="s around a frame", source=BY_HAND)
    lasting_s: float = parameter(5.0, unit="s around a frame, of a sensor that has turned", source=_STRETCHES)
    gap_periods: float = parameter(2.5, unit="median periods from which on a step is a gap", source=BY_HAND)


@dataclass(frozen=True)
class Naming:
    """How sensors are named."""

    least_probability: float = parameter(
        0.7, unit="posterior probability of a set, below which no sensor is named", source=CURVES
    )
    but_one_beyond: float = parameter(
        4.0,
        unit="z that unmatched light by all cameras but one exceeds the limit by",
        source="480 clean frames of streets 7000 to 7059: 0 to 4 tried (docs/decisions.md)",
    )
    beside_lit: float = parameter(
        2.0,
        unit="z by which checks of the LiDAR that a lit camera votes on exceed the limit, to count beside its light",
        source="1,860 faculas and 180 walls beside one on three real drives (docs/decisions.md)",
    )
    most_unmatched: float = parameter(
        0.42,
        unit="share of points that a lone camera's past does not show apart from conflicts, beyond which none names",
        source="walls, drifting rows and other pictures on drives 0009, 0001 and 04 (docs/decisions.md)",
    )


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
    dazzled: float = parameter(2.5, unit="times exposure, brighter: a gain of 1.65", source=_BENIGN)
    dark: float = parameter(40.0, unit="mean grey level; darkness begins at twice as much", source=_FAULTS)
    exposure: float = parameter(0.2, unit="logarithm of a level against the other cameras'", source=BY_HAND)
    warmth: float = parameter(0.15, unit="logarithm of red over blue against the other cameras'", source=_WARMTH)
    warmth_of_one_other: float = parameter(0.5, unit="share that is subtracted of a lone other camera", source=_WARMTH)
    rain: float = parameter(0.01, unit="share of isolated points nearby", source=_RAIN)
    least_in_aerosol: float = parameter(
        0.4,
        unit="share of LiDAR points that agree with a pair of cameras, below which no aerosol explains the others",
        source="dust in, and other clouds in place of, those of drives 0009, 0001 and 04 (docs/decisions.md)",
    )
    blurred: float = parameter(
        0.3, unit="logarithm of the share with texture, less than that of any other camera", source=_BLURRED
    )
    blind: float = parameter(
        2.0, unit="logarithm of the share with texture, less than within 2.5 s before or after", source=_BLIND
    )


@dataclass(frozen=True)
class LightOfCauses:
    """What dirt and exposures do to the scores of a camera's checks, and an attack by light does not."""

    least_thrown: float = parameter(
        2.5, unit="z of light of one colour or in rows, from which on it was thrown in", source=_ONE_COLOUR
    )
    least_texture: float = parameter(
        7.0,
        unit="z of added texture, from which on it was thrown in",
        source="speckle on two real drives, and 228 real frames of dirt and drops (docs/decisions.md)",
    )
    hardly_added: float = parameter(
        2.0, unit="z of added light, below which an exposure explains what is seen", source=_BENIGN
    )
    unchanged: float = parameter(1.0, unit="z of inconsistency, below which what is seen is the same", source=_BENIGN)
    nearby_s: float = parameter(3.0, unit="s around a frame, in which a fault of a lens stays", source=_LASTING)
    further_s: float = parameter(
        5.0, unit="s to the next frame, where none is within half of that", source="a gap of 4 s in a real drive"
    )
    as_much: float = parameter(0.5, unit="share of a z, from which on a frame nearby shows as much", source=_LASTING)
    shown_a_second: float = parameter(
        0.5, unit="taken from the logarithm of the ratio for each second nearby that shows as much", source=_LASTING
    )
    for_gone: float = parameter(
        1.5, unit="added to it where no frame nearby shows as much, in proportion where some do", source=_LASTING
    )


WINDOWED_MEAN = WindowedMean()
_PRIORS = {one.name: one for check in Check for one in check.kind.priors}
CHECK_PRIORS: "DataclassInstance" = make_dataclass(
    "CheckPriors",
    [(one.name, tuple, parameter(one.values, unit=_OF_PRIOR, source=one.source)) for one in _PRIORS.values()],
    frozen=True,
)()
"""Of the log odds of a statistic, by check and by how many cameras take part, as checks are declared with them."""
CAUSE_PRIORS = CausePriors()
HIERARCHY = Hierarchy()
JOINT_TAIL = JointTail()
SCORE_LIMITS = ScoreLimits()
STANDS_OUT = StandsOut()
FAULT_SCALE = FaultScale()
TEMPORAL_WINDOW = TemporalWindow()
NAMING = Naming()
FAULT_SCORES = FaultScores()
LIGHT_OF_CAUSES = LightOfCauses()

JUDGING = (
    DISPARITY_ERROR_SAMPLES,
    PAIR_DEPTH,
    WINDOWED_MEAN,
    IMAGE_WINDOW,
    CHECK_PRIORS,
    CAUSE_PRIORS,
    HIERARCHY,
    DRIVE_LEVEL,
    JOINT_TAIL,
    SCORE_LIMITS,
    NAMING,
    LIKELIHOOD,
    TEMPORAL_WINDOW,
    INCIDENTS,
    STRETCHES,
    ALERTS,
    POINT_EXCESS,
    ADDED_LIGHT,
    FAULT_SCORES,
    FAULT_SCALE,
    LIGHT_OF_CAUSES,
    THROWN_LIGHT,
    RIG_KIND_TOLERANCE,
    OTHER_LIDAR,
    LIKE_CAMERAS,
)
"""All that can change a verdict, given the measurement, the calibration and r."""


def judging(fitted_on: FittedOn) -> tuple["DataclassInstance", ...]:
    """JUDGING, and what a matcher's prior has of its own."""
    return (*JUDGING, PSMNET_PRIORS) if fitted_on is FittedOn.PSMNET else JUDGING


def judging_settings(fitted_on: FittedOn = FittedOn.SGBM) -> str:
    """The values of `judging` as canonical JSON."""
    return canonical_values(*judging(fitted_on))


def judging_digest(fitted_on: FittedOn = FittedOn.SGBM) -> str:
    """The digest of `judging`: equal digests judge alike."""
    return digest(*judging(fitted_on))
