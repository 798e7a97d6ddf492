"""What describes the sensors of packets: on a topic beside them, attached to the recording, or in the packets."""

from collections.abc import Iterator, Sequence

from auditor.errors import DecodingError
from auditor.recordings import schemas
from auditor.recordings.decoding.points.ouster import MAX_METADATA, sensor_of
from auditor.recordings.decoding.points.velodyne import calibration_of, names_no_model
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.recording import CarriesCalibrations, Recording, Topic

_NAME = "metadata"


def metadata_of(recording: Recording) -> dict[str, str]:
    """By topics of packets the texts that describe their sensors.

    The driver publishes a text once, often before anything else: of a topic the first counts, and nothing behind the
    last of them is read. A text that is attached stands for all topics that have none, where there is only one. The
    packets of an HDL-64E have it in them.
    """
    beside = _beside(recording.topics())
    published = _published(recording, metadata_topics(recording.topics()))
    attached = set(_attached(recording)) if any(place not in published for place in beside.values()) else set()
    shared = attached.pop() if len(attached) == 1 else None
    found = ((name, published.get(place, shared)) for name, place in beside.items())
    known = {name: text for name, text in sorted(found) if text is not None}
    return known | _gathered(recording)


def metadata_topics(topics: Sequence[Topic]) -> set[str]:
    """The topics that describe the sensors of packets."""
    texts = {topic.name for topic in topics if topic.schema == schemas.STRING}
    return texts.intersection(_beside(topics).values())


def _beside(topics: Sequence[Topic]) -> dict[str, str]:
    """By topic of packets where its driver publishes the metadata."""
    packets = {topic.name for topic in topics if topic.schema in schemas.OUSTER}
    return {name: f"{name.rpartition('/')[0]}/{_NAME}" for name in packets}


def _gathered(recording: Recording) -> dict[str, str]:
    """The calibrations that packets of Velodynes hold, of LiDARs whose packets name no model."""
    found: dict[str, str] = {}
    for topic in recording.topics():
        if topic.schema == schemas.VELODYNE and names_no_model(_packets(recording, topic)):
            text = calibration_of(_packets(recording, topic))
            found.update({} if text is None else {topic.name: text})
    return found


def _packets(recording: Recording, topic: Topic) -> Iterator[bytes]:
    types = RosTypes(recording.definition)
    for message in recording.messages({topic.name}):
        try:
            packets = types.decode(message).packets if message.schema == topic.schema else ()
        except DecodingError:
            continue
        yield from (packet.data.tobytes() for packet in packets)


def _published(recording: Recording, topics: set[str]) -> dict[str, str]:
    found: dict[str, str] = {}
    types = RosTypes(recording.definition)
    for message in recording.messages(topics) if topics else ():
        if message.schema == schemas.STRING and message.topic not in found and len(message.data) <= MAX_METADATA:
            try:
                found[message.topic] = types.decode(message).data
            except DecodingError:
                continue
        if found.keys() == topics:
            break
    return found


def _attached(recording: Recording) -> Iterator[str]:
    for text in recording.calibrations().values() if isinstance(recording, CarriesCalibrations) else ():
        try:
            sensor_of(text)
        except DecodingError:
            continue
        yield text
