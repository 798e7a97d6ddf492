"""The places of sensors by the robot's description (URDF), where tf does not have them."""

from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from auditor.model.rig import Rig
from auditor.recordings import find_rigs, open_recording, survey, write_mcap
from auditor.recordings.decoding.ros import known_types
from auditor.recordings.synchronisation.survey import Survey
from tests.making.recorded_drives import make_frames, make_rig

RIG = make_rig(3)
TEXT = "std_msgs/msg/String"
LIDAR_JOINT = '<joint name="a" type="fixed"><parent link="rig"/><child link="{child}"/><origin {origin}/></joint>'
TRUE = 'xyz="0 -0.1 -0.3" rpy="-1.5707963267948966 0 -1.5707963267948966"'
"""As descriptions turn optical frames: z to the parent's x, x to its -y and y to its -z."""
LINKS = '<robot name="car"><!-- its sensors --><link name="rig"/><link name="top"/>{joints}</robot>'


def described(folder: Path, text: str, *, tf: bool = False, encoding: str = "cdr") -> Survey:
    """A survey of a drive with a robot's description, in place of tf or beside it."""
    write_mcap(folder / "a.mcap", RIG, make_frames(RIG, 3))
    store = known_types(encoding)
    String = store.types[TEXT]
    data = store.serialize_ros1(String(text), TEXT) if encoding == "ros1" else store.serialize_cdr(String(text), TEXT)
    with open_recording(folder / "a.mcap") as recording, (folder / "b.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema(TEXT, "ros2msg", b"string data")
        writer.add_message(writer.register_channel("/robot_description", encoding, schema), 1, bytes(data), 1)
        channels: dict[str, int] = {}
        for message in recording.messages():
            if message.topic == "/tf_static" and not tf:
                continue
            if message.topic not in channels:
                known = recording.definition(message.schema)
                assert known is not None
                schema = writer.register_schema(message.schema, known.encoding, known.data)
                channels[message.topic] = writer.register_channel(message.topic, message.encoding, schema)
            writer.add_message(channels[message.topic], message.log_time_ns, bytes(message.data), message.log_time_ns)
        writer.finish()
    with open_recording(folder / "b.mcap") as recording:
        return survey(recording)


def joint(child: str, origin: str = TRUE) -> str:
    return LIDAR_JOINT.format(child=child, origin=origin)


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_a_lidar_that_tf_does_not_place_is_placed_by_the_description(encoding: str, tmp_path: Path) -> None:
    text = LINKS.format(joints=_cameras() + joint("top"))
    surveyed = described(tmp_path, text, encoding=encoding)
    [rig] = find_rigs(surveyed)
    assert _places(rig) == pytest.approx(_places(RIG), abs=1e-9)
    assert any("those of the robot's description" in problem for problem in surveyed.problems)


def test_tf_goes_before_the_description(tmp_path: Path) -> None:
    elsewhere = LINKS.format(joints=_cameras() + joint("top", 'xyz="9 9 9"'))
    surveyed = described(tmp_path, elsewhere, tf=True)
    [rig] = find_rigs(surveyed)
    assert _places(rig) == pytest.approx(_places(RIG), abs=1e-9)


def test_joints_that_move_say_nothing(tmp_path: Path) -> None:
    text = LINKS.format(joints=joint("top").replace("fixed", "revolute"))
    surveyed = described(tmp_path, text)
    assert surveyed.transforms == ()


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "ill-formed"),
        ("<robot", "ill-formed"),
        (LINKS.format(joints=joint("top", 'xyz="1 2"')), "not three numbers"),
        (LINKS.format(joints=joint("top", 'xyz="nan 0 0"')), "not three numbers"),
        (LINKS.format(joints=joint("top", 'rpy="1e300 0 0"')), "not three numbers"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><robot>&b;</robot>', "more than comments"),
        ("<robot>" * 100_000, "ill-formed"),
        (" " * 5_000_000, "is not accepted"),
    ],
)
def test_an_odd_description_is_a_problem_and_no_error(text: str, says: str, tmp_path: Path) -> None:
    surveyed = described(tmp_path, text, tf=True)
    assert any(says in problem for problem in surveyed.problems)
    assert find_rigs(surveyed)


def _cameras() -> str:
    places = {camera.name: camera.centre_m for camera in RIG.cameras}
    return "".join(joint(name, f'xyz="{" ".join(map(str, place))}"') for name, place in places.items())


def _places(rig: Rig) -> np.ndarray:
    assert rig.lidar is not None
    return np.concatenate([rig.lidar.rig_SE3_lidar.ravel(), *(camera.centre_m for camera in rig.cameras)])
