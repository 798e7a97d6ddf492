"""Rigs of a LiDAR alone, from a recording to exit codes, queries and pages."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import auditor
from auditor.cli import run
from auditor.lab.attacks.spoofing import GhostCar
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.model.arrays import Points
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from auditor.recordings import write_mcap
from auditor.recordings.writers.frames import write_bag
from tests.making.audits import ask

FRAMES, ATTACKED = 8, range(4, 7)
GHOST = GhostCar(points=120, range_m=8.0, seed=1)
SAID = "is looked at for what appears, by its own past alone: it is compared with no camera and no other LiDAR"


@pytest.fixture(scope="module")
def drive() -> SyntheticDrive:
    return make_drive(2, FRAMES, n_cameras=3, width_px=310, height_px=94)


@pytest.fixture(scope="module")
def frames(drive: SyntheticDrive) -> list[Frame]:
    return list(drive.frames())


def lidar_of(drive: SyntheticDrive, name: str = "top") -> Rig:
    assert drive.rig.lidar
    return Rig(replace(drive.rig.lidar, name=name, topic=f"/{name}/points"), ())


def scans(drive: SyntheticDrive, frames: Sequence[Frame], attacked: Iterable[int] = ()) -> list[Frame]:
    """The frames without their pictures; a ghost stands ahead in those that are attacked."""
    return [
        replace(
            one,
            cloud=GHOST.apply(one.cloud, drive.rig) if one.number in attacked else one.cloud,
            images={},
            presence={LIDAR: one.presence[LIDAR]},
        )
        for one in frames
        if one.cloud
    ]


def scanned(paths: Sequence[Path], store: Path, capfd: pytest.CaptureFixture[str], *options: str) -> tuple[int, str]:
    code = run(["scan", *map(str, paths), "--store", str(store), "--pictures", "none", *options])
    return code, capfd.readouterr().err


def test_a_ghost_that_appears_is_an_incident_of_the_lidar(
    drive: SyntheticDrive, frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "drive.bag"
    write_bag(path, lidar_of(drive), scans(drive, frames, ATTACKED))
    code, remarks = scanned([path], tmp_path / "audit", capfd)
    assert (code, f"S_0 top {SAID}" in remarks) == (4, True)
    rows = ask(tmp_path / "audit", "SELECT frame, kind, e, attacked, reason FROM verdicts ORDER BY frame")
    assert (rows[0]["kind"], rows[0]["e"]) == ("not_auditable", "")
    assert "no scan of the same place a moment before" in rows[0]["reason"]
    assert [row["frame"] for row in rows if row["attacked"] == [0]] == [*ATTACKED]
    assert {row["kind"] for row in rows[1:] if row["frame"] not in ATTACKED} == {"clean"}
    [incident] = ask(tmp_path / "audit", "SELECT attacked, kind, grade FROM incidents")
    assert (incident["attacked"], incident["kind"], incident["grade"]) == ([0], "attacked", "incident")
    assert scanned([path], tmp_path / "audit", capfd, "--min-view", "0", "--min-coverage", "0.8")[0] == 1


def test_a_clean_drive_can_be_calibrated_reported_and_verified(
    drive: SyntheticDrive, frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for name, attacked in (("clean", ()), ("ghost", ATTACKED)):
        write_mcap(tmp_path / f"{name}.mcap", lidar_of(drive), scans(drive, frames, attacked))
    store = str(tmp_path / "audit")
    assert run(["calibrate", str(tmp_path / "clean.mcap"), "--store", store]) == 0
    code, remarks = scanned([tmp_path / "clean.mcap"], tmp_path / "audit", capfd)
    assert (code, SAID in remarks) == (3, True)
    [looked] = ask(tmp_path / "audit", "SELECT sensor, one_share, two_share FROM looked")
    assert looked["sensor"] == 0
    assert 0.2 < looked["one_share"] < 0.5
    assert looked["two_share"] == 0
    assert scanned([tmp_path / "ghost.mcap"], tmp_path / "audit", capfd)[0] == 4
    [judged] = ask(tmp_path / "audit", "SELECT drives FROM judgements WHERE drives > 0 LIMIT 1")
    assert judged["drives"] == 1
    assert run(["report", "--store", store]) == 0
    pages = [page.read_text() for page in (tmp_path / "audit" / "reports").rglob("*.html")]
    assert any("has points where its beams passed a moment ago" in page for page in pages)
    assert run(["verify", "--store", store]) == 0


def test_inspect_says_what_a_lidar_alone_can_and_cannot_and_writes_a_rig_file_that_a_scan_takes(
    drive: SyntheticDrive, frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, file, picture = (tmp_path / name for name in ("clean.mcap", "rig.toml", "rig.svg"))
    write_mcap(path, lidar_of(drive), scans(drive, frames))
    words = ["--write-rig", str(file), "--picture", str(picture), "--format", "json"]
    assert run(["inspect", str(path), *words]) == 3
    [description] = json.loads(capfd.readouterr().out)
    assert "it holds no pictures of cameras: give the file that does" in description["problems"][0]
    [rig] = description["rigs"]
    assert (rig["kind"], rig["triples"], rig["max_attacked"]) == ("LiDAR alone", [], 0)
    assert "while the vehicle stands" in rig["capabilities"][0]
    assert "what is there from the first frame on" in rig["capabilities"][1]
    assert SAID in " ".join(rig["reading"])
    assert "top" in picture.read_text()
    assert scanned([path], tmp_path / "audit", capfd, "--rig", str(file))[0] == 3
    assert len(ask(tmp_path / "audit", "SELECT 1 FROM verdicts WHERE kind = 'clean'")) == FRAMES - 1


@pytest.mark.parametrize("with_cameras", [True, False])
def test_of_two_lidars_each_that_no_camera_takes_is_a_rig_of_its_own(
    drive: SyntheticDrive,
    frames: list[Frame],
    with_cameras: bool,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    folder = tmp_path / "drive"
    folder.mkdir()
    if with_cameras:
        write_mcap(folder / "cameras_and_top.mcap", drive.rig, frames)
    else:
        write_mcap(folder / "top.mcap", lidar_of(drive, "top"), scans(drive, frames))
    write_mcap(folder / "side.mcap", lidar_of(drive, "side"), scans(drive, frames, ATTACKED))
    code, remarks = scanned([folder], tmp_path / "audit", capfd)
    assert code == 4
    assert remarks.count(SAID) == (1 if with_cameras else 2)
    assert "not compared with others" not in remarks
    rigs = ask(tmp_path / "audit", "SELECT n, attacked_names FROM rigs LEFT JOIN incidents USING (rig_id) ORDER BY n")
    assert [row["n"] for row in rigs] == ([0, 3] if with_cameras else [0, 0])
    assert [row["attacked_names"] for row in rigs if row["attacked_names"]] == [["S_0 side"]]


def test_a_vehicle_with_two_kinds_of_rigs_is_calibrated_in_one_call(
    drive: SyntheticDrive, frames: list[Frame], tmp_path: Path
) -> None:
    folder, store = tmp_path / "drive", tmp_path / "audit"
    folder.mkdir()
    write_mcap(folder / "cameras_and_top.mcap", drive.rig, frames)
    write_mcap(folder / "side.mcap", lidar_of(drive, "side"), scans(drive, frames))
    made = auditor.calibrate(folder, store=store)
    assert len(made.calibrations) == 2
    assert made.calibration == made.calibrations[0]
    versions = ask(store, "SELECT DISTINCT calibration_id FROM calibrations")
    assert {row["calibration_id"] for row in versions} == {one.calibration_id for one in made.calibrations}


def test_a_lidar_alone_that_need_not_be_audited_leaves_the_audit_complete(
    drive: SyntheticDrive, frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, topic = tmp_path / "clean.mcap", lidar_of(drive).topic(LIDAR)
    write_mcap(path, lidar_of(drive), scans(drive, frames))
    code, remarks = scanned([path], tmp_path / "audit", capfd, "--no-sensor", topic)
    assert (code, SAID in remarks) == (0, False)
    assert run(["judge", "--store", str(tmp_path / "audit"), "--method", "paper"]) == 3


def test_a_vehicle_that_stands_is_looked_at_and_scans_far_apart_are_not(
    drive: SyntheticDrive, frames: list[Frame], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    first, scan_ns = scans(drive, frames)[0], 10**8
    assert first.cloud
    for name, apart_ns in (("stands", scan_ns), ("slow", 5 * scan_ns)):
        stamps = [first.stamp_ns + number * apart_ns for number in range(FRAMES)]
        still = [
            replace(
                first,
                number=number,
                stamp_ns=at,
                cloud=replace(first.cloud, stamp_ns=at, xyz_m=jittered(first, number)),
            )
            for number, at in enumerate(stamps)
        ]
        write_mcap(tmp_path / f"{name}.mcap", lidar_of(drive), still)
        scanned([tmp_path / f"{name}.mcap"], tmp_path / name, capfd)
    kinds = {name: ask(tmp_path / name, "SELECT kind FROM verdicts ORDER BY frame") for name in ("stands", "slow")}
    assert [row["kind"] for row in kinds["stands"]] == ["not_auditable", *["clean"] * (FRAMES - 1)]
    assert {row["kind"] for row in kinds["slow"]} == {"not_auditable"}


def jittered(frame: Frame, seed: int) -> Points:
    """The frame's points with the noise of another scan."""
    assert frame.cloud
    noise = np.random.default_rng(seed).normal(0, 0.01, frame.cloud.xyz_m.shape)
    return (frame.cloud.xyz_m + noise).astype(np.float32)
