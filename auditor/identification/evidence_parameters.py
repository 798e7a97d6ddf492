"""How likely attack sets make what frames show, and the sequential test of incidents: what was fitted, and stated."""

from dataclasses import dataclass

from auditor.model.parameters import BY_HAND, parameter

_TAIL = "the largest z of 540 clean frames of streets 2000 to 2053 (docs/method.md)"
_TRIED = "streets 2000 to 2053 and attacked frames of three real drives: 4 to 6 tried (docs/method.md)"
_CORRELATED = "clean frames of a real drive and of 21 streets at 10 Hz (docs/method.md)"
_AIMED = "benchmark incident_series on three real drives: 0.5, 1 and 2 tried (docs/method.md)"
_PEAKS = "benchmark incident_series --fit: streets 2000 to 2053, 5000 to 5041, 9000 to 9070 (docs/method.md)"
_FULL_SIZE = "benchmark incident_series --fit: 198 streets of full size, 9800 to 10119 (docs/method.md)"
_IN_TURN = "attacks on three sensors in turn on drive 0009: the innocent are named below it (docs/method.md)"
_NAMED_IN_VAIN = "lasting and brief attacks on three real drives, named and in no incident (docs/method.md)"
_WINDOWS = "streets 9800 to 9859 of four seconds and lasting attacks on three real drives (docs/decisions.md)"
_BESIDE = "clean real drives and streets 9800 to 9859: levels of cameras of one group (docs/decisions.md)"
_REAL_ATTACKS = "lasting attacks on three real drives, alone and in batches; guard: 56 streets (docs/ablations.md)"
CURVES = "fitted by benchmark likelihood to three real drives and streets 2000 to 2053 (docs/method.md)"
_ALIKE = "two cameras lit alike on three real drives: 0, -0.5, -1.5 and -3 tried (docs/decisions.md)"
_OF_CURVE = "natural logarithm of a likelihood, at each z of the curve"


@dataclass(frozen=True)
class Incidents:
    """The sequential test of attacked frames against clean ones."""

    tail_rate: float = parameter(
        0.01, unit="rate at which clean frames exceed the joint limit where their tail begins", source=_TAIL
    )
    tail_slope: float = parameter(2.5, unit="powers of e a z, by which clean frames are rarer beyond", source=_TAIL)
    duty: float = parameter(
        0.2,
        unit="share of the frames that an attack changes",
        source="a strobe of one frame in five",
    )
    most_of_a_frame: float = parameter(5.0, unit="log-likelihood ratio that a frame counts with at most", source=_TRIED)
    correlation: float = parameter(0.33, unit="autocorrelation of clean evidence at once", source=_CORRELATED)
    correlation_s: float = parameter(0.4, unit="s in which it falls by e", source=_CORRELATED)
    quiet_s: float = parameter(1.0, unit="s without a rise, after which an incident has ended", source=BY_HAND)
    fewest_worth: float = parameter(
        0.8, unit="independent frames that the findings of an incident are worth", source="three frames at 10 Hz"
    )
    explained_share: float = parameter(
        0.2, unit="share that evidence counts for, where a fault explains it as well", source=_PEAKS
    )
    per_hour: float = parameter(1.0, unit="false incidents an hour, where nothing else is asked for", source=_AIMED)
    peaks_from: float = parameter(0.3, unit="sum from which on the tail of clean peaks is fitted", source=_PEAKS)
    prior_peaks: float = parameter(2.5, unit="clean peaks beyond it, of the prior", source=_FULL_SIZE)
    prior_hours: float = parameter(0.25, unit="hours of clean driving, of the prior", source=_FULL_SIZE)
    prior_scale: float = parameter(0.46, unit="mean of what such peaks exceed it by", source=_FULL_SIZE)
    gap_s: float = parameter(
        0.5, unit="s that two events of one finding are apart at most, where they are one incident", source=BY_HAND
    )
    contested_share: float = parameter(
        0.25,
        unit="share of the naming evidence for other sensors, from which on frames are named singly",
        source=_IN_TURN,
    )


@dataclass(frozen=True)
class DriveLevel:
    """How far the level of the drive that is judged is believed."""

    beside: float = parameter(0.4, unit="deviation of a camera's level beside its group's", source=_REAL_ATTACKS)
    farthest: float = parameter(
        2.5, unit="deviations above the group, beyond which no level is believed", source=_BESIDE
    )
    quiet_share: float = parameter(
        0.25, unit="share of the frames that say a level where all do not", source="attacks of half a drive"
    )


@dataclass(frozen=True)
class Stretches:
    """Windows of frames that are judged as a whole."""

    seconds: float = parameter(1.2, unit="s of a window", source=_WINDOWS)
    fewest_frames: int = parameter(9, unit="frames of a window, however slow the camera", source=BY_HAND)
    within: float = parameter(0.6, unit="of a frame's deviation within drives", source=_WINDOWS)
    tail: float = parameter(1.15, unit="times the deviation of a median", source=_WINDOWS)
    reaches: float = parameter(
        0.5, unit="of a window's z in the half at its run's end, where an event reaches it", source=BY_HAND
    )


@dataclass(frozen=True)
class Alerts:
    """Findings outside incidents that count as found."""

    chance: float = parameter(
        2e-4, unit="chance of such a row of independent clean frames, at most", source="two in a row at r = 1 %"
    )
    share: float = parameter(
        0.1, unit="share of the audited frames that are findings outside incidents, at least", source=_NAMED_IN_VAIN
    )
    times_r: float = parameter(3.0, unit="times r that this share is at least", source="r/3 to 3r is what r promises")


OWN_AT = (-4.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.5, 8.0, 12.0)
"""z of an attacked sensor: where the curves below were fitted."""

REST_AT = (-8.0, -4.5, -3.5, -2.5, -1.5, -0.5, 0.5, 1.5, 3.0, 4.5, 8.0)
"""largest z of the others, less their limit: where the curves below were fitted."""


@dataclass(frozen=True)
class Likelihood:
    """How likely an attack set makes what a frame shows, and how likely it was before."""

    of_camera: tuple[float, ...] = parameter(
        (-9.79, -5.78, -4.43, -2.96, -1.29, 0.29, 1.64, 2.23, 2.23, 2.23, 2.3), unit=_OF_CURVE, source=CURVES
    )
    of_lidar: tuple[float, ...] = parameter(
        (-5.78, -3.34, -2.56, -1.86, -1.18, -0.54, 0.87, 2.51, 5.03, 7.56, 14.3), unit=_OF_CURVE, source=CURVES
    )
    of_rest: tuple[float, ...] = parameter(
        (0.0, -0.11, -0.12, -0.12, -0.55, -2.0, -5.15, -8.63, -13.87, -19.1, -31.33), unit=_OF_CURVE, source=CURVES
    )
    of_several: float = parameter(-1.98, unit="added for each sensor after the first", source=CURVES)
    of_lacking: float = parameter(
        -1.5, unit="added for each z by which a camera lacks light more than it shows any", source=_ALIKE
    )
    clean_worth: float = parameter(
        460.0, unit="independent clean frames: the largest ratio that is said", source=CURVES
    )
    further_sensor: float = parameter(
        0.2, unit="times the prior, which has even odds, for each sensor after the first", source="stated"
    )


_LENSES = "fitted by benchmark thrown_light to three real drives and 14 streets (docs/method.md)"
_OF_RATIO = "added to the logarithm of the ratio, at each value of the curve"


CHANGED_AT = (-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
"""z: where the curves below were fitted."""

DARKER_AT = (-3.0, -2.2, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0)
"""logarithm of removed over added light: where the curves below were fitted."""

SATURATED_AT = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0)
"""logarithm of saturated half px and one: where the curves below were fitted."""


@dataclass(frozen=True)
class ThrownLight:
    """How likely light that was thrown into a camera makes what it shows, against dirt, drops and glare on its lens."""

    start: float = parameter(0.6, unit="logarithm of the ratio where nothing is known", source=_LENSES)
    of_removed: tuple[float, ...] = parameter(
        (2.69, 1.7, 0.61, -0.19, -0.74, -1.08, -1.3, -1.51), unit=_OF_RATIO, source=_LENSES
    )
    of_inconsistent: tuple[float, ...] = parameter(
        (-0.46, -0.62, -0.73, -0.65, -0.27, 0.29, 0.87, 1.44), unit=_OF_RATIO, source=_LENSES
    )
    of_darker: tuple[float, ...] = parameter(
        (0.66, 0.31, 0.09, 0.12, 0.13, -0.07, -0.65, -1.48), unit=_OF_RATIO, source=_LENSES
    )
    of_saturated: tuple[float, ...] = parameter(
        (-1.21, -1.18, -1.17, -1.1, -0.91, -0.54, 0.09, 0.96, 2.02), unit=_OF_RATIO, source=_LENSES
    )


LIKELIHOOD = Likelihood()
THROWN_LIGHT = ThrownLight()
INCIDENTS = Incidents()
DRIVE_LEVEL = DriveLevel()
STRETCHES = Stretches()
ALERTS = Alerts()
