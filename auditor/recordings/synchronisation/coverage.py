"""The coverage of a recording's topics: those of the rig, and what became of each of the others."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

from auditor.model.checks import pasts_of
from auditor.model.coverage import TimeCoverage, TopicCoverage, TopicState
from auditor.model.rig import Rig
from auditor.recordings.decoding import Decoders, sensor_types
from auditor.recordings.decoding.sensor_types import is_of_radar, is_other, raw_data_of
from auditor.recordings.parameters import SENSOR_LIKE
from auditor.recordings.recording import Definition, Recording, Topic, Traffic
from auditor.recordings.rigs.cameras import sensor_name
from auditor.recordings.rigs.discovery import search_rigs
from auditor.recordings.rigs.left_out import AtOnePlace, Reason
from auditor.recordings.rigs.lidars import is_part_of
from auditor.recordings.synchronisation.counts import MessageCounts
from auditor.recordings.synchronisation.survey import Survey
from auditor.recordings.synchronisation.vehicles import frame_of, sharing_frames, space_of

_LATE = "it begins behind the beginning, from which rigs are found, or its name has messages of another type as well"
REMEDY = (
    "record or convert it as sensor_msgs/Image or PointCloud2 (foxglove: CompressedImage or PointCloud), "
    "or give --no-sensor {topic} where it is neither camera nor LiDAR"
)
"""What helps where nobody knows the type; `topic` is filled in."""
_OWN_FRAME = "record it in a frame of its own that tf places"
_LEAST_MESSAGES = 2  # what is published once, as a map is, is no sensor
_LEAST_S = 1.0  # shorter recordings count as so long: a rate of a moment is none


def topic_coverage(
    recording: Recording,
    rig: Rig,
    survey: Survey,
    counts: Mapping[int, MessageCounts],
    times: Mapping[int, TimeCoverage],
) -> tuple[TopicCoverage, ...]:
    """One entry a topic of camera pictures or LiDAR points, the rig's sensors first. The read must be exhausted."""
    of_rig = tuple(_of_sensor(recording, rig, survey, sensor, counts[sensor], times[sensor]) for sensor in rig.sensors)
    held_s = max((time.held_ns for time in times.values()), default=0) / 1e9
    outside = outside_topics(recording, survey, rig, held_s)
    return of_rig + tuple(one for one in outside if one.state is not TopicState.NO_SENSOR)


def outside_topics(
    recording: Recording, survey: Survey, rig: Rig | None = None, held_s: float = 0.0
) -> tuple[TopicCoverage, ...]:
    """What became of every topic with messages that is not in the rig. The read must be exhausted.

    `held_s` is the time of the recording's frames in seconds.
    """
    topics = {rig.topic(sensor) for sensor in rig.sensors} if rig else set()
    traffic = recording.traffic
    unreadable = [one for one in _unreadable(survey, traffic) if one.topic not in topics]
    left_out = _left_out(recording, survey, rig, topics)
    accounted = _accounted(recording, survey, traffic)
    others = {topic: found for topic, found in traffic.items() if found.messages and topic not in accounted}
    return (*unreadable, *left_out, *_unlisted(recording, others, held_s))


def _accounted(recording: Recording, survey: Survey, traffic: Iterable[Topic]) -> set[Topic]:
    """The topics that are read as sensors, calibrations or transforms, and those that are said to be unreadable."""
    decoders = Decoders(recording.definition)
    sensors = {image.topic.name for image in survey.images} | {cloud.topic.name for cloud in survey.clouds}
    by_name = {topic.name: topic for topic in recording.topics()}

    def is_read(topic: Topic) -> bool:
        decoder = decoders.of(topic.schema, topic.encoding)
        if decoder is None:
            return False
        return topic.name in sensors if decoder.kind in sensor_types.KINDS else by_name.get(topic.name) == topic

    return {topic for topic in traffic if is_read(topic)} | {one.topic for one in survey.unreadable}


def _unlisted(recording: Recording, others: Mapping[Topic, Traffic], held_s: float) -> Iterator[TopicCoverage]:
    """The topics that the survey did not meet: sensors by their type, or by their data, or none."""
    decoders = Decoders(recording.definition)
    for topic, traffic in sorted(others.items(), key=lambda entry: (entry[0].name, entry[0].schema)):
        decoder, listed = decoders.in_any_encoding(topic.schema), sensor_types.UNREAD.get(topic.schema)
        if decoder is not None and decoder.kind in sensor_types.KINDS:
            kind, remedy = sensor_types.KINDS[decoder.kind], sensor_types.remedy_of(topic.schema)
            if other := _other_content(topic, kind, traffic):
                yield _outside(topic, kind, TopicState.LEFT_OUT, traffic.messages, other)
            else:
                yield _outside(topic, kind, TopicState.UNREADABLE, traffic.messages, _LATE, remedy)
        elif listed:
            yield _outside(topic, listed.kind, TopicState.UNREADABLE, traffic.messages, _LATE, listed.remedy)
        elif reason := sensor_types.ONE_ROW.get(topic.schema):
            yield _outside(topic, sensor_types.LIDAR, TopicState.LEFT_OUT, traffic.messages, reason)
        elif why := why_a_sensor(topic, traffic, held_s, recording.definition(topic.schema)):
            remedy = REMEDY.format(topic=topic.name)
            yield _outside(topic, sensor_types.UNKNOWN, TopicState.UNREADABLE, traffic.messages, why, remedy)
        else:
            none = why_none(topic, traffic, held_s)
            yield _outside(topic, sensor_types.UNKNOWN, TopicState.NO_SENSOR, traffic.messages, none)


def _outside(
    topic: Topic, kind: sensor_types.SensorKind, state: TopicState, messages: int, reason: str, remedy: str = ""
) -> TopicCoverage:
    name = sensor_name(topic.name)
    return TopicCoverage(topic.name, topic.schema, kind, state, None, name, messages, reason=reason, remedy=remedy)


def _of_sensor(
    recording: Recording, rig: Rig, survey: Survey, sensor: int, counts: MessageCounts, time: TimeCoverage
) -> TopicCoverage:
    topic = rig.topic(sensor)
    unreadable = next((one for one in survey.unreadable if one.topic.name == topic), None)
    unread = unreadable is not None and not counts.used
    schema = next((known.schema for known in recording.topics() if known.name == topic), "")
    return TopicCoverage(
        topic,
        schema,
        sensor_types.LIDAR if sensor in rig.lidars else sensor_types.CAMERA,
        TopicState.UNREADABLE if unread else TopicState.READ,
        sensor,
        rig.name(sensor),
        counts.read,
        counts.regular,
        dict(sorted(counts.against.items())),
        time,
        unreadable.reason if unreadable and unread else "",
        unreadable.remedy if unreadable and unread else "",
    )


def _unreadable(survey: Survey, traffic: Mapping[Topic, Traffic]) -> Iterator[TopicCoverage]:
    for sensor in survey.unreadable:
        own_traffic = traffic.get(sensor.topic, Traffic())
        if not own_traffic.messages:
            continue
        if other := _other_content(sensor.topic, sensor.kind, own_traffic) or sensor_types.other_content(sensor.reason):
            yield _outside(sensor.topic, sensor.kind, TopicState.LEFT_OUT, own_traffic.messages, other)
        else:
            yield _outside(
                sensor.topic, sensor.kind, TopicState.UNREADABLE, own_traffic.messages, sensor.reason, sensor.remedy
            )


def _other_content(topic: Topic, kind: sensor_types.SensorKind, traffic: Traffic) -> str:
    """Why a topic that cannot be read is plainly no camera and no LiDAR, by its sizes; empty where it may be."""
    least = sensor_types.LEAST_BYTES.get(topic.schema, 0)
    mean = traffic.size_bytes / traffic.messages
    return f"packets of {mean:.0f} bytes are not a {kind}'s, which have {least} at least" if mean < least else ""


def _left_out(recording: Recording, survey: Survey, rig: Rig | None, topics: set[str]) -> Iterator[TopicCoverage]:
    images = [(image.topic, sensor_types.CAMERA) for image in survey.images]
    clouds = [(cloud.topic, sensor_types.LIDAR) for cloud in survey.clouds]
    outside = [(topic, kind) for topic, kind in (*images, *clouds) if topic.name not in topics]
    if not outside:
        return
    search, counted = search_rigs(survey), recording.counts
    spaces = sharing_frames(survey.frames)
    of_rigs = topics.union(*(map(one.topic, one.sensors) for one in search.rigs))
    compared = _frames_of(survey, of_rigs, spaces)
    own = rig is None or rig.rig_id in {one.rig_id for of in search.rigs for one in (of, *pasts_of(of))}
    for topic, kind in outside:
        if own and _is_of_any(topic, search.rigs):
            continue  # it is audited with another rig of this recording
        told = next((why for why in search.left_out if why.tells_of(topic.name, sensor_name(topic.name))), None)
        why = _why_left_out(topic, kind, rig, search.rigs, told)
        if apart := _apart(survey, topic.name, of_rigs, spaces) if own else "":
            why = f"it has points where {apart} has none, in the same frame: another LiDAR; {_OWN_FRAME}"
        at_one_place = isinstance(told, AtOnePlace) and not space_of(topic.name, spaces)
        of_one_sensor = at_one_place or not compared.isdisjoint(_frames_of(survey, {topic.name}, spaces))
        # Who wrote a rig file chose what it leaves out.
        state = TopicState.LEFT_OUT if not own or (of_one_sensor and not apart) else TopicState.NOT_COMPARED
        yield _outside(topic, kind, state, counted.get(topic.name, 0), why)


def _apart(survey: Survey, topic: str, of_rigs: Collection[str], spaces: Collection[str]) -> str:
    """The LiDAR of a rig in whose frame a topic's points are, but no part of its own; empty where there is none."""
    frames = _frames_of(survey, {topic}, spaces)
    clouds = [cloud for cloud in survey.clouds if cloud.topic.name == topic]
    others = [
        cloud
        for cloud in survey.clouds
        if cloud.topic.name in of_rigs and not frames.isdisjoint(_frames_of(survey, {cloud.topic.name}, spaces))
    ]
    apart = bool(clouds and others) and not any(is_part_of(clouds[0], other) for other in others)
    return others[0].topic.name if apart else ""


def _frames_of(survey: Survey, topics: Collection[str], spaces: Collection[str]) -> set[str]:
    """The coordinate frames of some topics of sensors: topics of one frame are of one sensor, in each of `spaces`."""
    return {frame_of(frame, topic, spaces) for topic, frame in survey.frames if topic in topics and frame}


def _why_left_out(
    topic: Topic, kind: sensor_types.SensorKind, rig: Rig | None, rigs: Sequence[Rig], told: Reason | None
) -> str:
    if _is_of_any(topic, rigs):
        return "the given rig does not have it"
    if told is not None:
        return told.text
    if rig is None:
        return "the recording has no rig"
    if kind == sensor_types.LIDAR and rig.lidar:
        names = dict.fromkeys(one.lidar.name for one in (rig, *rigs) if one.lidar)
        one_of = f"the LiDAR {', '.join(names)} covers" if len(names) == 1 else f"the LiDARs {', '.join(names)} cover"
        return f"{one_of} what the cameras see, and {'has' if len(names) == 1 else 'have'} more points"
    return "the rig does not have it: another topic of the same camera is used, or it has no place beside the others"


def _is_of_any(topic: Topic, rigs: Sequence[Rig]) -> bool:
    return any(topic.name in map(rig.topic, rig.sensors) for rig in rigs)


def why_a_sensor(topic: Topic, traffic: Traffic, held_s: float, definition: Definition | None) -> str:
    """Why a topic of an unlisted type may be a sensor, in words with its rates; empty where it is plainly none.

    `held_s` is the time of the recording's frames in seconds.
    """
    if is_other(topic.schema) or not _is_much(topic, traffic, held_s, definition):
        return ""
    raw = raw_data_of(definition)
    holds = f", whose definition holds {raw}," if raw else ""
    return f"the type {topic.schema or 'without a name'}{holds} is not known; {_rates(traffic, held_s)}"


def why_none(topic: Topic, traffic: Traffic, held_s: float) -> str:
    """Why a topic is neither camera nor LiDAR where `why_a_sensor` says nothing."""
    if is_other(topic.schema):
        return f"{topic.schema} carries no pictures and no points"
    return f"too little for a camera or LiDAR: {_rates(traffic, held_s)}"


def _is_much(topic: Topic, traffic: Traffic, held_s: float, definition: Definition | None) -> bool:
    seconds = max(held_s, _LEAST_S)
    if traffic.messages < max(_LEAST_MESSAGES, SENSOR_LIKE.least_hz * seconds):
        return False
    per_s = traffic.size_bytes / seconds
    if per_s >= SENSOR_LIKE.bytes_per_s:
        return True
    return per_s >= SENSOR_LIKE.blob_bytes_per_s and not is_of_radar(topic.schema) and bool(raw_data_of(definition))


def _rates(traffic: Traffic, held_s: float) -> str:
    seconds = max(held_s, _LEAST_S)
    mean, per_s = traffic.size_bytes / max(traffic.messages, 1), traffic.size_bytes / seconds
    return (
        f"{traffic.messages} messages of {mean:,.0f} bytes, {traffic.messages / seconds:.3g} a second, "
        f"{per_s / 1000:,.1f} kB/s"
    )
