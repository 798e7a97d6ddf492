"""Every path that a scan was given or found has a row, and pages and questions say what the exit code says."""

import json
import shutil

import pytest

import auditor
from auditor.cli import run
from auditor.store.queries import run_query, run_sql
from auditor.store.store import Store
from tests.making.small_drives import THREE_CAMERAS, write_drive


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Logs as they lie in a folder: one drive twice, and what is none."""
    logs = tmp_path_factory.mktemp("ledger") / "logs"
    logs.mkdir()
    drive = write_drive(logs / "a.mcap", 4, seed=1, positions_m=THREE_CAMERAS)
    shutil.copy(drive, logs / "b.mcap")
    (logs / "junk.mcap").write_text("no recording")
    (logs / "empty.bag").touch()
    (logs / "part.mcap.part").write_bytes(drive.read_bytes()[:999])
    return logs


def outcomes(store):
    rows = run_sql(store, "SELECT name, outcome, reason, recording_id IS NOT NULL AS known FROM inputs").to_pylist()
    return {row["name"]: (row["outcome"], row["known"]) for row in rows}


EXPECTED = {
    "a.mcap": ("read", True),
    "b.mcap": ("twin", True),
    "junk.mcap": ("not read", False),
    "empty.bag": ("not read", False),
    "part.mcap.part": ("not read", False),
    "nosuch.mcap": ("not read", False),
}


def test_every_path_that_was_offered_has_a_row_by_the_command_and_by_the_library(folder, tmp_path):
    paths = [folder, folder / "nosuch.mcap"]
    assert run(["scan", *map(str, paths), "--store", str(tmp_path / "audit"), "--jobs", "1"]) in (3, 4)
    list(auditor.scan(paths, store=tmp_path / "library", jobs=1))
    for name in ("audit", "library"):
        assert outcomes(Store.open(tmp_path / name)) == EXPECTED


def test_what_was_not_read_is_told_until_it_is_read(folder, tmp_path, capfd):
    log, store = tmp_path / "log.mcap", str(tmp_path / "audit")
    run(["scan", str(folder / "a.mcap"), "--store", store, "--jobs", "1"])
    log.write_text("being uploaded")
    assert run(["scan", str(log), "--store", store]) == 2

    def told():
        capfd.readouterr()
        assert run(["query", "not_audited", "--store", store, "--format", "json"]) == 0
        return [row["name"] for row in json.loads(capfd.readouterr().out) if row["what"] == "input"]

    assert told() == ["log.mcap"]
    shutil.copy(folder / "a.mcap", log)
    run(["scan", str(log), "--store", store, "--jobs", "1"])
    assert told() == []


def test_the_gaps_that_ended_a_scan_in_3_stand_in_the_rows_that_pages_show(folder, tmp_path):
    cut, store = tmp_path / "cut.mcap", tmp_path / "audit"
    whole = (folder / "a.mcap").read_bytes()
    cut.write_bytes(whole[: len(whole) * 4 // 5])
    assert run(["scan", str(cut), "--store", str(store), "--jobs", "1"]) in (3, 4)
    [row] = run_sql(Store.open(store), "FROM inputs").to_pylist()
    told = [one["reason"] for one in run_query(Store.open(store), "report_unaudited").to_pylist()]
    assert row["gaps"]
    assert all(any(gap.startswith(reason[:30]) for reason in told) for gap in row["gaps"])
