"""What the screen says after an audit: mixed verdicts, remarks once a rig kind, and a line that closes."""

import json
import re
from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from types import SimpleNamespace

import pytest

from auditor.cli import audit_tables, output, run, summary
from auditor.cli.exit_codes import NotAudited, Tally
from auditor.model.calibration import RobustThresholds
from auditor.model.verdict import Finding, VerdictKind
from auditor.pipeline.measured import MeasureTask
from auditor.pipeline.scan import Scan
from auditor.store.records import JudgementRecord
from auditor.store.store import Store
from tests.making.report_stores import add_recording, make_rig
from tests.making.stores import NOON, RULES, add_judgement, add_measurement, make_measurement, make_verdict, new_store
from tests.making.stores import make_rig as rig_of


@pytest.fixture
def store(tmp_path) -> Store:
    return new_store(tmp_path)


def table(text: str) -> list[list[str]]:
    """The cells of a printed table."""
    lines = [line for line in text.splitlines() if line.strip(" ─")]
    return [re.split(r"\s{2,}", line.strip()) for line in lines]


def judged_by_hand(store: Store, kinds: str, name: str, *, recording: str) -> str:
    rig = rig_of(3)
    frames = [make_measurement(rig, number) for number in range(len(kinds))]
    known = add_measurement(store, rig, frames, recording=recording, name=name)
    add_judgement(store, rig, known, kinds, r="0.01", resolvable=False)
    return known


def test_mixed_verdicts_are_shown_as_such_and_suspects_too(store, capfd):
    judged_by_hand(store, "cc" + "2" * 4 + "1" * 2 + "s" + "u", "a.mcap", recording="a")
    summary.show_audit(store, "table", Tally())
    head, row, *_ = table(capfd.readouterr().out)
    assert head == [
        "recording", "frames", "audited", "looked at", *("clean", "attacked", "unidentified", "suspect", "sensors"),
        "r", "by",
    ]  # fmt: skip
    assert row == ["a.mcap", "10", "100.0 %", "75 %", "2", "6", "1", "1", "S_2 (4), S_1 (2)", "0.01*", "learnt"]


def test_sets_of_sensors_are_counted_frame_by_frame_and_the_rest_is_a_number(store, capfd):
    sets = [{"attacked": one, "frames": frames} for one, frames in (([2], 37), ([0, 2], 3), ([1], 2), ([0], 1))]
    row = dict.fromkeys(
        ("name", "rig_name", "vehicle", "date", "frames", "clean", "attacked", "unidentified", "suspect", "r", "by")
    )
    row |= {"audited_share": None, "looked_share": 0.9, "resolvable": None, "attacked_sets": sets[:2]}
    assert audit_tables._recording(row)["sensors"] == "S_2 (37), S_0 + S_2 (3)"
    row["attacked_sets"] = sets
    assert audit_tables._recording(row)["sensors"] == "S_2 (37), S_0 + S_2 (3), S_1 (2) and 1 more"


def test_vehicle_and_date_stand_in_the_table_where_they_are_known(store, capfd):
    add_recording(store, "a.mcap", vehicle="car 7")
    add_recording(store, "b.mcap", vehicle=None)
    assert run(["judge", "--store", str(store.folder), "--method", "paper", "-r", "0"]) == 0
    head, first, second, *_ = table(capfd.readouterr().out)
    assert head[:3] == ["recording", "vehicle", "frames"]
    assert (first[:2], second[:2]) == (["a.mcap", "car 7"], ["b.mcap", "-"])


def test_what_holds_for_many_recordings_is_one_line_a_rig_kind(store, capfd):
    for number in range(5):
        add_recording(store, f"{number}.mcap", judged=False)
    for number in range(2):
        add_recording(store, f"no_lidar_{number}.mcap", rig=make_rig(lidar=False), judged=False)
    assert run(["judge", "--store", str(store.folder)]) == 3
    shown = capfd.readouterr()
    remark = "measured, but not judged: the store has no thresholds for its rig kind and matcher; make some"
    found = sorted(line for line in shown.err.splitlines() if remark in line)
    assert [line.partition(": measured")[0] for line in found] == [
        f"2 recordings of {make_rig(lidar=False).kind} (no_lidar_0.mcap, no_lidar_1.mcap)",
        f"5 recordings of {make_rig().kind} (0.mcap, 1.mcap, 2.mcap and 2 more)",
    ]
    assert shown.out.splitlines()[-1] == (
        "7 recordings: none with incidents, 7 not fully audited: no thresholds for its rig kind and matcher"
    )


def test_what_two_rigs_of_one_recording_have_is_said_with_the_kind_of_each(store, capfd):
    kinds = [rig_of(3), rig_of(2)]
    for rig in kinds:
        add_measurement(store, rig, [make_measurement(rig, 0)], name="drive.mcap")
    assert run(["judge", "--store", str(store.folder), "--method", "paper"]) == 3
    said = capfd.readouterr().err
    assert [f"drive.mcap ({rig.kind}): measured, but not judged" in said for rig in kinds] == [True, True]


def test_warnings_of_measuring_are_said_once(capfd, monkeypatch, tmp_path):
    def measure_all(batch, advanced):
        for task in batch.tasks:
            result = SimpleNamespace(
                recording=task.recording,
                recording_id=str(task),
                measurement_ids=(str(task),),
                frames=1,
                fresh=True,
                calibration_warnings=("it does not fit",),
                remarks=(),
            )
            yield SimpleNamespace(item=task, error=None, result=result)

    monkeypatch.setattr("auditor.pipeline.scan.measure_all", measure_all)
    tally = Tally()
    tasks = tuple(MeasureTask(Path(name), tmp_path) for name in ("a.mcap", "b.mcap"))
    batch = SimpleNamespace(tasks=tasks, remote=(), errors=(), notes=(), remarks=(), shows_known=True)
    summary.show_measuring(Scan(batch, tmp_path), tally)
    assert capfd.readouterr().err.splitlines() == [
        "a.mcap: 1 frames measured",
        "b.mcap: 1 frames measured",
        "2 recordings (a.mcap, b.mcap): WARNING: it does not fit",
    ]
    assert tally.recordings == {"a.mcap", "b.mcap"}


@pytest.mark.parametrize(
    ("tally", "line"),
    [
        (Tally(audited=True, recordings={"a"}), "1 recording: none with incidents, all fully audited"),
        (
            Tally(audited=True, recordings={"a", "b"}, with_incidents={"a"}),
            "2 recordings: 1 with incidents, all fully audited",
        ),
        (
            Tally(
                audited=True,
                recordings=set("abcdefg"),
                not_audited=[
                    NotAudited("a", "a", ("no thresholds",)),
                    NotAudited("b", "b", ("damaged: chunk 1",)),
                    NotAudited("c", "c", ("damaged: chunk 2; and more",)),
                    NotAudited("d", "d", ("25 of 40 frames audited",)),
                    NotAudited("e", "e", ("the file is empty",)),
                ],
            ),
            "7 recordings: none with incidents, 5 not fully audited: damaged (2), no thresholds (1), "
            "25 of 40 frames audited (1), and 1 other reason",
        ),
        (
            Tally(
                audited=True,
                recordings={"a"},
                not_audited=[
                    NotAudited("a", "a", ("23 of 24 frames audited", "S_1 left is seen by none: no other")),
                    NotAudited("a", "a", ("23 of 24 frames audited", "S_2 right: 3 % is compared, 5 due")),
                ],
            ),
            "1 recording: none with incidents, 1 not fully audited: 23 of 24 frames audited, S_1 left is seen by none, "
            "S_2 right: 3 % is compared",
        ),
    ],
)
def test_the_closing_line_counts_recordings_and_says_why(tally, line):
    assert summary.closing_line(tally) == line


@pytest.mark.parametrize(
    ("shares", "how"),
    [
        ([(1.0,), (1.0, 1.0)], "all fully audited"),
        ([(1.0,), (0.79, 0.96, 1.0)], "all fully audited by at least one rig"),
        ([(0.958,), (0.79, 1.0)], "all audited as far as is asked for: at least 95.8 % of the frames of each"),
    ],
)
def test_the_closing_line_says_no_more_than_the_rows_above_it(shares, how):
    tally = Tally(audited=True, recordings={"a", "b"})
    assert summary.closing_line(tally, 0, shares) == f"2 recordings: none with incidents, {how}"


def test_the_closing_line_says_how_many_single_frames_are_raised_where_nothing_is_found():
    quiet = {"attacked": 1, "unidentified": None, "suspect": 2}
    tally = Tally(audited=True, recordings={"a", "b"}, with_incidents={"a"})
    raised = summary._raised([{"recording_id": "a", **quiet, "attacked": 9}, {"recording_id": "b", **quiet}], tally)
    assert summary.closing_line(tally, raised) == (
        "2 recordings: 1 with incidents, 3 single frames raised, all fully audited"
    )


def test_the_json_of_an_audit_has_recordings_incidents_and_what_was_not_audited(store, capfd):
    add_recording(store, "a.mcap", attacks=[((1,), 10, 19)])
    add_recording(store, "b.mcap", rig=make_rig(("velo", "a", "b", "c", "d")), judged=False)
    assert run(["judge", "--store", str(store.folder), "--method", "paper", "-r", "0", "--format", "json"]) == 4
    said = json.loads(capfd.readouterr().out)
    assert list(said) == ["recordings", "incidents", "not_audited"]
    assert [(row["name"], row["attacked"], row["attacked_sets"]) for row in said["recordings"]] == [
        ("a.mcap", 10, [{"attacked": [1], "frames": 10}]),
        ("b.mcap", None, []),
    ]
    assert [(row["name"], row["first_frame"], row["last_frame"]) for row in said["incidents"]] == [("a.mcap", 10, 19)]
    assert said["not_audited"] == [
        {"recording": "b.mcap", "path": "/logs/b.mcap", "reason": "no thresholds for its rig kind and matcher"}
    ]


def test_a_scan_of_nothing_says_so_in_every_form(tmp_path, capfd):
    scan = ["scan", str(tmp_path / "none.mcap"), "--store", str(tmp_path / "audit")]
    assert run(scan) == 2
    reason = "there is no such file or folder"
    assert capfd.readouterr().out == f"nothing was audited: {reason}\n"
    assert run([*scan, "--format", "json"]) == 2
    left = {"recording": "none.mcap", "path": str(tmp_path / "none.mcap"), "reason": reason}
    assert json.loads(capfd.readouterr().out) == {"recordings": [], "incidents": [], "not_audited": [left]}
    assert run([*scan, "--format", "csv"]) == 2
    assert capfd.readouterr().out == ""


def test_judge_takes_its_store_either_way_but_once(store, capfd):
    add_recording(store)
    for where in ([str(store.folder)], ["--store", str(store.folder)]):
        assert run(["judge", *where, "--method", "paper", "-r", "0"]) == 0
    assert run(["judge", str(store.folder), "--store", str(store.folder)]) == 2
    assert "name the store once" in capfd.readouterr().err


@pytest.mark.parametrize("words", [["verify"], ["store", "list"], ["store", "check"], ["store", "compact"]])
def test_what_looks_after_a_store_takes_it_as_the_other_verbs_do(store, capfd, words):
    add_recording(store)
    codes = [run([*words, *where]) for where in ([str(store.folder)], ["--store", str(store.folder)])]
    assert codes[0] == codes[1] != 2
    assert run([*words, str(store.folder), "--store", str(store.folder)]) == 2
    assert "name the store once" in capfd.readouterr().err


def test_a_pipe_gets_a_line_now_and_then(capfd, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(output, "monotonic", lambda: now[0])
    with output.progress(2, "evaluating") as (advanced, finished):
        for frame in range(1, 8):
            now[0] += 10
            advanced("a.mcap", "a.mcap", frame)
        finished("a.mcap: done")
        now[0] += 30
        advanced("b.mcap", "b.mcap", 5)
        finished("b.mcap: done", "b.mcap: WARNING: it was slow")
    assert capfd.readouterr().err.splitlines() == [
        "evaluating: 0 of 2 done, 3 frames",
        "evaluating: 0 of 2 done, 6 frames",
        "a.mcap: done",
        "evaluating: 1 of 2 done, 12 frames",
        "b.mcap: done",
        "b.mcap: WARNING: it was slow",
    ]


def test_where_sizes_are_known_a_line_has_the_share_of_bytes_and_the_time_left(capfd, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(output, "monotonic", lambda: now[0])
    sizes = {"known": 10**9, "a": 10**9, "b": 2 * 10**9, "c": 10**9}
    with output.progress(4, "measuring", sizes) as (advanced, finished):
        finished("known: measured before", of="known")
        now[0] = 30
        advanced("a", "a", 100)
        finished("a: done", of="a")
        now[0] = 60
        advanced("b", "b", 50)
    assert capfd.readouterr().err.splitlines() == [
        "known: measured before",
        "measuring: 1 of 4 done, 100 frames",
        "a: done",
        "measuring: 2 of 4 done, 150 frames, 50 % of 5 GB, about 2 min left",
    ]


def test_a_table_wraps_and_leaves_out_before_it_breaks(monkeypatch, capfd):
    rows = [
        {"name": f"recording {n}", "number": 1000 + n, "words": "some words " * 4, "note": "x" * 30} for n in (1, 2)
    ]
    rows[1] = {**rows[1], "words": "other"}

    def printed(width: int) -> str:
        monkeypatch.setattr(output, "WIDEST_TABLE", width)
        output.print_rows(rows, tuple(rows[0]), expendable=("note", "number"), wrapped=("words",))
        return capfd.readouterr().out

    assert "note" in printed(100).splitlines()[1]
    assert [line.split() for line in printed(75).splitlines()[2:3]] == [["name", "number", "words"]]
    assert printed(75).splitlines()[0] == f"the same in all 2 rows: note {'x' * 30}"
    narrow = printed(40)
    assert max(len(line) for line in narrow.splitlines()[1:]) <= 40
    assert table(narrow)[1] == ["name", "number", "words"]
    assert table(printed(30))[1] == ["name", "words"]


def test_an_alert_is_shown_beside_incidents_with_its_grade(store, capfd):
    rig = rig_of(3)
    known = add_measurement(store, rig, [make_measurement(rig, number) for number in range(3)], name="a.mcap")
    single = replace(make_verdict(rig, "1"), finding=Finding(VerdictKind.ATTACKED, (1,), alert=True))
    thresholds = RobustThresholds("c" * 32, Decimal("0.01"), 4.0, {}, {}, drives=0)
    rows = [(frame, frame, single if frame == 1 else make_verdict(rig, "c")) for frame in range(3)]
    store.write_judgement(JudgementRecord(known, "robust", thresholds, RULES, NOON), rows)
    summary.show_audit(store, "table", Tally())
    out = capfd.readouterr().out
    assert "Incidents and alerts" in out
    [shown] = [line.split() for line in out.splitlines() if " alert " in line]
    assert shown[1:5] == ["alert", "a.mcap", "attacked", "S_1"]


def two_rigs(store, own, finding):
    """A recording of two rigs, in both of which each frame says `own` and is of an event; thresholds differ."""
    for cameras, limit in ((3, 4.0), (2, 3.0)):
        rig = rig_of(cameras)
        known = add_measurement(store, rig, [make_measurement(rig, number) for number in range(3)], name="a.mcap")
        thresholds = RobustThresholds("c" * 32, Decimal("0.01"), limit, {}, {}, drives=0)
        rows = [(frame, frame, replace(make_verdict(rig, own), finding=finding)) for frame in range(3)]
        store.write_judgement(JudgementRecord(known, "robust", thresholds, RULES, NOON), rows)


def test_where_a_recording_has_several_rigs_limits_and_incidents_say_which(store, capfd):
    two_rigs(store, "1", Finding(VerdictKind.ATTACKED, (1,)))
    summary.show_audit(store, "table", Tally())
    out = capfd.readouterr().out
    assert "thresholds prior for 2 cameras: a finding has a z above 3.00" in out
    assert "thresholds prior for 3 cameras: a finding has a z above 4.00" in out
    [incident] = table(out.partition("Incidents")[2])[1:2]
    assert incident[1:5] == ["a.mcap", *incident[2:3], "attacked", "S_1 cam1"]
    assert incident[2] in ("2 cameras", "3 cameras")


def test_an_incident_of_which_no_frame_is_a_finding_says_so_below_the_table(store, capfd):
    two_rigs(store, "c", Finding(VerdictKind.ATTACKED, (1,)))
    summary.show_audit(store, "table", Tally())
    said = capfd.readouterr().out
    assert re.search(
        r"^[0-9a-f]{8}: weak evidence that lasts; none of its frames is a finding by itself$", said, re.MULTILINE
    )
