"""The verdict of a frame and that of its temporal window, together."""

from dataclasses import replace
from decimal import Decimal

import numpy as np

from auditor.identification.naming import System
from auditor.identification.robust import FrameSeries, judge_frames, window_scores
from auditor.model.calibration import RobustThresholds, Scale
from auditor.model.checks import Check, PairCheck, pair_checks_of
from auditor.model.rig import triples_of
from auditor.model.verdict import FINDINGS, Cause, Finding, VerdictKind

PAIRS = ((1, 3), (2, 3))
SYSTEM = System(pair_checks_of(3, PAIRS, PAIRS, (3,)), triples_of(3, lidar=True), (0, 1, 2, 3))
THRESHOLDS = RobustThresholds(
    "c" * 32, Decimal("0.01"), dict.fromkeys(SYSTEM.pair_checks, Scale(0.4, 0.1, 100)), {}, resolvable=True
)
U13, U23 = (SYSTEM.pair_checks.index(PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, *pair)) for pair in PAIRS)
FRAMES = 20


def series_of(hit=(), pair_check=U13, *, frozen=(), missing=(), ratio=0.8):
    """Frames at 10 Hz; in those `hit` one pair check's ratio is high, in those `frozen` S_2 repeats its data."""
    ratios = np.full((FRAMES, len(SYSTEM.pair_checks)), 0.3)
    ratios[list(hit), pair_check] = ratio
    prints = np.arange(FRAMES)[:, None] * 10 + np.arange(4)
    prints[list(frozen), 2] = -7
    present = np.ones((FRAMES, 4), dtype=np.bool_)
    present[list(missing), 1] = False
    stamps_ns = np.arange(FRAMES, dtype=np.int64) * 100_000_000
    return FrameSeries.of_recording(stamps_ns, ratios, present, prints, {})


def judge(*hit, threshold=0.0, **what):
    return judge_frames(series_of(*hit, **what), SYSTEM, replace(THRESHOLDS, score=threshold))


def test_an_attack_that_lasts_is_an_incident_from_its_first_frame_to_its_last():
    verdicts = judge(range(5, 12))
    assert [f for f, v in enumerate(verdicts) if v.kind is VerdictKind.ATTACKED] == list(range(5, 12))
    assert [f for f, v in enumerate(verdicts) if v.finding] == list(range(5, 12))
    assert verdicts[8].finding == Finding(VerdictKind.ATTACKED, (1,))


def test_one_finding_alone_keeps_its_verdict_and_is_no_incident():
    verdicts = judge([7], ratio=0.45)
    assert verdicts[7].attacked == (1,)
    assert not [v for v in verdicts if v.finding]


def test_the_threshold_is_that_of_the_temporal_windows():
    assert judge(range(5, 12), threshold=2.0)[8].finding
    weak = judge(range(5, 12), threshold=2.0, ratio=0.5)
    assert weak[8].kind is VerdictKind.ATTACKED
    assert weak[8].finding is None


def test_a_sensor_with_frozen_data_is_a_finding_with_its_cause_and_is_left_out():
    verdicts = judge(range(5, 12), U23, frozen=range(4, 14))
    still = verdicts[8]
    assert (still.kind, still.attacked, still.out_of_system) == (VerdictKind.SUSPECT, (), (2,))
    assert [(one.cause, one.sensor) for one in still.causes] == [(Cause.FROZEN, 2)]
    assert still.finding == Finding(VerdictKind.SUSPECT, ())
    assert verdicts[4].kind is VerdictKind.CLEAN, "the first of equal frames repeats nothing yet"


def test_a_frozen_sensor_has_no_other_cause_and_the_others_keep_theirs():
    late = [(Cause.LATE, 1), (Cause.LATE, 2)]
    series = replace(series_of(frozen=range(4, 14)), fault_scores={cause: np.full(FRAMES, 2.0) for cause in late})
    thresholds = replace(THRESHOLDS, causes=dict.fromkeys(late, Scale(1.0, 0.25, 100)))
    verdicts = judge_frames(series, SYSTEM, thresholds)
    assert [(one.cause, one.sensor) for one in verdicts[8].causes] == [(Cause.FROZEN, 2), (Cause.LATE, 1)]
    assert [(one.cause, one.sensor) for one in verdicts[2].causes] == late


def test_a_missing_sensor_is_neither_checked_nor_named():
    verdicts = judge(range(5, 12), missing=range(5, 12))
    assert {v.kind for v in verdicts} == {VerdictKind.CLEAN}
    assert verdicts[8].out_of_system == (1,)


def test_frames_judged_alone_are_judged_as_among_all():
    series = series_of(range(5, 12), frozen=range(9, 14))
    everything = judge_frames(series, SYSTEM, THRESHOLDS)
    assert judge_frames(series, SYSTEM, THRESHOLDS, only=[10, 3]) == [everything[10], everything[3]]
    assert judge_frames(series, SYSTEM, THRESHOLDS, only=[]) == []


def test_a_cause_that_explains_a_frame_makes_it_suspect_unless_causes_are_left_out():
    late = {(Cause.LATE, 1): np.full(FRAMES, 2.0)}
    series = replace(series_of(range(5, 12)), fault_scores=late)
    thresholds = replace(THRESHOLDS, causes={(Cause.LATE, 1): Scale(1.0, 0.25, 100)})
    assert judge_frames(series, SYSTEM, thresholds)[8].finding == Finding(VerdictKind.SUSPECT, ())
    without = judge_frames(series, SYSTEM, thresholds, without_causes=True)
    assert (without[8].finding, without[8].causes) == (Finding(VerdictKind.ATTACKED, (1,)), ())


def test_the_score_of_a_temporal_window_is_what_the_threshold_is_compared_with():
    series = series_of(range(5, 12), frozen=range(9, 14), missing=[2])
    scores = window_scores(series, SYSTEM, THRESHOLDS)
    for threshold in (0.0, 1.0, float(scores[6]), 2.9):
        found = [v.finding is not None for v in judge_frames(series, SYSTEM, replace(THRESHOLDS, score=threshold))]
        still = series.frozen.any(axis=1)
        alone = [v.kind in FINDINGS for v in judge_frames(series, SYSTEM, THRESHOLDS)]
        assert found == [a and (bool(s > threshold) or bool(f)) for a, s, f in zip(alone, scores, still, strict=True)]
