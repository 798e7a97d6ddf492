"""Recordings as public reports describe them that are read like plain ones, and what is said of them."""

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Message, Schema
from mcap.writer import Writer

from auditor.model.frames import Frame
from auditor.recordings import open_recording, schemas, survey, write_mcap
from auditor.recordings.writers.messages import MessageMaker
from tests.making.recorded_drives import make_frames, make_rig, same_frame, split, stream_of

RIG = make_rig(3)
FRAMES = make_frames(RIG, 4)
STORE = MessageMaker("cdr").store

One = tuple[Schema, Channel, Message]


def rewritten(folder: Path, change: Callable[[list[One]], Iterable[tuple[One, bytes]]]) -> Path:
    """A drive whose messages were changed, each given with its new bytes, in their new order."""
    write_mcap(folder / "a.mcap", RIG, FRAMES)
    with (folder / "a.mcap").open("rb") as reading, (folder / "b.mcap").open("wb") as writing:
        writer, channels = Writer(writing), dict[str, int]()
        writer.start("ros2")
        for (schema, channel, message), data in change(list(make_reader(reading).iter_messages())):
            if channel.topic not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, known)
            writer.add_message(channels[channel.topic], message.log_time, data, message.publish_time)
        writer.finish()
    return folder / "b.mcap"


def frames_of(path: Path) -> tuple[list[Frame], tuple[str, ...], int]:
    """The frames, what is said of the recording, and how many messages were damaged or left out."""
    with open_recording(path) as recording:
        stream = stream_of(recording, colour=False)
        frames, _ = split(stream)
        assert all(topic.adds_up for topic in stream.balance)
        lost = sum(topic.damaged + sum(topic.skipped.values()) for topic in stream.balance)
        return frames, survey(recording).problems, lost


def same(messages: list[One]) -> Iterable[tuple[One, bytes]]:
    return ((one, one[2].data) for one in messages)


def with_a_second_of_nanoseconds(messages: list[One]) -> Iterable[tuple[One, bytes]]:
    """Stamps of a second less and 10**9 ns more, as of drivers that add without a carry."""
    for one in messages:
        data = bytearray(one[2].data)
        if one[0].name in {schemas.IMAGE, schemas.POINT_CLOUD}:
            seconds, nanoseconds = (int.from_bytes(data[at : at + 4], "little") for at in (4, 8))
            data[4:12] = (seconds - 1).to_bytes(4, "little") + (nanoseconds + 10**9).to_bytes(4, "little")
        yield one, bytes(data)


def twice(messages: list[One]) -> Iterable[tuple[One, bytes]]:
    """As two overlapping recordings that were merged."""
    return ((one, one[2].data) for one in messages for _ in range(2))


def calibrated_last(messages: list[One]) -> Iterable[tuple[One, bytes]]:
    """tf_static behind everything else, as a recorder that joins late gets it."""
    return same(sorted(messages, key=lambda one: one[0].name == schemas.TRANSFORMS))


def in_a_frame_of_its_own(messages: list[One]) -> Iterable[tuple[One, bytes]]:
    """Pictures whose frame_id is another one in each message but the first of a topic."""
    seen: dict[str, int] = {}
    for one in messages:
        number = seen[one[1].topic] = seen.get(one[1].topic, -1) + 1
        data = one[2].data
        if one[0].name == schemas.IMAGE and number:
            image = STORE.deserialize_cdr(data, schemas.IMAGE)
            image.header.frame_id = str(number)
            data = bytes(STORE.serialize_cdr(image, schemas.IMAGE))
        yield one, data


@pytest.mark.parametrize(
    ("change", "said", "lost"),
    [
        (same, "", 0),
        (with_a_second_of_nanoseconds, "", 0),
        (twice, "", 4 * 4),
        (calibrated_last, "", 0),
        (in_a_frame_of_its_own, "its messages are of several coordinate frames", 0),
    ],
)
def test_it_is_read_like_a_plain_one(
    change: Callable[[list[One]], Iterable[tuple[One, bytes]]], said: str, lost: int, tmp_path: Path
) -> None:
    frames, problems, left_out = frames_of(rewritten(tmp_path, change))
    assert len(frames) == len(FRAMES)
    assert all(same_frame(a, b) for a, b in zip(frames, FRAMES, strict=True))
    assert left_out == lost
    assert any(said in problem for problem in problems) if said else not problems
