from dataclasses import replace

import numpy as np

from auditor.model.fault_features import COLUMNS, Agreement, IsolatedShares, PairFaultFeatures, RowMatches
from auditor.model.frames import SkippedFrame
from auditor.model.measurement import Coverage, Region, Solid
from auditor.model.verdict import Cause, FaultHypothesis, Verdict, VerdictKind
from auditor.store.queries import run_sql
from auditor.store.records import JudgementRecord
from tests.making.stores import (
    NOON,
    RULES,
    add_judgement,
    add_measurement,
    make_measurement,
    make_rig,
    make_thresholds,
    new_store,
)

SEEN = PairFaultFeatures(
    RowMatches(40, 0.9, 0.5, 0.95),
    Agreement(1500, 0.8, 0, 0.8, 4, 0, 0.7, -0.1, -0.2),
    IsolatedShares(0.02, 0.001),
)
FACULA = Region(3, 3, (8, 4, 400, 240), 0.25, b"png")
WALL = Region(0, 3, (100, 80, 300, 200), 0.125, b"points", 850, Solid((8.0, -1.0, 0.5), (2.5, 1.5, 0.0625), 4.5))


def test_fault_features_come_back_by_frame_and_pair_with_how_bright_the_cameras_are(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    dim = {s: Coverage(0.25, 0.5, level=10.0 * s, red_level=1.0 * s) if s else Coverage(returns=9) for s in rig.sensors}
    frames = [
        replace(make_measurement(rig, 1), fault_features={(1, 3): SEEN, (2, 3): PairFaultFeatures()}, coverage=dim),
        SkippedFrame(2, 200_000_000, "no cloud"),
        replace(make_measurement(rig, 3), fault_features={(2, 3): SEEN}, coverage=dim),
    ]
    seen = store.load_fault_features(add_measurement(store, rig, frames))
    assert (seen.pairs, seen.cameras) == (((1, 3), (2, 3), (1, 2)), (1, 2, 3))
    assert tuple(seen.columns) == COLUMNS
    values = np.stack([seen.columns[name] for name in COLUMNS], axis=2)
    assert np.array_equal(values[0, 0], SEEN.values, equal_nan=True)
    assert np.array_equal(values[1, 1], SEEN.values, equal_nan=True)
    assert np.isnan(values[0, 1]).all()
    assert np.isnan(values[1, 0]).all()
    assert seen.brightness["level"].tolist() == [[10, 20, 30]] * 2
    assert seen.brightness["saturated_share"].tolist() == [[0.25] * 3] * 2
    assert seen.brightness["red_level"].tolist() == [[1, 2, 3]] * 2
    assert np.isnan(seen.brightness["blue_level"]).all()
    [row] = run_sql(
        store, "SELECT k, row_aligned, before_only, rotated FROM fault_features WHERE frame = 3"
    ).to_pylist()
    assert row == {"k": 3, "row_aligned": 0.9, "before_only": None, "rotated": 0.7}


def test_regions_come_back_and_tell_which_of_their_sensors_are_attacked(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    frames = [replace(make_measurement(rig, n), regions=(FACULA, WALL)) for n in (1, 2)]
    measurement_id = add_measurement(store, rig, frames)
    found = store.load_regions(measurement_id, 2)
    for region, written in zip(found, (FACULA, WALL), strict=True):
        assert vars(region) == vars(written)
    rows = run_sql(store, "SELECT sensor, attacked FROM regions WHERE frame = 1 ORDER BY sensor").to_pylist()
    assert [row["attacked"] for row in rows] == [None, None]
    add_judgement(store, rig, measurement_id, " 3c")
    rows = run_sql(store, "SELECT frame, sensor, attacked FROM regions ORDER BY frame, sensor").to_pylist()
    assert [tuple(row.values()) for row in rows] == [(1, 0, False), (1, 3, True), (2, 0, False), (2, 3, False)]


def test_causes_are_told_in_words_each_once_with_its_best_score(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    measurement_id = add_measurement(store, rig, [make_measurement(rig, n) for n in range(2)])
    causes = (FaultHypothesis(Cause.RAIN, 0, 0.75), FaultHypothesis(Cause.DARK, None, 0.25))
    verdicts = [
        (n, n * 100_000_000, Verdict(VerdictKind.SUSPECT, "0", gap=0.1, causes=causes[: n + 1])) for n in range(2)
    ]
    record = JudgementRecord(measurement_id, "robust", make_thresholds(rig), RULES, NOON)
    store.write_judgement(record, verdicts)
    told = "S_0 sees drops all around, as in rain (score 0.75 of 1)"
    rows = run_sql(store, "SELECT causes_in_words(causes) AS told FROM verdicts ORDER BY frame").to_pylist()
    assert [row["told"] for row in rows] == [told, f"{told}, all cameras are dark (score 0.25 of 1)"]
