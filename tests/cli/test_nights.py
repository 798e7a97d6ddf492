"""What a night must not get wrong: mixed fleets, addresses, empty stores, dark recordings, counts of incidents."""

import ast
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import auditor
from auditor.cli import run
from auditor.errors import SettingError, StoreError
from auditor.model.frames import Frame
from auditor.recordings import write_mcap
from auditor.resources import local_path
from auditor.store.export import rows_of
from auditor.store.queries import run_query
from auditor.store.store import Store
from auditor.store.versions.history import calibrations_in_force
from tests.making.fleets import add_drive
from tests.making.scenes import plane_rig
from tests.making.small_drives import drive_frames, write_drive

CAMERAS = (0.6, 0.3, 0.0)
ADDRESS = "s3://bucket/fleet"


def test_calibrate_makes_one_calibration_a_rig_kind(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    three = write_drive(tmp_path / "three.mcap", 6, seed=1, positions_m=CAMERAS)
    four = write_drive(tmp_path / "four.mcap", 6, seed=2)
    store = tmp_path / "audit"
    assert run(["calibrate", str(three), "--store", str(tmp_path / "one")]) == 0
    capfd.readouterr()
    assert run(["calibrate", str(three), str(four), "--vehicle", "a", "--store", str(store)]) in (0, 3)
    said = capfd.readouterr()
    found = calibrations_in_force(Store.open(store))
    assert sorted(len(one.recordings) for one in found) == [1, 1]
    assert len({str(one.rig_kind) for one in found}) == 2
    assert said.err.count("is in force for its rig kind") == 2
    [alone] = calibrations_in_force(Store.open(tmp_path / "one"))
    assert alone.calibration_id in {one.calibration_id for one in found}, "as it is made alone"


def test_calibrate_writes_no_file_for_several_rig_kinds(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    three = write_drive(tmp_path / "three.mcap", 4, seed=1, positions_m=CAMERAS)
    four = write_drive(tmp_path / "four.mcap", 4, seed=2)
    out = tmp_path / "fleet.thresholds"
    assert run(["calibrate", str(three), str(four), "--store", str(tmp_path / "a"), "--out", str(out)]) == 2
    assert "--out: these recordings have 2 rig kinds (LiDAR + 3 cameras" in capfd.readouterr().err
    assert not out.exists()


def test_a_recording_of_which_nothing_can_be_compared_ends_inspect_with_3_as_a_scan(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    rig = plane_rig(CAMERAS, lidar=True)

    def dark() -> Iterator[Frame]:
        for frame in drive_frames(rig, 6, seed=1):
            images = {n: replace(one, pixels=one.pixels // 128) for n, one in frame.images.items()}
            yield replace(frame, images=images)

    path = tmp_path / "dark.mcap"
    write_mcap(path, rig, dark())
    assert run(["scan", str(path), "--store", str(tmp_path / "audit"), "--pictures", "none"]) in (3, 4)
    capfd.readouterr()
    assert run(["inspect", str(path)]) == 3
    assert "could three sensors be compared: too little texture" in " ".join(capfd.readouterr().out.split())


def test_a_store_is_listed_with_its_incidents_and_the_frames_in_them(tmp_path: Path) -> None:
    store = Store.open(tmp_path / "audit", create=True)
    add_drive(store, "attacked.mcap", seed=50, vehicle="car1", day=1, attacked=(2,))
    add_drive(store, "clean.mcap", seed=51, vehicle="car2", day=2)
    [unjudged, _] = rows_of(run_query(store, "contents", {}))
    assert (unjudged["incidents"], unjudged["found"]) == (None, None)
    assert run(["judge", str(store.folder)]) == 1
    asked = rows_of(run_query(store, "incidents", {}))
    rows = {row["name"]: row for row in rows_of(run_query(store, "contents", {}))}
    assert rows["attacked.mcap"]["incidents"] == len(asked) == 1
    assert rows["attacked.mcap"]["found"] > 1
    assert (rows["clean.mcap"]["incidents"], rows["clean.mcap"]["found"]) == (0, 0)


def test_judging_an_empty_store_names_its_folder(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    store = Store.open(tmp_path / "audit", create=True)
    assert run(["judge", str(store.folder)]) == 2
    said = capfd.readouterr().err
    assert said == f"auditor: {store.folder}: nothing has been measured; measure recordings with auditor scan\n"
    assert str(store) == str(store.folder)


def test_no_error_shows_an_address_in_memory() -> None:
    class Nameless:
        pass

    for where in (Nameless(), Nameless, object()):
        assert "0x" not in str(StoreError("it is gone", where=where))
    assert str(StoreError("it is gone", where=Path("a"))) == "a: it is gone"


@pytest.mark.parametrize(
    "words",
    [
        ["convert", ADDRESS, "a.mcap"],
        ["show", ADDRESS, "3"],
        ["store", "list", ADDRESS],
        ["demo", ADDRESS],
        ["refresh", "--metrics", "https://host/file", "a.mcap"],
    ],
    ids=lambda words: " ".join(words[:2]),
)
def test_an_address_is_refused_and_makes_no_folder(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(words) == 2
    said = " ".join(capfd.readouterr().err.split())
    assert "this is an address, and only files of this computer are read and written" in said
    assert "copy it here or mount it as a folder" in said
    assert list(tmp_path.iterdir()) == []


def test_the_library_refuses_an_address_for_a_store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SettingError, match="this is an address"):
        Store.open(ADDRESS, create=True)
    assert list(tmp_path.iterdir()) == []
    assert local_path("C:/store") == Path("C:/store")


def test_every_path_of_the_command_line_is_checked_in_one_place() -> None:
    folder = Path(auditor.__file__).parent / "cli"
    for file in folder.rglob("*.py"):
        tree = ast.parse(file.read_text())
        calls = [
            node for node in ast.walk(tree) if isinstance(node, ast.Call) and ast.unparse(node.func) == "click.Path"
        ]
        assert not calls, file
