"""Reviews of incidents: kept, found again, shown, and used by exit codes; policies; what CI takes."""

import json
import shutil
from dataclasses import replace
from datetime import UTC, date, datetime, timedelta
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from auditor.cli import run
from auditor.pipeline.refreshing.pool import groups_of
from auditor.store import Store, rows_of, run_query, run_sql
from auditor.store.log.chains import entries
from auditor.store.maintenance.verify import verify
from auditor.store.reviews import ReviewVerdict, false_alarms, review_incident
from tests.making.small_drives import START_NS, THREE_CAMERAS, write_drive

FRAMES = 14
ATTACKED = {2: range(3, 9)}
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
    assert verb("scan", store, night / "drive.mcap", "--measure-again", "--jobs", "1") == 0
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


@pytest.mark.parametrize(("last", "fails"), [(TODAY, False), (TODAY - timedelta(days=1), True)])
def test_a_finding_returns_when_the_last_day_of_its_review_is_over(last: date, fails: bool, store):
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
    assert [log.named for group in groups_of([store], []) for log in group.logs].count(True) == 1
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


@pytest.fixture
def policy(tmp_path: Path) -> Path:
    return tmp_path / "policy.toml"


def test_a_suppressed_finding_does_not_fail_until_its_last_day_is_over(store, policy, capfd):
    for last, code in ((TODAY, 0), (TODAY - timedelta(days=1), 1)):
        policy.write_text(
            f'[[suppress]]\nrecording = "drive.mcap"\nsensors = ["S_2"]\nreason = "low sun"\nuntil = {last}\n'
        )
        assert verb("judge", store, "--policy", policy) == code
    assert f"suppressed until {TODAY}: low sun" in " ".join(capfd.readouterr().out.split())
    policy.write_text(f'[[suppress]]\nsensors = ["S_0"]\nreason = "other"\nuntil = {TODAY}\n')
    assert verb("judge", store, "--policy", policy) == 1


def test_a_baseline_fails_on_new_findings_only(store, night, policy, tmp_path, capfd):
    capfd.readouterr()
    assert verb("judge", store, "--format", "json") == 1
    (tmp_path / "before.json").write_text(capfd.readouterr().out)
    (tmp_path / "empty.json").write_text("[]")
    for baseline, code in (("before.json", 0), (night / "audit", 0), ("empty.json", 1)):
        policy.write_text(f'baseline = "{baseline}"\n')
        assert verb("judge", store, "-r", "2%", "--policy", policy) == code


def test_what_a_policy_does_not_fail_on_is_still_shown(store, policy, capfd):
    policy.write_text('fail = ["unidentified"]\n')
    capfd.readouterr()
    assert verb("judge", store, "--policy", policy, "--format", "json") == 0
    [shown] = json.loads(capfd.readouterr().out)["incidents"]
    assert shown["excuse"] == "attacked does not fail by the policy"
    assert verb("report", store, "--policy", policy) == 0
    assert "attacked does not fail by the policy" in (store.folder / "reports" / "index.html").read_text()


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("fail = 1", "fail is 1, not a list of texts"),
        ('fail = ["clean"]', "fail has clean; kinds are attacked, suspect, unidentified"),
        ("severity = 1", "it has 'severity'; what it may have is fail, baseline, suppress"),
        ('[[suppress]]\nsensors = ["S_1"]\nreason = "x"', "a suppression has no until"),
        ('[[suppress]]\nsensors = ["S_1"]\nuntil = 2030-01-01', "a suppression has no reason"),
        ('[[suppress]]\nreason = "x"\nuntil = 2030-01-01', "a suppression fits every incident"),
        ('[[suppress]]\nvehicle = "v"\nreason = "x"\nuntil = "soon"', "until is 'soon', not a day"),
        ('baseline = "none"', "there is no store"),
        ("[", "it is no policy that can be read"),
    ],
)
def test_a_policy_that_makes_no_sense_is_one_line_before_any_work(content, says, store, policy, capfd):
    policy.write_text(content)
    assert verb("judge", store, "--policy", policy) == 2
    [line] = capfd.readouterr().err.splitlines()
    assert says in line


def test_sarif_has_the_result_with_its_place_and_its_suppression(store, capfd):
    def report() -> dict[str, object]:
        capfd.readouterr()
        verb("judge", store, "--format", "sarif")
        document = json.loads(capfd.readouterr().out)
        assert document["version"] == "2.1.0"
        [part] = document["runs"]
        return part

    part = report()
    rules = part["tool"]["driver"]["rules"]
    [result] = part["results"]
    assert rules[result["ruleIndex"]]["id"] == result["ruleId"] == "attacked"
    assert (result["level"], "suppressions" in result) == ("error", False)
    assert "S_2" in result["message"]["text"]
    [place] = result["locations"]
    assert place["physicalLocation"]["artifactLocation"]["uri"].endswith("/drive.mcap")
    assert part["invocations"][0]["exitCode"] == 1
    stays = result["partialFingerprints"]
    assert review(store, "--as", "false-alarm") == 0
    part = report()
    [result] = part["results"]
    assert result["suppressions"][0]["justification"] == "reviewed as false alarm: low sun"
    assert (part["invocations"][0]["exitCode"], result["partialFingerprints"]) == (0, stays)


def test_junit_has_a_case_for_each_recording_that_fails_or_says_why_not(store, night, tmp_path, capfd):
    (tmp_path / "empty\x01.mcap").write_bytes(b"")
    capfd.readouterr()
    run(["scan", str(night / "drive.mcap"), str(tmp_path / "empty\x01.mcap"), "--store", str(store.folder),
         "--jobs", "1", "--format", "junit"])  # fmt: skip
    suite = ET.fromstring(capfd.readouterr().out).find("testsuite")
    assert suite is not None
    assert {name: suite.get(name) for name in ("tests", "failures", "errors")} == {
        "tests": "2",
        "failures": "1",
        "errors": "1",
    }
    failure, error = suite.find("testcase/failure"), suite.find("testcase/error")
    assert failure is not None
    assert failure.get("type") == "attacked"
    assert error is not None
    assert [case.get("name") for case in suite] == ["drive.mcap", r"empty\x01.mcap"]
    assert review(store, "--as", "known") == 0
    capfd.readouterr()
    verb("judge", store, "--format", "junit")
    suite = ET.fromstring(capfd.readouterr().out).find("testsuite")
    assert suite is not None
    assert suite.get("failures") == "0"
    assert "reviewed as known: low sun" in (suite.findtext("testcase/system-out") or "")
