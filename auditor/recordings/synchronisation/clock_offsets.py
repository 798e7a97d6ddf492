"""The clock offsets and periods of a rig's sensors, learnt from a recording's beginning."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from statistics import median_low

from auditor.model.rig import LIDAR, Rig
from auditor.recordings.parameters import RIG_LIMITS, SENSOR_TIMING
from auditor.recordings.synchronisation.sectors import whole_sweeps
from auditor.recordings.synchronisation.stamps import (
    SensorClock,
    StampCheck,
    clocks_ahead_ns,
    few_periods_ns,
    learn_clocks,
    times_of,
    usual_period_ns,
)
from auditor.recordings.synchronisation.survey import Survey


@dataclass(frozen=True)
class Timing:
    """The timing of a rig's sensors: offsets to the leftmost camera present, clocks, and periods.

    `period_ns` is that of the slowest sensor, `own_period_ns` that of each one that shows one. `remarks` are sentences
    on clocks, `withheld` is why the cameras cannot be compared, and what to do about it.
    """

    offset_ns: Mapping[int, int]
    clocks: Mapping[int, SensorClock]
    period_ns: int
    own_period_ns: Mapping[int, int]
    tolerance_ns: int
    fast: frozenset[int]
    remarks: tuple[str, ...] = ()
    withheld: str = ""

    def stamp_check(self, sensor: int) -> StampCheck:
        """A check of a sensor's stamps, for one read of the recording."""
        return StampCheck(self.clocks[sensor], few_periods_ns(self.period_ns))


def learn_timing(rig: Rig, survey: Survey) -> Timing:
    """Learn offsets and periods from a survey's sample stamps (all medians); offsets that the rig gives are kept."""
    samples = {sensor: survey.samples(rig.topic(sensor)) for sensor in rig.sensors}
    for sensor, lidar in rig.lidars.items():
        if lidar.sweep:
            places = whole_sweeps(lidar.sweep, survey.sectors(lidar.topic))
            samples[sensor] = tuple(samples[sensor][place] for place in places)
    found = {sensor: usual_period_ns(taken) for sensor, taken in samples.items()}
    periods = {sensor: period for sensor, period in found.items() if period}
    period_ns = max(periods.values(), default=SENSOR_TIMING.usual_period_ns)
    few_ns = few_periods_ns(period_ns)
    clocks = learn_clocks(samples, few_ns)
    ahead_ns = clocks_ahead_ns(clocks)
    seen = {
        sensor: [time_ns - ahead_ns.get(sensor, 0) for time_ns in times_of(taken, clocks[sensor], few_ns)]
        for sensor, taken in samples.items()
        if taken
    }
    base = max(seen, default=LIDAR)
    behind_ns = {sensor: _offset_ns(seen.get(sensor, []), seen.get(base, []), period_ns // 2) for sensor in rig.sensors}
    return Timing(
        offset_ns={sensor: behind_ns[sensor] + ahead_ns.get(sensor, 0) for sensor in rig.sensors} | rig.offsets_ns,
        clocks=clocks,
        period_ns=period_ns,
        own_period_ns=periods,
        tolerance_ns=min(period_ns // SENSOR_TIMING.periods_a_tolerance, SENSOR_TIMING.most_tolerance_ns),
        fast=frozenset(sensor for sensor, own in periods.items() if own < SENSOR_TIMING.fast_share * period_ns),
        remarks=tuple(_other_clock(rig, sensor, by_ns, len(samples[sensor])) for sensor, by_ns in ahead_ns.items()),
        withheld=_exposures_apart(rig, behind_ns, clocks),
    )


def _other_clock(rig: Rig, sensor: int, ahead_ns: int, messages: int) -> str:
    way = "ahead of" if ahead_ns > 0 else "behind"
    return (
        f"clock offset {rig.name(sensor)} {ahead_ns / 1e9:+.3f} s, by {messages} messages: the stamps of "
        f"{rig.topic(sensor)} are of another clock {way} the others', and the times of recording put them together"
    )


def _exposures_apart(rig: Rig, behind_ns: Mapping[int, int], clocks: Mapping[int, SensorClock]) -> str:
    """Why cameras cannot be compared: they expose too far apart in time; empty where they do not.

    Clocks that only differ show the same by their stamps, and not by the times of recording.
    """
    learnt = [camera.number for camera in rig.cameras if camera.offset_ns is None]
    for i, k in combinations(learnt, 2):
        by_stamp_ns = behind_ns[i] - behind_ns[k]
        apart_ns = abs(by_stamp_ns)
        if clocks[i].has_log and clocks[k].has_log:
            apart_ns = min(apart_ns, abs(by_stamp_ns + clocks[i].delay_ns - clocks[k].delay_ns))
        if apart_ns > RIG_LIMITS.most_exposures_apart_ns:
            return (
                f"exposures {apart_ns / 1e6:.0f} ms apart: {rig.name(i)} and {rig.name(k)} do not show one moment of a "
                "drive; record them in phase, or give a rig file with their offset_ns (--rig)"
            )
    return ""


def _offset_ns(stamps: list[int], base: list[int], reach_ns: int) -> int:
    """Median distance of stamps to the nearest one of the base, where there is one within reach."""
    nearest = (stamp - min(base, key=lambda other: abs(stamp - other)) for stamp in stamps if base)
    distances = [distance for distance in nearest if abs(distance) <= reach_ns]
    return int(median_low(distances)) if distances else 0
