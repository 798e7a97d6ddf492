"""Topics of message types that no table lists: which of them may be a camera or a LiDAR, by their data alone.

A topic's name says nothing here: whoever records a camera may call it a mask, and a LiDAR a radar.
"""

from auditor.recordings.decoding.definitions import raw_data_of
from auditor.recordings.decoding.other_types import is_of_radar, is_other
from auditor.recordings.parameters import SENSOR_LIKE
from auditor.recordings.recording import Definition, Topic, Traffic

REMEDY = (
    "record or convert it as sensor_msgs/Image or PointCloud2 (foxglove: CompressedImage or PointCloud), "
    "or give --no-sensor {topic} where it is neither camera nor LiDAR"
)
"""What helps where nobody knows the type; `topic` is filled in."""


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
    seconds = max(held_s, SENSOR_LIKE.least_s)
    if traffic.messages < max(SENSOR_LIKE.least_messages, SENSOR_LIKE.least_hz * seconds):
        return False
    per_s = traffic.size_bytes / seconds
    if per_s >= SENSOR_LIKE.bytes_per_s:
        return True
    return per_s >= SENSOR_LIKE.blob_bytes_per_s and not is_of_radar(topic.schema) and bool(raw_data_of(definition))


def _rates(traffic: Traffic, held_s: float) -> str:
    seconds = max(held_s, SENSOR_LIKE.least_s)
    mean, per_s = traffic.size_bytes / max(traffic.messages, 1), traffic.size_bytes / seconds
    return (
        f"{traffic.messages} messages of {mean:,.0f} bytes, {traffic.messages / seconds:.3g} a second, "
        f"{per_s / 1000:,.1f} kB/s"
    )
