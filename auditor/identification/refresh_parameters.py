"""Every number that decides which recordings a refresh learns from, and whether what it learnt comes into force.

None of them changes a verdict: verdicts follow from a measurement, a calibration and r.
"""

from dataclasses import dataclass

from auditor.model.parameter import BY_HAND, parameter


@dataclass(frozen=True)
class CleanDrive:
    """When a recording that nobody named clean is taken for it."""

    fewest_frames: int = parameter(20, unit="measured frames", source=BY_HAND)
    raised_r: float = parameter(
        0.0001, unit="designated rate of false alarms at which it has no incident", source=BY_HAND
    )
    chance: float = parameter(
        0.001, unit="chance of as many windows with findings in a clean drive, at least", source=BY_HAND
    )
    window_s: float = parameter(0.5, unit="s: frames that count as one trial", source="the temporal window")
    findings_of_a_window: float = parameter(
        2.0, unit="times r: chance of a finding in a clean window of several frames", source=BY_HAND
    )
    most_raised: float = parameter(
        0.25, unit="share of a night's new recordings that may be raised", source="2 of 8; no experiment recorded"
    )
    few_raised: int = parameter(1, unit="raised recordings of a night that refuse nothing", source=BY_HAND)


@dataclass(frozen=True)
class Influence:
    """How much of a calibration one log, day or vehicle may be."""

    most_drives: int = parameter(
        100, unit="recordings of a calibration", source="bounds the work; no experiment recorded"
    )
    most_of_a_day: int = parameter(3, unit="recordings of one vehicle and day", source=BY_HAND)
    share_of_vehicle: float = parameter(
        0.34, unit="share of the recordings, where there are three vehicles or more", source=BY_HAND
    )
    fewest_first: int = parameter(3, unit="recordings of a first calibration that nobody named clean", source=BY_HAND)
    folds: int = parameter(5, unit="groups of vehicles, and groups of days, that judge each other", source=BY_HAND)


@dataclass(frozen=True)
class Gate:
    """What a calibration must hold to come into force by itself."""

    most_step: float = parameter(0.5, unit="deviations that a threshold may rise in one refresh", source=BY_HAND)
    most_creep: float = parameter(
        1.0, unit="deviations that a threshold may lie above that of the version a person confirmed", source=BY_HAND
    )
    planted: float = parameter(2.5, unit="log odds added to a statistic: a mild attack", source=BY_HAND)
    most_lost: float = parameter(0.03, unit="share of planted attacks that may be lost in one refresh", source=BY_HAND)
    most_false_alarms: float = parameter(
        3.0, unit="times r: windows judged by others with findings, the lower end of their interval", source=BY_HAND
    )


@dataclass(frozen=True)
class Drifting:
    """When levels of a sensor are said to drift or to have changed over the days."""

    false_alarms: float = parameter(
        0.01, unit="chance, a night, that anything is named in a fleet without drift", source=BY_HAND
    )
    days: int = parameter(60, unit="days that are looked at", source=BY_HAND)
    fewest_frames: int = parameter(20, unit="measured frames of a vehicle's day", source=BY_HAND)
    fewest_days: int = parameter(6, unit="days of a series: two stretches", source=BY_HAND)
    fewest_of_stretch: int = parameter(3, unit="days of a stretch: a line and one more", source=BY_HAND)
    fewest_vehicles: int = parameter(3, unit="vehicles of a day whose median is the fleet's", source=BY_HAND)
    most_alike: float = parameter(0.9, unit="correlation of a day with the next that is believed", source=BY_HAND)
    days_around: int = parameter(5, unit="days whose median an odd day is drawn to", source=BY_HAND)
    extreme: float = parameter(2.0, unit="deviations that an odd day may differ from it", source=BY_HAND)
    days_beside: int = parameter(7, unit="days beside a change whose medians are before and after", source=BY_HAND)


@dataclass(frozen=True)
class LeastDeviations:
    """By check of a day's levels, the smallest deviation by chance that is believed; less is nobody's concern."""

    lidar_conflict: float = parameter(0.05, unit="log odds", source=BY_HAND)
    added_light: float = parameter(0.05, unit="log odds", source=BY_HAND)
    removed_light: float = parameter(0.05, unit="log odds", source=BY_HAND)
    photometric_inconsistency: float = parameter(0.05, unit="log odds", source=BY_HAND)
    point_dropout: float = parameter(0.05, unit="log odds", source=BY_HAND)
    isolated_points: float = parameter(0.05, unit="log odds", source=BY_HAND)
    disparity_error: float = parameter(0.05, unit="log odds", source=BY_HAND)
    lidar_disagreement: float = parameter(0.05, unit="log odds", source=BY_HAND)
    row_misalignment: float = parameter(0.05, unit="log odds", source=BY_HAND)
    row_offset: float = parameter(0.02, unit="px", source=BY_HAND)
    depth_bias: float = parameter(0.1, unit="px", source=BY_HAND)
    brightness: float = parameter(0.005, unit="logarithm of a ratio of levels", source=BY_HAND)
    texture: float = parameter(0.02, unit="log odds", source=BY_HAND)
    returns: float = parameter(0.005, unit="logarithm of a ratio of counts", source=BY_HAND)


CLEAN_DRIVE = CleanDrive()
INFLUENCE = Influence()
GATE = Gate()
DRIFT = Drifting()
LEAST_DEVIATIONS = LeastDeviations()

REFRESHING = (CLEAN_DRIVE, INFLUENCE, GATE, DRIFT, LEAST_DEVIATIONS)
"""All that can change what a refresh learns from and puts in force, and what drift it names."""
