"""What becomes of the messages of a rig's sensors, and which part of the recording's time they cover."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from math import ceil

from auditor.model.coverage import Against, TimeCoverage
from auditor.model.stamps import NANOSECONDS
from auditor.recordings.parameters import TIME_GAPS
from auditor.recordings.synchronisation.clocks import DUPLICATE, Timing

EDGE = "edge"
TOO_FEW = "too few sensors"
LATE = "late"
BETWEEN = "between frames"


@dataclass
class MessageCounts:
    """The use of the messages of one sensor; several at a time where a LiDAR's sweep was recorded in parts.

    `regular` ones are used by their own stamp, `unused` ones belong to another rig; `against` counts the others by
    reason, but for those at the edges, duplicates, and up to `most_surplus` messages of a fast sensor between two that
    are used. `problems` are those of damaged ones, of which the earliest was captured at `damaged_from_ns`.
    """

    most_surplus: int = 0
    read: int = 0
    used: int = 0
    unused: int = 0
    regular: int = 0
    problems: dict[str, int] = field(default_factory=dict)
    damaged_from_ns: int | None = None
    skipped: dict[str, int] = field(default_factory=dict)
    against: dict[str, int] = field(default_factory=dict)
    _surplus: int = 0

    def use(self, against: str, messages: int = 1) -> None:
        """Count a message that is in a frame."""
        self.used += messages
        self._surplus = 0
        if against:
            self._count_against(against, messages)
        else:
            self.regular += messages

    @property
    def damaged(self) -> int:
        """The messages that could not be decoded whole."""
        return sum(self.problems.values())

    def undecoded(self, begin_ns: int) -> str:
        """How many messages could not be decoded whole, from which second after `begin_ns` on, and why most could not.

        There has to be one.
        """
        usual = max(self.problems, key=self.problems.__getitem__)
        most = f", {self.problems[usual]} of them" if len(self.problems) > 1 else ""
        since_s = max(0, (self.damaged_from_ns or 0) - begin_ns) / NANOSECONDS
        return f"{self.damaged} message{'s' * (self.damaged > 1)} from {since_s:.1f} s on{most}: {usual}"

    def damage(self, problem: str, stamp_ns: int, messages: int = 1) -> None:
        """Count a message that could not be decoded whole, and why."""
        self.problems[problem] = self.problems.get(problem, 0) + messages
        self.damaged_from_ns = stamp_ns if self.damaged_from_ns is None else min(self.damaged_from_ns, stamp_ns)
        self._count_against(Against.DAMAGED, messages)

    def skip(self, reason: str, against: str = "", messages: int = 1) -> None:
        """Count a message that is in no frame; `against` is what is wrong with its stamp."""
        self.skipped[reason] = self.skipped.get(reason, 0) + messages
        if reason == BETWEEN:
            self._surplus += 1
        if against:
            self._count_against(against, messages)
        elif reason == LATE:
            self._count_against(Against.LATE, messages)
        elif reason == TOO_FEW or (reason == BETWEEN and self._surplus > self.most_surplus):
            self._count_against(Against.UNPAIRED, messages)

    def leave_out(self, reason: str, problem: str, against: str, stamp_ns: int, messages: int) -> None:
        """Count a message that is in no frame, as damaged where it has a problem."""
        if problem:
            self.damage(problem, stamp_ns, messages)
        else:
            self.skip(reason, against, messages)

    def skip_duplicate(self) -> None:
        """Count a message that another recorder of its topic has written too."""
        self.skipped[DUPLICATE] = self.skipped.get(DUPLICATE, 0) + 1

    def _count_against(self, reason: str, messages: int) -> None:
        self.against[str(reason)] = self.against.get(str(reason), 0) + messages


def counts_of(sensors: Collection[int], timing: Timing) -> dict[int, MessageCounts]:
    """Counts of each sensor at the beginning of a read."""
    return {
        sensor: MessageCounts(most_surplus=_most_surplus(timing, sensor) if sensor in timing.fast else 0)
        for sensor in sensors
    }


def _most_surplus(timing: Timing, sensor: int) -> int:
    """How many messages of a fast sensor may lie between two used ones: those of a time that is no gap.

    None may where the slowest sensor is slower than those of vehicles: it was thinned out, and with it the frames.
    """
    if timing.period_ns > TIME_GAPS.slowest_pace_ns:
        return 0
    return ceil(TIME_GAPS.most_periods * timing.period_ns / timing.own_period_ns[sensor])


@dataclass
class _SensorTime:
    first_ns: int | None = None
    last_ns: int | None = None
    lost_ns: int = 0
    late_ns: int = 0
    early_ns: int = 0
    gaps: int = 0
    longest_gap_ns: int = 0


class TimeLedger:
    """Which part of the recording's time the regular messages of each sensor cover.

    Each covers the time to the next one, if that is no more than a few periods; of a longer gap one period is covered.
    A period at either end is an edge. A clock set back begins anew.
    """

    def __init__(self, sensors: Collection[int], period_ns: int) -> None:
        self._period_ns = period_ns
        self._sensors = {sensor: _SensorTime() for sensor in sensors}
        self._held_ns = 0
        self._chunk = 0
        self._start_ns: int | None = None
        self._end_ns = 0

    def add(self, chunk: int, time_ns: int, regular: Collection[int]) -> None:
        """Take a moment of the recording with a frame or without, and the sensors whose regular messages are in it."""
        if chunk != self._chunk:
            self._close()
            self._chunk = chunk
        self._start_ns = time_ns if self._start_ns is None else min(self._start_ns, time_ns)
        self._end_ns = max(self._end_ns, time_ns)
        for sensor in regular:
            self._use(self._sensors[sensor], time_ns)

    def _use(self, sensor: _SensorTime, time_ns: int) -> None:
        if sensor.last_ns is None:
            sensor.first_ns = time_ns
        elif time_ns - sensor.last_ns > TIME_GAPS.most_periods * self._period_ns:
            gap_ns = time_ns - sensor.last_ns - self._period_ns
            sensor.lost_ns += gap_ns
            sensor.gaps += 1
            sensor.longest_gap_ns = max(sensor.longest_gap_ns, gap_ns)
        sensor.last_ns = time_ns

    def _close(self) -> None:
        """Close the part of the recording before its end, or before its clock was set back."""
        if self._start_ns is None:
            return
        held_ns = self._end_ns - self._start_ns + self._period_ns
        self._held_ns += held_ns
        for sensor in self._sensors.values():
            if sensor.first_ns is None or sensor.last_ns is None:
                sensor.lost_ns += held_ns
                continue
            late_ns = self._beyond_edge(sensor.first_ns - self._start_ns)
            early_ns = self._beyond_edge(self._end_ns - sensor.last_ns)
            sensor.late_ns += late_ns
            sensor.early_ns += early_ns
            sensor.lost_ns += late_ns + early_ns
            sensor.first_ns = sensor.last_ns = None
        self._start_ns, self._end_ns = None, 0

    def _beyond_edge(self, missing_ns: int) -> int:
        return missing_ns if missing_ns > TIME_GAPS.edge_periods * self._period_ns else 0

    def finish(self) -> Mapping[int, TimeCoverage]:
        """The time covered by each sensor, at the end of the recording."""
        self._close()
        return {
            number: TimeCoverage(
                self._held_ns,
                max(0, self._held_ns - sensor.lost_ns),
                sensor.late_ns,
                sensor.early_ns,
                sensor.gaps,
                sensor.longest_gap_ns,
            )
            for number, sensor in self._sensors.items()
        }
