"""Recordings that follow each other are one drive."""

import pytest

from auditor.model.frames import TopicBalance
from auditor.reporting.incident.loading import load_page
from auditor.reporting.incident.render import render
from auditor.store.queries import run_query, run_sql
from auditor.store.records import RecordingRecord
from tests.making.stores import add_frames, add_judgement, make_measurement, make_rig, new_store

RIG, OTHER_RIG = make_rig(3), make_rig(4)
DAY_NS = 1_700_000_000 * 10**9
S = 10**9


@pytest.fixture
def store(tmp_path):
    return new_store(tmp_path)


def record(store, name, from_s, to_s, *, rig=RIG, vehicle="alder", drive=None, clock="utc", kinds="", **measured):
    """A recording from and to so many seconds, and a measurement of it; `kinds` is judged, a frame each 0.1 s."""
    recording_id = name * 64
    from_ns = DAY_NS + round(from_s * S)
    store.write_rig(rig)
    store.write_recording(
        RecordingRecord(
            recording_id,
            f"{name}.mcap",
            f"/logs/{name}.mcap",
            clock=clock,
            from_ns=from_ns,
            to_ns=DAY_NS + round(to_s * S),
            vehicle=vehicle,
            drive=drive,
        )
    )
    stamps = [from_ns + n * S // 10 for n in range(len(kinds))]
    frames = [make_measurement(rig, n, stamp_ns=stamp) for n, stamp in enumerate(stamps)]
    measurement_id = add_frames(store, rig, recording_id, frames, **measured)
    if kinds:
        add_judgement(store, rig, measurement_id, kinds, stamps=stamps)


def drives(store):
    rows = run_sql(store, "SELECT recording_id, drive_id FROM recordings ORDER BY recording_id").to_pylist()
    return {row["recording_id"][0]: row["drive_id"][0] for row in rows}


def test_recordings_that_follow_each_other_within_ten_seconds_are_one_drive(store):
    record(store, "a", 0, 60)
    record(store, "b", 60.1, 120)
    record(store, "c", 129.9, 130)
    record(store, "d", 140.1, 150)
    assert drives(store) == {"a": "a", "b": "a", "c": "a", "d": "d"}


def test_others_are_drives_of_their_own(store):
    record(store, "a", 0, 60)
    record(store, "b", 30, 90)
    record(store, "c", 61, 99, vehicle="birch")
    record(store, "d", 61, 99, rig=OTHER_RIG)
    record(store, "e", 61, 99, clock="unknown")
    record(store, "f", 100, 101, clock="relative")
    record(store, "0", 102, 103, clock="relative")
    assert drives(store) == {name: name for name in "abcdef0"}


def test_what_was_said_to_be_a_drive_is_one(store):
    record(store, "a", 0, 60, drive="0009")
    record(store, "b", 500, 560, drive="0009")
    record(store, "c", 61, 70)
    record(store, "d", 61, 70, drive="0009", vehicle="birch")
    record(store, "e", 71, 75, drive="0009", clock="relative")
    assert drives(store) == {"a": "a", "b": "a", "c": "c", "d": "d", "e": "a"}


def test_a_recording_tells_where_its_messages_went(store):
    balance = (
        TopicBalance("/a", "x", 1, read=10, used=6, damaged=1, skipped={"edge": 2, "late": 1}),
        TopicBalance("/b", "y", None, read=5, unused=5),
    )
    record(store, "a", 0, 1, balance=balance)
    row = run_sql(store, "SELECT COLUMNS('messages_.*') FROM recordings").to_pylist()[0]
    assert row == {
        "messages_read": 15,
        "messages_used": 6,
        "messages_unused": 5,
        "messages_damaged": 1,
        "messages_skipped": 3,
    }


def incidents(store, **parameters):
    rows = run_query(store, "incidents", parameters).to_pylist()
    parts = [[(part["name"], part["first_frame"], part["last_frame"]) for part in row["parts"]] for row in rows]
    return list(zip([row["frames"] for row in rows], parts, strict=True))


def test_an_incident_runs_over_the_border_of_two_recordings(store):
    record(store, "a", 0, 0.9, kinds="cccccccc11")
    record(store, "b", 1.0, 1.9, kinds="111ccccccc")
    record(store, "c", 2.0, 2.9, kinds="2ccc1ccccc")
    through = (5, [("a.mcap", 8, 9), ("b.mcap", 0, 2)])
    assert incidents(store) == [through, (1, [("c.mcap", 0, 0)]), (1, [("c.mcap", 4, 4)])]
    (row, *_) = run_query(store, "incidents").to_pylist()
    assert (row["name"], row["first_frame"], row["last_frame"], row["seconds"]) == ("a.mcap", 8, 2, 0.4)
    assert incidents(store, recording="a.mcap") == incidents(store, recording="b.mcap") == [through]


def test_recordings_of_different_drives_share_no_incident(store):
    record(store, "a", 0, 0.9, kinds="ccccccccc1")
    record(store, "b", 1.0, 1.9, kinds="1ccccccccc", vehicle="birch")
    assert [frames for frames, _ in incidents(store)] == [1, 1]


def test_clocks_that_start_anew_in_a_drive_do_not_bridge_its_recordings(store):
    record(store, "a", 0, 1.9, kinds="1" + "c" * 19, drive="x", clock="relative")
    record(store, "b", 0, 1.9, kinds="1" + "c" * 19, drive="x", clock="relative")
    record(store, "c", 5, 6.9, kinds="1" + "c" * 19, drive="x", clock="relative")
    assert len(incidents(store)) == 3


def test_the_page_counts_an_incident_once_and_says_where_it_goes_on(store):
    record(store, "a", 0, 0.9, kinds="cccccccc11")
    record(store, "b", 1.0, 1.9, kinds="111ccccccc")
    page = load_page(store)
    assert page.incident_count == 1
    assert [[one.number for one in recording.incidents] for recording in page.recordings] == [[1], [1]]
    assert "in recording 1 of the 2 that it runs through" in render(page)
