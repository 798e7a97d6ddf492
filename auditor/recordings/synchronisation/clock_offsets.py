"""The clock offsets and periods of a rig's sensors, learnt from a recording's beginning."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from statistics import median, median_low

from auditor.model.rig import LIDAR, Rig
from auditor.recordings.parameters import SENSOR_TIMING
from auditor.recordings.synchronisation.survey import Sample, Survey


@dataclass(frozen=True)
class Timing:
    """The timing of a rig's sensors: offsets to the leftmost camera present, periods, delays from stamp to log time."""

    offset_ns: Mapping[int, int]
    delay_ns: Mapping[int, int]
    period_ns: int
    tolerance_ns: int
    fast: frozenset[int]


def learn_timing(rig: Rig, survey: Survey) -> Timing:
    """Learn offsets and periods from a survey's sample stamps (all medians); offsets that the rig gives are kept."""
    samples = {sensor: survey.samples(rig.topic(sensor)) for sensor in rig.sensors}
    seen = {sensor: sorted({sample.stamp_ns for sample in taken}) for sensor, taken in samples.items() if taken}
    periods = {
        sensor: median_low([b - a for a, b in pairwise(stamps)]) for sensor, stamps in seen.items() if len(stamps) > 1
    }
    period_ns = max(periods.values(), default=SENSOR_TIMING.usual_period_ns)
    base = max(seen, default=LIDAR)
    return Timing(
        offset_ns={
            sensor: _offset_ns(seen.get(sensor, []), seen.get(base, []), period_ns // 2) for sensor in rig.sensors
        }
        | rig.offsets_ns,
        delay_ns={sensor: _delay_ns(taken) for sensor, taken in samples.items()},
        period_ns=period_ns,
        tolerance_ns=min(period_ns // SENSOR_TIMING.periods_a_tolerance, SENSOR_TIMING.most_tolerance_ns),
        fast=frozenset(sensor for sensor, own in periods.items() if own < SENSOR_TIMING.fast_share * period_ns),
    )


def _offset_ns(stamps: list[int], base: list[int], reach_ns: int) -> int:
    """Median distance of stamps to the nearest one of the base, where there is one within reach."""
    nearest = (stamp - min(base, key=lambda other: abs(stamp - other)) for stamp in stamps if base)
    distances = [distance for distance in nearest if abs(distance) <= reach_ns]
    return int(median_low(distances)) if distances else 0


def _delay_ns(samples: tuple[Sample, ...]) -> int:
    return int(median([sample.log_time_ns - sample.stamp_ns for sample in samples])) if samples else 0
