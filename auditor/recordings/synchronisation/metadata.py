"""The texts that describe the sensors of packets: on a topic beside the packets, or attached to the recording."""

from collections.abc import Iterator

from auditor.errors import DecodingError
from auditor.recordings import schemas
from auditor.recordings.decoding.points.ouster import MAX_METADATA, sensor_of
from auditor.recordings.decoding.ros import RosTypes
from auditor.recordings.recording import CarriesCalibrations, Recording

_NAME = "metadata"


def metadata_of(recording: Recording) -> dict[str, str]:
    """By topics of packets the texts that describe their sensors.

    The driver publishes a text once, often before anything else: of a topic the first counts, and nothing behind the
    last of them is read. A text that is attached stands for all topics that have none, where there is only one.
    """
    packets = {topic.name for topic in recording.topics() if topic.schema in schemas.OUSTER}
    texts = {topic.name for topic in recording.topics() if topic.schema == schemas.STRING}
    beside = {name: f"{name.rpartition('/')[0]}/{_NAME}" for name in packets}
    published = _published(recording, texts.intersection(beside.values()))
    attached = set(_attached(recording)) if any(place not in published for place in beside.values()) else set()
    shared = attached.pop() if len(attached) == 1 else None
    found = ((name, published.get(place, shared)) for name, place in beside.items())
    return {name: text for name, text in sorted(found) if text is not None}


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
