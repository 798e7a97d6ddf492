"""What a sensor's coverage says of its clock and of when it was there."""

from auditor.model.coverage import TopicCoverage, TopicState
from auditor.store.queries import run_query, run_sql
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


def test_of_each_sensor_on_board_the_view_looked_says_how_much_of_it_others_were_compared_with(tmp_path):
    store = new_store(tmp_path)
    frames = [make_measurement(RIG, f, missing=(2,) if f < 3 else ()) for f in range(4)]
    side = ("/side", "sensor_msgs/msg/Image", "camera", TopicState.LEFT_OUT, None, "side", 9)
    add_measurement(store, RIG, frames, coverage=(TopicCoverage(*side, reason="no camera info"),))
    columns = "sensor, frames, time_share, two_share, one_share, none_share, reason"
    rows = run_sql(store, f"SELECT {columns} FROM looked ORDER BY sensor NULLS LAST").to_pylist()
    assert [tuple(row.values()) for row in rows] == [
        (0, 4, 1.0, None, None, None, None),
        (1, 4, 1.0, 0.75, 0.125, 0.125, None),
        (2, 1, 0.25, 0.75, 0.125, 0.125, None),
        (3, 4, 1.0, 0.75, 0.125, 0.125, None),
        (None, 0, 0.0, 0.0, 0.0, 1.0, "no camera info"),
    ]
    assert run_query(store, "summary", {}).to_pylist()[0]["looked_share"] == 0.75


def test_a_camera_beside_one_other_is_looked_at_where_that_one_was_compared(tmp_path):
    store, two = new_store(tmp_path), make_rig(2)
    add_measurement(store, two, [make_measurement(two, 0)])
    assert run_query(store, "summary", {}).to_pylist()[0]["looked_share"] == 0.875
