"""The questions by name: each answer is what was counted by hand in a store that was made row by row."""

import re
import shlex
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from auditor.cli import run
from auditor.errors import QueryError
from auditor.model.coverage import TopicCoverage, TopicState
from auditor.model.frames import FramePose, Pose, Presence, SensorState
from auditor.model.measurement import Coverage, Region
from auditor.model.verdict import AttackLabel
from auditor.store.queries import query, run_query
from auditor.store.records import GivenLabel, RecordingRecord
from auditor.store.sql_files import bind
from tests.making.stores import (
    NOON,
    PERIOD_NS,
    add_frames,
    add_judgement,
    make_measurement,
    make_rig,
    new_store,
    skip,
)

RIG = make_rig(3)
S_NS = 10**9
START_NS = int(datetime(2026, 1, 5, 12, tzinfo=UTC).timestamp()) * S_NS
DEGREE_M = 2 * np.pi * 6_371_009 / 360
WIDTH_PX, HEIGHT_PX = 1242, 375


def drive(
    store,
    name,
    kinds,
    *,
    vehicle="alder",
    start_s=0.0,
    stamps_s=None,
    clock="utc",
    north_m=None,
    regions=None,
    level=100.0,
    absent=(),
    judged=True,
    rig=RIG,
    **record,
):
    """A recording named by one character, with a frame for each one of `kinds`; a blank is a frame that was skipped.

    `north_m` is where the vehicle is, in metres north of 49 degrees: one number, or one a frame. `regions` are boxes in
    pixels by frame and sensor, `absent` are pairs of frame and sensor.
    """
    count = len(kinds)
    times_s = stamps_s or [start_s + frame * PERIOD_NS / S_NS for frame in range(count)]
    stamps = [START_NS + round(second * S_NS) for second in times_s]
    frames = []
    for frame, kind in enumerate(kinds):
        if kind == " ":
            frames.append(replace(skip(frame), stamp_ns=stamps[frame]))
            continue
        one = make_measurement(rig, frame, stamp_ns=stamps[frame])
        boxes = [(sensor, box) for (at, sensor), box in (regions or {}).items() if at == frame]
        presence = {s: Presence(SensorState.MISSING) for at, s in absent if at == frame}
        frames.append(
            replace(
                one,
                coverage={s: Coverage(level=level if s else None) for s in rig.sensors},
                presence={**one.presence, **presence},
                regions=tuple(Region(s, max(s, 1), box, 0.1, b"", None if s else 5, None) for s, box in boxes),
            )
        )
    metres = north_m if isinstance(north_m, list) else [north_m] * count
    poses = [
        FramePose(at, stamps[at], 0, "/fix", "f", Pose("gps", 49.0 + metre / DEGREE_M, 8.4))
        for at, metre in enumerate(metres)
        if metre is not None
    ]
    recording = RecordingRecord(
        name * 64,
        f"{name}.mcap",
        f"/logs/{name}.mcap",
        clock=clock,
        from_ns=min(stamps),
        to_ns=max(stamps),
        vehicle=vehicle,
    )
    store.write_recording(recording)
    store.write_rig(rig)
    known = add_frames(store, rig, name * 64, frames, poses=poses, **record)
    if judged:
        add_judgement(store, rig, known, kinds, stamps=stamps)
    return known


def ask(store, name, *columns, **parameters):
    rows = run_query(store, name, parameters).to_pylist()
    return [tuple(row[column] for column in columns) for row in rows]


@pytest.fixture
def store(tmp_path):
    return new_store(tmp_path)


# vehicle


def test_what_happened_to_a_vehicle_is_told_in_its_order(store):
    drive(store, "a", "cc11c  cc", north_m=0)
    drive(store, "b", "cc2", start_s=60)
    drive(store, "c", "11", vehicle="birch", start_s=30)
    assert ask(store, "vehicle", "what", "found", "frames", "name", vehicle="alder") == [
        ("recorded", "7 frames: 5 clean, 2 attacked", 7, "a.mcap"),
        ("incident", "attacked: S_1 cam1", 2, "a.mcap"),
        ("not audited", "no LiDAR (S_0)", 2, "a.mcap"),
        ("recorded", "3 frames: 2 clean, 1 attacked", 3, "b.mcap"),
        ("incident", "attacked: S_2 cam2", 1, "b.mcap"),
    ]
    [recorded, incident, *_] = run_query(store, "vehicle", {"vehicle": "alder"}).to_pylist()
    assert recorded["place"] == "49.000000, 8.400000"
    assert str(incident["from_utc"])[:21] == "2026-01-05 12:00:00.2"
    assert (incident["seconds"], incident["place"]) == (0.1, recorded["place"])


def test_a_vehicle_is_asked_for_between_two_times(store):
    drive(store, "a", "ccc")
    drive(store, "b", "cc2", start_s=60)

    def names(**times):
        return [name for (name,) in ask(store, "vehicle", "name", vehicle="alder", **times)]

    assert names(since="2026-01-05T12:00:30") == ["b.mcap", "b.mcap"]
    assert names(until="2026-01-05T13:00:30+01:00") == ["a.mcap"]
    assert names(since=str(START_NS + 60 * S_NS), until=START_NS + 61 * S_NS) == ["b.mcap", "b.mcap"]
    assert names(since=datetime(2026, 1, 5, 12, 2, tzinfo=UTC)) == []


@pytest.mark.parametrize("since", ["yesterday", "2026-13-01", str(2**63), "", "1.5", True])
def test_a_time_that_is_none_is_refused_with_an_example(since):
    with pytest.raises(QueryError, match=r"since is .*not a time such as 2026-01-05T18:40:00"):
        bind(query("vehicle"), {"vehicle": "alder", "since": since})


def test_a_time_is_a_stamp_in_nanoseconds_and_without_a_zone_it_is_utc():
    for since in ("2026-01-05T12:00:00", "2026-01-05T13:00:00+01:00", "2026-01-05 12:00", START_NS, str(START_NS)):
        assert bind(query("vehicle"), {"vehicle": "alder", "since": since})["since"] == START_NS
    assert bind(query("vehicle"), {"vehicle": "alder", "until": "2026-01-05"})["until"] == START_NS - 43_200 * S_NS


def test_a_vehicle_has_to_be_named():
    with pytest.raises(QueryError, match=r"vehicle is missing.*The vehicle's name"):
        bind(query("vehicle"), {})


# seen_by_others


def test_others_that_passed_tell_what_they_found(store):
    drive(store, "a", "c111c", north_m=0)
    drive(store, "b", "ccccc", vehicle="birch", start_s=60, north_m=[-90, -30, 20, 60, 100])
    drive(store, "c", "c3uuc", vehicle="cedar", start_s=-100, north_m=10)
    drive(store, "d", "22", vehicle="dogwood", start_s=30, north_m=500)  # elsewhere
    drive(store, "e", "11", vehicle="elm", start_s=5000, north_m=0)  # another time
    drive(store, "f", "11", vehicle="alder", start_s=50, north_m=0)  # the same vehicle
    found = ask(
        store, "seen_by_others", "other_name", "there", "nearest_m", "after_s", "frames", "attacked", "other_findings",
        recording="a.mcap",
    )  # fmt: skip
    assert found == [
        ("c.mcap", "attacked, too: S_3 cam3", pytest.approx(10), pytest.approx(-99.7), 5, 1, 2),
        ("b.mcap", "passed and found nothing", pytest.approx(20), pytest.approx(60.1), 2, 0, 0),
    ]
    wider = ask(store, "seen_by_others", "other_name", recording="a.mcap", metres=600, seconds="10000")
    assert sorted(name for (name,) in wider) == ["b.mcap", "c.mcap", "d.mcap", "e.mcap"]


def test_an_incident_that_nobody_else_passed_or_that_has_no_place_says_so(store):
    drive(store, "a", "c1", north_m=0)
    drive(store, "b", "cc", vehicle="birch", start_s=10)
    drive(store, "c", "u", vehicle="cedar", start_s=20)
    drive(store, "d", "1", vehicle="dogwood", clock="unknown", start_s=30, north_m=0)
    assert ask(store, "seen_by_others", "name", "there", "other_name") == [
        ("a.mcap", "nobody else passed", None),
        ("c.mcap", "the incident has no place: no GPS fix", None),
        ("d.mcap", "its clock is not UTC: times of others cannot be compared", None),
    ]


def test_a_recording_that_was_not_judged_passed_all_the_same(store):
    drive(store, "a", "1", north_m=0)
    drive(store, "b", "cc", vehicle="birch", start_s=10, north_m=0, judged=False)
    assert ask(store, "seen_by_others", "other_name", "there", "frames") == [
        ("b.mcap", "passed, and was not judged", 2)
    ]


# alike


def test_incidents_with_the_same_box_in_the_image_are_alike_and_others_are_not(store):
    box, same, apart = (100, 100, 300, 200), (120, 100, 320, 200), (900, 100, 1100, 200)
    drive(store, "a", "c11", north_m=0, regions={(1, 1): box, (2, 1): box, (2, 2): apart})
    drive(store, "b", "33c", vehicle="birch", start_s=60, north_m=300, regions={(0, 3): same, (1, 3): same})
    drive(store, "c", "1", vehicle="cedar", start_s=90, regions={(0, 1): apart})
    drive(store, "d", "0", vehicle="dogwood", start_s=99, regions={(0, 0): box})
    [pair] = run_query(store, "alike").to_pylist()
    assert (pair["name"], pair["sensor"], pair["other_name"], pair["other_sensor"]) == ("a.mcap", 1, "b.mcap", 3)
    assert pair["overlap"] == pytest.approx(180 / 220)
    assert pair["at"] == [round(200 / WIDTH_PX, 3), round(150 / HEIGHT_PX, 3)]
    assert pair["size"] == pair["other_size"] == [round(200 / WIDTH_PX, 3), round(100 / HEIGHT_PX, 3)]
    assert (pair["apart_s"], pair["apart_m"]) == (pytest.approx(59.9), pytest.approx(300))
    assert (pair["first_frame"], pair["other_first_frame"]) == (1, 0)
    assert ask(store, "alike", "name", overlap=0.9) == []
    assert ask(store, "alike", "name", recording="c.mcap") == []
    assert ask(store, "alike", "name", recording="bbbb") == [("a.mcap",)]


# circumstances


def test_what_was_before_an_incident_is_told(store):
    drive(store, "a", "cccc11", stamps_s=[0, 0.1, 0.2, 3.0, 3.1, 3.2])
    drive(store, "b", "cc1", start_s=100)
    drive(store, "c", "1c", start_s=200, clock_jumps=2)
    rows = ask(store, "circumstances", "name", "before", "after_gap_s", "gap_s", "after_change_s", "after_start_s")
    assert rows == [
        ("a.mcap", "0.1 s after a gap of 2.8 s", pytest.approx(0.1), pytest.approx(2.8), None, pytest.approx(3.1)),
        ("b.mcap", None, None, None, None, pytest.approx(0.2)),
        ("c.mcap", "the clock was set back in this recording", None, None, None, 0),
    ]
    assert ask(store, "circumstances", "before", recording="a.mcap", within_s=0.05) == [(None,)]
    assert ask(store, "circumstances", "before", recording="a.mcap", gap_s=3) == [(None,)]


def test_a_changed_calibration_before_an_incident_is_told(store):
    other = make_rig(3, focal_px=710.0)
    drive(store, "a", "ccc")
    drive(store, "a", "c1", start_s=0.3, rig=other)
    [row] = ask(store, "circumstances", "first_frame", "before", "after_change_s", "gap_s")
    assert row == (1, "0.1 s after the calibration changed", pytest.approx(0.1), None)
    [changed] = [row for row in run_query(store, "vehicle", {"vehicle": "alder"}).to_pylist() if "calib" in row["what"]]
    assert changed["from_ns"] == START_NS + 300_000_000


# clean_seconds


def intervals(store, **parameters):
    rows = ask(store, "clean_seconds", "name", "from_ns", "to_ns", "frames", **parameters)
    return [(name, (begin - START_NS) / S_NS, (end - START_NS) / S_NS, frames) for name, begin, end, frames in rows]


def test_clean_seconds_stay_away_from_all_that_is_not_clean(store):
    drive(store, "a", "c" * 30 + "1" + "c" * 30)
    # frames 0 to 19 lie more than 1 s before frame 30, and 41 to 60 more than 1 s behind it
    assert intervals(store) == [("a.mcap", 0.0, 1.9, 20), ("a.mcap", 4.1, 6.0, 20)]
    assert intervals(store, margin_s=0) == [("a.mcap", 0.0, 2.9, 30), ("a.mcap", 3.1, 6.0, 30)]
    assert intervals(store, least_s=2) == []
    assert intervals(store, vehicle="birch") == []


def test_what_is_not_clean_in_any_way_ends_an_interval(store):
    names = "abde"
    for name, kind in zip(names, "usn ", strict=True):
        drive(store, name, "c" * 20 + kind + "c" * 20)
    parts = ((0.0, 1.9, 20), (2.1, 4.0, 20))
    assert intervals(store, margin_s=0.05) == [(f"{name}.mcap", *part) for name in names for part in parts]


def test_a_gap_an_absent_sensor_and_a_label_end_an_interval(store):
    drive(store, "a", "c" * 20, stamps_s=[n / 10 + (5 if n > 11 else 0) for n in range(20)])
    drive(store, "b", "c" * 20, absent=[(15, 2)])
    drive(store, "d", "c" * 20)
    label = AttackLabel("/cam1", "facula", START_NS + 15 * PERIOD_NS, START_NS + 15 * PERIOD_NS, {})
    store.write_labels("d" * 64, [label], RIG)
    found = intervals(store, margin_s=0.05)
    assert found == [("a.mcap", 0.0, 1.1, 12), ("b.mcap", 0.0, 1.4, 15), ("d.mcap", 0.0, 1.4, 15)]


def test_what_was_not_judged_is_not_clean_and_all_rigs_of_a_recording_have_to_be(store):
    drive(store, "a", "c" * 20, judged=False)
    drive(store, "b", "c" * 20)
    assert intervals(store) == [("b.mcap", 0.0, 1.9, 20)]
    drive(store, "b", "c" * 10 + "1" + "c" * 9, rig=make_rig(4))
    assert intervals(store, least_s=0.5, margin_s=0.15) == [("b.mcap", 0.0, 0.8, 9), ("b.mcap", 1.2, 1.9, 8)]


# not_audited


def test_what_was_not_audited_is_told_with_its_reason(store):
    read = TopicCoverage("/cam1", "image", "camera", TopicState.READ, sensor=1)
    packets = TopicCoverage(
        "/packets", "velodyne", "LiDAR", TopicState.UNREADABLE, reason="it cannot be decoded", remedy="convert it"
    )
    known = {"coverage": (read, packets), "damage": ("chunk 7 is cut",)}
    drive(store, "a", "cc  c nn c", absent=[(1, 2)], **known)
    drive(store, "b", "cc", vehicle="birch", judged=False)
    store.write_recording(RecordingRecord("d" * 64, "d.mcap", "/logs/d.mcap"))
    columns = ("name", "what", "reason", "sensor_name", "frames", "runs", "first_frame", "last_frame", "remedy")
    nothing = (None,) * 5
    assert ask(store, "not_audited", *columns) == [
        ("a.mcap", "recording", "damaged: chunk 7 is cut", *nothing, None),
        ("a.mcap", "topic", "unreadable: it cannot be decoded", *nothing, "convert it"),
        ("b.mcap", "measurement", "measured and not judged", *nothing, "auditor judge"),
        ("d.mcap", "recording", "not measured", *nothing, "auditor scan"),
        ("a.mcap", "frames", "no LiDAR", "S_0 velo", 4, 3, 2, 8, None),
        ("a.mcap", "frames", "a reason", None, 2, 1, 6, 7, None),
        ("a.mcap", "sensor", "missing", "S_2 cam2", 1, 1, 1, 1, None),
    ]
    assert ask(store, "not_audited", "share", recording="a.mcap")[2:] == [(0.4,), (0.2,), (0.1,)]
    assert ask(store, "not_audited", "name", vehicle="birch") == [("b.mcap",)]


# false_alarms


def test_false_alarms_are_counted_in_what_labels_say_is_clean(store):
    drive(store, "a", "cc1cccccuc", level=100.0)  # two false alarms in 0.9 s
    drive(store, "b", "1ccc", level=30.0, start_s=3600)  # one in 0.3 s, an hour later, in the dark
    drive(store, "d", "111", start_s=10)  # not labelled
    drive(store, "e", "11cc2", vehicle="birch")  # attacked in its first two frames, and alarmed falsely in its last
    clean = GivenLabel(given_at=NOON)
    for name in "ab":
        store.write_given_labels(name * 64, [clean])
    store.write_labels("e" * 64, [AttackLabel("/cam1", "facula", START_NS, START_NS + PERIOD_NS, {})], RIG)
    columns = ("vehicle", "hour_utc", "light", "recordings", "frames", "false_alarms", "alarming_frames")
    rows = ask(store, "false_alarms", *columns, "hours", "an_hour")
    assert [row[:7] for row in rows] == [
        ("alder", 12, "bright", 1, 10, 2, 2),
        ("alder", 13, "dark", 1, 4, 1, 1),
        ("birch", 12, "bright", 1, 3, 1, 1),
    ]
    seconds = [row[7] * 3600 for row in rows]
    assert seconds == pytest.approx([0.9, 0.3, 0.2])
    assert [row[8] for row in rows] == pytest.approx([2 / 0.9 * 3600, 1 / 0.3 * 3600, 1 / 0.2 * 3600])
    assert ask(store, "false_alarms", "light", vehicle="alder", dark_below=200) == [("dark",), ("dark",)]


def test_the_bound_of_no_false_alarm_is_three_in_the_time(store):
    drive(store, "a", "c" * 11)
    store.write_given_labels("a" * 64, [GivenLabel(given_at=NOON)])
    [(alarms, hours, bound)] = ask(store, "false_alarms", "false_alarms", "hours", "an_hour_at_most")
    assert alarms == 0
    assert bound * hours == pytest.approx(2.9957, abs=1e-3)  # -ln 0.05


# look_first


def test_the_frames_worth_looking_at_come_by_what_they_name_and_how_sure_it_is(store):
    scores = {"a": [0.0, 0.3, 0.9, 0.0, 0.0, 0.2], "b": [0.5, 0.5], "d": [2.0]}
    for name, kinds in {"a": "c11ccs", "b": "2c", "d": "u"}.items():
        known = drive(store, name, kinds, judged=False, vehicle="birch" if name == "b" else "alder")
        stamps = [START_NS + frame * PERIOD_NS for frame in range(len(kinds))]
        add_judgement(store, RIG, known, kinds, stamps=stamps, scores=scores[name])
    assert ask(store, "look_first", "place", "name", "frame", "found", "frames", "gap", "pictured") == [
        (1, "a.mcap", 2, "attacked: S_1 cam1", 2, 0.9, False),
        (2, "b.mcap", 0, "attacked: S_2 cam2", 1, 0.5, False),
        (3, "d.mcap", 0, "unidentified", 1, 2.0, False),
        (4, "a.mcap", 5, "suspect", 1, 0.2, False),
    ]
    assert ask(store, "look_first", "place", most=2) == [(1,), (2,)]
    assert ask(store, "look_first", "name", vehicle="birch") == [("b.mcap",)]


# The page


PAGE = Path(__file__).parents[2] / "docs" / "questions.md"
COMMANDS = re.findall(r"^    auditor (query .*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    store = new_store(tmp_path_factory.mktemp("small"))
    drive(store, "a", "c" * 70 + "11 ", north_m=0, regions={(70, 1): (0, 0, 9, 9)})
    drive(store, "b", "cc11", vehicle="birch", start_s=20, north_m=10, regions={(2, 1): (0, 0, 9, 9)})
    store.write_given_labels("a" * 64, [GivenLabel(given_at=NOON)])
    return store


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_of_the_page_answers(small, command, capsys):
    assert run([*shlex.split(command), "--store", str(small.folder)]) == 0
    assert "(no rows)" not in capsys.readouterr().out


def test_the_page_asks_every_question():
    asked = {command.split()[1] for command in COMMANDS}
    assert asked == {
        "look_first", "vehicle", "seen_by_others", "alike", "circumstances", "not_audited", "clean_seconds",
        "false_alarms",
    }  # fmt: skip
