"""Files that are as they were when the store read them are not read again, and verdicts that would be the same stay."""

import json
import os
import shutil

import pytest

from auditor.cli import run
from auditor.pipeline import many
from auditor.recordings import Location
from auditor.store import Store
from auditor.store.maintenance.removal import remove_measurement
from tests.making.small_drives import write_drive

THREE_CAMERAS = (0.6, 0.3, 0.0)


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

    monkeypatch.setattr(many, "run_all", run_all)
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
