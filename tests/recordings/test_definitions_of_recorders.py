"""Schemas as recorders write them: without text, in part, or twice with other blanks."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from auditor.errors import RigError
from auditor.model.frames import Frame
from auditor.recordings import convert, find_rigs, open_recording, survey
from auditor.recordings.recording import Definition
from auditor.recordings.writers.messages import MessageMaker
from tests.making.forms import CONTAINERS
from tests.making.recorded_drives import make_frames, make_rig, same_frame, split, stream_of

RIG = make_rig(3)
FRAMES = make_frames(RIG, 4)

Text = Callable[[Definition], bytes]
NAME = b"<its name>"


def rewritten(
    folder: Path, container: str, *texts: Text, named: Callable[[str], str] = str, encoding: str = ""
) -> Path:
    """A drive whose schemas have other texts; of several, each topic has as many channels, and messages take turns."""
    write = next(one.write for one in CONTAINERS if one.name == container)
    target, channels, counted = folder / "b.mcap", dict[tuple[str, int], int](), dict[str, int]()
    with open_recording(write(folder, RIG, FRAMES, "raw")) as recording, target.open("wb") as file:
        writer = Writer(file)
        writer.start("ros1" if "ros1" in container else "ros2")
        for message in recording.messages():
            turn = counted[message.topic] = counted.get(message.topic, -1) + 1
            key = message.topic, turn % len(texts)
            if key not in channels:
                own = recording.definition(message.schema)
                assert own is not None
                schema = writer.register_schema(
                    named(message.schema),
                    encoding or own.encoding,
                    texts[key[1]](own).replace(NAME, message.schema.encode()),
                )
                channels[key] = writer.register_channel(message.topic, message.encoding, schema)
            writer.add_message(channels[key], message.log_time_ns, bytes(message.data), message.log_time_ns)
        writer.finish()
    return target


def frames_of(path: Path) -> list[Frame]:
    with open_recording(path) as recording:
        stream = stream_of(recording, colour=False)
        frames, skipped = split(stream)
        assert recording.damage == ()
        assert all(topic.adds_up for topic in stream.balance)
    assert not skipped
    return frames


@pytest.mark.parametrize("dds", [False, True])
def test_types_are_known_by_the_names_of_idl_and_dds(dds: bool, tmp_path: Path) -> None:
    def named(schema: str) -> str:
        package, _, kind = schema.split("/")
        return f"{package}::msg::dds_::{kind}_" if dds else f"{package}::msg::{kind}"

    if dds:
        path = rewritten(tmp_path, "mcap ros2", lambda _: b"", named=named)
    else:
        path = rewritten(tmp_path, "mcap ros2, idl", _without_rulers, named=named, encoding="omgidl")
    assert all(same_frame(a, b) for a, b in zip(frames_of(path), FRAMES, strict=True))


@pytest.mark.parametrize(
    ("schema", "encoding", "data", "said"),
    [
        ("sensor_msgs/msg/Image", "cdr", b"\0\7\0\0", "a form of CDR that is not read (0x0007: XCDR2 or parameter"),
        (
            "sensor_msgs/msg/Image",
            "json",
            b"{}",
            "in the encoding 'json' cannot be decoded; convert its messages to cdr",
        ),
        ("foxglove.RawImage", "flatbuffer", b"\0", "convert its messages to json or protobuf"),
        ("acme::Frame", "cdr", b"\0", "types that are not known: /a (acme::Frame, cdr); convert what is a sensor's"),
    ],
)
def test_messages_in_another_form_are_said_with_what_helps(
    schema: str, encoding: str, data: bytes, said: str, tmp_path: Path
) -> None:
    with open_recording(written(tmp_path / "a.mcap", schema, data + bytes(40), encoding)) as recording:
        surveyed = survey(recording)
    with pytest.raises(RigError) as raised:
        find_rigs(surveyed)
    assert said in raised.value.what


def written(path: Path, schema: str, data: bytes, encoding: str = "cdr") -> Path:
    """One message of a schema without text."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        channel = writer.register_channel("/a", encoding, writer.register_schema(schema, "ros2msg", b""))
        writer.add_message(channel, 1, data, 1)
        writer.finish()
    return path


def _name_alone(_: Definition) -> bytes:
    return NAME


def _top_alone(definition: Definition) -> bytes:
    return definition.data.split(b"=" * 80)[0]


def _without_rulers(definition: Definition) -> bytes:
    return "\n".join(one for one in definition.text.splitlines() if not one.startswith(("===", "IDL: "))).encode()


def _with_blanks(definition: Definition) -> bytes:
    return definition.data.replace(b"\n", b"  \n\n# one more word\n").replace(b" ", b"\t ") + b" \n"


@pytest.mark.parametrize("container", ["mcap ros2", "mcap ros1"])
@pytest.mark.parametrize(
    "texts",
    [
        [lambda _: b""],
        [lambda _: b"\n  \n"],
        [_name_alone],
        [_name_alone, lambda own: own.data],
        [_top_alone],
        [lambda _: b"", lambda own: own.data],
        [lambda own: own.data, lambda _: b""],
        [lambda own: own.data, _with_blanks],
        [_top_alone, _top_alone],
        [lambda own: own.data.replace(b"\n", b"\r\n")],
        [lambda own: own.data, lambda own: b"\xef\xbb\xbf" + own.data.replace(b"\n", b"\r\n")],
    ],
    ids=[
        "no text",
        "blanks",
        "the name",
        "first the name",
        "no parts",
        "first blank",
        "later blank",
        "other blanks",
        "the same twice",
        "of Windows",
        "once of Windows",
    ],
)
def test_a_drive_is_read_whatever_its_recorder_found_of_its_definitions(
    container: str, texts: list[Text], tmp_path: Path
) -> None:
    frames = frames_of(rewritten(tmp_path, container, *texts))
    assert len(frames) == len(FRAMES)
    assert all(same_frame(a, b) for a, b in zip(frames, FRAMES, strict=True))


def test_a_second_type_of_a_topic_that_nobody_knows_does_no_harm(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        for schema, text in (("sensor_msgs/msg/Image", b""), ("acme/msg/Image", b"uint8[] data")):
            channel = writer.register_channel("/a", "cdr", writer.register_schema(schema, "ros2msg", text))
            writer.add_message(channel, 1, b"\0\1\0\0\1\0\0\0<", 1)
        writer.finish()
    with open_recording(tmp_path / "a.mcap") as recording:
        assert not survey(recording).images


def test_two_definitions_of_one_name_are_damage(tmp_path: Path) -> None:
    path = rewritten(tmp_path, "mcap ros2", lambda own: own.data, lambda own: own.data + b"\nMSG: a/B\nuint8 c\n")
    with open_recording(path) as recording:
        assert len(list(recording.messages())) > len(FRAMES) * len(RIG.sensors)
        assert any("second, different definition" in piece.what for piece in recording.damage)


def test_a_definition_that_contradicts_the_bytes_is_not_replaced_by_ros_s_own(tmp_path: Path) -> None:
    """What a recording defines wins: these images have one field more than they were written with."""
    path = rewritten(
        tmp_path, "mcap ros2", lambda own: own.data.replace(b"uint32 step", b"uint32 step\nuint32 more", 1)
    )
    with open_recording(path) as recording:
        surveyed = survey(recording)
    assert not surveyed.images
    assert {one.reason for one in surveyed.unreadable} >= {"sensor_msgs/msg/Image is defined otherwise than by ROS"}


def test_messages_that_fit_no_standard_type_are_said_to_lack_a_definition(tmp_path: Path) -> None:
    maker = MessageMaker("cdr")
    whole = maker.raw_image(np.zeros((4, 4), np.uint8), "mono8", maker.header(1, "cam"))
    path = written(tmp_path / "a.mcap", "sensor_msgs/msg/Image", whole[:-9])
    with open_recording(path) as recording:
        [unread] = survey(recording).unreadable
    assert "ROS's own definition of sensor_msgs/msg/Image, and the recording has none" in unread.reason


@pytest.mark.parametrize("container", ["mcap ros2", "mcap ros1"])
def test_a_conversion_defines_the_standard_types(container: str, tmp_path: Path) -> None:
    path = rewritten(tmp_path, container, lambda _: b"")
    with open_recording(path) as recording:
        report = convert(recording, tmp_path / "c.mcap")
    assert not report.left_out
    with open_recording(tmp_path / "c.mcap") as recording:
        assert all(not recording.definition(topic.schema).is_blank for topic in recording.topics())
    assert all(same_frame(a, b) for a, b in zip(frames_of(tmp_path / "c.mcap"), FRAMES, strict=True))


def test_a_conversion_copies_what_nobody_defines(tmp_path: Path) -> None:
    path = written(tmp_path / "a.mcap", "acme/msg/Thing", b"\0\1\0\0\7")
    with open_recording(path) as recording:
        assert convert(recording, tmp_path / "b.mcap").messages == {"/a": 1}
