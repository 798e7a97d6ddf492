"""Every number that decides what a refresh learns from and puts into force, and what drift is named.

None of them changes a verdict: verdicts follow from a measurement, a calibration and r.
"""

from dataclasses import dataclass

from auditor.model.parameters import BY_HAND, parameter


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
    findings_of_a_window: float = parameter(
        6.0,
        unit="times r: chance of a finding in a clean window of several frames",
        source="5 to 6 times r on 21 streets that others judge",
    )
    most_raised: float = parameter(
        0.5,
        unit="share of the new recordings, and of all of the days that are learnt from, that may be raised",
        source="beyond it medians say nothing; 0.25 stopped refreshes under a fifth of attacked logs for nothing",
    )


@dataclass(frozen=True)
class Influence:
    """How much of a calibration one log, day or vehicle may be."""

    most_drives: int = parameter(
        100, unit="recordings of a calibration", source="bounds the work; no experiment recorded"
    )
    most_of_a_day: int = parameter(3, unit="recordings of one vehicle and day", source=BY_HAND)
    share: float = parameter(
        0.34, unit="share of the recordings of one vehicle, or day, where there are three or more", source=BY_HAND
    )
    cell_m: float = parameter(100.0, unit="m: side of the cells that a road is compared by", source=BY_HAND)
    same_place: float = parameter(0.5, unit="share of a drive's cells that another was in too", source=BY_HAND)
    most_of_a_place: int = parameter(5, unit="recordings of one road", source=BY_HAND)
    fewest_first: int = parameter(3, unit="recordings of a first calibration that nobody named clean", source=BY_HAND)


@dataclass(frozen=True)
class Gate:
    """What a calibration must hold to come into force by itself."""

    most_step: float = parameter(
        0.5, unit="deviations that a threshold of a hundred drives may rise in one refresh", source=BY_HAND
    )
    most_creep: float = parameter(
        1.0,
        unit="deviations that a threshold may lie above that of a hundred drives a person confirmed",
        source=BY_HAND,
    )
    planted: float = parameter(2.5, unit="log odds added to a statistic: a mild attack", source=BY_HAND)
    most_lost: float = parameter(
        0.03, unit="share of planted attacks that a version of a hundred drives may lose", source=BY_HAND
    )
    most_lost_in_all: float = parameter(
        0.05,
        unit="share of planted attacks that may be lost since a person confirmed a version of a hundred",
        source=BY_HAND,
    )
    most_more_alarms: float = parameter(
        0.01, unit="share of windows of new drives that may be raised besides in one refresh", source=BY_HAND
    )
    most_false_alarms: float = parameter(
        8.0,
        unit="times r: windows judged by others with findings, the lower end of their interval",
        source="5 to 6 times r on 21 streets that others judge",
    )


@dataclass(frozen=True)
class TwoSamples:
    """When the statistics of a drive are not those of the others."""

    chance: float = parameter(
        0.01, unit="chance that a night of clean drives leaves one out, all tests together", source=BY_HAND
    )
    shape: float = parameter(
        0.4,
        unit="deviation between drives of the log of the distance of their shapes",
        source="21 streets of 100 frames: 0.27 to 0.53 by check",
    )
    fewest_drives: int = parameter(8, unit="others that a drive is compared with", source=BY_HAND)
    fewest_frames: int = parameter(10, unit="measured frames of a drive that are compared", source=BY_HAND)


@dataclass(frozen=True)
class Conditions:
    """When the drives under one condition say anything."""

    windows_of_all: float = parameter(
        50.0, unit="windows that the share of all drives weighs in that of one condition", source=BY_HAND
    )
    fewest_drives: int = parameter(3, unit="drives under one condition", source=BY_HAND)
    fewest_windows: int = parameter(200, unit="windows: 2 are raised by chance at r = 0.01", source="2 / 0.01")


CLEAN_DRIVE = CleanDrive()
INFLUENCE = Influence()
GATE = Gate()
TWO_SAMPLES = TwoSamples()
CONDITIONS = Conditions()

REFRESHING = (CLEAN_DRIVE, INFLUENCE, GATE, TWO_SAMPLES, CONDITIONS)
"""All that can change what a refresh learns from and puts in force."""


@dataclass(frozen=True)
class Drifting:
    """When levels of a sensor are said to drift or to have changed over the days."""

    false_alarms: float = parameter(
        0.01, unit="chance, a night, that anything is named in a fleet without drift", source=BY_HAND
    )
    rougher: float = parameter(
        10.0,
        unit="times a chance by the normal distribution: days are rougher",
        source="docs/drift.md, figures: without it another vehicle is named on 3 of 24 drawn evenings",
    )
    days: int = parameter(60, unit="days that are looked at", source=BY_HAND)
    fewest_frames: int = parameter(20, unit="measured frames of a vehicle's day", source=BY_HAND)
    margin: float = parameter(
        1.2, unit="over the root of the days of a pool: its deviation is larger by that", source="its standard error"
    )
    most_alike: float = parameter(0.9, unit="correlation of a day with the next that is believed", source=BY_HAND)
    days_around: int = parameter(5, unit="days whose median an odd day is drawn to", source=BY_HAND)
    extreme: float = parameter(2.0, unit="deviations that an odd day may differ from it", source=BY_HAND)
    days_beside: int = parameter(7, unit="days beside a change whose medians are before and after", source=BY_HAND)


@dataclass(frozen=True)
class LeastDeviations:
    """The smallest deviation of a day's levels by chance that is believed; less is nobody's concern."""

    log_odds: float = parameter(0.05, unit="log odds of what is not named below", source=BY_HAND)
    row_offset: float = parameter(0.02, unit="px", source=BY_HAND)
    depth_bias: float = parameter(0.1, unit="px", source=BY_HAND)
    brightness: float = parameter(0.005, unit="logarithm of a ratio of levels", source=BY_HAND)
    texture: float = parameter(0.02, unit="log odds", source=BY_HAND)
    returns: float = parameter(0.005, unit="logarithm of a ratio of counts", source=BY_HAND)

    def of(self, check: str) -> float:
        """That of the levels of a check."""
        return float(getattr(self, check, self.log_odds))


DRIFT = Drifting()
LEAST_DEVIATIONS = LeastDeviations()

DRIFTING = (DRIFT, LEAST_DEVIATIONS)
"""All that can change what is named."""
