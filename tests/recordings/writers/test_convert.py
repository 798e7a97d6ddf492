from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.well_known import Profile
from rosbags.highlevel import AnyReader

from auditor.errors import RecordingError
from auditor.model.frames import CameraImage, PointCloud
from auditor.model.verdict import AttackLabel
from auditor.recordings import (
    convert,
    find_rigs,
    open_recording,
    rewrite,
    survey,
    synchronise,
    write_bag,
    write_db3,
    write_mcap,
)
from tests.making.recorded_drives import make_frames, make_rig, mcap_file, same_frame, split, stream_of

RIG = make_rig(3)
FRAMES = make_frames(RIG, 4, colour=True)
LABEL = AttackLabel("/cam1/image_rect", "facula", 1, 2, {"R": 200})
WRITERS = {"a.mcap": write_mcap, "a.bag": write_bag, "a": write_db3}


def darker(image: CameraImage) -> CameraImage:
    return replace(image, pixels=image.pixels // 2)


def nearer(cloud: PointCloud) -> PointCloud:
    return replace(cloud, xyz_m=cloud.xyz_m[10:] / 2)


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("form", ["raw", "png"])
def test_every_kind_of_recording_is_converted_without_loss(tmp_path: Path, name: str, form: str) -> None:
    WRITERS[name](tmp_path / name, RIG, FRAMES, [LABEL], vehicle="V1", image=form)
    with open_recording(tmp_path / name) as recording:
        report = convert(recording, tmp_path / "out.mcap")
        source = recording.recording_id
    assert not report.left_out
    assert report.messages["/top/points"] == 4
    with open_recording(tmp_path / "out.mcap") as recording:
        (rig,) = find_rigs(survey(recording))
        frames, skipped = split(stream_of(recording, colour=True))
        assert recording.labels() == (LABEL,)
        assert recording.metadata() == {"vehicle": "V1", "clock": "utc", "source": source}
    assert not skipped
    assert all(same_frame(a, b) for a, b in zip(frames, FRAMES, strict=True))
    assert np.array_equal([c.centre_m for c in rig.cameras], [c.centre_m for c in RIG.cameras])
    assert rig.lidar
    assert RIG.lidar
    assert np.allclose(rig.lidar.rig_SE3_lidar, RIG.lidar.rig_SE3_lidar)


@pytest.mark.parametrize("name", WRITERS)
def test_the_readers_of_mcap_and_rosbags_read_what_is_converted(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name, RIG, FRAMES)
    with open_recording(tmp_path / name) as recording:
        total = sum(convert(recording, tmp_path / "out.mcap").messages.values())
    with (tmp_path / "out.mcap").open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_header().profile == Profile.ROS2
        assert len(list(reader.iter_messages())) == total
    with AnyReader([tmp_path / "out.mcap"]) as ros:
        assert len([ros.deserialize(data, connection.msgtype) for connection, _, data in ros.messages()]) == total


def test_real_recordings_without_cameras_are_converted_as_far_as_they_are_defined(
    real_data: Path, tmp_path: Path
) -> None:
    bags = real_data / "real_bags_without_cameras"
    with open_recording(bags / "ros1_tilt_laser.bag") as recording:
        report = convert(recording, tmp_path / "a.mcap")
    assert sum(report.messages.values()) == 4093
    assert not report.left_out
    with AnyReader([tmp_path / "a.mcap"]) as ros, AnyReader([bags / "ros1_tilt_laser.bag"]) as source:
        ours = [ros.deserialize(d, c.msgtype) for c, _, d in ros.messages() if c.topic == "/imu_data"]
        theirs = [source.deserialize(d, c.msgtype) for c, _, d in source.messages() if c.topic == "/imu_data"]
    assert [m.orientation.x for m in ours] == [m.orientation.x for m in theirs]
    with open_recording(bags / "ros2_vlp16") as recording:
        report = convert(recording, tmp_path / "b.mcap")
    assert (report.messages, report.left_out) == ({"/velodyne_packets": 4}, {})


def test_messages_of_other_encodings_keep_their_bytes(tmp_path: Path) -> None:
    mcap_file(tmp_path / "a.mcap", [("/a", 5, b'{"x": 1}'), ("/b", 6, b"\xff")])
    with open_recording(tmp_path / "a.mcap") as recording:
        convert(recording, tmp_path / "b.mcap")
    with (tmp_path / "b.mcap").open("rb") as stream:
        read = [(s.encoding, c.topic, m.log_time, m.data) for s, c, m in make_reader(stream).iter_messages() if s]
    assert read == [("jsonschema", "/a", 5, b'{"x": 1}'), ("jsonschema", "/b", 6, b"\xff")]


@pytest.mark.parametrize("form", ["raw", "png", "jpeg"])
@pytest.mark.parametrize("colour", [True, False])
def test_a_changed_copy_differs_only_where_it_was_changed(tmp_path: Path, form: str, colour: bool) -> None:
    frames = make_frames(RIG, 4, colour=colour)
    # JPEG shows what was changed only on pictures that it can keep.
    for frame in frames:
        for image in frame.images.values():
            image.pixels[:] = cv2.GaussianBlur(image.pixels, (0, 0), 4)
    write_mcap(tmp_path / "a.mcap", RIG, frames, vehicle="V1", image=form)
    with open_recording(tmp_path / "a.mcap") as recording:
        changes = {"/cam1/image_rect": darker, "/top/points": nearer}
        rewrite(recording, tmp_path / "b.mcap", changes, [LABEL])
        before, _ = split(stream_of(recording, colour=True))
    with open_recording(tmp_path / "b.mcap") as recording:
        after, skipped = split(stream_of(recording, RIG, colour=True))
        assert recording.labels() == (LABEL,)
        assert recording.metadata()["vehicle"] == "V1"
    assert not skipped
    for a, b in zip(before, after, strict=True):
        assert a.cloud
        assert b.cloud
        assert np.array_equal(b.cloud.xyz_m, a.cloud.xyz_m[10:] / 2)
        assert all(np.array_equal(a.images[k].pixels, b.images[k].pixels) for k in (2, 3))
        assert a.images[1].stamp_ns == b.images[1].stamp_ns
        error = np.abs(b.images[1].pixels.astype(int) - a.images[1].pixels // 2)
        assert error.max() <= (8 if form == "jpeg" else 0)


def test_ground_truth_is_requested_after_the_last_message(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", RIG, FRAMES)
    seen: list[int] = []

    def noted(image: CameraImage) -> CameraImage:
        seen.append(image.stamp_ns)
        return image

    with open_recording(tmp_path / "a.mcap") as recording:
        labels = (AttackLabel("/cam1/image_rect", "facula", min(at), max(at), {}) for at in [seen])
        rewrite(recording, tmp_path / "b.mcap", {"/cam1/image_rect": noted}, labels)
    with open_recording(tmp_path / "b.mcap") as recording:
        (label,) = recording.labels()
    assert (label.from_ns, label.to_ns) == (FRAMES[0].stamp_ns, FRAMES[-1].stamp_ns)


def test_a_topic_that_is_not_there_cannot_be_changed(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", RIG, FRAMES)
    with open_recording(tmp_path / "a.mcap") as recording, pytest.raises(RecordingError, match="no topic /cam9"):
        rewrite(recording, tmp_path / "b.mcap", {"/cam9": darker}, ())
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_an_existing_target_is_never_overwritten(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", RIG, FRAMES)
    content = (tmp_path / "a.mcap").read_bytes()
    with open_recording(tmp_path / "a.mcap") as recording, pytest.raises(RecordingError, match="exists already"):
        convert(recording, tmp_path / "a.mcap")
    assert (tmp_path / "a.mcap").read_bytes() == content


def test_a_conversion_that_fails_leaves_nothing_behind(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", RIG, FRAMES)

    def failing(_: CameraImage) -> CameraImage:
        raise KeyboardInterrupt

    with open_recording(tmp_path / "a.mcap") as recording, pytest.raises(KeyboardInterrupt):
        rewrite(recording, tmp_path / "b.mcap", {"/cam1/image_rect": failing}, ())
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


@pytest.mark.parametrize("write", [write_mcap, write_bag, write_db3])
def test_a_writer_that_fails_leaves_nothing_behind(tmp_path: Path, write: object) -> None:
    def frames() -> object:
        yield FRAMES[0]
        raise RuntimeError("the scene fell over")

    with pytest.raises(RuntimeError):
        write(tmp_path / "a.x", RIG, frames())
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("write", [write_mcap, write_bag, write_db3])
def test_a_full_disk_is_a_clear_error(write: object) -> None:
    with pytest.raises(RecordingError, match="cannot be written"):
        write(Path("/proc/nowhere/a.mcap"), RIG, FRAMES)


def test_a_cut_recording_is_converted_as_far_as_it_goes_and_the_damage_is_reported(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", RIG, FRAMES)
    content = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[:-200])
    with open_recording(tmp_path / "cut.mcap") as recording:
        report = convert(recording, tmp_path / "b.mcap")
    assert report.damage
    assert report.messages["/top/points"] == 4


def test_a_four_camera_rig_survives_its_recording(tmp_path: Path) -> None:
    rig = make_rig(4)
    write_mcap(tmp_path / "a.mcap", rig, make_frames(rig, 3))
    with open_recording(tmp_path / "a.mcap") as recording:
        known = survey(recording)
        (found,) = find_rigs(known)
        assert found.kind == rig.kind
        assert len(split(synchronise(recording, found, known))[0]) == 3
