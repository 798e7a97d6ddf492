"""Reviews of incidents: kept, found again, shown, and used by exit codes."""

import json
import shutil
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.pipeline.refreshing.choosing import REVIEWED, _by_person
from auditor.pipeline.refreshing.pool import groups_of
from auditor.store.export import rows_of
from auditor.store.log.chains import entries
from auditor.store.maintenance.verify import verify
from auditor.store.queries import run_query, run_sql
from auditor.store.reviews import ReviewVerdict, false_alarms, review_incident
from auditor.store.store import Store
from tests.making.small_drives import START_NS, THREE_CAMERAS, write_drive

FRAMES = 8
ATTACKED = {2: range(2, 6)}
MINUTE_NS = 60 * 10**9
TODAY = datetime.now(UTC).date()


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with thresholds, and an attacked drive with one incident."""
    folder = tmp_path_factory.mktemp("night")
    clean = write_drive(folder / "clean.mcap", FRAMES, seed=1, positions_m=THREE_CAMERAS, start_ns=START_NS - MINUTE_NS)
    drive = write_drive(folder / "drive.mcap", FRAMES, seed=1, positions_m=THREE_CAMERAS, attacked=ATTACKED)
    assert run(["calibrate", str(clean), "--store", str(folder / "audit")]) == 0
    assert run(["scan", str(drive), "--store", str(folder / "audit"), "--jobs", "1", "--pictures", "none"]) == 1
    return folder


@pytest.fixture
def store(night: Path, tmp_path: Path) -> Store:
    """A store of one's own."""
    return Store.open(shutil.copytree(night / "audit", tmp_path / "audit"))


def incident(store: Store) -> dict[str, object]:
    [row] = rows_of(run_query(store, "incidents", {}))
    return row


def verb(name: str, store: Store, *words: object) -> int:
    return run([name, *map(str, words), "--store", str(store.folder)])


def review(store: Store, *words: object, reason: str = "low sun") -> int:
    return verb("review", store, incident(store)["incident_id"], "--reason", reason, *words)


def test_a_review_is_kept_with_its_author_in_the_log_and_shown_with_its_history(store, capfd):
    assert review(store, "--as", "confirmed", reason="laser seen") == 0
    assert review(store, "--as", "false-alarm", "--until", TODAY + timedelta(days=3)) == 0
    said = rows_of(run_sql(store, "FROM incident_reviews ORDER BY reviewed_at"))
    assert [(one["verdict"], one["reason"], one["counts"]) for one in said] == [
        ("confirmed", "laser seen", False),
        ("false-alarm", "low sun", True),
    ]
    assert all(one["author"] for one in said)
    assert (incident(store)["review"], incident(store)["review_reason"]) == ("false-alarm", "low sun")
    told = [entry.what for entry in entries(store.folder) if entry.kind == "reviewed"]
    assert [(one["verdict"], one["review"]) for one in told] == [(one["verdict"], one["review_id"]) for one in said]
    capfd.readouterr()
    assert verb("review", store, "list") == 0
    shown = capfd.readouterr().out
    assert "no: a later one does" in shown
    assert "laser seen" in shown


def test_verify_finds_a_review_that_was_removed_or_changed(store):
    assert review(store, "--as", "known") == 0
    assert verify(store).grave == ()
    [path] = (store.folder / "reviews").iterdir()
    content = path.read_bytes()
    path.write_bytes(content[:-40] + bytes([content[-40] ^ 1]) + content[-39:])
    assert [problem.place for problem in verify(store).grave][:1] == [f"reviews/{path.name}"]
    path.unlink()
    assert "it is missing" in str(verify(store).grave[0])


def test_a_review_outlives_judging_and_measuring_anew(store, night):
    before = incident(store)["incident_id"]
    assert review(store, "--as", "false-alarm") == 0
    assert verb("judge", store, "-r", "2%") == 0
    after = incident(store)
    assert after["incident_id"] == before
    assert after["review"] == "false-alarm"
    assert verb("scan", store, night / "drive.mcap", "--measure-again", "--jobs", "1", "--pictures", "none") == 0
    assert incident(store)["review"] == "false-alarm"


def test_a_review_is_of_its_sensors_and_its_time_alone(store):
    row = incident(store)
    seconds = 10**9
    for other in (
        {**row, "attacked_names": ["S_1 right"]},
        {**row, "from_ns": row["to_ns"] + seconds, "to_ns": row["to_ns"] + 2 * seconds},
        {**row, "parts": [{"recording_id": "f" * 64}], "drive_id": "f" * 64},
    ):
        review_incident(store, other, ReviewVerdict.FALSE_ALARM, "another")
        assert incident(store)["review"] is None
    part_of_it = {**row, "from_ns": row["to_ns"], "parts": [{"recording_id": "f" * 64}]}
    review_incident(store, part_of_it, ReviewVerdict.KNOWN, "the same drive")
    assert incident(store)["review"] == "known"


def test_a_review_holds_for_the_recording_that_holds_every_frame_of_its_own(store):
    assert review(store, "--as", "false-alarm") == 0
    said = rows_of(run_sql(store, "FROM reviews"))[0]
    [record] = store.recordings_called("drive.mcap")
    store.write_recording(replace(record, superseded_by="e" * 64))
    assert set(rows_of(run_sql(store, "FROM reviews"))[0]["places"]) == {*said["places"], "e" * 64}


@pytest.mark.parametrize(("days_ago", "fails"), [(0, False), (1, True)])
def test_a_finding_returns_when_the_last_day_of_its_review_is_over(days_ago: int, fails: bool, store):
    last = datetime.now(UTC).date() - timedelta(days=days_ago)
    review_incident(store, incident(store), ReviewVerdict.FALSE_ALARM, "low sun", last)
    assert (incident(store)["review"] is None) == fails
    assert verb("judge", store) == int(fails)


def test_what_is_confirmed_fails_still_and_a_false_alarm_may_be_calibrated_on(store, capfd):
    drive = incident(store)["measurement_id"]
    assert review(store, "--as", "confirmed") == 0
    assert verb("judge", store) == 1
    assert "remark" in capfd.readouterr().out
    assert false_alarms(store) == frozenset()
    assert review(store, "--as", "false-alarm") == 0
    assert false_alarms(store) == {drive}
    assert [_by_person(log) for group in groups_of([store], []) for log in group.logs if log.named] == [REVIEWED]
    assert verb("judge", store) == 0
    assert "1 with incidents (1 of them excused)" in capfd.readouterr().out
    assert verb("calibrate", store, store.folder, "-r", "0") == 0
    assert "left out" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--as", "known"], "say what it is (--as), and why (--reason)"),
        (["--reason", "why"], "say what it is (--as), and why (--reason)"),
        (["--as", "known", "--reason", " "], "say what it is (--as), and why (--reason)"),
        (["--as", "known", "--reason", "why", "--until", "2020-01-01"], "is over: name today or a later day"),
        (["--as", "maybe", "--reason", "why"], "'maybe' is not one of"),
    ],
)
def test_a_review_that_makes_no_sense_is_refused(words, says, store, capfd):
    assert verb("review", store, incident(store)["incident_id"][:8], *words) == 2
    assert says in " ".join(capfd.readouterr().err.split())
    assert not (store.folder / "reviews").exists()


def test_an_incident_that_is_not_there_is_refused(store, capfd):
    assert verb("review", store, "ffff0000", "--as", "known", "--reason", "why") == 2
    assert "ffff0000: the store has no such incident; auditor query incidents" in capfd.readouterr().err
    assert verb("review", store, "list") == 0
    assert "nobody has reviewed an incident" in capfd.readouterr().err


@pytest.mark.parametrize(("verdict", "excuse"), [("known", "reviewed as known: low sun"), ("confirmed", None)])
def test_what_is_excused_is_shown_with_its_excuse_in_json_and_what_fails_without(verdict, excuse, store, capfd):
    assert review(store, "--as", verdict) == 0
    capfd.readouterr()
    assert verb("judge", store, "--format", "json") == int(excuse is None)
    [shown] = json.loads(capfd.readouterr().out)["incidents"]
    assert (shown["incident_id"], shown["excuse"]) == (incident(store)["incident_id"], excuse)


def test_an_excused_incident_is_listed_on_the_index_with_its_review_and_counts_as_none(store):
    assert verb("report", store) == 0
    index = store.folder / "reports" / "index.html"
    assert "low sun" not in index.read_text()
    assert review(store, "--as", "false-alarm") == 0
    assert verb("report", store) == 0
    page = index.read_text()
    assert "reviewed as false alarm: low sun" in page
    assert "1 incident excused by a review" in " ".join(page.split())
