"""Rings of cameras, rendered with the published geometry of a fleet, from a recording to exit codes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auditor.cli import run
from auditor.lab.attacks.paper import BogusWall
from auditor.model.frames import PointCloud
from tests.making.audits import ask
from tests.making.published_recordings import write_published
from tests.making.published_rigs import PUBLISHED_RIGS
from tests.making.ring_drives import make_ring_drive

FRAMES, ATTACKED = 8, range(3, 7)
RIG = replace(
    PUBLISHED_RIGS["nuscenes"].smaller(0.4),
    cameras=tuple(PUBLISHED_RIGS["nuscenes"].smaller(0.4).cameras[n] for n in (0, 3, 5)),
)
WALL = BogusWall(6.0, 0.0, seed=3)


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder, [lidar] = tmp_path_factory.mktemp("rings"), RIG.lidars
    drive = make_ring_drive(RIG, 3, FRAMES)
    back = RIG.lone("cam_back")
    assert back.lidar
    # The wall stands before the camera that looks back: "ahead" is where that looks.
    turn = np.eye(4)
    turn[:3, :3] = back.camera(1).rotation
    behind = replace(back, lidar=replace(back.lidar, rig_SE3_lidar=turn @ back.lidar.rig_SE3_lidar))
    pictures = [{camera.name: drive.picture(n, camera) for camera in RIG.cameras} for n in range(FRAMES)]
    clouds = [drive.points(n, lidar) for n in range(FRAMES)]
    walled = [
        WALL.apply(PointCloud(n, xyz_m), behind).xyz_m if n in ATTACKED else xyz_m for n, xyz_m in enumerate(clouds)
    ]
    for name, points in (("clean", clouds), ("walled", walled)):
        write_published(folder / f"{name}.mcap", RIG, pictures, [{lidar.name: xyz_m} for xyz_m in points])
    return {name: folder / f"{name}.mcap" for name in ("clean", "walled")}


def verdicts(path: Path, store: Path) -> tuple[int, dict[str, list[str]]]:
    """The exit code of a scan, and by camera the kinds of its frames."""
    code = run(["scan", str(path), "--store", str(store), "--pictures", "none"])
    rows = ask(
        store,
        "SELECT s.name, frame, kind, attacked FROM verdicts JOIN (SELECT DISTINCT measurement_id, name FROM sensors "
        "WHERE sensor = 1) s USING (measurement_id) ORDER BY frame",
    )
    assert {tuple(row["attacked"] or ()) for row in rows} <= {(), (0,)}
    kinds: dict[str, list[str]] = {}
    for row in rows:
        kinds.setdefault(row["name"], []).append(row["kind"])
    return code, kinds


def test_a_wall_behind_the_vehicle_names_the_lidar_once_whichever_camera_looks_there(
    recordings: dict[str, Path], tmp_path: Path
) -> None:
    code, kinds = verdicts(recordings["walled"], tmp_path)
    assert code == 4
    assert set(kinds) == {"cam_back", "cam_front", "cam_front_left"}
    # How sure it is of each frame differs a little from processor to processor.
    for each in kinds.values():
        raised = {frame: kind for frame, kind in enumerate(each) if kind in ("attacked", "unidentified")}
        assert set(raised) <= set(ATTACKED)
        assert list(raised.values()).count("attacked") >= 2
    assert ask(tmp_path, "SELECT attacked FROM incidents WHERE same_as IS NULL") == [{"attacked": [0]}]


def test_a_clean_drive_is_audited_all_around_once_it_moves(recordings: dict[str, Path], tmp_path: Path) -> None:
    code, kinds = verdicts(recordings["clean"], tmp_path)
    assert code == 3, "no light is looked at"
    assert all(each == ["not_auditable", *["clean"] * (FRAMES - 1)] for each in kinds.values())
    assert len(kinds) == 3


def test_inspect_draws_the_ring(recordings: dict[str, Path], tmp_path: Path) -> None:
    picture = tmp_path / "ring.svg"
    assert run(["inspect", str(recordings["clean"]), "--picture", str(picture)]) == 3
    svg = picture.read_text(encoding="utf-8")
    assert all(camera.name in svg for camera in RIG.cameras)
    assert run(["inspect", str(recordings["clean"]), "--picture", str(picture)]) == 2, "it is kept"
