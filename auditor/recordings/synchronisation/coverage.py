"""The coverage of a recording's topics: those of the rig, and those that are unreadable or left out."""

from collections.abc import Iterator, Mapping, Sequence

from auditor.model.coverage import TimeCoverage, TopicCoverage, TopicState
from auditor.model.rig import LIDAR, Rig
from auditor.recordings.decoding import sensor_types
from auditor.recordings.recording import Recording, Topic
from auditor.recordings.rigs.cameras import sensor_name
from auditor.recordings.rigs.discovery import search_rigs
from auditor.recordings.synchronisation.counts import Counts
from auditor.recordings.synchronisation.survey import Survey


def topic_coverage(
    recording: Recording,
    rig: Rig,
    survey: Survey,
    counts: Mapping[int, Counts],
    times: Mapping[int, TimeCoverage],
) -> tuple[TopicCoverage, ...]:
    """One entry a topic of camera pictures or LiDAR points, the rig's sensors first. The read must be exhausted."""
    of_rig = tuple(_of_sensor(recording, rig, survey, sensor, counts[sensor], times[sensor]) for sensor in rig.sensors)
    return of_rig + outside_topics(recording, survey, rig)


def outside_topics(recording: Recording, survey: Survey, rig: Rig | None = None) -> tuple[TopicCoverage, ...]:
    """The topics of camera pictures or LiDAR points that are not in a rig, and why. The read must be exhausted."""
    topics = {rig.topic(sensor) for sensor in rig.sensors} if rig else set()
    unreadable = [one for one in _unreadable(recording, survey) if one.topic not in topics]
    return (*unreadable, *_left_out(recording, survey, rig, topics))


def _of_sensor(
    recording: Recording, rig: Rig, survey: Survey, sensor: int, counts: Counts, time: TimeCoverage
) -> TopicCoverage:
    topic = rig.topic(sensor)
    found = next((one for one in survey.unreadable if one.topic.name == topic), None)
    unread = found is not None and not counts.used
    schema = next((known.schema for known in recording.topics() if known.name == topic), "")
    return TopicCoverage(
        topic,
        schema,
        sensor_types.LIDAR if sensor == LIDAR else sensor_types.CAMERA,
        TopicState.UNREADABLE if unread else TopicState.READ,
        sensor,
        rig.name(sensor),
        counts.read,
        counts.regular,
        dict(sorted(counts.against.items())),
        time,
        found.reason if found and unread else "",
        found.remedy if found and unread else "",
    )


def _unreadable(recording: Recording, survey: Survey) -> Iterator[TopicCoverage]:
    counted = recording.counts
    for one in survey.unreadable:
        read = counted.get(one.topic.name, 0)
        if not read:
            continue
        name, other = one.topic.name, sensor_types.other_content(one.topic.name, one.reason)
        known = (name, one.topic.schema, one.kind)
        if other:
            yield TopicCoverage(*known, TopicState.LEFT_OUT, None, sensor_name(name), read, reason=other)
        else:
            yield TopicCoverage(
                *known,
                TopicState.UNREADABLE,
                None,
                sensor_name(name),
                read,
                reason=one.reason,
                remedy=one.remedy,
            )


def _left_out(recording: Recording, survey: Survey, rig: Rig | None, topics: set[str]) -> Iterator[TopicCoverage]:
    images = [(image.topic, sensor_types.CAMERA) for image in survey.images]
    clouds = [(cloud.topic, sensor_types.LIDAR) for cloud in survey.clouds]
    outside = [(topic, kind) for topic, kind in (*images, *clouds) if topic.name not in topics]
    if not outside:
        return
    found, counted = search_rigs(survey), recording.counts
    for topic, kind in outside:
        if rig in found.rigs and _is_of_any(topic, found.rigs):
            continue  # it is audited with another rig of this recording
        yield TopicCoverage(
            topic.name,
            topic.schema,
            kind,
            TopicState.LEFT_OUT,
            None,
            sensor_name(topic.name),
            counted.get(topic.name, 0),
            reason=_why_left_out(topic, kind, rig, found.rigs, found.reasons),
        )


def _why_left_out(
    topic: Topic, kind: sensor_types.SensorKind, rig: Rig | None, rigs: Sequence[Rig], reasons: Sequence[str]
) -> str:
    if _is_of_any(topic, rigs):
        return "the given rig does not have it"
    name = sensor_name(topic.name)
    told = next((why for why in reasons if topic.name in why or f"{name} " in why or f"({name})" in why), "")
    if told:
        return told
    if rig is None:
        return "the recording has no rig"
    if kind == sensor_types.LIDAR and rig.lidar:
        return f"the LiDAR {rig.lidar.name} has more points"
    return "the rig does not have it: another topic of the same camera is used, or it has no place beside the others"


def _is_of_any(topic: Topic, rigs: Sequence[Rig]) -> bool:
    return any(topic.name in map(rig.topic, rig.sensors) for rig in rigs)
