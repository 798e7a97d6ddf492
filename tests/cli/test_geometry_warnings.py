"""What scan and inspect say of rigs that are not rectified, and of rigs that do not fit their recording."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.lab.simulation.vehicles import rotation
from auditor.model.optics.geometry import motion
from auditor.model.optics.sensors import NO_LENS, Lens
from auditor.model.rig import Rig
from auditor.recordings import write_mcap, write_rig
from tests.making.perturbed_rigs import perturbed

LENSES = (Lens("plumb_bob", (-0.3, 0.1, 0.0005, -0.0003)), Lens("equidistant", (-0.01, 0.0, 0.0, 0.0)), NO_LENS)


@pytest.fixture(scope="module")
def drive() -> SyntheticDrive:
    return make_drive(2, 2, width_px=621, height_px=188)


@pytest.fixture(scope="module")
def bent(drive: SyntheticDrive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording by cameras that are not rectified, whose calibration says so."""
    crooked = replace(drive, vehicle=replace(drive.vehicle, rig=perturbed(drive.rig, LENSES, 1)))
    path = tmp_path_factory.mktemp("bent") / "bent.mcap"
    write_mcap(path, crooked.rig, crooked.frames())
    return path


def test_a_recording_that_is_not_rectified_is_scanned_and_inspected(
    bent: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(["inspect", str(bent), "--format", "json"]) == 0
    (rig,) = json.loads(capfd.readouterr().out)[0]["rigs"]
    assert rig["calibration_warnings"] == []
    assert rig["rectified_to"]["focal_px"] == pytest.approx(2 * 360.77, abs=0.01)  # enlarged
    assert run(["inspect", str(bent)]) == 0
    assert "not rectified as recorded" in capfd.readouterr().out
    assert run(["scan", str(bent), "--measure-only", "--store", str(tmp_path / "audit")]) == 3
    printed = capfd.readouterr().err
    assert "2 frames measured" in printed
    assert "WARNING" not in printed


def test_inspect_says_that_pictures_of_few_pixels_are_enlarged(
    drive: SyntheticDrive, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    write_mcap(tmp_path / "small.mcap", drive.rig, drive.frames())
    assert run(["inspect", str(tmp_path / "small.mcap"), "--format", "json"]) == 0
    (rig,) = json.loads(capfd.readouterr().out)[0]["rigs"]
    assert rig["rectified_to"] is None
    assert rig["enlarged_to"]["size_px"] == "1242 x 376"
    assert run(["inspect", str(tmp_path / "small.mcap")]) == 0
    assert "measured on images of 1242 x 376 px, focal length 722 px, enlarged" in capfd.readouterr().out


def test_images_that_a_rig_wrongly_calls_rectified_are_a_warning_not_an_attack(
    bent: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with_rig = str(tmp_path / "rig.toml")
    assert run(["inspect", str(bent), "--write-rig", with_rig]) == 0
    wrong = Path(with_rig).read_text().replace("rectified = false", "rectified = true")
    lines = [line for line in wrong.splitlines() if not line.startswith("distortion")]
    Path(with_rig).write_text("\n".join(lines))
    scan = ["scan", str(bent), "--measure-only", "--rig", with_rig, "--store", str(tmp_path / "audit")]
    for how in ("measured", "measured before"):  # the store keeps what did not fit
        assert run(scan) == 3
        said = capfd.readouterr().err
        assert f"2 frames {how}" in said
        assert "WARNING: the images of camera_" in " ".join(said.split())
        assert "wrong rectification flag" in " ".join(said.split())


def test_a_lidar_that_was_moved_is_a_warning_at_inspect(
    drive: SyntheticDrive, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    lidar = drive.rig.lidar
    assert lidar
    tilted = replace(
        lidar, rig_SE3_lidar=motion(rotation(0.02, 0.0, 0.0), lidar.rig_SE3_lidar[:3, 3] * 0) @ lidar.rig_SE3_lidar
    )
    write_mcap(tmp_path / "moved.mcap", Rig(tilted, drive.rig.cameras), drive.frames())
    write_rig(drive.rig, tmp_path / "rig.toml")
    assert run(["inspect", str(tmp_path / "moved.mcap"), "--format", "json"]) == 0
    (rig,) = json.loads(capfd.readouterr().out)[0]["rigs"]
    (warning,) = rig["calibration_warnings"]
    assert "wrong LiDAR mounting" in warning
    assert (
        run(
            [
                "scan",
                str(tmp_path / "moved.mcap"),
                "--measure-only",
                "--rig",
                str(tmp_path / "rig.toml"),
                "--store",
                str(tmp_path / "a"),
            ]
        )
        == 3
    )
    assert "WARNING" not in capfd.readouterr().err
