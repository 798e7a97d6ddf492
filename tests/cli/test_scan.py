import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.identification.evidence_parameters import INCIDENTS
from auditor.identification.incidents.sequential import incident_limit
from auditor.store.store import Store
from tests.making.audits import ask
from tests.making.small_drives import START_NS, THREE_CAMERAS, write_drive

MINUTE_NS = 60 * 10**9
FRAMES = 16
UNSHOWN = ("--pictures", "none")
"""For pictures of incidents a recording is read again, in a process of its own."""
RATES = {"robust": "1%", "paper": "0"}


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two clean drives and one whose S_2 and S_0 are attacked in turn, in the three formats."""
    folder = tmp_path_factory.mktemp("fleet")
    attacked = {2: range(4, 8), 0: range(10, 14)}
    same = {"seed": 1, "count": FRAMES, "positions_m": THREE_CAMERAS}
    write_drive(folder / "clean.mcap", **same)
    write_drive(folder / "quiet.bag", **same, start_ns=START_NS + MINUTE_NS)
    write_drive(folder / "attacked.db3", **same, start_ns=START_NS + 2 * MINUTE_NS, attacked=attacked)
    return folder


@pytest.fixture(scope="module")
def measured(fleet: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store in which the fleet was measured and nothing else."""
    store = tmp_path_factory.mktemp("measured") / "audit"
    assert (
        run(["scan", *map(str, sorted(fleet.iterdir())), "--measure-only", "--store", str(store), "--jobs", "1"]) == 3
    )
    return store


@pytest.fixture
def store(measured: Path, tmp_path: Path) -> Path:
    """A store of the test's own, in which the fleet was measured."""
    return shutil.copytree(measured, tmp_path / "audit")


def summary(store: Path, capfd: pytest.CaptureFixture[str]) -> dict[str, dict[str, object]]:
    capfd.readouterr()
    assert run(["query", "summary", "--store", str(store), "--format", "json"]) == 0
    rows = json.loads(capfd.readouterr().out)
    return {row["name"]: row for row in sorted(rows, key=lambda row: row["rig_name"].endswith("cameras"))}


@pytest.mark.parametrize("method", ["robust", "paper"])
def test_an_attack_is_found_identified_and_exits_with_1(
    method: str, fleet: Path, store: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    how = ["-r", RATES[method], "--store", str(store), "--method", method]
    assert run(["calibrate", str(fleet / "clean.mcap"), *how]) == 0
    recordings = [str(fleet / name) for name in ("clean.mcap", "quiet.bag", "attacked.db3")]
    assert run(["scan", *recordings, *how, *UNSHOWN, "--jobs", "1"]) == 1
    rows = summary(store, capfd)
    assert {row["method"] for row in rows.values()} == {method}
    assert rows["clean.mcap"]["clean"] == FRAMES
    assert rows["quiet.bag"]["clean"] == FRAMES
    assert rows["attacked.db3"]["attacked_sensors"] == [0, 2]
    found = rows["attacked.db3"]
    assert (found["attacked"] + found["suspect"], found["clean"]) == (8, FRAMES - 8)
    assert run(["query", "incidents", "--store", str(store), "--format", "json"]) == 0
    incidents = json.loads(capfd.readouterr().out)
    says = {
        "robust": ("S_2 sees light that others do not", "the cameras disagree with the LiDAR"),
        "paper": ("E_0,2,3", "E_0,1,3"),
    }[method]
    incidents = [row for row in incidents if row["attacked"]]
    assert [row["attacked"] for row in incidents] == [[2], [0]]
    assert [row["last_frame"] for row in incidents] in ([7, 13], [7, 12])
    assert all(words in row["evidence"] for words, row in zip(says, incidents, strict=True))
    others = {"robust": " %)", "paper": "worse by"}[method]
    assert all(others in row["alternatives"] for row in incidents)


def test_a_clean_scan_exits_with_0_in_every_format(fleet: Path, store: Path, capfd: pytest.CaptureFixture[str]) -> None:
    run(["calibrate", str(fleet / "clean.mcap"), "--store", str(store)])
    for form in ("table", "json", "csv", "parquet"):
        assert run(["scan", str(fleet / "clean.mcap"), "--store", str(store), "--format", form]) == 0
    capfd.readouterr()
    assert run(["scan", str(fleet / "attacked.db3"), *UNSHOWN, "--store", str(store), "--format", "json"]) == 1
    said = json.loads(capfd.readouterr().out)
    assert list(said) == ["recordings", "incidents", "not_audited"]
    assert [row["name"] for row in said["recordings"]] == ["attacked.db3"]
    assert [row["attacked"] for row in said["incidents"] if row["attacked"]] == [[2], [0]]
    assert said["not_audited"] == []


def test_recordings_are_scanned_side_by_side_with_the_same_result(tmp_path: Path) -> None:
    names = ("one.mcap", "two.bag", "three.db3")
    recordings = [
        str(write_drive(tmp_path / name, 4, positions_m=THREE_CAMERAS, start_ns=START_NS + number * MINUTE_NS))
        for number, name in enumerate(names)
    ]
    for jobs in ("1", "2"):
        scan = ["scan", *recordings, "--measure-only", "--store", str(tmp_path / jobs), "--jobs", jobs]
        assert run(scan) == 3
    stores = tmp_path / "1", tmp_path / "2"
    for table in ("frames", "cells", "fault_features", "regions"):
        one, two = ({p.name: p.read_bytes() for p in (store / table).iterdir()} for store in stores)
        assert len(one) == 3
        assert one == two, table


def test_without_thresholds_the_prior_judges_and_says_so_and_the_paper_s_method_calls_nothing_clean(
    fleet: Path, store: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    scan = ["scan", str(fleet / "clean.mcap"), *UNSHOWN, "--store", str(store), "--jobs", "1"]
    assert run(scan) in {0, 1}
    shown = capfd.readouterr()
    assert "clean.mcap: judged by the prior alone" in shown.err
    assert "all fully audited" in shown.out
    assert run([*scan, "--method", "paper"]) == 3
    assert "auditor calibrate" in capfd.readouterr().err


def test_measuring_only_says_so_and_judging_comes_later(
    fleet: Path, store: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run(["calibrate", str(fleet / "clean.mcap"), "--store", str(store)])
    assert run(["scan", str(fleet / "attacked.db3"), "--measure-only", "--store", str(store)]) == 3
    assert "no verdicts were reached" in capfd.readouterr().err
    assert run(["judge", str(store)]) == 1
    found = summary(store, capfd)["attacked.db3"]
    assert found["attacked"] + found["suspect"] == 8


def test_a_path_pattern_that_fits_no_recording_is_told(
    fleet: Path, store: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pattern, given = "{vehicle}/{date}/log_*.mcap", sorted(fleet.iterdir())
    assert run(["scan", *map(str, given), "--store", str(store), "--path-pattern", pattern, "--measure-only"]) in (0, 3)
    said = f"path pattern '{pattern}': it does not fit any of the {len(given)} paths, and says no vehicle or date"
    assert said in capfd.readouterr().err


def test_judging_again_at_another_r_needs_no_recording(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    store, copy = tmp_path / "audit", tmp_path / "drive.mcap"
    write_drive(copy, 8, seed=1, positions_m=THREE_CAMERAS)
    run(["calibrate", str(copy), "--store", str(store)])
    assert run(["scan", str(copy), "--store", str(store)]) == 0
    copy.unlink()
    assert run(["judge", str(store), "-r", "0.5", "--method", "paper"]) == 1
    assert run(["judge", str(store), "-r", "0", "--method", "paper"]) == 0
    assert run(["judge", str(store), "-r", "0.1%"]) == 0
    assert summary(store, capfd)["drive.mcap"]["clean"] == 8


def test_a_rate_below_one_sample_is_marked_and_strict_refuses_it(
    fleet: Path, store: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    how = ["-r", "1%", "--method", "paper", "--store", str(store)]
    assert run(["calibrate", str(fleet / "clean.mcap"), *how]) == 0
    assert run(["scan", str(fleet / "clean.mcap"), *how]) == 0
    shown = capfd.readouterr()
    assert "not resolvable" in shown.out
    assert "not resolvable" in shown.err
    assert summary(store, capfd)["clean.mcap"]["resolvable"] is False
    assert run(["scan", str(fleet / "clean.mcap"), *how, "--strict"]) == 2
    assert run(["calibrate", str(fleet / "clean.mcap"), *how, "--strict"]) == 2


def test_any_rate_has_a_limit_by_the_robust_method_and_strict_refuses_what_was_not_learnt(
    fleet: Path, store: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    clean = str(fleet / "clean.mcap")
    how = ["--store", str(store)]
    assert run(["scan", clean, *how, "--strict"]) == 2
    assert "its thresholds are the prior alone" in capfd.readouterr().err
    assert run(["calibrate", clean, *how, "-r", "0.001", "--strict"]) == 0
    shown = capfd.readouterr()
    assert "thresholds learnt from 1 drive: at r = 0.001 a finding has a z above " in shown.out
    assert "resolv" not in shown.out + shown.err
    assert run(["scan", clean, *how, "-r", "0.001", "--strict"]) == 0
    assert "thresholds learnt from 1 drive: a finding has a z above " in capfd.readouterr().out
    for verb in ("calibrate", "scan"):
        assert run([verb, clean, *how, "-r", "0.00001", "--strict"]) == 2
        assert "r = 0.00001 is smaller than what clean frames show" in capfd.readouterr().err


def test_a_calibration_prints_what_is_expected_and_what_the_limit_is_of_each_check(
    fleet: Path, store: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    recordings = [str(fleet / name) for name in ("clean.mcap", "quiet.bag")]
    assert run(["calibrate", *recordings, "--store", str(store), "--format", "json"]) == 0
    rows = json.loads(capfd.readouterr().out)
    light = [row for row in rows if (row["check"], row["sensor"]) == ("added_light", 1)]
    assert [row["others"] for row in light] == [[2, 3], [2], [3]]
    assert {(row["drives"], row["N"], row["thresholds"]) for row in light} == {(2, 2 * FRAMES, "learnt from 2 drives")}
    assert all(0 <= row["expected"] < row["theta"] < 1 for row in light)
    assert len({(row["limit"], row["r"]) for row in rows}) == 1


def test_a_store_judged_by_both_methods_answers_by_the_latest(
    fleet: Path, store: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    page, report = tmp_path / "page.html", ["report", "--store", str(store), "--out"]
    run(["calibrate", str(fleet / "clean.mcap"), "--store", str(store)])
    assert run(["scan", str(fleet / "attacked.db3"), *UNSHOWN, "--store", str(store)]) == 1
    assert run([*report, str(page)]) == 0
    assert "Method <code>robust</code> at" in page.read_text()
    assert "the cameras agree with each other and not with it" in page.read_text()
    assert run(["judge", str(store), "-r", "0", "--method", "paper"]) == 1
    assert {row["method"] for row in summary(store, capfd).values()} == {"paper"}
    assert run([*report, str(page)]) == 0
    assert "Method <code>paper</code> on the gated disparity error" in page.read_text()


def test_incidents_per_hour_are_for_the_robust_method_and_need_clean_hours(
    fleet: Path, store: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    run(["calibrate", str(fleet / "clean.mcap"), str(fleet / "quiet.bag"), "--store", str(store)])
    capfd.readouterr()
    scan = ["scan", str(fleet / "attacked.db3"), *UNSHOWN, "--store", str(store), "--incidents-per-hour"]
    assert run([*scan, "1"]) == 1
    assert "too few clean frames for that incident rate: its limit is extrapolated" in capfd.readouterr().err
    sql = "SELECT incidents_per_hour, score_threshold FROM judgements"
    [row] = ask(store, sql)
    assert row["incidents_per_hour"] == 1.0
    assert row["score_threshold"] > incident_limit(2.0)
    assert run([*scan, "1", "--strict"]) == 2
    assert "1 incidents an hour are not resolvable with" in capfd.readouterr().err
    assert run([*scan, "1", "--method", "paper"]) == 2
    assert "--incidents-per-hour" in capfd.readouterr().err


def test_the_help_names_the_incident_rate_that_is_aimed_at(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["scan", "--help"]) == 0
    shown = " ".join(capfd.readouterr().out.split())
    assert f"false incidents an hour to aim at on clean drives. [default: {INCIDENTS.per_hour:g}]" in shown


def test_calibrating_says_what_is_left_out_in_turn_or_that_nothing_can_be(
    fleet: Path, measured: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for name in ("one", "two"):
        shutil.copytree(measured, tmp_path / name)
    clean, quiet = str(fleet / "clean.mcap"), str(fleet / "quiet.bag")
    assert run(["calibrate", clean, "--store", str(tmp_path / "one")]) == 0
    assert "no other can judge it" in capfd.readouterr().err
    assert run(["calibrate", clean, quiet, "--store", str(tmp_path / "two")]) == 0
    shown = capfd.readouterr()
    assert f"each of 2 recordings judged by the others at r = 0.01: 0 of {2 * FRAMES} frames are findings" in shown.err
    assert "findings by paper" in shown.out


def test_of_three_cameras_two_that_agree_name_the_third(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    # Before one plane nothing tells whether a LiDAR beside two cameras is displaced, which the robust method asks too.
    rigs = (("three", (0.6, 0.3, 0.0), False, 2), ("two", (0.6, 0.0), True, 1))
    for (name, positions, lidar, sensor), methods in zip(rigs, (("robust", "paper"), ("paper",)), strict=True):
        store = tmp_path / name
        how = {"positions_m": positions, "lidar": lidar, "count": 12}
        clean = write_drive(tmp_path / f"{name}_clean.mcap", **how)
        how |= {"start_ns": START_NS + MINUTE_NS, "attacked": {sensor: range(4, 8)}}
        attacked = write_drive(tmp_path / f"{name}_attacked.mcap", **how)
        run(["calibrate", str(clean), "--store", str(store)])
        scan = ["scan", str(clean), str(attacked), *UNSHOWN, "--store", str(store), "--jobs", "1"]
        for method in methods:
            assert run([*scan, "--method", method, "-r", RATES[method]]) == 1
            row = summary(store, capfd)[attacked.name]
            named = 4 if method == "robust" else 0
            assert (row["unidentified"] + row["suspect"], row["attacked"], row["clean"]) == (4 - named, named, 8)


def test_a_rig_file_takes_the_place_of_the_recordings_own(
    fleet: Path, store: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    rig = tmp_path / "rig.toml"
    assert run(["inspect", str(fleet / "clean.mcap"), "--write-rig", str(rig)]) == 0
    assert run(["calibrate", str(fleet / "clean.mcap"), "--rig", str(rig), "--store", str(store)]) == 0
    rig.write_text(rig.read_text().replace("/camera_1", "/camera_9"))
    assert run(["scan", str(fleet / "clean.mcap"), "--rig", str(rig), "--store", str(store)]) == 3
    assert "/camera_9" in capfd.readouterr().err


def test_the_program_runs_as_a_command(fleet: Path, store: Path) -> None:
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "auditor",
            "scan",
            str(fleet / "clean.mcap"),
            "--store",
            str(store),
            "--method",
            "paper",
            "--format",
            "json",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 3
    said = json.loads(done.stdout)
    assert said["recordings"][0]["frames"] == FRAMES
    assert said["incidents"] == []
    [left] = said["not_audited"]
    assert left["reason"] == "no thresholds for its rig kind and matcher"


def test_a_scan_killed_before_it_kept_the_recording_itself_is_completed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    store = tmp_path / "audit"
    clean = write_drive(tmp_path / "clean.mcap", 12, positions_m=THREE_CAMERAS)
    run(["calibrate", str(clean), "--store", str(store)])
    kept = [path for table in ("recordings", "labels") for path in (store / table).glob("*.parquet")]
    assert len(kept) == 2
    for path in kept:
        path.unlink()
    assert run(["scan", str(clean), "--store", str(store)]) == 3, "by the log they were there: somebody took them"
    assert "measured before" in capfd.readouterr().err
    assert all(path.is_file() for path in kept)
    assert [(known.name, known.format) for known in Store.open(store).recordings()] == [("clean.mcap", "mcap")]
    assert summary(store, capfd)["clean.mcap"]["clean"] == 12
