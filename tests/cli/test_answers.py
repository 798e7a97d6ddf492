"""Answers of the store can be read, and neither missing rows nor earlier verdicts pass for results of today."""

import json
import re
import shlex
from datetime import UTC, datetime
from decimal import Decimal
from pathlib import Path

import pytest

from auditor.cli import output, run
from auditor.model.calibration import PRIOR, RobustThresholds
from auditor.store.records import JudgementRecord
from auditor.store.store import Store
from tests.making.report_stores import add_recording, new_store
from tests.making.stores import RULES

ATTACK = [((1,), 10, 19)]


@pytest.fixture
def store(tmp_path: Path) -> Store:
    return new_store(tmp_path)


def printed(store: Store, capfd: pytest.CaptureFixture[str], *arguments: str) -> tuple[str, str]:
    """What a query prints, with exit code 0."""
    capfd.readouterr()
    assert run(["query", *arguments, "--store", str(store.folder)]) == 0
    return capfd.readouterr()


def refused(capfd: pytest.CaptureFixture[str], *arguments: object) -> str:
    """The message of a command that could not run."""
    capfd.readouterr()
    assert run([str(argument) for argument in arguments]) == 2
    return capfd.readouterr().err


def commands_in(text: str) -> list[list[str]]:
    """The commands that a message gives, as a shell would take them apart."""
    found = re.findall(r'(?<!\w)auditor (?:"[^"]*"|[^;"])*?(?= lists them| shows| reaches|;|$)', text)
    return [shlex.split(line)[1:] for line in found if not line.startswith("auditor: ")]


def test_no_rows_of_judged_recordings_say_no_more(store, capfd):
    add_recording(store)
    out, err = printed(store, capfd, "incidents", "recording=drive.mcap")
    assert out.strip() == "(no rows)"
    assert "not judged" not in err


def test_no_rows_for_want_of_verdicts_say_so(store, capfd):
    assert "nothing has been measured" in printed(store, capfd, "incidents")[1]
    add_recording(store, "a.mcap", judged=False)
    add_recording(store, "b.mcap")
    out, err = printed(store, capfd, "incidents")
    assert "(no rows)" in out
    assert "1 of 2 measurements is not judged" in err
    assert "not judged" in printed(store, capfd, "--sql", "SELECT * FROM verdicts WHERE kind = 'attacked'")[1]
    assert "not judged" not in printed(store, capfd, "skipped")[1]
    assert json.loads(printed(store, capfd, "incidents", "--format", "json")[0]) == []


def test_no_rows_for_want_of_thresholds_say_so(store, capfd):
    add_recording(store)
    asked = ("identification_rate", "r=0")
    assert "learnt" not in printed(store, capfd, *asked)[1], "no recording has labels"
    [known] = store.ids("measurements")
    by_prior = RobustThresholds(PRIOR, Decimal("0.01"), 4.0, {}, {}, drives=0)
    store.write_judgement(JudgementRecord(known, "robust", by_prior, RULES, datetime.now(UTC)), [])
    out, err = printed(store, capfd, *asked)
    assert "(no rows)" in out
    assert "it asks of thresholds learnt from clean recordings, and no verdict is by such: auditor calibrate" in err


@pytest.mark.parametrize("recording", ["nosuch", ""])
def test_a_recording_that_is_not_there_is_refused(store, capfd, recording):
    add_recording(store)
    err = refused(capfd, "query", "incidents", f"recording={recording}", "--store", store.folder)
    assert f"no recording has the name or id {recording!r}" in err
    [command] = commands_in(err)
    assert run(command) == 0
    assert "drive.mcap" in capfd.readouterr().out


@pytest.mark.parametrize("question", ["vehicle", "clean_seconds", "look_first", "not_audited", "before_after"])
def test_a_vehicle_that_is_not_there_is_refused_with_the_nearest_or_all(store, capfd, question):
    add_recording(store, vehicle="alpha")
    add_recording(store, "other.mcap", vehicle="beta")
    day = ["day=2026-01-01"] if question == "before_after" else []
    err = refused(capfd, "query", question, "vehicle=alhpa", *day, "--store", store.folder)
    assert "no recording is of a vehicle 'alhpa'; did you mean 'alpha'?" in err
    err = refused(capfd, "query", question, "vehicle=zzz", *day, "--store", store.folder)
    assert "no recording is of a vehicle 'zzz'; they are of 'alpha', 'beta'" in err


def test_what_no_recording_can_have_is_refused_and_not_answered_with_no_rows(store, capfd):
    add_recording(store, vehicle="alpha")
    for words, says in (
        (("vehicle", "alpha", "since=2026-10-26", "until=2026-10-25"), "since is after until"),
        (("look_first", "most=-1"), "most is '-1', not a whole number of 0 or more"),
        (("frame", "drive.mcap", "999"), "there is no frame 999; they go from 0 to 39"),
    ):
        assert says in refused(capfd, "query", *words, "--store", store.folder)


def test_a_calibration_that_is_not_there_is_refused_with_a_command_that_lists_them(store, capfd):
    add_recording(store)
    [known] = store.ids("calibrations")
    for arguments in (
        ("query", "thresholds", "calibration=zzz", "--store", store.folder),
        ("judge", store.folder, "--calibration", "zzz"),
    ):
        [command] = commands_in(refused(capfd, *arguments))
        assert run(command) == 0
        assert known in capfd.readouterr().out


def test_a_wrong_calibration_is_refused_before_anything_is_measured(tmp_path, capfd, monkeypatch):
    def measure_all(*_: object) -> None:
        raise AssertionError("it was measured")

    monkeypatch.setattr("auditor.pipeline.many.measure_all", measure_all)
    err = refused(capfd, "scan", tmp_path / "drive.mcap", "--calibration", "zzz", "--store", tmp_path / "new")
    assert "auditor calibrate" in err
    assert not (tmp_path / "new").exists()


def test_only_what_was_judged_now_is_shown(store, capfd):
    add_recording(store, attacks=ATTACK)
    judge = ["judge", str(store.folder), "--method", "paper"]
    assert run([*judge, "-r", "0"]) == 1
    assert "Incidents" in capfd.readouterr().out
    assert run([*judge, "-r", "0.001", "--strict"]) == 2
    shown = capfd.readouterr()
    assert "drive.mcap" not in shown.out
    assert "Incidents" not in shown.out
    assert "1 measurement keeps its verdicts from earlier" in shown.err
    assert run([*judge, "-r", "0.001", "--strict", "--format", "json"]) == 2
    said = json.loads(capfd.readouterr().out)
    assert (said["recordings"], said["incidents"]) == ([], [])
    [left] = said["not_audited"]
    assert (left["recording"], left["path"]) == ("drive.mcap", "/logs/drive.mcap")
    assert "not resolvable" in left["reason"]


def test_what_a_store_finds_attacked_is_not_calibrated_on(store, capfd):
    add_recording(store, "attacked.mcap", attacks=ATTACK, labelled=False)
    add_recording(store, "clean.mcap", labelled=False)
    assert run(["calibrate", str(store.folder), "-r", "0", "--store", str(store.folder)]) == 0
    shown = capfd.readouterr()
    assert "attacked.mcap: left out: by its current verdicts" in shown.err
    assert "10 frames are in incidents" in shown.err
    assert "clean.mcap: left out" not in shown.err
    assert "from 1 clean recordings" in shown.out


def test_a_recording_with_incidents_by_the_thresholds_of_the_others_is_warned_of(store, capfd):
    for name, attacks in (("a.mcap", ()), ("b.mcap", ()), ("hit.mcap", ATTACK)):
        add_recording(store, name, attacks=attacks, labelled=False, judged=False)
    assert run(["calibrate", str(store.folder), "-r", "0", "--store", str(store.folder)]) == 0
    err = capfd.readouterr().err
    assert re.search(r"WARNING: judged by the others there are findings in hit\.mcap \(\d+ incidents?\): check", err)


def test_sql_errors_say_what_may_be_meant(store, capfd):
    for sql, hint in (
        ("SELECT * FROM verdict", 'Did you mean "verdicts"?'),
        ("SELECT kindd FROM verdicts", "Candidate bindings:"),
    ):
        err = refused(capfd, "query", "--sql", sql, "--store", store.folder)
        assert hint in err
        assert "LINE 1" not in err
        assert len(err.splitlines()) == 1


def test_a_query_without_its_parameter_and_a_view_say_what_to_write(store, capfd):
    add_recording(store)
    assert "write frame=12: Number of the frame." in refused(capfd, "query", "frame", "--store", store.folder)
    [command] = commands_in(refused(capfd, "query", "verdicts", "--store", store.folder))
    assert run([*command, "--store", str(store.folder)]) == 0


def test_the_list_fits_the_terminal_and_leaves_out_what_only_pages_ask(store, capfd, monkeypatch):
    monkeypatch.setenv("COLUMNS", "70")
    out, _ = printed(store, capfd)
    assert max(map(len, out.splitlines())) <= 70
    assert "report_frames" not in out
    assert "incidents  " in out


def test_a_wide_answer_cuts_ids_and_says_once_what_is_the_same(store, capfd, monkeypatch):
    ids = {name: add_recording(store, name) for name in ("a.mcap", "b.mcap")}
    out, _ = printed(store, capfd, "summary")
    assert all(known not in out and known[:12] in out for known in ids.values())
    above, *_ = out.splitlines()
    assert above.startswith("the same in all 2 rows: vehicle car 7, ")
    assert "vehicle" not in out.removeprefix(above)
    assert max(map(len, out.removeprefix(above).splitlines())) <= output.WIDEST_TABLE
    recordings = json.loads(printed(store, capfd, "summary", "--format", "json")[0])
    assert {row["measurement_id"] for row in recordings} == set(ids.values()), "programs get them whole"
    prefix = recordings[0]["recording_id"][:12]
    [row] = json.loads(printed(store, capfd, "summary", f"recording={prefix}", "--format", "json")[0])
    assert row["name"] == recordings[0]["name"]
    monkeypatch.setattr(output, "WIDEST_TABLE", 70)
    out, _ = printed(store, capfd, "summary")
    assert max(len(line.rstrip()) for line in out.splitlines()[1:]) <= 70
    monkeypatch.undo()
    short, _ = printed(store, capfd, "--sql", "SELECT measurement_id, 1 AS one FROM measurements")
    assert all(known in short for known in ids.values()), "what fits is not cut"


def test_tables_of_an_audit_fit_eighty_columns(store, capfd, monkeypatch):
    add_recording(store, attacks=ATTACK, r="0.001")
    judge = ["judge", str(store.folder), "--method", "paper", "-r", "0.001"]
    assert run(judge) == 1
    assert "0.001*" in capfd.readouterr().out
    monkeypatch.setattr(output, "WIDEST_TABLE", 80)
    assert run(judge) == 1
    out = capfd.readouterr().out
    headings = [line.split() for line in out.splitlines() if line.startswith((" recording ", " incident "))]
    assert [columns[-1] for columns in headings] == ["sensors", "gap"]
    assert "* r = 0.001 is not resolvable: judged as at r = 0\n" in out
    assert max(len(line.rstrip()) for line in out.splitlines()) <= 80


@pytest.mark.parametrize(
    ("words", "nearest"),
    [(("scna", "x.mcap"), "Did you mean 'scan'?"), (("query", "incidnets"), "did you mean incidents?")],
)
def test_a_mistyped_verb_or_query_names_the_nearest(words, nearest, store, capfd):
    add_recording(store)
    assert run([*words, "--store", str(store.folder)]) == 2
    assert nearest in capfd.readouterr().err
