"""Frames from messages: the data of all sensors, brought together by the stamps of their headers.

Every sensor has a constant offset to the leftmost camera, learnt from the recording's beginning. A frame opens with the
oldest message not yet used; the leftmost camera that is present gives its time, and every sensor's nearest message
within the tolerance belongs to it. Waiting messages stay as recorded; pixels and points are decoded when the frame is
complete.
"""

from collections.abc import Iterator, Mapping
from heapq import merge

from auditor.errors import DecodingError
from auditor.model.frames import CameraImage, Frame, Message, PointCloud, Presence, SensorState, Skipped, TopicBalance
from auditor.model.rig import LIDAR, Rig
from auditor.recordings.decoding import Decoders, DeepImageDecoder, FollowingDecoder
from auditor.recordings.recording import Damage, Recording
from auditor.recordings.rigs.discovery import MIN_SENSORS, check_rig
from auditor.recordings.synchronisation.clock_offsets import learn_timing
from auditor.recordings.synchronisation.survey import Survey
from auditor.recordings.synchronisation.window import EDGE, TOO_FEW, Counts, Edges, Group, Waiting, Window


class FrameStream:
    """An iterable of frames and skipped frames; each iteration reads the recording again.

    `balance`, `damage` and `clock_jumps` (how often the clock jumped back) describe the last iteration and are complete
    once it is exhausted.
    """

    def __init__(self, recording: Recording, rig: Rig, survey: Survey, *, colour: bool) -> None:
        self._recording = recording
        self._rig = rig
        self._survey = survey
        self._colour = colour
        self.timing = learn_timing(rig, survey)
        self._counts: dict[int, Counts] = {}
        self.clock_jumps = 0

    def __iter__(self) -> Iterator[Frame | Skipped]:
        self._counts = {sensor: Counts() for sensor in self._rig.sensors}
        decoders = Decoders(self._recording.definition)
        window = Window(self._rig, self.timing, self._counts)
        maker = _FrameMaker(self._rig, decoders, self._counts, colour=self._colour)
        for group in Edges(self.timing).groups(self._groups(window, decoders)):
            yield maker.make(group)

    def _groups(self, window: Window, decoders: Decoders) -> Iterator[Group]:
        by_topic = {self._rig.topic(sensor): sensor for sensor in self._rig.sensors}
        for sensor, waiting in self._arrivals(by_topic, decoders):
            window.add(sensor, waiting)
            yield from window.closed()
        yield from window.rest()
        self.clock_jumps = window.jumps

    def _arrivals(self, by_topic: Mapping[str, int], decoders: Decoders) -> Iterator[tuple[int, Waiting]]:
        if self._survey.interleaved:
            streams = [self._stamped(self._recording.messages(by_topic.keys()), by_topic, decoders)]
        else:
            # The topics lie one after the other in the file: each gets a read of its own, and the reads are merged.
            streams = [
                self._stamped(self._recording.messages({topic}), by_topic, decoders) for topic in sorted(by_topic)
            ]
        return merge(*streams, key=lambda arrival: arrival[1].time_ns) if len(streams) > 1 else streams[0]

    def _stamped(
        self, messages: Iterator[Message], by_topic: Mapping[str, int], decoders: Decoders
    ) -> Iterator[tuple[int, Waiting]]:
        for order, message in enumerate(messages):
            sensor = by_topic[message.topic]
            self._counts[sensor].read += 1
            stamp_ns, problem = self._stamp(sensor, message, decoders)
            yield sensor, Waiting(stamp_ns - self.timing.offset_ns[sensor], order, stamp_ns, message, problem)

    def _stamp(self, sensor: int, message: Message, decoders: Decoders) -> tuple[int, str]:
        decoder = decoders.of(message.schema, message.encoding)
        if decoder is None or decoder.kind == "transforms":
            problem = f"{message.schema or 'a message without schema'} is not data of a sensor"
        else:
            if isinstance(decoder, FollowingDecoder):
                decoder.follow(message)
            try:
                return decoder.header(message).stamp_ns or message.log_time_ns, ""
            except DecodingError as error:
                problem = error.what
        # A message without a readable stamp still belongs to a frame: there it is damaged, not missing.
        return message.log_time_ns - self.timing.delay_ns[sensor], problem

    @property
    def damage(self) -> tuple[Damage, ...]:
        """The parts that the recording's reader could not read."""
        return self._recording.damage

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
            if sensor is None or sensor not in self._counts:
                read = counted.get(topic.name, 0)
                balance.append(TopicBalance(topic.name, topic.schema, sensor, read=read, unused=read))
            else:
                counts = self._counts[sensor]
                balance.append(
                    TopicBalance(
                        topic.name,
                        topic.schema,
                        sensor,
                        counts.read,
                        counts.used,
                        0,
                        counts.damaged,
                        dict(counts.skipped),
                    )
                )
        return tuple(balance)


def synchronise(recording: Recording, rig: Rig, survey: Survey, *, colour: bool = False) -> FrameStream:
    """The frames of a recording, in order; with `colour` images keep their colours as BGR.

    Offsets that the rig gives replace learnt ones. Raises RigError where the rig does not fit the recording. The
    window holds at most MAX_WINDOW_BYTES of messages as recorded.
    """
    check_rig(rig, survey)
    return FrameStream(recording, rig, survey, colour=colour)


class _FrameMaker:
    """Decodes the messages of a group."""

    def __init__(self, rig: Rig, decoders: Decoders, counts: Mapping[int, Counts], *, colour: bool) -> None:
        self._rig = rig
        self._decoders = decoders
        self._counts = counts
        self._colour = colour

    def make(self, group: Group) -> Frame | Skipped:
        """The frame, or a Skipped with the reason why there is none."""
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

    def _presence(self, sensor: int, group: Group, stamp_ns: int, problems: Mapping[int, str]) -> Presence:
        waiting = group.members.get(sensor)
        if waiting is None:
            return Presence(SensorState.MISSING)
        skew_ns = waiting.time_ns - stamp_ns
        if sensor in problems:
            return Presence(SensorState.DAMAGED, skew_ns, problems[sensor])
        return Presence(SensorState.PRESENT, skew_ns)

    def _stamp_ns(self, members: Mapping[int, Waiting]) -> int:
        return members[max(members)].time_ns

    def _skip(self, group: Group, stamp_ns: int, reason: str) -> Skipped:
        for sensor, waiting in group.members.items():
            if waiting.problem:
                self._counts[sensor].damaged += 1
            else:
                self._counts[sensor].skip(reason)
        return Skipped(group.number, stamp_ns, reason, self._culprit(group.members))

    def _skip_rest(self, group: Group, stamp_ns: int, good: Mapping[int, Waiting]) -> Skipped:
        for sensor in good:
            self._counts[sensor].skip(TOO_FEW)
        return Skipped(group.number, stamp_ns, TOO_FEW, self._culprit(good))

    def _culprit(self, there: Mapping[int, Waiting]) -> int | None:
        """The sensor that the frame lacks, where it is only one."""
        lacking = [sensor for sensor in self._rig.sensors if sensor not in there]
        return lacking[0] if len(lacking) == 1 else None

    def _image(self, sensor: int, waiting: Waiting) -> CameraImage:
        camera = self._rig.camera(sensor)
        decoder = self._decoders.image(waiting.message.schema, waiting.message.encoding)
        if waiting.problem or decoder is None:
            raise DecodingError(waiting.problem or "this is not an image", where=camera.topic)
        if camera.depth_bits is not None and isinstance(decoder, DeepImageDecoder):
            decoder.use_depth(camera.topic, camera.depth_bits)
        pixels = decoder.pixels(waiting.message, colour=self._colour, size_px=(camera.width_px, camera.height_px))
        return CameraImage(sensor, waiting.stamp_ns, pixels)

    def _cloud(self, waiting: Waiting) -> PointCloud:
        decoder = self._decoders.cloud(waiting.message.schema, waiting.message.encoding)
        if waiting.problem or decoder is None:
            raise DecodingError(waiting.problem or "this is not a point cloud", where=waiting.message.topic)
        return PointCloud(waiting.stamp_ns, decoder.xyz_m(waiting.message))
