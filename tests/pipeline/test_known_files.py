"""Files that are as they were when the store read them are not read again, and verdicts that would be the same stay."""

import json
import os
import shutil

import pytest

from auditor.cli import run
from auditor.pipeline import judged, library, many
from auditor.pipeline import scan as scanning
from auditor.pipeline.remote import measuring
from auditor.recordings import Location
from auditor.store import queries
from auditor.store.export import rows_of
from auditor.store.maintenance.removal import remove_measurement
from auditor.store.reviews import ReviewVerdict, review_incident
from auditor.store.store import Store
from tests.making.small_drives import THREE_CAMERAS, write_drive


@pytest.fixture(scope="module")
def scanned(tmp_path_factory):
    """A drive and the store that it was scanned into."""
    folder = tmp_path_factory.mktemp("known").resolve()
    drive = write_drive(folder / "drive.mcap", 6, seed=1, positions_m=THREE_CAMERAS, attacked={2: range(2, 4)})
    assert run(["scan", str(drive), "--store", str(folder / "audit"), "--jobs", "1"]) in {0, 1, 3, 4}
    return folder


@pytest.fixture
def known(scanned, tmp_path):
    """A copy of the store; the drive stays where it was read."""
    return scanned / "drive.mcap", shutil.copytree(scanned / "audit", tmp_path / "audit")


@pytest.fixture
def read(monkeypatch):
    """The recordings that are read; reading them is left out."""
    found = []

    def run_all(_, tasks, *__):
        found.extend(task.recording.name for task in tasks)
        return iter(())

    monkeypatch.setattr(measuring, "run_all", run_all)
    return found


def scan(drive, store, *words):
    return run(["scan", str(drive), "--store", str(store), "--format", "json", *map(str, words)])


def test_a_known_file_is_not_read_again_and_its_verdicts_are_shown_as_they_were(known, read, capfd):
    drive, folder = known
    before = [one.judged_at for one in Store.open(folder).judgements()]
    assert scan(drive, folder) in {0, 1, 3, 4}
    assert read == []
    said = json.loads(capfd.readouterr().out)
    assert [row["name"] for row in said["recordings"]] == ["drive.mcap"]
    assert [one.judged_at for one in Store.open(folder).judgements()] == before


def test_where_many_are_known_and_nothing_is_judged_they_are_counted_and_json_has_all(known, read, monkeypatch, capfd):
    drive, folder = known
    monkeypatch.setattr(many, "MOST_KNOWN", 0)
    assert run(["scan", str(drive), "--store", str(folder)]) == scan(drive, folder)
    said = capfd.readouterr()
    printed, as_json = said.out.split("{", 1)
    assert "frames measured before" not in said.err
    assert "1 recording measured before" in said.err
    assert "1 measurement keeps its verdicts from earlier" in said.err
    assert printed.startswith("1 recording: ")
    assert [row["name"] for row in json.loads("{" + as_json)["recordings"]] == ["drive.mcap"]


def test_where_many_are_known_what_keeps_its_verdicts_is_not_asked_for_pictures_again(known, read, monkeypatch):
    drive, folder = known

    def picture_incidents(*_):
        raise AssertionError("pictures of an earlier scan are made again")

    monkeypatch.setattr(judged.JudgeResult, "found", True)
    monkeypatch.setattr(many, "MOST_KNOWN", 0)
    monkeypatch.setattr("auditor.pipeline.scan.picture_incidents", picture_incidents)
    assert scan(drive, folder) in {1, 3}


@pytest.mark.parametrize("most", [0, 1])
def test_the_library_pictures_what_is_known_as_the_command_does(known, read, monkeypatch, most):
    drive, folder = known
    asked = []
    monkeypatch.setattr(judged.JudgeResult, "found", True)
    monkeypatch.setattr(many, "MOST_KNOWN", most)
    monkeypatch.setattr(scanning, "picture_incidents", lambda store, found, *_: asked.append(list(found)) or [])
    [scanned] = library.scan(drive, store=folder)
    scan(drive, folder)
    ids = [one.measurement_id for one in scanned.judged] if most else []
    assert asked == ([ids, ids] if most else [])


def test_earlier_incidents_are_asked_for_only_where_something_may_excuse_them(known, read, monkeypatch):
    drive, folder = known
    asked = []
    run_query = queries.run_query
    monkeypatch.setattr(many, "MOST_KNOWN", 0)
    monkeypatch.setattr(queries, "run_query", lambda *of: asked.append(of[1]) or run_query(*of))
    assert run(["scan", str(drive), "--store", str(folder)]) in {1, 3}
    assert asked == []
    store = Store.open(folder)
    review_incident(store, rows_of(run_query(store, "incidents"))[0], ReviewVerdict.KNOWN, "low sun")
    assert run(["scan", str(drive), "--store", str(folder)]) in {0, 3}
    assert asked == ["incidents"]


def test_other_thresholds_judge_a_known_file_again_without_reading_it(known, read):
    drive, folder = known
    scan(drive, folder, "-r", "0.02")
    assert read == []
    assert sorted(str(one.r) for one in Store.open(folder).judgements()) == ["0.01", "0.02"]


@pytest.mark.parametrize("words", [["--verify-content"], ["--measure-again"], ["--vehicle", "car9"]])
def test_it_is_read_where_that_is_asked_for_or_more_is_said_of_it(known, read, words):
    drive, folder = known
    scan(drive, folder, *words)
    assert read == ["drive.mcap"]


def test_it_is_read_again_where_its_measurement_is_gone(known, read):
    drive, folder = known
    store = Store.open(folder)
    remove_measurement(store, store.ids("measurements")[0])
    scan(drive, folder)
    assert read == ["drive.mcap"]


def test_content_that_was_changed_is_read_though_size_and_time_are_set_back(known, read, tmp_path):
    drive, folder = known
    copied = Location(shutil.copy2(drive, tmp_path / "copy.mcap"))
    status, before = copied.path.stat(), copied.identity
    with copied.path.open("r+b") as file:
        file.seek(100)
        file.write(b"x")
    os.utime(copied.path, ns=(status.st_atime_ns, status.st_mtime_ns))
    assert copied.path.stat().st_mtime_ns == status.st_mtime_ns
    assert copied.identity != before
    scan(copied.path, folder)
    assert read == ["copy.mcap"]


def test_a_file_that_comes_beside_a_recording_changes_its_identity(tmp_path):
    bag = tmp_path / "bag" / "drive.db3"
    bag.parent.mkdir()
    bag.write_bytes(b"x")
    for location, beside in ((Location(bag), "drive.db3-wal"), (Location(bag.parent), "metadata.yaml")):
        before = location.identity
        assert location.identity == before
        (bag.parent / beside).write_bytes(b"y")
        assert location.identity != before
