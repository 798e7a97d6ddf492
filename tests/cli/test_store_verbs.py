"""Recordings that come twice, on the command line; the verbs that list, remove and check what a store holds."""

import io
import json
import shutil
from decimal import Decimal
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.errors import RecordingError
from auditor.store.store import Store
from tests.making.small_drives import START_NS, THREE_CAMERAS, write_drive

MINUTE_NS = 60 * 10**9
FRAMES = 10
ATTACKED = {2: range(3, 7)}


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """A store with thresholds, and an attacked drive."""
    folder = tmp_path_factory.mktemp("night")
    clean = write_drive(folder / "clean.mcap", FRAMES, seed=1, positions_m=THREE_CAMERAS, start_ns=START_NS - MINUTE_NS)
    drive = write_drive(folder / "drive.mcap", FRAMES, seed=1, positions_m=THREE_CAMERAS, attacked=ATTACKED)
    assert run(["calibrate", str(clean), "--store", str(folder / "audit")]) == 0
    assert scan(folder / "audit", drive) == 1
    return folder


@pytest.fixture
def audit(night, tmp_path):
    """A store of one's own: thresholds, and the attacked drive as `drive.mcap`."""
    return shutil.copytree(night / "audit", tmp_path / "audit")


def scan(store, *paths, how=("--pictures", "none")):
    return run(["scan", *map(str, paths), "--store", str(store), "--jobs", "1", *how])


def rows(capfd, *words):
    capfd.readouterr()
    assert run([*map(str, words), "--format", "json"]) == 0
    return json.loads(capfd.readouterr().out)


def incidents(capfd, store):
    return rows(capfd, "query", "incidents", "--store", store)


def listed(capfd, store):
    return {row["name"]: row for row in rows(capfd, "store", "list", store)}


def test_a_growing_file_gives_one_incident(night, tmp_path, capfd):
    store, growing = tmp_path / "audit", tmp_path / "growing.mcap"
    shutil.copytree(night / "audit", store)
    assert run(["store", "remove", "drive.mcap", "--store", str(store), "--yes"]) == 0
    whole = (night / "drive.mcap").read_bytes()
    growing.write_bytes(whole[: int(0.8 * len(whole))])
    assert scan(store, growing) == 4  # it is cut
    assert len(incidents(capfd, store)) == 1
    growing.write_bytes(whole)
    assert scan(store, growing) == 1
    assert "growing.mcap: it has changed and holds every frame that it had before" in capfd.readouterr().err
    assert [row["frames"] for row in incidents(capfd, store)] == [len(ATTACKED[2])]
    assert len(rows(capfd, "query", "summary", "--store", store)) == 2  # with the one that was calibrated on
    assert len(rows(capfd, "store", "list", store)) == 3


def test_a_copy_in_another_format_is_counted_once_and_both_are_listed(audit, tmp_path, capfd):
    copy = write_drive(tmp_path / "copy.bag", FRAMES, seed=1, positions_m=THREE_CAMERAS, attacked=ATTACKED)
    assert scan(audit, copy) == 1
    assert len(incidents(capfd, audit)) == 1
    known = listed(capfd, audit)
    assert {"drive.mcap", "copy.bag"} <= known.keys()
    superseded = [row["name"] for row in known.values() if row["superseded_by"]]
    assert len(superseded) == 1
    assert run(["query", "summary", f"recording={superseded[0]}", "--store", str(audit)]) == 2
    assert "holds every frame of it; ask for recording=" in capfd.readouterr().err
    earlier = copy if superseded == ["copy.bag"] else Path(known["drive.mcap"]["paths"][-1])
    [counted] = {"drive.mcap", "copy.bag"} - {*superseded}
    capfd.readouterr()
    assert scan(audit, earlier, how=("--format", "json")) == 1
    out, err = capfd.readouterr()
    assert "holds every frame of it, and is counted in its place" in err
    told = json.loads(out)
    assert [row["name"] for row in told["recordings"]] == [counted]
    assert [part["name"] for row in told["incidents"] for part in row["parts"]] == [counted]
    assert (
        run(
            [
                "review",
                told["incidents"][0]["incident_id"],
                "--as",
                "known",
                "--reason",
                "a test",
                "--store",
                str(audit),
            ]
        )
        == 0
    )
    assert scan(audit, earlier) == 0  # the review is of both


def test_a_part_of_what_was_scanned_before_shows_the_rows_of_the_whole(audit, night, tmp_path, capfd):
    part = tmp_path / "part.mcap"
    part.write_bytes((night / "drive.mcap").read_bytes()[: int(0.8 * (night / "drive.mcap").stat().st_size)])
    assert scan(audit, part) == 4  # it is cut
    out = capfd.readouterr().out
    assert "1 recording: 1 with incidents" in out
    assert "drive.mcap" in out
    assert "part.mcap" not in out


def test_a_cleaned_twin_is_a_conflict_that_is_told_and_never_ends_in_0(audit, tmp_path, capfd):
    twin = write_drive(tmp_path / "twin.mcap", FRAMES, seed=1, positions_m=THREE_CAMERAS)
    assert scan(audit, twin) == 3
    [line] = [line for line in capfd.readouterr().err.splitlines() if "conflict" in line]
    assert line.startswith("twin.mcap: conflict with drive.mcap")
    assert len(incidents(capfd, audit)) == 1
    known = listed(capfd, audit)
    assert known["twin.mcap"]["conflicts"] == [known["drive.mcap"]["recording_id"]]
    assert known["drive.mcap"]["conflicts"] == [known["twin.mcap"]["recording_id"]]
    assert run(["judge", str(audit)]) == 4
    page = tmp_path / "page.html"
    assert run(["report", "--recording", "drive.mcap", "--store", str(audit), "--out", str(page)]) == 0
    assert "has other data at the same stamps" in page.read_text()


def test_every_name_and_path_of_a_content_is_kept_and_it_has_one_incident(audit, night, tmp_path, capfd):
    renamed = shutil.copy(night / "drive.mcap", tmp_path / "renamed.mcap")
    for _ in range(2):
        assert scan(audit, renamed) == 1
    assert len(incidents(capfd, audit)) == 1
    row = listed(capfd, audit)["drive.mcap"]
    assert row["other_names"] == ["renamed.mcap"]
    assert row["paths"] == [str(night / "drive.mcap"), str(renamed)]
    [record] = Store.open(audit).recordings_called("renamed.mcap")
    assert record.name == "drive.mcap"
    assert all(one.seen_at is not None for one in record.sightings)
    page = tmp_path / "page.html"
    assert run(["report", "--recording", "renamed.mcap", "--store", str(audit), "--out", str(page)]) == 0
    assert "renamed.mcap" in page.read_text()
    [incident] = rows(capfd, "query", "incidents", "recording=renamed.mcap", "--store", audit)
    assert incident["name"] == "drive.mcap"
    assert "Incident 1" in page.read_text()


def test_json_says_where_a_recording_lies_that_was_read_under_another_name_first(audit, night, tmp_path, capfd):
    renamed = shutil.copy(night / "drive.mcap", tmp_path / "renamed.mcap")
    for place in (renamed, night / "drive.mcap"):
        capfd.readouterr()
        assert scan(audit, place, how=("--pictures", "none", "--format", "json")) == 1
        [row] = json.loads(capfd.readouterr().out)["recordings"]
        assert (row["name"], row["path"]) == ("drive.mcap", str(place))
    assert run(["judge", str(audit), "--format", "json"]) == 1
    judged = {row["name"]: row["path"] for row in json.loads(capfd.readouterr().out)["recordings"]}
    assert judged == {"clean.mcap": str(night / "clean.mcap"), "drive.mcap": str(renamed)}


def test_measuring_again_replaces_the_measurement_and_its_judgements(audit, night, capfd):
    store = Store.open(audit)
    [record] = store.recordings_called("drive.mcap")
    [known] = [one for one in store.measurements() if one.recording_id == record.recording_id]
    assert run(["judge", str(audit), "-r", "0.5"]) == 1
    before = store.path("measurements", known.measurement_id).read_bytes()
    frames = store.path("frames", known.measurement_id).read_bytes()
    assert scan(audit, night / "drive.mcap") == 1
    assert store.path("measurements", known.measurement_id).read_bytes() == before
    assert scan(audit, night / "drive.mcap", how=["--measure-again", "--pictures", "all"]) == 1
    assert store.path("measurements", known.measurement_id).read_bytes() != before
    assert store.path("frames", known.measurement_id).read_bytes() == frames
    assert [one.r for one in store.judgements() if one.measurement_id == known.measurement_id] == [Decimal("0.01")]
    assert store.pictured_frames(known.measurement_id)
    assert run(["store", "check", str(audit)]) == 0


def test_what_was_measured_stays_while_it_is_measured_again_in_vain(audit, night, monkeypatch):
    from auditor.pipeline import measure  # noqa: PLC0415 - beside what it changes

    def failing(*_given):
        yield 1
        raise RecordingError("it cannot be read any more")

    monkeypatch.setattr(measure._Measuring, "frames", failing)
    task = measure.MeasureTask(night / "drive.mcap", audit, again=True)
    with pytest.raises(RecordingError):
        measure.measure_recording(task, lambda *_: None)
    assert run(["store", "check", str(audit)]) == 0
    assert len(Store.open(audit).measurements()) == 2


def test_removing_takes_all_that_is_of_a_recording_and_says_which_calibration_was_made_of_it(audit, capfd):
    store = Store.open(audit)
    [record] = store.recordings_called("clean.mcap")
    assert run(["label", "clean.mcap", "--clean", "--store", str(audit)]) == 0
    assert run(["store", "check", str(audit)]) == 0
    assert run(["store", "remove", record.recording_id[:10], "--store", str(audit), "--yes"]) == 0
    says = capfd.readouterr().err
    assert "removed clean.mcap" in says
    assert f"calibration {store.ids('calibrations')[0]} was made of what is removed; it stays" in says
    assert run(["store", "check", str(audit)]) == 0
    assert [one.name for one in store.recordings()] == ["drive.mcap"]
    assert not list(audit.rglob(f"*{record.recording_id}*"))
    assert len(incidents(capfd, audit)) == 1


@pytest.mark.parametrize("name", ["nobody.mcap", "drive.mca", ""])
def test_an_unknown_name_removes_nothing(audit, capfd, name):
    assert run(["store", "remove", "drive.mcap", name, "--store", str(audit), "--yes"]) == 2
    assert "no recording is called" in capfd.readouterr().err
    assert len(Store.open(audit).recordings()) == 2


def test_a_name_of_two_recordings_is_refused_with_their_ids(audit, tmp_path, capfd):
    other = write_drive(tmp_path / "drive.mcap", 4, seed=3, positions_m=THREE_CAMERAS, start_ns=START_NS + MINUTE_NS)
    scan(audit, other)
    capfd.readouterr()
    assert run(["store", "remove", "drive.mcap", "--store", str(audit), "--yes"]) == 2
    says = capfd.readouterr().err
    assert "2 recordings are called 'drive.mcap'" in says
    assert all(one.recording_id[:12] in says for one in Store.open(audit).recordings_called("drive.mcap"))


def test_without_a_terminal_nothing_is_removed_unasked(audit, monkeypatch, capfd):
    monkeypatch.setattr("sys.stdin", io.StringIO())
    before = len(Store.open(audit).recordings())
    capfd.readouterr()
    assert run(["store", "remove", "drive.mcap", "--store", str(audit)]) == 2
    assert "nobody can be asked here, and nothing was removed; --yes removes without asking" in capfd.readouterr().err
    assert len(Store.open(audit).recordings()) == before


def test_on_a_terminal_removing_asks_first(audit, monkeypatch, capfd):
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    for answer, code, left in (("n\n", 2, 2), ("y\n", 0, 1)):
        monkeypatch.setattr("sys.stdin", Terminal(answer))
        assert run(["store", "remove", "drive.mcap", "--store", str(audit)]) == code
        assert len(Store.open(audit).recordings()) == left


@pytest.mark.parametrize("form", ["table", "csv", "json"])
def test_a_store_is_listed_in_every_format(audit, capfd, form):
    assert run(["store", "list", str(audit), "--format", form]) == 0
    says = capfd.readouterr().out
    assert "drive.mcap" in says
    assert "clean.mcap" in says


def test_a_superseded_recording_is_not_calibrated_on(audit, tmp_path, capfd):
    copy = write_drive(tmp_path / "copy.bag", FRAMES, seed=1, positions_m=THREE_CAMERAS, start_ns=START_NS - MINUTE_NS)
    assert scan(audit, copy) == 0
    capfd.readouterr()
    assert run(["calibrate", str(audit), "--store", str(tmp_path / "other")]) == 0
    left_out = [line for line in capfd.readouterr().err.splitlines() if "left out" in line]
    assert "clean.mcap: left out: copy.bag holds every frame of it" in left_out
