from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer

from auditor.errors import RecordingError, RigError
from auditor.model.verdict import AttackLabel
from auditor.recordings import find_rigs, open_recording, survey, write_bag, write_db3
from auditor.recordings.writers.messages import MessageMaker
from tests.making.recorded_drives import make_frames, make_rig, same_frame, split, stream_of

RIG = make_rig(3)
FRAMES = make_frames(RIG, 6)
LABEL = AttackLabel("/top/points", "wall", 5, 9, {"lateral_m": -1.25})


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bag") / "a.bag"
    write_bag(path, RIG, FRAMES, [LABEL], vehicle="V7")
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("db3") / "drive"
    write_db3(path, RIG, FRAMES, [LABEL], vehicle="V7")
    return path


@pytest.mark.parametrize("kind", ["bag", "folder"])
def test_frames_and_ground_truth_come_out_as_they_went_in(kind: str, request: pytest.FixtureRequest) -> None:
    with open_recording(request.getfixturevalue(kind)) as recording:
        stream = stream_of(recording)
        frames, skipped = split(stream)
        assert recording.labels() == (LABEL,)
        assert recording.metadata() == {"vehicle": "V7"}
        assert recording.clock == "utc"
        assert recording.damage == ()
        assert all(topic.adds_up for topic in stream.balance)
        assert sum(topic.read for topic in stream.balance) == 1 + 6 * 7 + 1
    assert not skipped
    assert all(same_frame(a, b) for a, b in zip(frames, FRAMES, strict=True))


@pytest.mark.parametrize("kind", ["bag", "folder"])
def test_rosbags_own_reader_reads_what_is_written(kind: str, request: pytest.FixtureRequest) -> None:
    with AnyReader([request.getfixturevalue(kind)]) as reader:
        decoded = [reader.deserialize(data, connection.msgtype) for connection, _, data in reader.messages()]
    assert len(decoded) == 1 + 6 * 7 + 1


def test_a_rosbag2_folder_of_mcap_files_is_read(tmp_path: Path) -> None:
    maker = MessageMaker("cdr")
    with Rosbag2Writer(tmp_path / "a", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection("/a", "std_msgs/msg/String", typestore=maker.store)
        for number in range(3):
            writer.write(connection, number, maker.string(f"text {number}"))
    with open_recording(tmp_path / "a") as recording:
        assert [message.log_time_ns for message in recording.messages()] == [0, 1, 2]
        assert [topic.schema for topic in recording.topics()] == ["std_msgs/msg/String"]


def test_a_damaged_file_of_a_folder_is_reported_and_the_others_are_read(folder: Path, tmp_path: Path) -> None:
    target = tmp_path / "two"
    target.mkdir()
    (target / "a_0.db3").write_bytes((folder / "drive.db3").read_bytes())
    (target / "a_1.db3").write_bytes((folder / "drive.db3").read_bytes()[:3000])
    with open_recording(target) as recording:
        frames, _ = split(stream_of(recording))
        assert [damage.file for damage in recording.damage] == ["a_1.db3"]
    assert len(frames) == 6


@settings(max_examples=25, deadline=None, derandomize=True)
@given(share=st.floats(0, 1, exclude_max=True))
@pytest.mark.parametrize("kind", ["bag", "folder"])
def test_a_recording_cut_anywhere_raises_only_our_own_error_or_reports_its_damage(
    kind: str, share: float, request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> None:
    whole: Path = request.getfixturevalue(kind)
    whole = whole if whole.is_file() else whole / "drive.db3"
    cut = tmp_path_factory.mktemp("cut") / whole.name
    content = whole.read_bytes()
    cut.write_bytes(content[: int(share * len(content))])
    with suppress(RecordingError), open_recording(cut) as recording:
        count = len(list(recording.messages()))
        assert recording.damage or count == 44


def test_a_real_ros_1_bag_without_cameras_is_read_and_gives_no_rig(real_data: Path) -> None:
    with open_recording(real_data / "real_bags_without_cameras" / "ros1_tilt_laser.bag") as recording:
        assert len(list(recording.messages())) == 4093
        assert recording.counts["/scan"] == 178
        known = survey(recording)
        assert len(known.transforms) > 0
        with pytest.raises(RigError, match="no camera images"):
            find_rigs(known)


def test_a_real_ros_2_file_of_packets_is_read_and_is_a_lidar_alone(real_data: Path) -> None:
    with open_recording(real_data / "real_bags_without_cameras" / "ros2_vlp16") as recording:
        assert [topic.schema for topic in recording.topics()] == ["velodyne_msgs/msg/VelodyneScan"]
        assert len(list(recording.messages())) == 4
        known = survey(recording)
        assert [rig.sensors for rig in find_rigs(known)] == [(0,)]


@pytest.mark.parametrize("kind", ["bag", "folder"])
def test_the_bytes_of_every_topic_are_counted_requested_or_not(kind: str, request: pytest.FixtureRequest) -> None:
    with open_recording(request.getfixturevalue(kind)) as recording:
        held: dict[str, int] = {}
        for message in recording.messages():
            held[message.topic] = held.get(message.topic, 0) + len(message.data)
        for _ in recording.messages(()):
            pass
        assert {topic.name: found.size_bytes for topic, found in recording.traffic.items()} == held
        assert {topic.name: found.messages for topic, found in recording.traffic.items()} == dict(recording.counts)
