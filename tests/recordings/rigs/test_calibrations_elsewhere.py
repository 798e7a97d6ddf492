"""Calibrations that stand in no camera info and no tf: in attachments and metadata, and in YAML that is given."""

from collections.abc import Collection, Iterable
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from auditor.errors import DecodingError, RigError
from auditor.model.optics.geometry import invert, motion
from auditor.model.rig import Rig
from auditor.recordings import open_recording, rig_of_yaml, schemas, search_rigs, survey, write_mcap
from auditor.recordings.decoding.calibration_texts import calibrations_of
from auditor.recordings.synchronisation.survey import Survey
from tests.making.camchains import camchain
from tests.making.perturbed_rigs import perturbed
from tests.making.recorded_drives import make_frames, make_rig
from tests.recordings.rigs.test_camchain import LENSES

RIG = perturbed(make_rig(), LENSES, seed=3)


def without_calibration(
    source: Path,
    path: Path,
    attached: Iterable[tuple[str, str]] = (),
    metadata: dict[str, str] | None = None,
    leave_out: Collection[str] = (schemas.CAMERA_INFO, schemas.TRANSFORMS),
) -> Path:
    """A copy without its camera infos and tf, with attachments and metadata."""
    with source.open("rb") as reading, path.open("wb") as writing:
        writer = Writer(writing)
        writer.start(profile="ros2")
        channels: dict[int, int] = {}
        for schema, channel, message in make_reader(reading).iter_messages():
            if schema.name in leave_out:
                continue
            if channel.id not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, known)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        for name, text in attached:
            writer.add_attachment(0, 0, name, "application/yaml", text.encode())
        if metadata:
            writer.add_metadata("calibration", metadata)
        writer.finish()
    return path


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    write_mcap(path, RIG, make_frames(RIG, 3))
    return path


def surveyed(path: Path) -> Survey:
    with open_recording(path) as recording:
        return survey(recording)


def camera_infos() -> str:
    """As camera_calibration_parsers writes them, one document a camera."""
    documents = []
    for camera in RIG.cameras:
        K, D = camera.intrinsics, list(camera.lens.coefficients) or [0.0] * 5
        P = np.hstack([K, np.zeros((3, 1))])
        model = "plumb_bob" if camera.lens.model == "none" else camera.lens.model
        name = camera.topic.strip("/").split("/")[0]
        matrices = {
            name: f"{name}: {{rows: 3, cols: {values.size // 3}, data: {values.reshape(-1).tolist()}}}"
            for name, values in {"camera_matrix": K, "rectification_matrix": np.eye(3), "projection_matrix": P}.items()
        }
        documents.append(
            f"image_width: {camera.width_px}\nimage_height: {camera.height_px}\ncamera_name: {name}\n"
            f"distortion_model: {model}\ndistortion_coefficients: {{rows: 1, cols: {len(D)}, data: {D}}}\n"
            + "\n".join(matrices.values())
        )
    return "\n---\n".join(documents) + "\n"


def places(survey_: Survey) -> str:
    """As Autoware has them: where the cameras and the LiDAR sit on the sensor kit."""
    frame_ids = {image.topic.name: image.frame_id for image in survey_.images}
    sit = {frame_ids[camera.topic]: motion(camera.rotation.T, camera.centre_m) for camera in RIG.cameras}
    assert RIG.lidar
    sit[survey_.clouds[0].frame_id] = RIG.lidar.rig_SE3_lidar
    lines = ["sensor_kit_base_link:"]
    for frame, kit_SE3_sensor in sit.items():
        R, (x, y, z) = kit_SE3_sensor[:3, :3], kit_SE3_sensor[:3, 3].tolist()
        roll, pitch = np.arctan2(R[2, 1], R[2, 2]), np.arctan2(-R[2, 0], np.hypot(R[2, 1], R[2, 2]))
        yaw = np.arctan2(R[1, 0], R[0, 0])
        lines.append(f"  {frame}: {{x: {x}, y: {y}, z: {z}, roll: {roll}, pitch: {pitch}, yaw: {yaw}}}")
    return "\n".join(lines) + "\n"


def assert_the_same(found: Rig, *, lidar: bool = True) -> None:
    assert [camera.topic for camera in found.cameras] == [camera.topic for camera in RIG.cameras]
    assert [camera.lens for camera in found.cameras] == list(LENSES)
    assert (found.lidar is not None) == lidar
    a, b = RIG.cameras[-1], found.cameras[-1]
    for one, other in zip(RIG.cameras, found.cameras, strict=True):
        between, again = (
            invert(motion(x.rotation.T, x.centre_m)) @ motion(y.rotation.T, y.centre_m)
            for x, y in ((a, one), (b, other))
        )
        assert np.allclose(between, again, atol=1e-6)
        if lidar:
            assert RIG.lidar
            assert found.lidar
            expected, read = (c.projection @ r.lidar.rig_SE3_lidar for c, r in ((one, RIG), (other, found)))
            assert np.allclose(expected, read, atol=1e-4)


@pytest.mark.parametrize("as_metadata", [False, True])
def test_a_camchain_in_the_recording_calibrates_its_cameras(tmp_path: Path, whole: Path, as_metadata: bool) -> None:
    chain = camchain(RIG)
    how = {"metadata": {"camchain": chain}} if as_metadata else {"attached": [("camchain.yaml", chain)]}
    found = surveyed(without_calibration(whole, tmp_path / "b.mcap", **how))
    rig, alone = search_rigs(found).rigs
    assert_the_same(rig, lidar=False)
    assert alone.sensors == (0,)
    assert any("3 cameras and 2 frames are as this text in the recording says" in problem for problem in found.problems)


def test_calibrations_of_autoware_in_the_recording_make_its_rig(tmp_path: Path, whole: Path) -> None:
    texts = [("camera_info.yaml", camera_infos()), ("sensor_kit_calibration.yaml", places(surveyed(whole)))]
    [rig] = search_rigs(surveyed(without_calibration(whole, tmp_path / "b.mcap", texts))).rigs
    assert_the_same(rig)


def test_calibrations_of_autoware_are_taken_as_a_file(tmp_path: Path, whole: Path) -> None:
    bare = surveyed(without_calibration(whole, tmp_path / "b.mcap"))
    assert not any(rig.cameras for rig in search_rigs(bare).rigs)
    (tmp_path / "all.yaml").write_text(camera_infos() + "---\n" + places(bare))
    assert_the_same(rig_of_yaml(tmp_path / "all.yaml", bare))
    (tmp_path / "places.yaml").write_text(places(bare))
    with pytest.raises(RigError, match=r"no rig by these calibrations: .*no camera info"):
        rig_of_yaml(tmp_path / "places.yaml", bare)


def test_a_given_calibration_goes_before_the_recordings_and_one_in_it_behind(tmp_path: Path, whole: Path) -> None:
    known = surveyed(whole)
    wrong = camera_infos().replace(f"data: [{RIG.cameras[0].intrinsics[0, 0]}", "data: [500.0")
    (tmp_path / "a.yaml").write_text(wrong)
    assert rig_of_yaml(tmp_path / "a.yaml", known).rig_id != search_rigs(known).rigs[0].rig_id
    beside = without_calibration(whole, tmp_path / "c.mcap", [("a.yaml", wrong)], leave_out=())
    assert [rig.rig_id for rig in search_rigs(surveyed(beside)).rigs] == [rig.rig_id for rig in search_rigs(known).rigs]


def test_a_frame_of_autowares_camera_gets_that_of_its_pictures() -> None:
    text = "base_link:\n  camera0/camera_link: {x: 1, y: 2, z: 3, roll: 0, pitch: 0, yaw: 0}\n"
    link, optical = calibrations_of(text).transforms
    assert (link.child, optical.child) == ("camera0/camera_link", "camera0/camera_optical_link")
    assert np.allclose((link.parent_SE3_child @ optical.parent_SE3_child)[:3, 2], [1, 0, 0])  # it looks ahead


@pytest.mark.parametrize(
    "text",
    [
        "",
        "a: 1",
        "cam0: 3",
        "camera_matrix: 3",
        "a: [",
        "{",
        "- " * 9000,
        "a: {b: {x: .nan, y: 1, z: 2, roll: 0, pitch: 0, yaw: 0}}",
    ],
)
def test_texts_that_are_no_calibrations_raise_one_kind_of_error(text: str) -> None:
    with pytest.raises(DecodingError):
        calibrations_of(text)
