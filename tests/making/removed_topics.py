"""Copies of recordings that lack some topics, as where a sensor was unplugged."""

from collections.abc import Collection
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import Writer

from auditor.model.rig import Rig


def without_sensors(source: Path, target: Path, rig: Rig, sensors: Collection[int]) -> Path:
    """The MCAP file without the data of these sensors, and without their camera infos."""
    removed = {rig.topic(sensor) for sensor in sensors}
    removed |= {f"{topic}/camera_info" for topic in removed} | {
        f"{topic.rpartition('/')[0]}/camera_info" for topic in removed if topic.count("/") > 1
    }
    with source.open("rb") as stream, target.open("wb") as out:
        writer = Writer(out)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for schema, channel, message in make_reader(stream).iter_messages(log_time_order=False):
            assert schema
            if channel.topic in removed:
                continue
            if channel.topic not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, known)
            writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()
    return target
