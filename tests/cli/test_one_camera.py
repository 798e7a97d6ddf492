"""Rigs of one camera and a LiDAR, from a recording to exit codes, queries and pages."""

import json
from dataclasses import replace
from itertools import islice
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.lab.attacks.paper import BogusWall
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.model.frames import Frame
from auditor.recordings import write_mcap, write_rig
from tests.making.audits import ask
from tests.making.foxglove_messages import ddad, nuscenes, write_protobuf

FRAMES, ATTACKED = 10, range(5, 9)
WALL = BogusWall(range_m=7.0, lateral_m=-1.5, seed=3)
LIGHT = "is looked at for light by its own past alone, hardly straight ahead and not in the sky: no other camera"


@pytest.fixture(scope="module")
def drive() -> SyntheticDrive:
    return make_drive(2, FRAMES, n_cameras=1, width_px=620, height_px=188)


@pytest.fixture(scope="module")
def recordings(drive: SyntheticDrive, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("one_camera")
    clean = list(drive.frames())
    walled = [
        replace(one, cloud=WALL.apply(one.cloud, drive.rig)) if one.number in ATTACKED and one.cloud else one
        for one in clean
    ]
    for name, frames in (("clean", clean), ("wall", walled)):
        write_mcap(folder / f"{name}.mcap", drive.rig, frames)
    return {name: folder / f"{name}.mcap" for name in ("clean", "wall")}


def scanned(path: Path, store: Path, capfd: pytest.CaptureFixture[str], *options: str) -> tuple[int, str]:
    code = run(["scan", str(path), "--store", str(store), "--pictures", "none", *options])
    return code, capfd.readouterr().err


def test_a_bogus_wall_is_an_incident_of_the_lidar_and_the_camera_is_not_looked_at_for_light(
    recordings: dict[str, Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    code, remarks = scanned(recordings["wall"], tmp_path, capfd)
    assert code == 4
    assert LIGHT in remarks
    verdicts = "SELECT frame, kind, e, attacked FROM verdicts ORDER BY frame"
    rows = ask(tmp_path, verdicts)
    assert (rows[0]["kind"], rows[0]["e"]) == ("not_auditable", "-")
    named = {row["frame"] for row in rows if row["attacked"] == [0]}
    assert set(ATTACKED[1:]) <= named <= set(ATTACKED)
    assert {row["kind"] for row in rows[1:] if row["frame"] not in ATTACKED} == {"clean"}
    [incident] = ask(tmp_path, "SELECT attacked, kind, grade FROM incidents")
    assert (incident["attacked"], incident["kind"], incident["grade"]) == ([0], "attacked", "incident")
    assert run(["report", "--store", str(tmp_path)]) == 0
    pages = [page.read_text() for page in (tmp_path / "reports").rglob("*.html")]
    assert any("the camera and its own past agree with each other and not with it" in page for page in pages)


def test_a_clean_drive_is_clean_and_ends_in_3_unless_nobody_asks_for_the_camera(
    recordings: dict[str, Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    code, remarks = scanned(recordings["clean"], tmp_path, capfd)
    assert (code, LIGHT in remarks) == (3, True)
    rows = ask(tmp_path, "SELECT kind, reason FROM verdicts ORDER BY frame")
    assert [row["kind"] for row in rows] == ["not_auditable", *["clean"] * (FRAMES - 1)]
    assert "the vehicle stands" in rows[0]["reason"]
    code, remarks = scanned(recordings["clean"], tmp_path, capfd, "--min-view", "0", "--min-coverage", "0.9")
    assert (code, LIGHT in remarks) == (0, False)


def test_a_picture_that_is_black_is_said_to_be_why_nothing_was_compared(
    drive: SyntheticDrive, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    night = [
        replace(one, images={1: replace(one.images[1], pixels=one.images[1].pixels % 4)})
        for one in islice(drive.frames(), 2)
        if isinstance(one, Frame)
    ]
    write_mcap(tmp_path / "night.mcap", drive.rig, night)
    assert scanned(tmp_path / "night.mcap", tmp_path / "audit", capfd)[0] == 3
    rows = ask(tmp_path / "audit", "SELECT reason FROM verdicts")
    assert {row["reason"] for row in rows} == {"the camera's picture is black: nothing was compared"}


def test_inspect_says_what_one_camera_can_and_cannot(
    recordings: dict[str, Path], capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(["inspect", str(recordings["clean"]), "--format", "json"]) == 3
    [rig] = json.loads(capfd.readouterr().out)[0]["rigs"]
    assert (rig["triples"], rig["max_attacked"], rig["kind"].split(" f=")[0]) == (
        [[0, 1, 1]],
        0,
        "LiDAR + 1 camera 620x188",
    )
    assert [sensor.get("compared_share") for sensor in rig["sensors"]] == [None, 0.0]
    assert "name S_0" in rig["capabilities"][0]
    assert LIGHT in " ".join(rig["reading"])
    assert not any("could the LiDAR be compared" in line for line in rig["reading"])


def test_a_rig_file_may_name_one_camera(
    recordings: dict[str, Path], drive: SyntheticDrive, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    write_rig(drive.rig, tmp_path / "rig.toml")
    code, _ = scanned(recordings["clean"], tmp_path / "audit", capfd, "--rig", str(tmp_path / "rig.toml"))
    assert code == 3
    assert len(ask(tmp_path / "audit", "SELECT 1 FROM verdicts WHERE kind = 'clean'")) == FRAMES - 1


def test_one_camera_can_be_calibrated_and_judged_by_it(
    recordings: dict[str, Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(["calibrate", str(recordings["clean"]), "--store", str(tmp_path)]) == 0
    code, _ = scanned(recordings["wall"], tmp_path, capfd)
    assert code == 4
    assert run(["judge", "--store", str(tmp_path), "--method", "paper"]) in (3, 4)
    assert {row["attacked"] is None or row["attacked"] == [] for row in ask(tmp_path, "SELECT attacked FROM verdicts")}


def test_a_ring_whose_vehicle_stands_is_a_rig_a_camera_and_never_clean(
    real_data: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    write_protobuf(tmp_path / "ddad.mcap", ddad(real_data / "ddad_scene_01"))
    code, remarks = scanned(tmp_path / "ddad.mcap", tmp_path / "audit", capfd)
    assert code == 3
    for camera in ("camera_01", "camera_05", "camera_06"):
        assert f"{camera} {LIGHT}" in remarks
    assert {row["kind"] for row in ask(tmp_path / "audit", "SELECT kind FROM verdicts")} == {"not_auditable"}


def test_the_six_cameras_of_a_nuscenes_frame_are_six_rigs_of_which_one_frame_tells_nothing(
    real_data: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    write_protobuf(tmp_path / "nuscenes.mcap", nuscenes(real_data / "nuscenes_one_frame"))
    code, remarks = scanned(tmp_path / "nuscenes.mcap", tmp_path / "audit", capfd)
    assert code == 3
    assert remarks.count(LIGHT) == 6
    assert {row["kind"] for row in ask(tmp_path / "audit", "SELECT kind FROM verdicts")} == {"not_auditable"}
