import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from auditor.errors import RecordingError
from auditor.recordings import convert, find_recordings, find_rigs, format_of, open_recording, survey
from tests.making.recorded_drives import same_frame, split, stream_of

RAW = "kitti_raw_2011_09_26_drive_0001/2011_09_26"


@pytest.fixture
def sequence(real_data: Path, tmp_path: Path) -> Path:
    """Five real frames in the benchmark's layout, with the calibration that belongs to them."""
    raw, target = real_data / RAW, tmp_path / "dataset" / "sequences" / "00"
    drive = raw / "2011_09_26_drive_0001_sync"
    for number in range(4):
        (target / f"image_{number}").mkdir(parents=True)
        for frame in range(5):
            shutil.copy(drive / f"image_0{number}" / "data" / f"{frame:010d}.png", target / f"image_{number}")
    (target / "velodyne").mkdir()
    for frame in range(5):
        shutil.copy(drive / "velodyne_points" / "data" / f"{frame:010d}.bin", target / "velodyne")
    for file in target.rglob("*.*"):
        file.rename(file.with_name(file.name[4:]))
    values = dict(line.split(":", 1) for line in (raw / "calib_cam_to_cam.txt").read_text().splitlines())
    velo = dict(line.split(":", 1) for line in (raw / "calib_velo_to_cam.txt").read_text().splitlines())
    rotation = np.array(values["R_rect_00"].split(), float).reshape(3, 3)
    Tr = rotation @ np.column_stack(
        [np.array(velo["R"].split(), float).reshape(3, 3), np.array(velo["T"].split(), float)]
    )
    lines = [f"P{number}:{values[f'P_rect_0{number}']}" for number in range(4)]
    lines.append("Tr: " + " ".join(repr(float(value)) for value in Tr.ravel()))
    (target / "calib.txt").write_text("\n".join(lines) + "\n")
    (target / "times.txt").write_text("".join(f"{frame * 0.1037:.6e}\n" for frame in range(5)))
    for file in target.rglob("*"):
        file.chmod(0o755)
    return target


def test_a_sequence_gives_the_rig_and_the_frames_of_its_raw_drive(sequence: Path, real_data: Path) -> None:
    with open_recording(sequence) as recording, open_recording(real_data / RAW) as raw:
        (rig,), (raw_rig,) = find_rigs(survey(recording)), find_rigs(survey(raw))
        frames, skipped = split(stream_of(recording, colour=True))
        raw_frames, _ = split(stream_of(raw, colour=True))
        assert recording.clock == "relative"
        assert recording.metadata() == {"drive": "00"}
    assert (format_of(sequence), format_of(real_data / RAW)) == ("kitti_odometry", "kitti")
    assert not skipped
    assert rig.lidar
    assert raw_rig.lidar
    assert np.allclose(rig.lidar.rig_SE3_lidar, raw_rig.lidar.rig_SE3_lidar)
    assert [c.name for c in rig.cameras] == [c.name for c in raw_rig.cameras]
    assert all(np.allclose(a.projection, b.projection) for a, b in zip(rig.cameras, raw_rig.cameras, strict=True))
    assert [frame.stamp_ns for frame in frames] == [round(n * 0.1037 * 1e9) for n in range(5)]
    assert all(same_frame(a, b) for a, b in zip(frames, raw_frames[:5], strict=True))


def test_sequences_are_found_below_their_dataset_and_converted(sequence: Path, tmp_path: Path) -> None:
    shutil.copytree(sequence, sequence.parent / "01")
    found = find_recordings([tmp_path / "dataset"])
    assert [one.path for one in found.recordings] == [sequence, sequence.parent / "01"]
    with open_recording(sequence) as recording:
        report = convert(recording, tmp_path / "a.mcap")
    assert report.messages["/kitti/velo/pointcloud"] == 5
    with open_recording(tmp_path / "a.mcap") as recording:
        assert len(split(stream_of(recording))[0]) == 5
        assert recording.clock == "relative"


def test_a_sequence_of_two_cameras_without_times_and_lidar_is_read(sequence: Path) -> None:
    for name in ("image_2", "image_3", "velodyne"):
        shutil.rmtree(sequence / name)
    (sequence / "times.txt").unlink()
    with open_recording(sequence) as recording:
        stamps = [m.log_time_ns for m in recording.messages({"/kitti/camera_gray_left/image_rect"})]
    assert stamps == [n * 10**8 for n in range(5)]


def test_the_colour_pictures_alone_have_their_place_beside_the_lidar(sequence: Path) -> None:
    with open_recording(sequence) as recording:
        [whole] = find_rigs(survey(recording))
    for name in ("image_0", "image_1"):
        shutil.rmtree(sequence / name)
    with open_recording(sequence) as recording:
        rig, *_ = find_rigs(survey(recording))
    assert [camera.name for camera in rig.cameras] == ["camera_color_right", "camera_color_left"]
    leftmost = whole.cameras[-1]
    assert leftmost.name == "camera_color_left"
    assert rig.lidar
    assert whole.lidar
    assert np.allclose(rig.lidar.rig_SE3_lidar, whole.lidar.rig_SE3_lidar)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("times.txt", "0.0\n", "no time for file 1"),
        ("times.txt", "yesterday", "ill-formed"),
        ("times.txt", "nan\n" * 5, "not a time since"),
        ("times.txt", "1e300\n" * 5, "not a time since"),
        ("calib.txt", "", "no P0 to P3"),
        ("calib.txt", "P0: 1 2 3", "no P0 to P3"),
        ("image_0/000000.png", "text", "neither PNG nor JPEG"),
    ],
)
def test_an_ill_formed_file_is_a_clear_error(sequence: Path, name: str, text: str, message: str) -> None:
    (sequence / name).write_text(text)
    with pytest.raises(RecordingError, match=message):
        open_recording(sequence)


def test_a_cut_picture_is_damaged_and_the_others_are_used(sequence: Path) -> None:
    picture = sequence / "image_1" / "000002.png"
    picture.write_bytes(picture.read_bytes()[:5000])
    assert cv2.imread(str(sequence / "image_1" / "000001.png")) is not None
    with open_recording(sequence) as recording:
        frames, _ = split(stream_of(recording))
    states = [{s: p.state.value for s, p in f.presence.items() if p.state.value != "present"} for f in frames]
    assert states == [{}, {}, {1: "damaged"}, {}, {}]
