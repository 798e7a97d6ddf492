"""What a sensor's coverage says of its clock and of when it was there."""

from auditor.store.queries import run_query
from tests.making.stores import add_measurement, make_measurement, make_rig, new_store

RIG = make_rig(3)


def test_a_late_starter_its_offset_and_the_jumps_of_the_clock_are_told(tmp_path):
    store = new_store(tmp_path)
    frames = [make_measurement(RIG, f, missing=(2,) if f < 3 or f > 5 else ()) for f in range(8)]
    add_measurement(store, RIG, frames, offsets_ns=(-10_000_000, 2_500_000, 0, 0), clock_jumps=1)
    add_measurement(store, RIG, frames[:1], recording="b")
    rows = run_query(store, "coverage", {"recording": "a.mcap"}).to_pylist()
    assert [(row["first_frame"], row["last_frame"]) for row in rows] == [(0, 7), (0, 7), (3, 5), (0, 7)]
    assert [row["offset_ms"] for row in rows] == [-10, 2.5, 0, 0]
    assert {row["clock_jumps"] for row in rows} == {1}
    assert {row["offset_ms"] for row in run_query(store, "coverage", {"recording": "b.mcap"}).to_pylist()} == {None}
