"""Cameras too close together to check the LiDAR, as of a robot's stereo head: each does it by its own past as well."""

import json
import re
import shutil
from contextlib import redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.lab.attacks.paper import BogusWall
from auditor.lab.simulation.drives import make_drive
from auditor.recordings import write_mcap
from tests.making.audits import ask

FRAMES, ATTACKED = 10, range(5, 9)
WALL = BogusWall(range_m=7.0, lateral_m=-1.5, seed=3)
BY_PAST = "is checked by each camera's own past alone: S_1 and S_2 lie too close together to check its ranges"


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("close_together")
    drive = make_drive(2, FRAMES, n_cameras=2, width_px=620, height_px=188, positions_m=(0.06, 0.0))
    clean = list(drive.frames())
    walled = [
        replace(one, cloud=WALL.apply(one.cloud, drive.rig)) if one.number in ATTACKED and one.cloud else one
        for one in clean
    ]
    for name, frames in (("clean", clean), ("wall", walled)):
        write_mcap(folder / f"{name}.mcap", drive.rig, frames)
    wide = make_drive(2, FRAMES, n_cameras=2, width_px=620, height_px=188, positions_m=(0.54, 0.0))
    # From the first frame on, so that no scan by itself names the LiDAR.
    lasting = (replace(one, cloud=WALL.apply(one.cloud, wide.rig)) if one.cloud else one for one in wide.frames())
    write_mcap(folder / "wide.mcap", wide.rig, lasting)
    return {name: folder / f"{name}.mcap" for name in ("clean", "wall", "wide")}


def scan(path: Path, store: Path, *options: str) -> int:
    return run(["scan", str(path), "--store", str(store), "--pictures", "none", *options])


def test_a_bogus_wall_names_the_lidar_by_each_camera_s_past(
    recordings: dict[str, Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert scan(recordings["wall"], tmp_path) == 4
    shown = capfd.readouterr()
    assert BY_PAST in shown.err
    assert "no other camera sees it" not in shown.err  # the other one of the pair does
    rows = [line.split() for line in shown.out.splitlines() if line.split()[:1] == ["wall.mcap"]]
    assert {" ".join(row[1:3]) for row in rows} >= {"2 cameras"}
    named = "SELECT i.kind, attacked, len(sensors) AS sensors FROM incidents AS i JOIN rigs USING (rig_id)"
    assert {(row["kind"], *row["attacked"], row["sensors"]) for row in ask(tmp_path, named)} >= {("attacked", 0, 2)}


@pytest.fixture(scope="module")
def wide(recordings: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The store of a wide pair under a wall, and what its scan says."""
    store, told = tmp_path_factory.mktemp("wide") / "audit", StringIO()
    with redirect_stdout(told):
        # Frames that a lone camera could not compare are no gap here.
        assert scan(recordings["wide"], store) == 1
    return store, told.getvalue()


def test_a_wide_pair_detects_a_wall_and_the_past_of_its_cameras_names_the_lidar_on_its_page(
    wide: tuple[Path, str], tmp_path: Path
) -> None:
    shutil.copytree(wide[0], tmp_path, dirs_exist_ok=True)
    found = "SELECT incident_id, attacked, len(sensors) AS sensors FROM incidents JOIN rigs USING (rig_id)"
    of_pair = [row["incident_id"] for row in ask(tmp_path, found) if (row["attacked"], row["sensors"]) == ([], 3)]
    assert of_pair
    assert run(["report", "--store", str(tmp_path)]) == 0
    page = (tmp_path / "reports" / "incidents" / f"{of_pair[0]}.html").read_text()
    words = re.sub("<[^>]*>", "", page)
    assert re.search(r"Compared with the past of camera_\d, lidar was attacked in \d+\sframes", words)


def test_what_several_rigs_say_of_one_attack_is_shown_once_and_reviewed_once(
    wide: tuple[Path, str], tmp_path: Path
) -> None:
    store, out = wide
    shutil.copytree(store, tmp_path, dirs_exist_ok=True)
    assert re.search(r"^LiDAR: \d+ % to \d+ % of its points are compared with cameras; elsewhere only what ", out, re.M)
    shown = re.findall(r"^ ([0-9a-f]{8}) .* (\d)\s*$", out, re.MULTILINE)
    rows = ask(tmp_path, "SELECT incident_id, kind, attacked, same_as FROM incidents")
    ((one, rigs),) = shown
    assert [(row["kind"], row["attacked"]) for row in rows if row["same_as"] is None] == [("attacked", [0])]
    assert len(rows) == int(rigs) > 1
    assert {row["same_as"][:8] for row in rows if row["same_as"]} == {one}
    assert run(["report", "--store", str(tmp_path)]) == 0
    assert re.search(r"<title>Sensor audit: 1\sincident in ", (tmp_path / "reports" / "index.html").read_text())
    assert run(["review", one, "--as", "false-alarm", "--reason", "a bus", "--store", str(tmp_path)]) == 0
    assert {row["review"] for row in ask(tmp_path, "SELECT review FROM incidents")} == {"false-alarm"}
    assert run(["judge", "--store", str(tmp_path)]) == 0


def test_a_clean_drive_says_what_the_lidar_is_checked_by_and_is_complete_where_that_will_do(
    recordings: dict[str, Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert scan(recordings["clean"], tmp_path) == 3
    assert BY_PAST in capfd.readouterr().err
    # The first frame has no past.
    assert scan(recordings["clean"], tmp_path, "--min-view", "0", "--min-coverage", "0.9") == 0


def test_inspect_shows_the_pair_and_each_camera_by_itself(
    recordings: dict[str, Path], capfd: pytest.CaptureFixture[str]
) -> None:
    assert run(["inspect", str(recordings["clean"]), "--format", "json"]) == 3
    pair, *alone = json.loads(capfd.readouterr().out)[0]["rigs"]
    assert [len(rig["sensors"]) for rig in (pair, *alone)] == [3, 2, 2]
    assert any(BY_PAST in line for line in pair["reading"])
    assert {rig["sensors"][1]["topic"] for rig in alone} == {one["topic"] for one in pair["sensors"][1:]}
