"""Messages that wait for their frame, in bounded memory, and sweeps of a LiDAR that come in parts."""

from bisect import insort
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

from auditor.errors import DecodingError
from auditor.model.coverage import Against
from auditor.model.frames import Message
from auditor.model.rig import Rig, Sweep
from auditor.recordings.decoding import Decoders, PartDecoder
from auditor.recordings.parameters import FRAME_WINDOW, SWEEPS
from auditor.recordings.synchronisation.clocks import Timing
from auditor.recordings.synchronisation.counts import BETWEEN, LATE, MessageCounts
from auditor.recordings.synchronisation.sectors import Sector, SweepStarts, sector_of, timed_part

MOST_WAITING_BYTES = 96 * 2**20
"""Of messages that wait for their frame: it bounds the memory."""
MESSAGE_BYTES = 512
"""What a message takes beside its data."""

_MOST_WAITING = 2048  # messages that wait, 1 kHz beside 1 Hz: it bounds the memory
_MOST_FROM_BEFORE = 100  # messages after a clock went back: it bounds the memory
_MOST_HELD_GROUPS = 100  # frames that are held: it bounds the memory


class Waiting(NamedTuple):
    """A message in the window; sorted by when it was captured, less the sensor's offset.

    `stamp_ns` is its stamp, or what stands in for it; `against` says why it counts against the coverage even if used.
    `parts` are all messages of a LiDAR's sweep that was recorded in parts, in their order.
    """

    time_ns: int
    order: int
    stamp_ns: int
    message: Message
    problem: str
    against: str = ""
    parts: tuple[Message, ...] = ()

    @property
    def messages(self) -> tuple[Message, ...]:
        """The message, or all of its sweep."""
        return self.parts or (self.message,)


@dataclass(frozen=True)
class FrameMessages:
    """The messages of one frame.

    `last_ns` is the newest time seen when it was closed; `chunk` counts how often the clock had jumped back.
    """

    number: int
    time_ns: int
    members: Mapping[int, Waiting]
    complete: bool
    last_ns: int
    chunk: int = 0
    edge: bool = False


class MessageWindow:
    """Messages that wait for their frame."""

    def __init__(self, rig: Rig, timing: Timing, counts: Mapping[int, MessageCounts]) -> None:
        self._rig = rig
        self._timing = timing
        self._counts = counts
        self._waiting: dict[int, list[Waiting]] = {sensor: [] for sensor in rig.sensors}
        self._newest: dict[int, int] = {}
        self._leapt_to: int | None = None
        self._closed_until: int | None = None
        self._from_before: list[tuple[int, Waiting]] = []
        self._has_jumped = False
        self.held_bytes = 0
        self.jumps = 0
        self._number = 0
        self._wait_ns = FRAME_WINDOW.most_wait_periods * timing.period_ns

    def add(self, sensor: int, waiting: Waiting) -> None:
        """Add a message; one that is older than the last frame is late, unless the clock has jumped back."""
        if self._is_from_before(waiting):
            self._from_before.append((sensor, waiting))
            self.held_bytes += _bytes(waiting)
            # One sensor that lags is late; old stamps of two sensors, near one another, mean a clock set back.
            self._has_jumped = len({sensor for sensor, _ in self._from_before}) > 1
            if not self._has_jumped and len(self._from_before) > _MOST_FROM_BEFORE:
                self._refuse_from_before()
            return
        self._refuse_from_before()
        self._take(sensor, waiting)

    def _take(self, sensor: int, waiting: Waiting) -> None:
        self._advance(sensor, waiting.time_ns)
        if self._closed_until is not None and waiting.time_ns <= self._closed_until:
            self._refuse(sensor, waiting, LATE)
            return
        insort(self._waiting[sensor], waiting)
        self.held_bytes += _bytes(waiting)

    def _is_from_before(self, waiting: Waiting) -> bool:
        """True for a time too old to be a late message's, or of a clock that went back, and near to others like it."""
        late_ns = 0 if waiting.against == Against.BACK else self._wait_ns
        if self._closed_until is None or waiting.time_ns > self._closed_until - late_ns:
            return False
        return all(abs(waiting.time_ns - other.time_ns) <= self._wait_ns for _, other in self._from_before)

    def _refuse_from_before(self) -> None:
        for sensor, waiting in self._from_before:
            self.held_bytes -= _bytes(waiting)
            self._refuse(sensor, waiting, LATE)
        self._from_before.clear()

    def _restart(self) -> None:
        """Start again at the time that the clock has jumped back to."""
        self._newest.clear()
        self._leapt_to = self._closed_until = None
        self._has_jumped = False
        self.jumps += 1
        again, self._from_before = self._from_before, []
        for sensor, waiting in again:
            self.held_bytes -= _bytes(waiting)
            self._take(sensor, waiting)

    def _advance(self, sensor: int, time_ns: int) -> None:
        """Move a sensor's time on; a leap far ahead of all sensors counts once a second message confirms it.

        Without this, one stamp from another century would close every frame before its messages have come.
        """
        leaps = bool(self._newest) and time_ns > max(self._newest.values()) + self._wait_ns
        if leaps and (self._leapt_to is None or abs(time_ns - self._leapt_to) > self._wait_ns):
            self._leapt_to = time_ns
        else:
            self._newest[sensor] = time_ns

    def closed(self) -> Iterator[FrameMessages]:
        """The frames that are complete, or can get no more messages."""
        if self._has_jumped:
            yield from self._rest()
            self._restart()
        while (opening := self._opening()) is not None and self._is_settled(opening):
            yield self._close(opening)

    def rest(self) -> Iterator[FrameMessages]:
        """The frames that are left at the end."""
        self._refuse_from_before()
        yield from self._rest()

    def _rest(self) -> Iterator[FrameMessages]:
        while (opening := self._opening(at_end=True)) is not None:
            yield self._close(opening)
        for sensor, waiting in self._waiting.items():
            self._drop(sensor, len(waiting))

    def _opening(self, *, at_end: bool = False) -> int | None:
        """The time of the oldest message that may open a frame.

        Sensors with shorter periods than the slowest one do not open frames, unless the slow ones are silent.
        """
        slow = [w[0].time_ns for s, w in self._waiting.items() if w and s not in self._timing.fast]
        fast = [w for s, w in self._waiting.items() if w and s in self._timing.fast]
        oldest = min(slow, default=None)
        if fast:
            due = self._due_ns()
            late = [
                first for w in fast if (first := next((m.time_ns for m in w if m.time_ns >= due), None)) is not None
            ]
            overdue = min(late, default=None)
            silent = oldest is None or (overdue is not None and overdue < oldest)
            if overdue is not None and silent and (at_end or self._slow_are_past(overdue)):
                return overdue
        return oldest

    def _due_ns(self) -> int:
        """The time from which on a fast sensor may open a frame: a message of a slow one is overdue."""
        if self._closed_until is None:
            return min(w[0].time_ns for w in self._waiting.values() if w) + self._timing.period_ns
        return self._closed_until + self._timing.period_ns

    def _slow_are_past(self, time_ns: int) -> bool:
        newest = max(self._newest.values())
        return self._is_full() or all(
            self._newest.get(sensor, newest - self._wait_ns) > time_ns + self._timing.tolerance_ns
            or newest > time_ns + self._wait_ns
            for sensor in self._rig.sensors
            if sensor not in self._timing.fast
        )

    def _is_full(self) -> bool:
        return self.held_bytes > MOST_WAITING_BYTES or sum(map(len, self._waiting.values())) > _MOST_WAITING

    def _is_settled(self, opening: int) -> bool:
        """True where every sensor has a message in the frame or behind it, or the wait is over."""
        tolerance = self._timing.tolerance_ns
        if self._is_full():
            return True
        if max(self._newest.values()) > opening + self._wait_ns:
            return True
        for sensor, waiting in self._waiting.items():
            past = self._newest.get(sensor, opening) > opening + 2 * tolerance
            here = sensor not in self._timing.fast and any(opening <= w.time_ns <= opening + tolerance for w in waiting)
            if not past and not here:
                return False
        return True

    def _close(self, opening: int) -> FrameMessages:
        tolerance = self._timing.tolerance_ns
        time_ns = self._centre(opening)
        members: dict[int, Waiting] = {}
        for sensor, waiting in self._waiting.items():
            near = [w for w in waiting if abs(w.time_ns - time_ns) <= tolerance]
            if near:
                members[sensor] = min(near, key=lambda w: abs(w.time_ns - time_ns))
        self._closed_until = time_ns + tolerance
        for sensor, waiting in self._waiting.items():
            gone = sum(1 for w in waiting if w.time_ns <= self._closed_until)
            self._drop(sensor, gone, members.get(sensor))
        self._number += 1
        complete = len(members) == len(self._rig.sensors)
        return FrameMessages(self._number - 1, time_ns, members, complete, max(self._newest.values()), self.jumps)

    def _centre(self, opening: int) -> int:
        """The time of the leftmost camera within the tolerance of the opening message."""
        until = opening + self._timing.tolerance_ns
        for sensor in reversed(self._rig.sensors):
            here = [w.time_ns for w in self._waiting[sensor] if opening <= w.time_ns <= until]
            if here:
                return here[0]
        return opening

    def _drop(self, sensor: int, count: int, kept: Waiting | None = None) -> None:
        dropped = self._waiting[sensor][:count]
        del self._waiting[sensor][:count]
        for waiting in dropped:
            self.held_bytes -= _bytes(waiting)
            if waiting is not kept:
                self._refuse(sensor, waiting, BETWEEN)

    def _refuse(self, sensor: int, waiting: Waiting, reason: str) -> None:
        self._counts[sensor].leave_out(
            reason, waiting.problem, waiting.against, waiting.stamp_ns, len(waiting.messages)
        )


def _bytes(waiting: Waiting) -> int:
    return sum(len(message.data) + MESSAGE_BYTES for message in waiting.messages)


class Edges:
    """Marks incomplete frames at the edges of a recording, which are not failures of a sensor."""

    def __init__(self, timing: Timing) -> None:
        # The neighbour of the first or last frame is not an edge, though jitter may bring it nearer than one period.
        self._period_ns = timing.period_ns - timing.tolerance_ns

    def groups(self, groups: Iterator[FrameMessages]) -> Iterator[FrameMessages]:
        """The same groups; those within one period of the start or the end that are incomplete are marked."""
        held: deque[FrameMessages] = deque()
        start: int | None = None
        newest = 0
        chunk = 0
        for group in groups:
            if group.chunk != chunk:
                yield from self._last(held, start, newest)
                chunk, start, newest = group.chunk, None, 0
            start = group.time_ns if start is None else start
            newest = max(newest, group.last_ns)
            held.append(group)
            while held and (
                held[0].complete or newest > held[0].time_ns + self._period_ns or len(held) > _MOST_HELD_GROUPS
            ):
                yield self._marked(held.popleft(), start, None)
        yield from self._last(held, start, newest)

    def _is_full(self, held: deque[FrameMessages]) -> bool:
        return len(held) > _MOST_HELD_GROUPS

    def _last(self, held: deque[FrameMessages], start: int | None, newest: int) -> Iterator[FrameMessages]:
        """The groups held at the end of a chunk."""
        end = max((group.time_ns for group in held), default=0)
        while held:
            yield self._marked(held.popleft(), start or 0, max(end, newest))

    def _marked(self, group: FrameMessages, start: int, end: int | None) -> FrameMessages:
        near_start = group.time_ns < start + self._period_ns
        near_end = end is not None and group.time_ns > end - self._period_ns
        if group.complete or not (near_start or near_end):
            return group
        return replace(group, edge=True)


class WholeSweep(NamedTuple):
    """A sweep with all its messages; `cut` is true for one that the beginning or the end of the recording cut."""

    waiting: Waiting
    cut: bool


class SweepAssembly:
    """Collects the parts of one sweep after the other; `period_ns` is that of whole sweeps.

    A sweep that lacks parts is damaged, but for the first and the last one of a recording, which are cut by its edges.
    """

    def __init__(self, sweep: Sweep, period_ns: int, decoders: Decoders) -> None:
        self._sweep = sweep
        self._most_ns = int(SWEEPS.most_periods * period_ns)
        self._decoders = decoders
        self._starts = SweepStarts(sweep)
        self._parts: list[Waiting] = []
        self._sectors: list[Sector | None] = []
        self._is_first = True

    def add(self, part: Waiting) -> Iterator[WholeSweep]:
        """Take the next cloud; gives the sweep that ended before it, if one did."""
        sector = self._sector(part)
        begins = self._starts.begins(sector)
        if self._parts and (begins or abs(part.time_ns - self._parts[0].time_ns) > self._most_ns):
            yield self._whole(at_edge=self._is_first)
            self._is_first = False
        self._parts.append(part)
        self._sectors.append(sector)

    def rest(self) -> Iterator[WholeSweep]:
        """The last sweep."""
        if self._parts:
            yield self._whole(at_edge=True)

    def _sector(self, part: Waiting) -> Sector | None:
        decoder = self._decoders.cloud(part.message.schema, part.message.encoding)
        if part.problem or decoder is None:
            return None
        try:
            if isinstance(decoder, PartDecoder):
                return sector_of(decoder.looks(part.message))
            return sector_of(decoder.xyz_m(part.message))
        except DecodingError:
            return None  # it is decoded again with its frame, and damaged there

    def _whole(self, *, at_edge: bool) -> WholeSweep:
        parts, self._parts = self._parts, []
        sectors, self._sectors = self._sectors, []
        lacks = self._sweep.parts - len(parts)
        problem = next((part.problem for part in parts if part.problem), "")
        if lacks > 0 and not problem:
            problem = f"the sweep has {len(parts)} of its {self._sweep.parts} parts"
        against = next((part.against for part in parts if part.against), "")
        middle = parts[timed_part(self._sweep, sectors)]
        messages = tuple(part.message for part in parts)
        whole = middle._replace(problem=problem, against=against, parts=messages)
        return WholeSweep(whole, cut=at_edge and lacks > 0)
