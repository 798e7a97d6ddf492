import json
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from auditor.errors import RigError
from auditor.model.optics.geometry import invert, motion
from auditor.model.optics.sensors import NO_LENS, Lens
from auditor.model.rig import Rig
from auditor.recordings import open_recording, rig_of_yaml, survey, write_mcap
from auditor.recordings.decoding.calibration_texts import calibrations_of
from tests.making.camchains import camchain
from tests.making.perturbed_rigs import perturbed
from tests.making.recorded_drives import make_frames, make_rig

LENSES = (Lens("radtan", (-0.2, 0.05, 0.001, 0.0)), Lens("equidistant", (0.01, 0.0, 0.0, 0.0)), NO_LENS)
WIDE = (
    Lens("double_sphere", (-0.2, 0.55)),
    Lens("omni", (0.9, -0.1, 0.02, 0.001, 0.0)),
    Lens("omni", (0.7,) + 4 * (0.0,)),
)


@pytest.fixture
def rig() -> Rig:
    return perturbed(make_rig(), LENSES, seed=3)


@pytest.mark.parametrize("lenses", [LENSES, WIDE])
def test_kalibrs_cameras_and_the_recordings_lidar_are_the_rig(tmp_path: Path, lenses: tuple[Lens, ...]) -> None:
    rig = perturbed(make_rig(), lenses, seed=3)
    (tmp_path / "camchain.yaml").write_text(camchain(rig))
    write_mcap(tmp_path / "a.mcap", rig, make_frames(rig, 3))
    with open_recording(tmp_path / "a.mcap") as recording:
        surveyed = survey(recording)
    again = rig_of_yaml(tmp_path / "camchain.yaml", surveyed)
    assert [camera.topic for camera in again.cameras] == [camera.topic for camera in rig.cameras]
    assert [camera.lens for camera in again.cameras] == list(lenses)
    assert rig.lidar
    assert again.lidar
    for a, b in zip(rig.cameras, again.cameras, strict=True):
        expected, read = (c.projection @ r.lidar.rig_SE3_lidar for c, r in ((a, rig), (b, again)))
        assert np.allclose(expected, read, atol=1e-6)


@pytest.mark.parametrize("name", ["T_cam_imu", "T_imu_cam"])
def test_a_chain_whose_places_are_those_of_an_imu_gives_the_same(rig: Rig, name: str) -> None:
    plain = calibrations_of(camchain(rig))
    places = [np.eye(4)]  # of each camera in the first one's frame, which is put beside an IMU
    for transform in plain.transforms:
        places.append(places[-1] @ transform.parent_SE3_child)
    imu_SE3_cam0 = motion(rig.cameras[0].rotation, np.array([0.1, -0.2, 0.3]))
    document = YAML(typ="safe", pure=True).load(camchain(rig))
    for camera, place in zip(document.values(), places, strict=True):
        imu_SE3_cam = imu_SE3_cam0 @ place
        camera.pop("T_cn_cnm1", None)
        camera[name] = (invert(imu_SE3_cam) if name == "T_cam_imu" else imu_SE3_cam).tolist()
    by_imu = calibrations_of("%YAML:1.0\n" + json.dumps(document))  # OpenCV's own first line
    for a, b in zip(plain.transforms, by_imu.transforms, strict=True):
        assert np.allclose(a.parent_SE3_child, b.parent_SE3_child, atol=1e-9)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("cam0:", "camera:", "it describes no cam0"),
        ("camera_model: pinhole", "camera_model: eucm", "cam0: the camera model 'eucm' is not known"),
        ("camera_model: pinhole", "camera_model: ds", "cam0 is ill-formed"),
        ("distortion_model: radtan", "distortion_model: fov", "cam2: the distortion model 'fov' is not known"),
        ("  rostopic", "  topic", "cam0 lacks 'rostopic'"),
        ("intrinsics: [", "intrinsics: [[[1]], ", "cam0 is ill-formed"),
        ("T_cn_cnm1:", "T_cn_cnm1: 3\n  x:", "cam1 is ill-formed"),
        ("cam0:", "cam0: !!python/object/apply:os.system [true]\ncamX:", "it is not YAML"),
        ("cam0:", "cam0: &a [*a]\ncamX:", "no YAML|cam0 is ill-formed"),
        ("cam0:", "{", "it is not YAML"),
    ],
)
def test_an_ill_formed_camchain_is_an_error(tmp_path: Path, rig: Rig, old: str, new: str, problem: str) -> None:
    path = tmp_path / "camchain.yaml"
    path.write_text(camchain(rig).replace(old, new))
    write_mcap(tmp_path / "a.mcap", rig, make_frames(rig, 2))
    with (
        open_recording(tmp_path / "a.mcap") as recording,
        pytest.raises(RigError, match=rf"camchain\.yaml: .*({problem})"),
    ):
        rig_of_yaml(path, survey(recording))
