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
    few_raised: int = parameter(1, unit="raised recordings of a night that refuse nothing", source=BY_HAND)


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
