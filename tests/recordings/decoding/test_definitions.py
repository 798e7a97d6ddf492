"""Definitions come from the recording: rosbags turns them into code, so nothing but plain words may get there."""

import sys
from pathlib import Path

import pytest
from mcap.writer import Writer
from rosbags.typesys import Stores, get_typestore

from auditor.errors import DecodingError
from auditor.recordings import convert, open_recording
from auditor.recordings.decoding.ros import RosTypes, parse_definition
from auditor.recordings.recording import Definition
from auditor.recordings.schemas import TRANSFORMS
from tests.making.idl import idl_definition

CODE = "a/msg/B:\n    import sys; sys.hostile = True\nclass c/msg/D"


@pytest.fixture(autouse=True)
def _nothing_hostile_ran() -> None:
    assert not hasattr(sys, "hostile")


@pytest.mark.parametrize(
    "name",
    [CODE, "", "8a/msg/B", "a/msg/8", "a/b/c/d", "a/msg/" + "b" * 200, "ä/msg/B", "a/__class__"],
)
def test_an_ill_formed_schema_name_is_refused(name: str) -> None:
    with pytest.raises(DecodingError, match="its definition"):
        parse_definition(name, Definition("ros2msg", b"uint8 x\n"))


def test_constants_are_left_out() -> None:
    types = parse_definition("a/msg/B", Definition("ros2msg", b"string X='\"; import os'\nuint8 x\n"))
    assert [(name, constants, [field for field, _ in fields]) for name, (constants, fields) in types.items()] == [
        ("a/msg/B", [], ["x"])
    ]


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
def test_a_conversion_runs_nothing_of_a_recording(tmp_path: Path, encoding: str) -> None:
    with (tmp_path / "a.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start("ros1" if encoding == "ros1" else "ros2")
        schema = writer.register_schema(CODE, "ros1msg" if encoding == "ros1" else "ros2msg", b"uint8 x\n")
        writer.add_message(writer.register_channel("/a", encoding, schema), 1, b"\0", 1)
        writer.finish()
    with open_recording(tmp_path / "a.mcap") as recording:
        report = convert(recording, tmp_path / "b.mcap")
    assert not hasattr(sys, "hostile")
    if encoding == "ros1":
        assert "its definition" in report.left_out["/a"]


@pytest.mark.parametrize(
    "text", ["class x", "uint8 __class__", "8a/B x", "a/msg/B x", "float64[99999999999999999999] x"]
)
def test_an_ill_formed_definition_is_left_out_of_a_conversion(tmp_path: Path, text: str) -> None:
    with (tmp_path / "a.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start("ros1")
        schema = writer.register_schema("a/B", "ros1msg", text.encode())
        writer.add_message(writer.register_channel("/a", "ros1", schema), 1, b"\0", 1)
        writer.finish()
    with open_recording(tmp_path / "a.mcap") as recording:
        assert convert(recording, tmp_path / "b.mcap").left_out.keys() == {"/a"}


@pytest.mark.parametrize(("before", "after"), [("module tf2", "module 8tf2"), ("struct TFM", "struct 8TFM")])
def test_an_ill_formed_type_name_in_idl_is_refused(before: str, after: str) -> None:
    text = idl_definition(TRANSFORMS, get_typestore(Stores.ROS2_HUMBLE))
    assert before in text
    assert parse_definition(TRANSFORMS, Definition("ros2idl", text.encode()))
    with pytest.raises(DecodingError, match="its definition"):
        parse_definition(TRANSFORMS, Definition("ros2idl", text.replace(before, after).encode()))


def test_only_the_names_that_ros_1_writes_in_capitals_may_be_written_so() -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    text, _ = store.generate_msgdef("geometry_msgs/msg/Quaternion")
    definition = Definition("ros2msg", text.replace("float64 y", "float64 Y").encode())
    assert definition.data != text.encode()
    with pytest.raises(DecodingError, match="defined otherwise"):
        RosTypes(lambda _: definition).store("geometry_msgs/msg/Quaternion", "cdr")
