"""Frames from messages: the data of all sensors, brought together by the stamps of their headers.

Where a stamp cannot be the time of capture, the time of recording less the sensor's usual delay stands in for it, see
`clocks`: a frame's stamp orders the frames also then.

Every sensor has a constant offset to the leftmost camera, learnt from the recording's beginning. A frame opens with the
oldest message not yet used; the leftmost camera that is present gives its time, and every sensor's nearest message
within the tolerance belongs to it. Waiting messages stay as recorded; pixels and points are decoded when the frame is
complete.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from heapq import merge

import numpy as np

from auditor.errors import DecodingError
from auditor.model.coverage import Against, TopicCoverage
from auditor.model.frames import (
    CameraImage,
    Frame,
    Message,
    PointCloud,
    Presence,
    SensorState,
    SkippedFrame,
    TopicBalance,
)
from auditor.model.rig import LIDAR, Rig
from auditor.recordings.decoding import Decoder, Decoders, DeepImageDecoder, FollowingDecoder
from auditor.recordings.decoding.pictures import check_received, grey_if_grey
from auditor.recordings.recording import Damage, Recording
from auditor.recordings.rigs.changes import WHOLE, Stretch, stretch_at
from auditor.recordings.rigs.discovery import MIN_SENSORS, check_rig
from auditor.recordings.synchronisation.clocks import DUPLICATE, StampCheck, learn_timing
from auditor.recordings.synchronisation.counts import EDGE, TOO_FEW, MessageCounts, TimeLedger, counts_of
from auditor.recordings.synchronisation.coverage import topic_coverage
from auditor.recordings.synchronisation.survey import Survey
from auditor.recordings.synchronisation.window import (
    Edges,
    FrameMessages,
    MessageWindow,
    SweepAssembly,
    Waiting,
    WholeSweep,
)


class FrameStream:
    """An iterable of frames and skipped frames; each iteration reads the recording again.

    `balance`, `coverage`, `damage`, `undecoded` and `clock_jumps` (how often the clock jumped back) describe the last
    iteration and are complete once it is exhausted.
    """

    def __init__(
        self, recording: Recording, rig: Rig, survey: Survey, *, colour: bool, stretches: Sequence[Stretch] = WHOLE
    ) -> None:
        self._recording = recording
        self._rig = rig
        self._survey = survey
        self._colour = colour
        self._stretches = stretches
        self.timing = learn_timing(rig, survey)
        self._counts: dict[int, MessageCounts] = {}
        self._time = TimeLedger(rig.sensors, self.timing.period_ns)
        self._decoders = Decoders(recording.definition, rig.units_m, survey.metadata)
        self._shared: Iterator[Message] | None = None
        self._disorder_ns = 0
        self.clock_jumps = 0

    @property
    def topics(self) -> frozenset[str]:
        """The topics of the rig's sensors."""
        return frozenset(self._rig.topic(sensor) for sensor in self._rig.sensors)

    def take_from(self, messages: Iterator[Message]) -> None:
        """Take the messages of the next iteration, the only one there is, from a read that is somebody else's."""
        assert self._survey.interleaved
        self._shared = messages

    def __iter__(self) -> Iterator[Frame | SkippedFrame]:
        maker = self._begun()
        for group in Edges(self.timing).groups(self._groups(maker.decoders)):
            place = stretch_at(self._stretches, group.time_ns)
            if place is None:
                maker.leave(group)
            else:
                yield maker.make(group, place, self._stretches[place].reason)

    def chosen(self, frames: Collection[int]) -> Iterator[Frame | SkippedFrame]:
        """Some frames alone, by their numbers, in their order: no others are decoded, and what is counted is theirs."""
        maker = self._begun()
        for group in self._chosen_groups(frames, maker.decoders):
            place = stretch_at(self._stretches, group.time_ns)
            if place is not None:
                yield maker.make(group, place, self._stretches[place].reason)

    def recorded_at(self, frames: Collection[int]) -> dict[int, tuple[int, int]]:
        """When the first and the last message of some frames were recorded (log times), by the frames' numbers."""
        times = {}
        for group in self._chosen_groups(frames, self._begun().decoders):
            of_members = [part.log_time_ns for one in group.members.values() for part in one.messages]
            times[group.number] = (min(of_members), max(of_members))
        return times

    def _begun(self) -> "_FrameMaker":
        """What makes the frames of a new read, of which nothing is counted yet."""
        self._disorder_ns = 0
        self._counts = counts_of(self._rig.sensors, self.timing)
        self._time = TimeLedger(self._rig.sensors, self.timing.period_ns)
        self._decoders = Decoders(self._recording.definition, self._rig.units_m, self._survey.metadata)
        return _FrameMaker(
            self._rig, self._decoders, self._counts, self._time, self._lidars_start_ns, colour=self._colour
        )

    def _chosen_groups(self, frames: Collection[int], decoders: Decoders) -> Iterator[FrameMessages]:
        """The groups of some frames; the recording is not read behind the last one."""
        wanted = set(frames)
        groups = self._groups(decoders)
        while wanted and (group := next(groups, None)) is not None:
            if group.number in wanted:
                wanted.discard(group.number)
                yield group

    def _groups(self, decoders: Decoders) -> Iterator[FrameMessages]:
        window = MessageWindow(self._rig, self.timing, self._counts)
        by_topic = {self._rig.topic(sensor): sensor for sensor in self._rig.sensors}
        for sensor, waiting in self._arrivals(by_topic, decoders):
            window.add(sensor, waiting)
            yield from window.closed()
        yield from window.rest()
        self.clock_jumps = window.jumps

    def _arrivals(self, by_topic: Mapping[str, int], decoders: Decoders) -> Iterator[tuple[int, Waiting]]:
        if self._survey.interleaved:
            messages = self._recording.messages(by_topic.keys()) if self._shared is None else self._shared
            streams = [self._stamped(messages, by_topic, decoders)]
        else:
            # The topics lie one after the other in the file: each gets a read of its own, and the reads are merged.
            streams = [
                self._stamped(self._recording.messages({topic}), by_topic, decoders) for topic in sorted(by_topic)
            ]
        return merge(*streams, key=lambda arrival: arrival[1].time_ns) if len(streams) > 1 else streams[0]

    def _stamped(
        self, messages: Iterator[Message], by_topic: Mapping[str, int], decoders: Decoders
    ) -> Iterator[tuple[int, Waiting]]:
        checks = {sensor: self.timing.stamp_check(sensor) for sensor in by_topic.values()}
        sweeps = {sensor: self._assembly(sensor, decoders) for sensor in by_topic.values()}
        newest_ns = 0
        for order, message in enumerate(messages):
            sensor = by_topic[message.topic]
            newest_ns = max(newest_ns, message.log_time_ns)
            self._disorder_ns = max(self._disorder_ns, newest_ns - message.log_time_ns)
            self._counts[sensor].read += 1
            waiting = self._placed(message, order, self.timing.offset_ns[sensor], checks[sensor], decoders)
            if waiting is None:
                self._counts[sensor].skip_duplicate()
            elif (parts := sweeps[sensor]) is not None:
                yield from self._whole(sensor, parts.add(waiting))
            else:
                yield sensor, waiting
        for sensor, parts in sweeps.items():
            if parts is not None:
                yield from self._whole(sensor, parts.rest())

    def _assembly(self, sensor: int, decoders: Decoders) -> SweepAssembly | None:
        """What puts the clouds of a LiDAR together, where they are parts of sweeps."""
        sweep = self._rig.lidars[sensor].sweep if sensor in self._rig.lidars else None
        period_ns = self.timing.own_period_ns.get(sensor, self.timing.period_ns)
        return SweepAssembly(sweep, period_ns, decoders) if sweep is not None else None

    def _whole(self, sensor: int, sweeps: Iterator[WholeSweep]) -> Iterator[tuple[int, Waiting]]:
        for sweep in sweeps:
            if sweep.cut:
                self._counts[sensor].skip(EDGE, messages=len(sweep.waiting.messages))
            else:
                yield sensor, sweep.waiting

    def _placed(
        self, message: Message, order: int, offset_ns: int, check: StampCheck, decoders: Decoders
    ) -> Waiting | None:
        """The message at its time, or None for an exact duplicate."""
        decoder = decoders.of(message.schema, message.encoding)
        if decoder is None or decoder.kind == "transforms":
            problem = f"{message.schema or 'a message without schema'} is not data of a sensor"
        else:
            try:
                stamp_ns = decoder.header(message).stamp_ns
            except DecodingError as error:
                problem = error.what
            else:
                placed = check.place(stamp_ns, message.log_time_ns, message.data)
                if placed.against == DUPLICATE:
                    return None
                self._follow(decoder, message)
                return Waiting(placed.time_ns - offset_ns, order, placed.time_ns, message, "", placed.against)
            self._follow(decoder, message)
        # A message without a readable stamp still belongs to a frame: there it is damaged, not missing.
        time_ns = check.of_recording(message.log_time_ns)
        return Waiting(time_ns - offset_ns, order, time_ns, message, problem)

    def _follow(self, decoder: Decoder, message: Message) -> None:
        if isinstance(decoder, FollowingDecoder):
            decoder.follow(message)

    @property
    def _lidars_start_ns(self) -> dict[int, int]:
        """When the first cloud with points was recorded of each LiDAR whose first one has none."""
        starts_ns = {cloud.topic.name: cloud.starts_ns for cloud in self._survey.clouds if cloud.starts_ns}
        lidars = self._rig.lidars.items()
        return {sensor: starts_ns[lidar.topic] for sensor, lidar in lidars if lidar.topic in starts_ns}

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on clocks that were put together, and on the order and the repairs of the last one's messages."""
        start = [f"{self._rig.name(sensor)} {_STARTS}" for sensor in self._lidars_start_ns]
        return (*self.timing.remarks, *start, *self._decoders.repairs, *filter(None, [self._out_of_order]))

    @property
    def _out_of_order(self) -> str:
        """That messages lie so far out of order that frames lack some; empty where none do, or a clock was set back."""
        lost = any({Against.LATE, Against.BACK} & counts.against.keys() for counts in self._counts.values())
        if not lost or self.clock_jumps or self._disorder_ns <= self.timing.period_ns:
            return ""
        by = f"{self._disorder_ns / 1e9:.1f} s"
        return (
            f"its messages lie out of order by up to {by}, and not all could be put together: sort them by their log "
            "times (an MCAP file by mcap sort), and scan again"
        )

    @property
    def damage(self) -> tuple[Damage, ...]:
        """The parts that the recording's reader could not read."""
        return self._recording.damage

    @property
    def undecoded(self) -> tuple[str, ...]:
        """How many messages of each sensor could not be decoded, since when and why; nothing of the others."""
        begin_ns = min((sample.time_ns for sample in self._survey.samples(self._rig.topic(self._rig.n))), default=0)
        counted = [(self._rig.name(sensor), self._counts[sensor]) for sensor in sorted(self._counts)]
        return tuple(f"{name}: {counts.undecoded(begin_ns)}" for name, counts in counted if counts.problems)

    @property
    def balance(self) -> tuple[TopicBalance, ...]:
        """Where the messages of every topic went.

        Messages of topics that belong to no sensor of the rig are `unused`. So are camera infos and transforms: the
        rig is made of the first ones in a read of its own.
        """
        sensors = {self._rig.topic(sensor): sensor for sensor in self._rig.sensors}
        balance = []
        counted = self._recording.counts
        for topic in self._recording.topics():
            sensor = sensors.get(topic.name)
            read = counted.get(topic.name, 0)
            counts = self._counts[sensor] if sensor in self._counts else MessageCounts(read=read, unused=read)
            use = counts.read, counts.used, counts.unused, counts.damaged, dict(counts.skipped)
            balance.append(TopicBalance(topic.name, topic.schema, sensor, *use))
        return tuple(balance)

    @property
    def coverage(self) -> tuple[TopicCoverage, ...]:
        """How much of each topic of camera pictures or LiDAR points was audited, those outside the rig included."""
        covered = self._time.finish()
        if self._out_of_order:  # where a sensor's messages begin and end is not known then
            covered = {sensor: replace(time, late_ns=0, early_ns=0) for sensor, time in covered.items()}
        return topic_coverage(self._recording, self._rig, self._survey, self._counts, covered)


def synchronise(
    recording: Recording, rig: Rig, survey: Survey, *, colour: bool = False, stretches: Sequence[Stretch] = WHOLE
) -> FrameStream:
    """The frames of a recording, in order; with `colour` images keep their colours as BGR.

    Outside the `stretches` another rig is in force: its frames are left out, and their numbers with them. Offsets that
    the rig gives replace learnt ones. Raises RigError where the rig does not fit the recording. The window holds at
    most MOST_WAITING_BYTES of messages as recorded.
    """
    check_rig(rig, survey)
    return FrameStream(recording, rig, survey, colour=colour, stretches=stretches)


_STARTS = "has hardly a point at the recording's beginning: a LiDAR that has not started shows nothing"

_MOST_STRETCHES = 1 << 16
"""The time between two stretches is no gap: like the time before a clock was set back, each is counted by itself."""


class _FrameMaker:
    """Decodes the messages of a group."""

    def __init__(
        self,
        rig: Rig,
        decoders: Decoders,
        counts: Mapping[int, MessageCounts],
        time: TimeLedger,
        lidars_start_ns: Mapping[int, int],
        *,
        colour: bool,
    ) -> None:
        self._rig = rig
        self.decoders = decoders
        self._counts = counts
        self._time = time
        self._lidars_start_ns = lidars_start_ns
        self._colour = colour

    def leave(self, group: FrameMessages) -> None:
        """Count the messages of a frame that belongs to another rig."""
        for sensor, waiting in group.members.items():
            self._counts[sensor].unused += len(waiting.messages)

    def make(self, group: FrameMessages, stretch: int = 0, reason: str = "") -> Frame | SkippedFrame:
        """The frame, or a Skipped with the reason why there is none, such as that of the stretch it lies in."""
        group = replace(group, chunk=group.chunk * _MOST_STRETCHES + stretch)
        stamp_ns = self._stamp_ns(group.members) if group.members else group.time_ns
        if group.edge or reason:
            return self._skip(group, stamp_ns, EDGE if group.edge else reason, group.members)
        fewest = 1 if self._rig.others else min(MIN_SENSORS, len(self._rig.sensors))
        if len(group.members) < fewest:
            return self._skip(group, stamp_ns, TOO_FEW, group.members)
        images: dict[int, CameraImage] = {}
        clouds: dict[int, PointCloud] = {}
        problems: dict[int, str] = {}
        for sensor, waiting in group.members.items():
            try:
                if sensor in self._rig.lidars:
                    clouds[sensor] = self._cloud(sensor, waiting)
                else:
                    images[sensor] = self._image(sensor, waiting)
            except DecodingError as error:
                problems[sensor] = error.what
                self._counts[sensor].damage(error.what, waiting.stamp_ns, len(waiting.messages))
        good = {sensor: waiting for sensor, waiting in group.members.items() if sensor not in problems}
        if len(good) < fewest:
            return self._skip(group, stamp_ns, TOO_FEW, good)
        for sensor, waiting in good.items():
            self._counts[sensor].use(waiting.against, len(waiting.messages))
        self._time.add(group.chunk, group.time_ns, [sensor for sensor, waiting in good.items() if not waiting.against])
        stamp_ns = self._stamp_ns(good)
        presence = {sensor: self._presence(sensor, group, stamp_ns, problems) for sensor in self._rig.sensors}
        return Frame(group.number, stamp_ns, presence, clouds.pop(LIDAR, None), images, clouds)

    def _presence(self, sensor: int, group: FrameMessages, stamp_ns: int, problems: Mapping[int, str]) -> Presence:
        waiting = group.members.get(sensor)
        if waiting is None:
            return Presence(SensorState.MISSING)
        skew_ns = waiting.time_ns - stamp_ns
        if sensor in problems:
            return Presence(SensorState.DAMAGED, skew_ns, problems[sensor])
        return Presence(SensorState.PRESENT, skew_ns)

    def _stamp_ns(self, members: Mapping[int, Waiting]) -> int:
        return members[max(members)].time_ns

    def _skip(self, group: FrameMessages, stamp_ns: int, reason: str, members: Mapping[int, Waiting]) -> SkippedFrame:
        """Count some members of a group that makes no frame."""
        for sensor, waiting in members.items():
            self._counts[sensor].leave_out(
                reason, waiting.problem, waiting.against, waiting.stamp_ns, len(waiting.messages)
            )
        self._time.add(group.chunk, group.time_ns, ())
        return SkippedFrame(group.number, stamp_ns, reason, self._culprit(members))

    def _culprit(self, there: Mapping[int, Waiting]) -> int | None:
        """The sensor that the frame lacks, where it is only one."""
        lacking = [sensor for sensor in self._rig.sensors if sensor not in there]
        return lacking[0] if len(lacking) == 1 else None

    def _image(self, sensor: int, waiting: Waiting) -> CameraImage:
        camera = self._rig.camera(sensor)
        decoder = self.decoders.image(waiting.message.schema, waiting.message.encoding)
        if waiting.problem or decoder is None:
            raise DecodingError(waiting.problem or "this is not an image", where=camera.topic)
        if camera.depth_bits is not None and isinstance(decoder, DeepImageDecoder):
            decoder.use_depth(camera.topic, camera.depth_bits)
        pixels = decoder.pixels(waiting.message, colour=self._colour, size_px=(camera.width_px, camera.height_px))
        check_received(pixels)
        return CameraImage(sensor, waiting.stamp_ns, grey_if_grey(pixels))

    def _cloud(self, sensor: int, waiting: Waiting) -> PointCloud:
        decoder = self.decoders.cloud(waiting.message.schema, waiting.message.encoding)
        if waiting.problem or decoder is None:
            raise DecodingError(waiting.problem or "this is not a point cloud", where=waiting.message.topic)
        if waiting.messages[-1].log_time_ns < self._lidars_start_ns.get(sensor, 0):
            raise DecodingError(f"{self._rig.name(sensor)} {_STARTS}", where=waiting.message.topic)
        parts = [decoder.xyz_m(message) for message in waiting.messages]
        xyz_m = parts[0] if len(parts) == 1 else np.concatenate(parts)
        if not xyz_m.any():  # missing returns may be written as zeros
            raise DecodingError("it shows nothing: no beam of it returned", where=waiting.message.topic)
        return PointCloud(waiting.stamp_ns, xyz_m)
