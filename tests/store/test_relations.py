"""Which recordings of a store hold the same drive, decided from stamps and fingerprints of their frames."""

from dataclasses import replace
from datetime import date

import pytest

from auditor.model.frames import Presence, SensorState
from auditor.store.maintenance.relations import MIN_CHANGED_FRAMES, relate
from auditor.store.maintenance.removal import remove_recordings
from auditor.store.queries import run_query, run_sql
from auditor.store.records import RecordingRecord
from tests.making.stores import PERIOD_NS, PROCEDURE, add_frames, add_judgement, make_measurement, make_rig, new_store

RIG = make_rig(3)
START_NS = 1_700_000_000 * 10**9
ALONE = replace(PROCEDURE, counting_version=1)
"""How a LiDAR alone is measured: by parameters of its own."""


def frames(numbers, *, changed=(), missing=(), shift_ns=0):
    """Frames of one drive; the data of S_1 are others in the `changed` ones, and S_1 misses in the `missing` ones."""
    for place, number in enumerate(numbers):
        made = make_measurement(
            RIG, number, missing={1} if number in missing else (), stamp_ns=START_NS + number * PERIOD_NS + shift_ns
        )
        other = {1: made.fingerprints.get(1, 0) + 10**6} if number in changed else {}
        yield replace(made, number=place, fingerprints=made.fingerprints | other)


def add(store, letter, made, *, rig=RIG, span=(0, 1000), how=PROCEDURE, withheld=None, **about):
    """A recording, not compared yet, with these frames, measured so."""
    time_ns = {"from_ns": START_NS + span[0] * PERIOD_NS, "to_ns": START_NS + span[1] * PERIOD_NS}
    about = {"clock": "utc", **time_ns, **about}
    store.write_recording(RecordingRecord(letter * 64, f"{letter}.mcap", f"/logs/{letter}.mcap", **about))
    store.write_rig(rig)
    return add_frames(store, rig, letter * 64, list(made), procedure=how, withheld=withheld)


def related(store):
    """By recording: its superseding one and its conflicts, by their letters."""
    relate(store)
    return {
        record.recording_id[0]: (
            record.superseded_by and record.superseded_by[0],
            "".join(other[0] for other in record.conflicts),
        )
        for record in store.recordings()
    }


def test_a_recording_that_grew_supersedes_the_earlier_and_incidents_count_once(tmp_path):
    store = new_store(tmp_path)
    short, long = add(store, "a", frames(range(6))), add(store, "b", frames(range(10)))
    add_judgement(store, RIG, short, "c222cc")
    add_judgement(store, RIG, long, "c222cccccc")
    assert len(run_query(store, "incidents")) == 2
    [told] = map(str, relate(store))
    assert told == "b.mcap: it holds every frame of a.mcap, which counts no longer"
    assert related(store) == {"a": ("b", ""), "b": (None, "")}
    assert [row["frames"] for row in run_query(store, "incidents").to_pylist()] == [3]
    assert [row["name"] for row in run_query(store, "summary").to_pylist()] == ["b.mcap"]
    for view in ("recordings", "measurements", "verdicts", "balance"):
        assert "a" * 64 not in set(run_sql(store, f"SELECT * FROM {view}")["recording_id"].to_pylist())
    assert run_sql(store, "SELECT name FROM superseded").to_pylist() == [{"name": "a.mcap"}]
    assert relate(store) == ()


@pytest.mark.parametrize("order", ["ab", "ba"])
def test_of_equal_copies_one_counts_in_whichever_order_they_are_compared(tmp_path, order):
    store = new_store(tmp_path)
    for letter in order:
        add(store, letter, frames(range(5)))
        relate(store)
    assert related(store) == {"a": ("b", ""), "b": (None, "")}


def test_the_edges_of_a_recording_need_not_be_complete_and_its_middle_must_be(tmp_path):
    store = new_store(tmp_path)
    add(store, "a", frames(range(2, 7), missing={2, 6}))
    add(store, "b", frames(range(3, 12)))  # which lacks frame 2 altogether
    assert related(store)["a"] == ("b", "")
    add(store, "c", frames(range(3, 12), missing={5}))
    add(store, "d", frames([3, 4, *range(6, 12)]))
    assert related(store)["c"] == ("b", "")
    add(store, "e", frames([1, *range(3, 5), 6]))  # its first frame is complete, and nobody else has it
    assert related(store)["e"] == (None, "")


def test_a_twin_with_other_data_is_a_conflict_and_both_count(tmp_path):
    store = new_store(tmp_path)
    add(store, "a", frames(range(10)))
    add(store, "b", frames(range(10), changed={3, 4, 5}))
    assert related(store) == {"a": (None, "b"), "b": (None, "a")}
    assert len(run_query(store, "summary")) == 2
    add(store, "c", frames(range(10), changed=range(MIN_CHANGED_FRAMES - 1)))
    assert related(store)["c"] == (None, "b")


def test_a_white_image_is_no_proof_that_two_frames_are_one(tmp_path):
    """A picture that is white all over has no fingerprint: a twin that shows something there has other data."""
    store = new_store(tmp_path)
    made = list(frames(range(5)))
    dazzled = [{s: known for s, known in one.fingerprints.items() if s != 1} for one in made]
    white = [replace(one, fingerprints=prints) for one, prints in zip(made, dazzled, strict=True)]
    add(store, "a", white)
    add(store, "b", frames(range(8)))
    assert related(store) == {"a": (None, "b"), "b": (None, "a")}


def test_two_vehicles_and_other_times_and_other_sensors_have_nothing_to_do_with_each_other(tmp_path):
    store = new_store(tmp_path)
    other_rig = make_rig(3, name="other", lidar=False)
    add(store, "a", frames(range(8)), vehicle="one")
    add(store, "b", frames(range(8), changed=range(8)), vehicle="two")
    add(store, "c", frames(range(8), changed=range(8), shift_ns=1), vehicle="one")
    assert set(related(store).values()) == {(None, "")}
    add(store, "d", frames(range(8), changed=range(8)), vehicle="one")
    assert related(store)["d"] == (None, "a")
    no_lidar = [
        replace(one, presence={s: p for s, p in one.presence.items() if s}, counts=(None,) * len(other_rig.triples))
        for one in frames(range(8))
    ]
    add(store, "e", no_lidar, rig=other_rig)
    assert related(store)["e"] == (None, "")


def test_equal_stamps_by_accident_are_no_conflict_of_unknown_vehicles(tmp_path):
    store = new_store(tmp_path)
    add(store, "a", frames(range(20)))
    rounded = [*frames(range(4), changed=range(4)), *frames(range(4, 20), changed=range(20), shift_ns=1)]
    add(store, "b", [replace(one, number=place) for place, one in enumerate(rounded)])
    assert related(store) == {"a": (None, ""), "b": (None, "")}


def test_relative_clocks_collide_only_within_one_known_drive(tmp_path):
    store = new_store(tmp_path)
    add(store, "a", frames(range(6)), clock="relative")
    add(store, "b", frames(range(6), changed=range(6)), clock="relative")
    add(store, "c", frames(range(6), changed=range(3)), clock="utc")
    known = {"vehicle": "one", "date": date(2026, 1, 2), "drive": "7"}
    assert set(related(store).values()) == {(None, "")}
    add(store, "d", frames(range(6)), clock="relative", **known)
    add(store, "e", frames(range(6), changed=range(6)), clock="relative", **known)
    found = related(store)
    assert found["e"] == (None, "d")
    assert found["d"][1] == "e"


def test_only_recordings_that_overlap_in_time_are_read(tmp_path):
    store = new_store(tmp_path)
    add(store, "a", frames(range(6)), span=(0, 5))
    add(store, "b", frames(range(6)), span=(6, 11))
    for path in store.finished_paths("frames"):
        path.write_bytes(b"")
    assert related(store) == {"a": (None, ""), "b": (None, "")}


def of_lidar(made):
    """The same frames as a part of the drive without its calibration is measured: its LiDAR alone."""
    for one in made:
        yield replace(
            make_measurement(RIG.alone(0), one.number, stamp_ns=one.stamp_ns), fingerprints={0: one.fingerprints[0]}
        )


@pytest.mark.parametrize(
    ("changed", "withheld", "superseding"), [((), None, "b"), ((5,), None, None), ((), "points fit nowhere", None)]
)
def test_a_part_that_was_a_lidar_alone_counts_no_more_where_the_whole_is_measured_with_its_cameras(
    tmp_path, changed, withheld, superseding
):
    store = new_store(tmp_path)
    add(store, "a", of_lidar(frames(range(4, 8))), rig=RIG.alone(0), how=ALONE)
    whole = [
        replace(one, fingerprints=one.fingerprints | {0: 7}) if one.number in changed else one
        for one in frames(range(8))
    ]
    add(store, "b", whole, withheld=withheld)
    assert related(store)["a"][0] == superseding
    assert related(store)["b"][0] is None


def test_cameras_count_no_more_where_they_are_measured_with_their_lidar(tmp_path):
    store, cameras = new_store(tmp_path), make_rig(3, lidar=False)
    made = [
        replace(
            make_measurement(cameras, one.number, stamp_ns=one.stamp_ns),
            fingerprints={s: data for s, data in one.fingerprints.items() if s},
        )
        for one in frames(range(6))
    ]
    add(store, "a", made, rig=cameras)
    add(store, "b", frames(range(6)))
    assert related(store) == {"a": ("b", ""), "b": (None, "")}


def test_another_calibration_of_the_same_frames_supersedes_nothing(tmp_path):
    """A copy whose calibration was changed is measured otherwise: nothing of the first may be hidden by it."""
    store = new_store(tmp_path)
    add(store, "a", frames(range(6)))
    add(store, "b", frames(range(8)), rig=make_rig(3, focal_px=701.0))
    assert related(store) == {"a": (None, ""), "b": (None, "")}
    add(store, "c", frames(range(8)), rig=make_rig(3, focal_px=700.0 + 1e-8))
    assert related(store)["a"] == ("c", "")


def test_frames_put_together_otherwise_are_not_the_same_frames(tmp_path):
    store = new_store(tmp_path)
    add(store, "a", frames(range(6)))
    shuffled = []
    for one, following in zip(frames(range(8)), frames(range(1, 9)), strict=True):
        skewed = {**one.presence, 2: Presence(SensorState.PRESENT, PERIOD_NS)}
        shuffled.append(replace(one, presence=skewed, fingerprints={**one.fingerprints, 2: following.fingerprints[2]}))
    add(store, "b", shuffled)
    assert related(store) == {"a": (None, ""), "b": (None, "")}


def test_what_a_removed_recording_superseded_counts_again_or_is_superseded_by_the_next(tmp_path):
    store = new_store(tmp_path)
    for letter, count in (("a", 4), ("b", 6), ("c", 8)):
        add(store, letter, frames(range(count)))
    assert related(store) == {"a": ("c", ""), "b": ("c", ""), "c": (None, "")}
    remove_recordings(store, ["c" * 64])
    assert related(store) == {"a": ("b", ""), "b": (None, "")}
    remove_recordings(store, ["b" * 64])
    assert related(store) == {"a": (None, "")}
