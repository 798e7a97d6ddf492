import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from auditor.errors import RecordingError
from auditor.model.frames import SensorState
from auditor.model.rig import Rig
from auditor.recordings import Recording, convert, find_rigs, open_recording, survey, synchronise
from tests.making.recorded_drives import split, stream_of


def drive(real_data: Path, number: str) -> Path:
    return real_data / f"kitti_raw_2011_09_26_drive_{number}"


def rig_of(recording: Recording) -> Rig:
    (rig,) = find_rigs(survey(recording))
    return rig


def centres_of(path: Path) -> dict[str, float]:
    """x of every camera from the calibration file's text, by the plain rule -P[0, 3] / f (metres)."""
    lines = (line.split() for line in path.read_text().splitlines())
    projections = {line[0]: np.array(line[1:], float).reshape(3, 4) for line in lines if line[0].startswith("P_rect")}
    names = {"0": "camera_gray_left", "1": "camera_gray_right", "2": "camera_color_left", "3": "camera_color_right"}
    return {names[key[-2]]: -(P[0, 3] - P[0, 2] * P[2, 3]) / P[0, 0] for key, P in projections.items()}


@pytest.mark.parametrize(("number", "converted"), [("0001", False), ("0009", False), ("0009", True)])
def test_the_rig_of_a_drive_has_the_lidar_and_four_cameras_in_order_within_a_millimetre(
    real_data: Path, tmp_path: Path, number: str, converted: bool
) -> None:
    path = drive(real_data, number)
    if converted:
        with open_recording(path) as recording:
            path = convert(recording, tmp_path / "a.mcap").target
    with open_recording(path) as recording:
        rig = rig_of(recording)
    names = [camera.name for camera in rig.cameras]
    assert names == ["camera_gray_right", "camera_color_right", "camera_gray_left", "camera_color_left"]
    expected = centres_of(drive(real_data, number) / "2011_09_26" / "calib_cam_to_cam.txt")
    for i in range(1, 5):
        for k in range(i + 1, 5):
            assert abs(rig.baseline_m(i, k) - (expected[rig.name(i)] - expected[rig.name(k)])) < 1e-3
    assert [round(float(camera.centre_m[0]), 2) for camera in rig.cameras] == [0.54, 0.47, 0.0, -0.06]
    assert rig.name(0) == "velo"
    assert rig.lidar
    # The HDL-64E stands 8 cm above and 27 cm behind camera 0, and looks along its z.
    assert np.allclose(rig.lidar.rig_SE3_lidar[:3, 3], [0, -0.08, -0.27], atol=0.01)
    assert np.allclose(rig.lidar.rig_SE3_lidar[:3, 0], [0, 0, 1], atol=0.02)


def test_every_frame_of_a_drive_with_gaps_comes_out(real_data: Path) -> None:
    with open_recording(drive(real_data, "0001")) as recording:
        stream = stream_of(recording)
        frames, skipped = split(stream)
        assert all(topic.adds_up for topic in stream.balance)
    assert not skipped
    assert [frame.number for frame in frames] == list(range(10))
    seconds = [(frame.stamp_ns - frames[0].stamp_ns) / 1e9 for frame in frames]
    assert np.allclose(seconds, [n * 0.1034 for n in (0, 1, 2, 3, 4, 5, 25, 45, 65, 85)], atol=0.05)
    assert all(presence.state is SensorState.PRESENT for frame in frames for presence in frame.presence.values())


@pytest.mark.parametrize("converted", [False, True])
def test_pixels_and_points_are_those_of_the_files(real_data: Path, tmp_path: Path, converted: bool) -> None:
    path = source = drive(real_data, "0001")
    data = source / "2011_09_26" / "2011_09_26_drive_0001_sync"
    if converted:
        with open_recording(path) as recording:
            path = convert(recording, tmp_path / "a.mcap").target
    with open_recording(path) as recording:
        frames, _ = split(stream_of(recording, colour=True))
    for place, number in ((0, "0000000000"), (6, "0000000025")):
        frame = frames[place]
        for sensor, camera in {1: "01", 2: "03", 3: "00", 4: "02"}.items():
            picture = cv2.imread(str(data / f"image_{camera}" / "data" / f"{number}.png"), cv2.IMREAD_UNCHANGED)
            assert np.array_equal(frame.images[sensor].pixels, picture)
        scan = np.fromfile(data / "velodyne_points" / "data" / f"{number}.bin", np.float32).reshape(-1, 4)
        assert frame.cloud
        assert np.array_equal(frame.cloud.xyz_m, scan[:, :3])


def test_a_converted_drive_holds_the_bytes_of_its_files(real_data: Path, tmp_path: Path) -> None:
    data = drive(real_data, "0001") / "2011_09_26" / "2011_09_26_drive_0001_sync"
    picture = (data / "image_02" / "data" / "0000000003.png").read_bytes()
    scan = (data / "velodyne_points" / "data" / "0000000003.bin").read_bytes()
    with open_recording(drive(real_data, "0001")) as recording:
        report = convert(recording, tmp_path / "a.mcap")
    assert report.messages["/kitti/velo/pointcloud"] == 10
    assert not report.left_out
    with open_recording(tmp_path / "a.mcap") as recording:
        messages = list(recording.messages())
        assert recording.clock == "unknown"
    assert any(picture in bytes(message.data) for message in messages)
    assert any(scan in bytes(message.data) for message in messages)


def test_stamps_are_those_of_timestamps_txt_by_file_number(real_data: Path) -> None:
    with open_recording(drive(real_data, "0009")) as recording:
        frames, _ = split(stream_of(recording))
        assert recording.clock == "unknown"
    text = drive(real_data, "0009") / "2011_09_26" / "2011_09_26_drive_0009_sync" / "image_02" / "timestamps.txt"
    line = text.read_text().splitlines()[17]
    assert str(frames[17].images[4].stamp_ns).endswith(line.partition(".")[2])
    assert len(frames) == 40


def test_a_drive_without_timestamps_ticks_ten_times_a_second(real_data: Path) -> None:
    with open_recording(drive(real_data, "0048")) as recording:
        frames, skipped = split(stream_of(recording))
        assert recording.clock == "unknown"
    assert not skipped
    (frame,) = frames
    assert frame.stamp_ns == 0
    assert sorted(frame.images) == [1, 2]


@pytest.fixture
def small(real_data: Path, tmp_path: Path) -> Path:
    """A drive of five frames that may be damaged."""
    source = drive(real_data, "0001") / "2011_09_26"
    target = tmp_path / "2011_09_26"
    numbers = [f"{number:010d}" for number in range(5)]
    for file in source.rglob("*"):
        if file.is_file() and (file.suffix == ".txt" or file.stem in numbers) and "oxts" not in file.parts:
            (target / file.relative_to(source)).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, target / file.relative_to(source))
    for file in target.rglob("*"):
        file.chmod(0o755)
    return target / "2011_09_26_drive_0001_sync"


def test_a_cut_picture_and_a_cut_scan_are_damaged_and_a_removed_one_is_missing(small: Path) -> None:
    picture = small / "image_03" / "data" / "0000000001.png"
    picture.write_bytes(picture.read_bytes()[:100_000])
    scan = small / "velodyne_points" / "data" / "0000000002.bin"
    scan.write_bytes(scan.read_bytes()[:-3])
    (small / "image_00" / "data" / "0000000003.png").unlink()
    with open_recording(small) as recording:
        known = survey(recording)
        frames, _ = split(synchronise(recording, find_rigs(known)[0], known))
    states = [{s: p.state.value for s, p in f.presence.items() if p.state is not SensorState.PRESENT} for f in frames]
    assert states == [{}, {2: "damaged"}, {0: "damaged"}, {3: "missing"}, {}]


def test_the_identity_does_not_change_with_the_folder_that_names_the_drive(small: Path) -> None:
    ids = []
    for path in (small, small.parent, small.parent.parent):
        with open_recording(path) as recording:
            ids.append(recording.recording_id)
    assert len(set(ids)) == 1
    scan = small / "velodyne_points" / "data" / "0000000002.bin"
    scan.write_bytes(scan.read_bytes()[:-3])
    with open_recording(small) as recording:
        assert recording.recording_id not in ids


def test_a_drive_without_calibration_is_refused(small: Path) -> None:
    (small.parent / "calib_cam_to_cam.txt").unlink()
    with pytest.raises(RecordingError, match=r"calib_cam_to_cam\.txt is missing"):
        open_recording(small)


@pytest.mark.parametrize("text", ["", "2011-09-26 13:02:25.967\n", "yesterday\n", "\n\n\n\n\n\n"])
def test_times_that_are_missing_or_ill_formed_are_a_clear_error(small: Path, text: str) -> None:
    (small / "image_00" / "timestamps.txt").write_text(text)
    with pytest.raises(RecordingError, match=r"timestamps.txt: .*time"):
        open_recording(small)


def test_times_of_some_sensors_alone_are_refused(small: Path) -> None:
    times = "".join(f"2011-09-26 13:02:25.{frame}\n" for frame in range(5))
    for sensor in ("image_00", "image_01", "image_03", "velodyne_points"):
        (small / sensor / "timestamps.txt").write_text(times)
    (small / "image_02" / "timestamps.txt").unlink(missing_ok=True)
    with pytest.raises(RecordingError, match=r"image_02/timestamps.txt: it is missing") as raised:
        open_recording(small)
    assert raised.value.remedy == "put it back, or take image_02 out of the drive"


def test_a_place_that_is_gone_is_no_damage_and_a_picture_is(real_data: Path, small: Path) -> None:
    shutil.copytree(drive(real_data, "0001") / small.parent.name / small.name / "oxts", small / "oxts")
    with open_recording(small) as recording:
        (small / "oxts" / "data").chmod(0o755)
        (small / "oxts" / "data" / "0000000001.txt").unlink()
        (small / "image_00" / "data" / "0000000002.png").unlink()
        empty = [message.topic for message in recording.messages() if not message.data]
        damage = list(map(str, recording.damage))
    assert sorted(empty) == ["/kitti/camera_gray_left/image_rect", "/kitti/oxts"]
    assert damage == ["0000000002.png: it cannot be read (No such file or directory)"]
