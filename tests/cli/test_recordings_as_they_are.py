"""What a scan does with recordings that are cut, too dear, or of sensors that cannot be compared."""

from pathlib import Path

import pytest

from auditor.cli import run
from tests.making.audits import ask
from tests.making.cut_scans import IN_ONE_CHUNK, KINDS, scan_cuts
from tests.making.small_drives import PERIOD_NS, START_NS, write_drive

FRAMES, PLACES = 8, 2


@pytest.mark.parametrize("kind", KINDS)
def test_the_frames_before_each_cut_are_audited_and_the_loss_is_printed(kind: str, tmp_path: Path) -> None:
    scan = scan_cuts(tmp_path, kind, FRAMES, PLACES)
    assert scan.exit_code == 3
    for cut in scan.cuts:
        assert cut.measured >= FRAMES * cut.share - IN_ONE_CHUNK, cut
        assert cut.adds_up
        assert cut.damage or not cut.measured, cut


def test_bags_without_cameras_say_what_is_missing_or_how_little_is_looked_at(
    real_data: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    source = real_data / "real_bags_without_cameras"
    assert run(["scan", str(source), "--store", str(tmp_path / "audit")]) == 3
    lines = [line for line in capfd.readouterr().err.splitlines() if line.strip()]
    [line] = [line for line in lines if "ros1_tilt_laser.bag" in line]
    assert "no triple possible: there are no camera images and no points" in line
    assert any("ros2_vlp16" in line and "by its own past alone" in line for line in lines), lines
    for name, said in (("ros1_tilt_laser.bag", "no triple possible"), ("ros2_vlp16", "LiDAR alone")):
        assert run(["inspect", str(source / name)]) == 3
        assert said in capfd.readouterr().out


def test_a_recording_over_its_budget_is_one_line_and_leaves_nothing_half_done(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    store, long = tmp_path / "audit", write_drive(tmp_path / "long.mcap", count=40, positions_m=(0.6, 0.3, 0.0))
    assert run(["scan", str(long), "--store", str(store), "--time-limit", "0.4"]) == 3
    [line] = [line for line in capfd.readouterr().err.splitlines() if line.strip()]
    assert "took longer than 0.4 s" in line
    assert "long.mcap" in line
    of_rig = {"rigs", "triples", "sensor_checks", "inputs"}  # known before the first frame is measured
    assert {path.parent.name for path in store.rglob("[0-9a-f]*.parquet")} <= of_rig
    assert not list((store / "measurements").glob("*.parquet"))
    assert run(["scan", str(long), "--measure-only", "--store", str(store)]) == 3
    assert "40 frames measured" in capfd.readouterr().err


def test_vehicle_date_and_drive_come_from_the_path_from_options_and_from_the_recording(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    folder, store = tmp_path / "fleet" / "alder" / "2026-01-31", tmp_path / "audit"
    folder.mkdir(parents=True)
    for place, name in enumerate(("morning", "noon")):
        write_drive(folder / f"{name}.mcap", count=3, start_ns=START_NS + place * 3 * PERIOD_NS, seed=place)
    pattern = ["--path-pattern", "{vehicle}/{date}/*.mcap"]
    scan = ["scan", str(folder), "--measure-only", "--store", str(store)]
    known = "SELECT name, vehicle, CAST(date AS VARCHAR) AS date, drive, drive_id FROM recordings ORDER BY name"
    assert run(scan) == 3
    first, second = ask(store, known)
    assert (first["vehicle"], first["date"], first["drive"]) == (None, None, None)
    assert first["drive_id"] == second["drive_id"], "they follow each other"
    assert run([*scan, *pattern]) == 3
    assert [(row["vehicle"], row["date"]) for row in ask(store, known)] == [("alder", "2026-01-31")] * 2
    assert run([*scan, "--vehicle", "birch", "--drive", "0009"]) == 3
    found = [(row["vehicle"], row["date"], row["drive"]) for row in ask(store, known)]
    assert found == [("birch", "2026-01-31", "0009")] * 2, "what is not given again stays"
    assert run([*scan, "--path-pattern", "{date}/alder/*/*.mcap"]) == 2
    assert "is not a date" in capfd.readouterr().err
    assert run([*scan, "--path-pattern", "{colour}/*.mcap"]) == 2
