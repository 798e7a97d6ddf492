"""A store judged by the robust method: what SQL says of it is what Python said."""

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.naming import System
from auditor.identification.robust import FrameSeries, judge_frames
from auditor.identification.scores import normalised_scores
from auditor.model.calibration import RobustThresholds, Scale
from auditor.model.checks import rig_pair_checks
from auditor.model.verdict import Finding, VerdictKind
from auditor.store.describing import describe
from auditor.store.queries import run_query, run_sql
from auditor.store.records import JudgementRecord
from tests.making.stores import (
    NOON,
    RULES,
    add_judgement,
    add_measurement,
    make_measurement,
    make_rig,
    make_verdict,
    new_store,
)

RIG = make_rig(3)
ELEMENTS = rig_pair_checks(RIG)
FRAMES = 30


@pytest.fixture
def judged(tmp_path):
    """A store with random ratios, among which S_1 is attacked in ten frames, and the verdicts given on them."""
    rng = np.random.default_rng(3)
    ratios = rng.uniform(0, 0.4, (FRAMES, len(ELEMENTS)))
    ratios[rng.random(ratios.shape) < 0.05] = np.nan
    ratios[
        10:20, [place for place, e in enumerate(ELEMENTS) if e.check == "photometric_inconsistency" and e.i == 1]
    ] = 0.9
    given = [[None if np.isnan(x) else x for x in row] for row in ratios.tolist()]
    store = new_store(tmp_path)
    known = add_measurement(store, RIG, [make_measurement(RIG, f, ratios=row) for f, row in enumerate(given)])
    scales_of = {pair_check: Scale(0.35, 0.1, 100) for pair_check in ELEMENTS[:-1]}  # the last has no clean samples
    loaded = store.load_ratios(known)
    system = System(ELEMENTS, RIG.triples, RIG.sensors, RIG.fallback)
    scales = [scales_of.get(pair_check) for pair_check in ELEMENTS]
    thresholds = RobustThresholds("c" * 32, Decimal("0.01"), scales_of, {}, resolvable=True, incidents_per_hour=2.0)
    present = loaded.states == "present"
    series = FrameSeries.of_recording(loaded.stamps_ns, loaded.ratios, present, loaded.fingerprints, {})
    verdicts = judge_frames(series, system, thresholds)
    rows = zip(loaded.frames.tolist(), loaded.stamps_ns.tolist(), verdicts, strict=True)
    store.write_judgement(JudgementRecord(known, "robust", thresholds, RULES, NOON), rows)
    return store, known, verdicts, normalised_scores(loaded.ratios, scales)


def test_margins_in_sql_are_those_in_python(judged):
    store, _, _, z = judged
    rows = run_sql(store, "SELECT frame, position, z FROM ratios ORDER BY frame, position").to_pylist()
    found = np.array([np.nan if row["z"] is None else row["z"] for row in rows]).reshape(z.shape)
    np.testing.assert_allclose(found, z, rtol=1e-12)


def test_findings_are_the_frames_that_the_half_second_confirms(judged):
    store, known, verdicts, _ = judged
    rows = run_sql(store, "SELECT frame, kind, attacked FROM findings ORDER BY frame").to_pylist()
    expected = [(f, v.finding.kind, list(v.finding.attacked)) for f, v in enumerate(verdicts) if v.finding]
    assert [(row["frame"], row["kind"], row["attacked"]) for row in rows] == expected
    assert {frame for frame, *_ in expected} >= set(range(11, 19))
    judgement = store.current_judgements()[known]
    assert judgement.in_incidents == len(expected)
    assert judgement.statistic is None
    assert judgement.counts[VerdictKind.CLEAN] == sum(v.kind is VerdictKind.CLEAN for v in verdicts)


def test_an_incident_says_in_words_what_carried_it_and_what_else_it_could_be(judged):
    store, *_ = judged
    (row,) = [row for row in run_query(store, "incidents").to_pylist() if row["attacked"] == [1]]
    assert "S_1 and S_3 do not see the same in 10 frames (+3.00)" in row["evidence"]
    assert "worse by" in row["alternatives"]
    assert row["causes"] is None
    facts = {(row["part"], row["item"]): row for row in run_query(store, "frame", {"frame": 15}).to_pylist()}
    assert (facts["verdict", "finding"]["value"], facts["verdict", "finding"]["note"]) == ("attacked", "S_1")
    assert facts["score", "photometric_inconsistency S_1 S_3"]["score"] == pytest.approx(3.0)
    assert all(row["measured"] > 0 for (part, _), row in facts.items() if part == "alternative")
    assert "alternative" in {part for part, _ in facts}


def test_a_frame_that_the_half_second_does_not_confirm_names_no_sensor_in_the_summary(tmp_path):
    store = new_store(tmp_path)
    known = add_measurement(store, RIG, [make_measurement(RIG, f) for f in range(3)])
    alone = replace(make_verdict(RIG, "2"), finding=None)
    confirmed = replace(make_verdict(RIG, "1"), finding=Finding(VerdictKind.ATTACKED, (1,)))
    thresholds = RobustThresholds("c" * 32, Decimal(0), {}, {}, resolvable=True)
    rows = [(f, f, verdict) for f, verdict in enumerate((alone, confirmed, make_verdict(RIG, "c")))]
    kept = store.write_judgement(JudgementRecord(known, "robust", thresholds, RULES, NOON), rows)
    assert kept == store.current_judgements()[known]
    (row,) = run_query(store, "summary").to_pylist()
    assert (row["attacked"], row["attacked_sensors"]) == (2, [1])
    column = next(column for column in describe("summary").columns if column.name == "attacked_sensors")
    assert column.sentence.startswith("Sensors that an incident names")


def test_the_later_judgement_decides_by_which_method_a_frame_belongs_to_an_incident(judged):
    store, known, *_ = judged
    add_judgement(store, RIG, known, "c" * 29 + "2", minutes=5, method="paper")
    (row,) = run_query(store, "incidents").to_pylist()
    assert (row["first_frame"], row["attacked"]) == (29, [2])
    assert [row["method"] for row in run_query(store, "summary").to_pylist()] == ["paper"]
