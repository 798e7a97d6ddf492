"""Messages -> frames: the sensors' data put together by the stamps of their headers.

Every sensor has a constant offset to the leftmost camera, learnt from the recording's beginning. A frame opens with the
oldest message not yet used; the leftmost camera then there gives its time, and every sensor's nearest message within
the tolerance belongs to it. What waits stays as recorded; pixels and points are decoded when the frame is handed out.
"""

from bisect import insort
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from heapq import merge
from itertools import pairwise
from statistics import median, median_low
from typing import NamedTuple

from auditor.errors import DecodingError
from auditor.frames import (
    CameraImage,
    Frame,
    Message,
    PointCloud,
    Presence,
    SensorState,
    Skipped,
    TopicBalance,
)
from auditor.recordings.decoding import Decoders
from auditor.recordings.interface import Damage, Recording
from auditor.recordings.rigs import MIN_SENSORS, check_rig
from auditor.recordings.surveying import Sample, Survey
from auditor.rig import LIDAR, Rig

MAX_TOLERANCE_NS = 50 * 10**6
DEFAULT_PERIOD_NS = 10**8
"""Where a recording is too short to show one."""

MAX_WAIT_PERIODS = 10
"""How long a frame waits for a sensor that is silent."""

MAX_WINDOW_BYTES = 96 * 2**20
FAST = 0.75
"""A sensor with a shorter period than this share of the slowest one ticks several times a frame."""

EDGE = "edge"
TOO_FEW = "too few sensors"
LATE = "late"
BETWEEN = "between frames"


class _Waiting(NamedTuple):
    """A message in the window; sorted by its stamp less the sensor's offset."""

    time_ns: int
    order: int
    stamp_ns: int
    message: Message
    problem: str


@dataclass(frozen=True)
class Timing:
    """How the sensors of a rig tick: offsets to the leftmost camera that was seen, delays from stamp to log time."""

    offset_ns: Mapping[int, int]
    delay_ns: Mapping[int, int]
    period_ns: int
    tolerance_ns: int
    fast: frozenset[int]


def learn_timing(rig: Rig, survey: Survey) -> Timing:
    """Learn offsets and periods from a survey's sample stamps (all medians)."""
    samples = {sensor: survey.samples(rig.topic(sensor)) for sensor in rig.sensors}
    seen = {sensor: sorted({sample.stamp_ns for sample in taken}) for sensor, taken in samples.items() if taken}
    periods = {
        sensor: median_low([b - a for a, b in pairwise(stamps)]) for sensor, stamps in seen.items() if len(stamps) > 1
    }
    period_ns = max(periods.values(), default=DEFAULT_PERIOD_NS)
    base = max(seen, default=LIDAR)
    return Timing(
        offset_ns={
            sensor: _offset_ns(seen.get(sensor, []), seen.get(base, []), period_ns // 2) for sensor in rig.sensors
        },
        delay_ns={sensor: _delay_ns(taken) for sensor, taken in samples.items()},
        period_ns=period_ns,
        tolerance_ns=min(period_ns // 4, MAX_TOLERANCE_NS),
        fast=frozenset(sensor for sensor, own in periods.items() if own < FAST * period_ns),
    )


def _offset_ns(stamps: list[int], base: list[int], reach_ns: int) -> int:
    """Median distance of stamps to the nearest one of the base, where there is one within reach."""
    nearest = (stamp - min(base, key=lambda other: abs(stamp - other)) for stamp in stamps if base)
    distances = [distance for distance in nearest if abs(distance) <= reach_ns]
    return int(median_low(distances)) if distances else 0


def _delay_ns(samples: tuple[Sample, ...]) -> int:
    return int(median([sample.log_time_ns - sample.stamp_ns for sample in samples])) if samples else 0


@dataclass
class _Counts:
    used: int = 0
    damaged: int = 0
    skipped: dict[str, int] = field(default_factory=dict)

    def skip(self, reason: str) -> None:
        self.skipped[reason] = self.skipped.get(reason, 0) + 1


class FrameStream:
    """An iterable of frames and skipped frames; each iteration reads the recording again.

    `balance` and `damage` describe the last iteration and are complete once it is exhausted.
    """

    def __init__(self, recording: Recording, rig: Rig, survey: Survey, *, colour: bool) -> None:
        self._recording = recording
        self._rig = rig
        self._survey = survey
        self._colour = colour
        self.timing = learn_timing(rig, survey)
        self._counts: dict[int, _Counts] = {}

    def __iter__(self) -> Iterator[Frame | Skipped]:
        self._counts = {sensor: _Counts() for sensor in self._rig.sensors}
        decoders = Decoders(self._recording.definition)
        window = _Window(self._rig, self.timing, self._counts)
        maker = _FrameMaker(self._rig, decoders, self._counts, colour=self._colour)
        for group in _Edges(self.timing).groups(self._groups(window, decoders)):
            yield maker.make(group)

    def _groups(self, window: "_Window", decoders: Decoders) -> "Iterator[_Group]":
        by_topic = {self._rig.topic(sensor): sensor for sensor in self._rig.sensors}
        for sensor, waiting in self._arrivals(by_topic, decoders):
            window.add(sensor, waiting)
            yield from window.closed()
        yield from window.rest()

    def _arrivals(self, by_topic: Mapping[str, int], decoders: Decoders) -> Iterator[tuple[int, _Waiting]]:
        if self._survey.interleaved:
            streams = [self._stamped(self._recording.messages(by_topic.keys()), by_topic, decoders)]
        else:
            # Topics that lie one after the other: one read for each, side by side.
            streams = [
                self._stamped(self._recording.messages({topic}), by_topic, decoders) for topic in sorted(by_topic)
            ]
        return merge(*streams, key=lambda arrival: arrival[1].time_ns) if len(streams) > 1 else streams[0]

    def _stamped(
        self, messages: Iterator[Message], by_topic: Mapping[str, int], decoders: Decoders
    ) -> Iterator[tuple[int, _Waiting]]:
        for order, message in enumerate(messages):
            sensor = by_topic[message.topic]
            stamp_ns, problem = self._stamp(sensor, message, decoders)
            yield sensor, _Waiting(stamp_ns - self.timing.offset_ns[sensor], order, stamp_ns, message, problem)

    def _stamp(self, sensor: int, message: Message, decoders: Decoders) -> tuple[int, str]:
        decoder = decoders.of(message.schema, message.encoding)
        if decoder is None or decoder.kind == "transforms":
            problem = f"{message.schema or 'a message without schema'} is no data of a sensor"
        else:
            try:
                return decoder.header(message).stamp_ns or message.log_time_ns, ""
            except DecodingError as error:
                problem = error.what
        # A message without a readable stamp still belongs to a frame: there it is damaged, not missing.
        return message.log_time_ns - self.timing.delay_ns[sensor], problem

    @property
    def damage(self) -> tuple[Damage, ...]:
        """What the recording's reader could not read."""
        return self._recording.damage

    @property
    def balance(self) -> tuple[TopicBalance, ...]:
        """Where the messages of every topic went.

        Messages of topics that are no sensor of the rig are `unused`; camera infos and transforms, too: the rig is
        made from the first ones in a look of its own.
        """
        sensors = {self._rig.topic(sensor): sensor for sensor in self._rig.sensors}
        balance = []
        for topic in self._recording.topics():
            read = self._recording.counts.get(topic.name, 0)
            sensor = sensors.get(topic.name)
            if sensor is None or sensor not in self._counts:
                balance.append(TopicBalance(topic.name, topic.schema, sensor, read=read, unused=read))
            else:
                counts = self._counts[sensor]
                balance.append(
                    TopicBalance(
                        topic.name, topic.schema, sensor, read, counts.used, 0, counts.damaged, dict(counts.skipped)
                    )
                )
        return tuple(balance)


def synchronise(recording: Recording, rig: Rig, survey: Survey, *, colour: bool = False) -> FrameStream:
    """The frames of a recording, in order; with `colour` images keep their colours as BGR.

    Raises RigError where the rig does not fit the recording or is not rectified. The window holds at most
    MAX_WINDOW_BYTES of messages as recorded.
    """
    check_rig(rig, survey)
    return FrameStream(recording, rig, survey, colour=colour)


@dataclass(frozen=True)
class _Group:
    """The messages of one frame. `last_ns` is the newest time seen when it was closed."""

    number: int
    time_ns: int
    members: Mapping[int, _Waiting]
    complete: bool
    last_ns: int
    edge: bool = False


class _Window:
    """Messages that wait for their frame."""

    def __init__(self, rig: Rig, timing: Timing, counts: Mapping[int, _Counts]) -> None:
        self._rig = rig
        self._timing = timing
        self._counts = counts
        self._waiting: dict[int, list[_Waiting]] = {sensor: [] for sensor in rig.sensors}
        self._newest: dict[int, int] = {}
        self._leapt_to: int | None = None
        self._closed_until: int | None = None
        self._bytes = 0
        self._number = 0

    def add(self, sensor: int, waiting: _Waiting) -> None:
        """Take in a message; one that is older than the last frame is late."""
        self._believe(sensor, waiting.time_ns)
        if self._closed_until is not None and waiting.time_ns <= self._closed_until:
            self._refuse(sensor, waiting, LATE)
            return
        insort(self._waiting[sensor], waiting)
        self._bytes += len(waiting.message.data)

    def _believe(self, sensor: int, time_ns: int) -> None:
        """Move a sensor's time on; a leap far ahead of all sensors counts once a second message confirms it.

        Else one stamp from another century would close every frame before its sensors have spoken.
        """
        wait = MAX_WAIT_PERIODS * self._timing.period_ns
        leaps = bool(self._newest) and time_ns > max(self._newest.values()) + wait
        if leaps and (self._leapt_to is None or abs(time_ns - self._leapt_to) > wait):
            self._leapt_to = time_ns
        else:
            self._newest[sensor] = time_ns

    def closed(self) -> Iterator[_Group]:
        """The frames that nothing more can come to."""
        while (opening := self._opening()) is not None and self._is_settled(opening):
            yield self._close(opening)

    def rest(self) -> Iterator[_Group]:
        """What is left at the end."""
        while (opening := self._opening(at_end=True)) is not None:
            yield self._close(opening)
        for sensor, waiting in self._waiting.items():
            self._drop(sensor, len(waiting))

    def _opening(self, *, at_end: bool = False) -> int | None:
        """The time of the oldest message that may open a frame.

        Sensors that tick faster than the slowest one do not open frames, unless the slow ones are silent.
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
        """From when on a fast sensor may open a frame: a slow one should have come."""
        if self._closed_until is None:
            return min(w[0].time_ns for w in self._waiting.values() if w) + self._timing.period_ns
        return self._closed_until + self._timing.period_ns

    def _slow_are_past(self, time_ns: int) -> bool:
        wait = MAX_WAIT_PERIODS * self._timing.period_ns
        newest = max(self._newest.values())
        return self._bytes > MAX_WINDOW_BYTES or all(
            self._newest.get(sensor, newest - wait) > time_ns + self._timing.tolerance_ns or newest > time_ns + wait
            for sensor in self._rig.sensors
            if sensor not in self._timing.fast
        )

    def _is_settled(self, opening: int) -> bool:
        """True where every sensor has given its message, has gone past, or has been waited for long enough."""
        tolerance = self._timing.tolerance_ns
        if self._bytes > MAX_WINDOW_BYTES:
            return True
        if max(self._newest.values()) > opening + MAX_WAIT_PERIODS * self._timing.period_ns:
            return True
        for sensor, waiting in self._waiting.items():
            past = self._newest.get(sensor, opening) > opening + 2 * tolerance
            here = sensor not in self._timing.fast and any(opening <= w.time_ns <= opening + tolerance for w in waiting)
            if not past and not here:
                return False
        return True

    def _close(self, opening: int) -> _Group:
        tolerance = self._timing.tolerance_ns
        time_ns = self._centre(opening)
        members: dict[int, _Waiting] = {}
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
        return _Group(self._number - 1, time_ns, members, complete, max(self._newest.values()))

    def _centre(self, opening: int) -> int:
        """The time of the leftmost camera within the tolerance of the opening message."""
        until = opening + self._timing.tolerance_ns
        for sensor in reversed(self._rig.sensors):
            here = [w.time_ns for w in self._waiting[sensor] if opening <= w.time_ns <= until]
            if here:
                return here[0]
        return opening

    def _drop(self, sensor: int, count: int, kept: _Waiting | None = None) -> None:
        dropped = self._waiting[sensor][:count]
        del self._waiting[sensor][:count]
        for waiting in dropped:
            self._bytes -= len(waiting.message.data)
            if waiting is not kept:
                self._refuse(sensor, waiting, BETWEEN)

    def _refuse(self, sensor: int, waiting: _Waiting, reason: str) -> None:
        if waiting.problem:
            self._counts[sensor].damaged += 1
        else:
            self._counts[sensor].skip(reason)


class _Edges:
    """Tells incomplete frames at the edges of a recording from those in its middle."""

    def __init__(self, timing: Timing) -> None:
        # The neighbour of the first and last frame is no edge, though jitter may bring it nearer than one period.
        self._period_ns = timing.period_ns - timing.tolerance_ns

    def groups(self, groups: Iterator[_Group]) -> Iterator[_Group]:
        """The same groups; those within one period of the start or the end that are incomplete are marked."""
        held: deque[_Group] = deque()
        start: int | None = None
        newest = 0
        for group in groups:
            start = group.time_ns if start is None else start
            newest = max(newest, group.last_ns)
            held.append(group)
            while held and (held[0].complete or newest > held[0].time_ns + self._period_ns):
                yield self._marked(held.popleft(), start, None)
        end = max((group.time_ns for group in held), default=0)
        for group in held:
            yield self._marked(group, start or 0, max(end, newest))

    def _marked(self, group: _Group, start: int, end: int | None) -> _Group:
        near_start = group.time_ns < start + self._period_ns
        near_end = end is not None and group.time_ns > end - self._period_ns
        if group.complete or not (near_start or near_end):
            return group
        return _Group(group.number, group.time_ns, group.members, group.complete, group.last_ns, edge=True)


class _FrameMaker:
    """Decodes the messages of a group."""

    def __init__(self, rig: Rig, decoders: Decoders, counts: Mapping[int, _Counts], *, colour: bool) -> None:
        self._rig = rig
        self._decoders = decoders
        self._counts = counts
        self._colour = colour

    def make(self, group: _Group) -> Frame | Skipped:
        """The frame, or why there is none."""
        stamp_ns = self._stamp_ns(group.members) if group.members else group.time_ns
        if group.edge:
            return self._skip(group, stamp_ns, EDGE)
        if len(group.members) < MIN_SENSORS:
            return self._skip(group, stamp_ns, TOO_FEW)
        images: dict[int, CameraImage] = {}
        cloud: PointCloud | None = None
        problems: dict[int, str] = {}
        for sensor, waiting in group.members.items():
            try:
                if sensor == LIDAR:
                    cloud = self._cloud(waiting)
                else:
                    images[sensor] = self._image(sensor, waiting)
            except DecodingError as error:
                problems[sensor] = error.what
                self._counts[sensor].damaged += 1
        good = {sensor: waiting for sensor, waiting in group.members.items() if sensor not in problems}
        if len(good) < MIN_SENSORS:
            return self._skip_rest(group, stamp_ns, good)
        for sensor in good:
            self._counts[sensor].used += 1
        stamp_ns = self._stamp_ns(good)
        presence = {sensor: self._presence(sensor, group, stamp_ns, problems) for sensor in self._rig.sensors}
        return Frame(group.number, stamp_ns, presence, cloud, images)

    def _presence(self, sensor: int, group: _Group, stamp_ns: int, problems: Mapping[int, str]) -> Presence:
        waiting = group.members.get(sensor)
        if waiting is None:
            return Presence(SensorState.MISSING)
        skew_ns = waiting.time_ns - stamp_ns
        if sensor in problems:
            return Presence(SensorState.DAMAGED, skew_ns, problems[sensor])
        return Presence(SensorState.PRESENT, skew_ns)

    def _stamp_ns(self, members: Mapping[int, _Waiting]) -> int:
        return members[max(members)].time_ns

    def _skip(self, group: _Group, stamp_ns: int, reason: str) -> Skipped:
        for sensor, waiting in group.members.items():
            if waiting.problem:
                self._counts[sensor].damaged += 1
            else:
                self._counts[sensor].skip(reason)
        return Skipped(group.number, stamp_ns, reason, self._culprit(group.members))

    def _skip_rest(self, group: _Group, stamp_ns: int, good: Mapping[int, _Waiting]) -> Skipped:
        for sensor in good:
            self._counts[sensor].skip(TOO_FEW)
        return Skipped(group.number, stamp_ns, TOO_FEW, self._culprit(good))

    def _culprit(self, there: Mapping[int, _Waiting]) -> int | None:
        """The sensor that the frame lacks, where it is only one."""
        lacking = [sensor for sensor in self._rig.sensors if sensor not in there]
        return lacking[0] if len(lacking) == 1 else None

    def _image(self, sensor: int, waiting: _Waiting) -> CameraImage:
        camera = self._rig.camera(sensor)
        decoder = self._decoders.image(waiting.message.schema, waiting.message.encoding)
        if waiting.problem or decoder is None:
            raise DecodingError(waiting.problem or "this is no image", where=camera.topic)
        pixels = decoder.pixels(waiting.message, colour=self._colour, size_px=(camera.width_px, camera.height_px))
        return CameraImage(sensor, waiting.stamp_ns, pixels)

    def _cloud(self, waiting: _Waiting) -> PointCloud:
        decoder = self._decoders.cloud(waiting.message.schema, waiting.message.encoding)
        if waiting.problem or decoder is None:
            raise DecodingError(waiting.problem or "this is no point cloud", where=waiting.message.topic)
        return PointCloud(waiting.stamp_ns, decoder.xyz_m(waiting.message))
