"""When a message was captured, and the offsets and periods of a rig's sensors, learnt from a recording's beginning.

A message is of the time of its stamp, or of its time of recording where the stamp cannot be that. A stamp that repeats,
goes back, is not positive, or lies far from its own log time is irregular. Its message is placed by its log time less
the usual delay of its sensor, so that it is audited all the same, and it counts against the coverage.
"""

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from statistics import median, median_high, median_low
from typing import NamedTuple

from auditor.model.coverage import Against
from auditor.model.rig import LIDAR, Rig
from auditor.recordings.parameters import RIG_LIMITS, SENSOR_TIMING, STAMP_AGREEMENT
from auditor.recordings.synchronisation.sectors import whole_sweeps
from auditor.recordings.synchronisation.survey import Sample, Survey

DUPLICATE = "duplicate"
"""The reason of messages that another recorder of the same topic has written too: same stamp, same bytes."""
_REMEMBERED = 64  # messages among which a stamp is repeated: it bounds the memory


class CaptureTime(NamedTuple):
    """When a message was captured, and why its stamp counts against the coverage; "" where it does not."""

    time_ns: int
    against: str = ""


@dataclass(frozen=True)
class SensorClock:
    """The stamps of one sensor at a recording's beginning.

    `delay_ns` is the usual time from a stamp to its log time; `is_set` is False where all stamps are 0, which means
    that the recorder's time counts. `still_ns` is the one stamp of all messages, where they have only one. `has_log`
    is False where the log times do not go with the stamps, and cannot stand in for them.
    """

    delay_ns: int = 0
    is_set: bool = True
    still_ns: int | None = None
    has_log: bool = True


def few_periods_ns(period_ns: int) -> int:
    """How far a stamp's distance to its log time may differ from the usual one."""
    return max(STAMP_AGREEMENT.most_periods * period_ns, STAMP_AGREEMENT.least_ns)


def usual_period_ns(samples: Sequence[Sample]) -> int | None:
    """The median distance of neighbouring stamps, or of log times where there is only one stamp; None without two."""
    stamps = sorted({sample.stamp_ns for sample in samples if _is_stamp(sample)})
    times = stamps if len(stamps) > 1 else sorted({sample.log_time_ns for sample in samples})
    return median_low([b - a for a, b in pairwise(times)]) if len(times) > 1 else None


def _is_stamp(sample: Sample) -> bool:
    """True for a positive stamp, and for 0 at the beginning of a clock that counts from the recording's start."""
    return sample.stamp_ns > 0 or sample.stamp_ns == sample.log_time_ns == 0


def learn_clocks(samples: Mapping[int, Sequence[Sample]], few_ns: int) -> dict[int, SensorClock]:
    """The clock of each sensor, from its samples; one that stands still has the delay of the others."""
    clocks = {sensor: _clock(taken, few_ns) for sensor, taken in samples.items()}
    trusted = [clock.delay_ns for clock in clocks.values() if clock.is_set and clock.still_ns is None and clock.has_log]
    shared = median_low(trusted) if trusted else 0
    return {
        sensor: clock if clock.still_ns is None else SensorClock(shared, still_ns=clock.still_ns, has_log=clock.has_log)
        for sensor, clock in clocks.items()
    }


def clocks_ahead_ns(clocks: Mapping[int, SensorClock], other_ns: int) -> dict[int, int]:
    """By sensor how far its clock is ahead of the others', where their times of recording show that it is another one.

    A camera may stamp in time since its start beside others in UTC. Delays of a sensor differ by far less. What is
    stamped later than it was recorded has a wrong clock where the others have none. `other_ns` is what other_delay_ns
    says.
    """
    delays_ns = _usual_delays_ns(clocks)
    shared_ns = _shared_ns(delays_ns, other_ns)
    ahead_ns = {sensor: shared_ns - delay_ns for sensor, delay_ns in delays_ns.items()}
    future = {sensor for sensor, delay_ns in delays_ns.items() if delay_ns < -other_ns <= shared_ns}
    return {
        sensor: by_ns
        for sensor, by_ns in ahead_ns.items()
        if abs(by_ns) > STAMP_AGREEMENT.most_ns or (sensor in future and by_ns > other_ns)
    }


def other_delay_ns(period_ns: int) -> int:
    """By how much more than that of the others the usual delay of a sensor is no latency that can be relied upon."""
    return max(round(STAMP_AGREEMENT.other_periods * period_ns), STAMP_AGREEMENT.other_least_ns)


def _usual_delays_ns(clocks: Mapping[int, SensorClock]) -> dict[int, int]:
    return {s: one.delay_ns for s, one in clocks.items() if one.is_set and one.still_ns is None and one.has_log}


def _shared_ns(delays_ns: Mapping[int, int], other_ns: int) -> int:
    """The usual delay of most sensors, of those that are not recorded before they are stamped, where there are any."""
    possible = [delay_ns for delay_ns in delays_ns.values() if delay_ns >= -other_ns]
    return median_low(possible or delays_ns.values()) if delays_ns else 0


def _clock(samples: Sequence[Sample], few_ns: int) -> SensorClock:
    if not any(sample.stamp_ns for sample in samples):
        return SensorClock(is_set=False)
    first = {sample.stamp_ns: sample for sample in reversed(samples) if _is_stamp(sample)}
    logged = len({sample.log_time_ns for sample in samples})
    if len(first) <= 1 < len(samples):
        return SensorClock(still_ns=next(iter(first), samples[0].stamp_ns), has_log=logged > 1)
    delays = [sample.log_time_ns - sample.stamp_ns for sample in first.values()]
    # Of stamps that leap between two halves the median is that of one half, and not what lies between them.
    delay_ns = min(median_low(delays), median_high(delays), key=abs) if delays else 0
    spread_ns = median([abs(delay - delay_ns) for delay in delays]) if delays else 0
    goes_along = spread_ns <= few_ns or _is_as_fast(delays, list(first))
    return SensorClock(delay_ns, has_log=goes_along and (logged > 1 or len(samples) == 1))


def _is_as_fast(delays: Sequence[int], stamps: Sequence[int]) -> bool:
    """Whether log times go on as fast as stamps do from one to the next, but for a leap; a slow recorder's do not."""
    return 4 * _usual_step_ns(delays) <= _usual_step_ns(stamps)


def _usual_step_ns(times: Sequence[int]) -> float:
    return median([abs(b - a) for a, b in pairwise(times)])


class StampCheck:
    """Places the messages of one sensor in time, in the order of the recording."""

    def __init__(self, clock: SensorClock, few_ns: int) -> None:
        self._clock = clock
        self._few_ns = few_ns
        self._delay_ns = clock.delay_ns
        self._newest_ns: int | None = None
        self._newest_log_ns = 0
        self._recent: deque[tuple[int, int]] = deque(maxlen=_REMEMBERED)

    def place(self, stamp_ns: int, log_time_ns: int, data: bytes | memoryview = b"") -> CaptureTime:
        """The time of a message and what is wrong with its stamp, which is 0 where the message has none.

        `against` is DUPLICATE where a message of late had the same stamp and the same bytes.
        """
        if not self._clock.is_set and stamp_ns == 0:
            stamp_ns = log_time_ns
        # Python's hash of bytes has a secret key: nobody can make others with the same one, and it is fast.
        seen = stamp_ns, hash(bytes(data))
        if data and seen in self._recent:
            return CaptureTime(stamp_ns, DUPLICATE)
        repeated = any(stamp_ns == other for other, _ in self._recent)
        self._recent.append(seen)
        against = self._irregularity(stamp_ns, log_time_ns, repeated=repeated)
        self._newest_log_ns = max(self._newest_log_ns, log_time_ns)
        placed = self._time_ns(stamp_ns, log_time_ns, against)
        if placed == stamp_ns:
            self._newest_ns = stamp_ns if self._newest_ns is None else max(self._newest_ns, stamp_ns)
            # Clocks drift apart by parts of a second an hour: the usual delay follows, and only a jump is noticed.
            behind_ns = self._behind_ns(stamp_ns, log_time_ns)
            if abs(behind_ns) <= STAMP_AGREEMENT.most_ns:
                self._delay_ns += behind_ns // STAMP_AGREEMENT.follows
        return CaptureTime(placed, against)

    def of_recording(self, log_time_ns: int) -> int:
        """The time of a message whose stamp cannot be read."""
        return log_time_ns - self._delay_ns

    def _irregularity(self, stamp_ns: int, log_time_ns: int, *, repeated: bool) -> str:
        agrees = abs(self._behind_ns(stamp_ns, log_time_ns)) <= self._few_ns
        if stamp_ns < 0 or (stamp_ns == 0 and not agrees):
            return Against.NOT_POSITIVE
        if stamp_ns == self._clock.still_ns:
            return Against.STANDS_STILL
        if repeated:
            # A simulation that starts again repeats its stamps, and the recorder's clock goes back with them.
            restarted = agrees and log_time_ns < self._newest_log_ns and stamp_ns < (self._newest_ns or 0)
            return Against.BACK if restarted else Against.REPEATED
        if self._newest_ns is not None and stamp_ns < self._newest_ns - self._few_ns:
            return Against.BACK
        return "" if agrees else Against.DISAGREES

    def _behind_ns(self, stamp_ns: int, log_time_ns: int) -> int:
        """How much later than usual after its stamp a message was recorded; 0 where log times say nothing."""
        if not self._clock.is_set or not self._clock.has_log:
            return 0
        return log_time_ns - stamp_ns - self._delay_ns

    def _time_ns(self, stamp_ns: int, log_time_ns: int, against: str) -> int:
        if not against or not self._clock.has_log:
            return stamp_ns
        behind_ns = self._behind_ns(stamp_ns, log_time_ns)
        # A log whose clock was set back has such stamps, and log times that agree with them. A recorder that stalls
        # writes late, and the stamps go on: they are right.
        went_back = against == Against.BACK and abs(behind_ns) <= self._few_ns
        stalled = against == Against.DISAGREES and abs(behind_ns) <= STAMP_AGREEMENT.most_ns
        return stamp_ns if went_back or stalled else log_time_ns - self._delay_ns


def times_of(samples: Sequence[Sample], clock: SensorClock, few_ns: int) -> list[int]:
    """The times of a sensor's samples, in order, each once."""
    check = StampCheck(clock, few_ns)
    return sorted({check.place(sample.stamp_ns, sample.log_time_ns).time_ns for sample in samples})


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
    usual_periods = {sensor: usual_period_ns(taken) for sensor, taken in samples.items()}
    periods = {sensor: period for sensor, period in usual_periods.items() if period}
    period_ns = max(periods.values(), default=SENSOR_TIMING.usual_period_ns)
    few_ns = few_periods_ns(period_ns)
    clocks = learn_clocks(samples, few_ns)
    other_ns = other_delay_ns(period_ns)
    ahead_ns = clocks_ahead_ns(clocks, other_ns)
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
        withheld=_exposures_apart(rig, behind_ns, clocks) or _other_delay(rig, clocks, ahead_ns, other_ns),
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


def _other_delay(rig: Rig, clocks: Mapping[int, SensorClock], ahead_ns: Mapping[int, int], other_ns: int) -> str:
    """Why a sensor cannot be compared: it is recorded much later than the others, or its clock is another one.

    A rig that gives its offset says which it is. Empty where there is no such sensor.
    """
    delays_ns = {sensor: by_ns for sensor, by_ns in _usual_delays_ns(clocks).items() if sensor not in ahead_ns}
    shared_ns = _shared_ns(delays_ns, other_ns)
    for sensor, delay_ns in delays_ns.items():
        if sensor not in rig.offsets_ns and abs(delay_ns - shared_ns) > other_ns:
            return (
                f"the stamps of {rig.name(sensor)} lie {_off(delay_ns)} its log times, those of the others "
                f"{_off(shared_ns)} theirs: its clock is set otherwise, or it is recorded late; put them right, or "
                "give its offset_ns in a rig file (--rig)"
            )
    return ""


def _off(delay_ns: int) -> str:
    return f"{abs(delay_ns) / 1e9:.2f} s {'before' if delay_ns >= 0 else 'after'}"


def _offset_ns(stamps: list[int], base: list[int], reach_ns: int) -> int:
    """Median distance of stamps to the nearest one of the base, where there is one within reach."""
    nearest = (stamp - min(base, key=lambda other: abs(stamp - other)) for stamp in stamps if base)
    distances = [distance for distance in nearest if abs(distance) <= reach_ns]
    return int(median_low(distances)) if distances else 0
