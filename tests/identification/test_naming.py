from dataclasses import replace
from math import comb

import numpy as np
import pytest
from auditor.identification.attack_sets import attack_set_costs

from auditor.identification.algorithm2 import allowed_attack_sets
from auditor.identification.naming import System, name_attacked
from auditor.model.checks import Check, PairCheck, pair_checks_of
from auditor.model.rig import Triple, triples_of
from auditor.model.verdict import VerdictKind

PAIRS = ((1, 3), (2, 3))
SYSTEM = System(pair_checks_of(3, PAIRS, PAIRS, (3,)), triples_of(3, lidar=True), (0, 1, 2, 3))
NONE = frozenset()
X13, X23 = (PairCheck(Check.LIDAR_CONFLICT, *pair) for pair in PAIRS)
U13, U23 = (PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, *pair) for pair in PAIRS)
POINT_DROPOUT, ISOLATED_POINTS = (PairCheck(check, 0, 3) for check in (Check.POINT_DROPOUT, Check.ISOLATED_POINTS))
L12 = PairCheck(Check.BRIGHTNESS_DIFFERENCE, 1, 2)


def one(fired, *, system=SYSTEM, missing=NONE, others=-1.0, threshold=0.0):
    z = np.array([[fired.get(pair_check, others) for pair_check in system.pair_checks]])
    (verdict,) = name_attacked(z, system, [missing], threshold)
    return verdict


def test_a_frame_in_which_no_check_fires_is_clean():
    verdict = one({})
    assert (verdict.kind, verdict.attacked, verdict.e, verdict.reason) == (VerdictKind.CLEAN, (), "000", "")


@pytest.mark.parametrize(
    ("fired", "attacked", "e"),
    [
        ({X13: 2.0, X23: 1.0}, (0,), "110"),
        ({POINT_DROPOUT: 0.5}, (0,), "110"),
        ({ISOLATED_POINTS: 0.5}, (0,), "110"),
        ({U13: 2.0, L12: 1.0}, (1,), "101"),
        ({U23: 2.0}, (2,), "011"),
        ({U13: 0.5, U23: 2.0}, (3,), "111"),
    ],
)
def test_the_checks_together_name_the_sensor(fired, attacked, e):
    verdict = one(fired)
    assert (verdict.kind, verdict.attacked, verdict.named, verdict.e) == (VerdictKind.ATTACKED, attacked, attacked, e)


def test_a_verdict_has_its_evidence_and_its_alternatives():
    verdict = one({X23: 1.0, X13: 2.0})
    assert verdict.evidence == (("lidar_conflict", 1, None, 3, 2.0), ("lidar_conflict", 2, None, 3, 1.0))
    # {S_3} would cover nine tenths of both, but it expects two pairs, by half, that did not fire
    assert verdict.gap == pytest.approx(1.3)
    assert verdict.alternatives[0] == ((3,), pytest.approx(1.3))
    assert verdict.reason == ""


def test_a_clean_verdict_says_how_far_the_nearest_attack_is():
    verdict = one({})
    assert verdict.evidence == ()
    assert (
        verdict.gap == verdict.alternatives[0].worse_by == pytest.approx(0.52)
    )  # a pair that did not fire, and the penalty
    assert [len(other.attacked) for other in verdict.alternatives] == [1, 1]


def test_what_cannot_be_named_says_what_is_likeliest():
    verdict = one({U13: 3.0, U23: 3.0, L12: 3.0})
    assert [other.worse_by for other in verdict.alternatives] == [0, 0, 0]  # any one of the three cameras


def test_below_the_score_s_threshold_a_frame_is_clean():
    assert one({U23: 0.5}, threshold=0.6).kind is VerdictKind.CLEAN
    assert one({U23: 0.5}, threshold=0.4).kind is VerdictKind.ATTACKED


def test_two_attacked_of_four_are_not_named_as_one():
    verdict = one({U13: 3.0, U23: 3.0, L12: 3.0})
    assert verdict.kind is VerdictKind.UNIDENTIFIED
    assert verdict.attacked == ()
    assert "no attack on at most 1 of 4 sensors explains" in verdict.reason


def test_of_two_attacks_that_explain_a_frame_equally_well_none_is_named():
    only = System((L12,), SYSTEM.triples, SYSTEM.sensors)
    verdict = one({L12: 2.0}, system=only)
    assert verdict.kind is VerdictKind.UNIDENTIFIED
    assert "equally well" in verdict.reason


def test_with_three_sensors_an_attack_is_found_and_not_attributed():
    verdict = one({U23: 2.0}, missing=frozenset({0}))
    assert verdict.kind is VerdictKind.UNIDENTIFIED
    assert verdict.out_of_system == (0,)
    assert verdict.named is None
    assert one({}, missing=frozenset({0})).kind is VerdictKind.CLEAN


def test_pair_checks_of_a_missing_sensor_do_not_count():
    verdict = one({U13: 3.0}, missing=frozenset({1}))
    assert verdict.kind is VerdictKind.CLEAN
    assert verdict.e == "-0-"


def test_nothing_measured_is_not_auditable():
    assert one({}, others=np.nan).kind is VerdictKind.NOT_AUDITABLE
    assert one({}, missing=frozenset({3, 2, 1})).kind is VerdictKind.NOT_AUDITABLE


def test_a_lidar_that_no_camera_pair_can_check_is_remarked_whatever_else_is_found():
    quiet = one({X13: np.nan, X23: np.nan})
    assert quiet.kind is VerdictKind.CLEAN
    assert "no camera pair can check the LiDAR here" in quiet.reason
    assert "no camera pair can check the LiDAR here" in one({X13: np.nan, X23: np.nan, U13: 3.0}).reason
    assert one({X13: np.nan}).reason == ""
    assert one({X13: np.nan, X23: np.nan}, missing=frozenset({0})).reason == "judged without S_0"


def test_a_reference_is_in_several_pairs_and_its_source_cameras_are_not():
    assert SYSTEM.in_several_pairs == {3}


def test_frames_keep_their_order_whatever_each_of_them_lacks():
    z = np.full((4, len(SYSTEM.pair_checks)), -1.0)
    z[1, SYSTEM.pair_checks.index(U23)] = 2.0
    z[3, SYSTEM.pair_checks.index(U13)] = 2.0
    verdicts = name_attacked(z, SYSTEM, [NONE, frozenset({0}), frozenset({1}), NONE])
    kinds = [VerdictKind.CLEAN, VerdictKind.UNIDENTIFIED, VerdictKind.CLEAN, VerdictKind.ATTACKED]
    assert [v.kind for v in verdicts] == kinds
    assert verdicts[3].attacked == (1,)


@pytest.mark.parametrize(("sensors", "sizes"), [(2, 0), (3, 0), (4, 1), (5, 2), (6, 3)])
def test_a_system_tells_attacks_on_all_but_three_of_its_sensors_apart(sensors, sizes):
    sets = allowed_attack_sets(range(sensors))
    assert len(sets) == len(set(sets)) == sum(comb(sensors, size) for size in range(sizes + 1))
    assert sets[0] == ()


def test_of_three_sensors_the_gap_is_the_largest_score_measured():
    assert one({U23: 2.0, U13: 0.5, L12: np.nan}, missing=frozenset({0})).gap == 2.0
    assert one({U23: -0.5}, missing=frozenset({0})).gap == -0.5


def test_a_frame_at_the_score_s_threshold_is_clean():
    z = np.array([[2.0 if pair_check == U23 else -1.0 for pair_check in SYSTEM.pair_checks]])
    score = float(attack_set_costs(z, SYSTEM.pair_checks, allowed_attack_sets(SYSTEM.sensors)).score[0])
    assert score == pytest.approx(1.98)
    assert one({U23: 2.0}, threshold=score).kind is VerdictKind.CLEAN
    assert one({U23: 2.0}, threshold=np.nextafter(score, 0)).kind is VerdictKind.ATTACKED


@pytest.mark.parametrize(("left", "kind"), [(1.0, VerdictKind.ATTACKED), (1.01, VerdictKind.UNIDENTIFIED)])
def test_the_best_attack_set_may_leave_a_score_of_one_uncovered(left, kind):
    verdict = one({U23: 3.0, POINT_DROPOUT: left})
    assert verdict.kind is kind
    assert (verdict.alternatives[0].attacked == (2,)) == (kind is VerdictKind.UNIDENTIFIED)


def test_a_score_of_zero_does_not_fire():
    verdict = one({X13: 2.0, X23: 2.0, U13: 0.0})
    assert (verdict.attacked, verdict.e, len(verdict.evidence)) == ((0,), "110", 2)


def test_a_triple_is_measured_where_its_own_pair_checks_are():
    assert one({X13: np.nan}).e == "-00"
    assert one({U13: np.nan}).e == "00-"
    assert one({X13: np.nan, U13: 1.0}).e == "101", "a pair check inside it fired, so it need not be measured"


def test_of_five_sensors_the_smaller_of_two_attacks_is_named_where_nothing_else_tells_them_apart():
    five = System(pair_checks_of(4, (), (), (4,)), triples_of(4, lidar=True), (0, 1, 2, 3, 4))
    verdict = one({PairCheck(Check.POINT_DROPOUT, 0, 4): 0.5}, system=five, others=np.nan)
    assert (verdict.kind, verdict.attacked, verdict.gap) == (VerdictKind.ATTACKED, (0,), 0.02)


def test_a_frame_is_a_finding_where_any_attack_explains_it_better_than_none():
    z = np.array([[0.25 if pair_check == U23 else -1.0 for pair_check in SYSTEM.pair_checks]])
    assert name_attacked(z, SYSTEM, [NONE])[0].attacked == (2,)


X12, U12 = PairCheck(Check.LIDAR_CONFLICT, 1, 2), PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, 1, 2)
DROPOUT_2 = PairCheck(Check.POINT_DROPOUT, 0, 2)
WITH_FALLBACK = System(
    (*SYSTEM.pair_checks, *pair_checks_of(0, [(1, 2)], [(1, 2)], [2])), SYSTEM.triples, SYSTEM.sensors, Triple(0, 1, 2)
)
NARROW = replace(WITH_FALLBACK, pair_checks=tuple(e for e in WITH_FALLBACK.pair_checks if e != X12))
NO_S_3 = frozenset({3})


@pytest.mark.parametrize(
    ("system", "missing", "reason"),
    [
        (SYSTEM, {3}, "S_3 missing: S_1 and S_2 lie too close together to check the LiDAR"),
        (NARROW, {3}, "S_3 missing: S_1 and S_2 lie too close together to check the LiDAR"),
        (SYSTEM, {0, 3}, "S_0 and S_3 missing: three sensors have to be compared, and only S_1 and S_2 were there"),
        (SYSTEM, {0, 1, 2, 3}, "and only none were there"),
    ],
)
def test_no_frame_is_clean_in_which_no_three_sensors_were_compared(system, missing, reason):
    verdict = one({}, system=system, missing=frozenset(missing))
    assert (verdict.kind, verdict.e) == (VerdictKind.NOT_AUDITABLE, "---")
    assert verdict.out_of_system == tuple(sorted(missing))
    assert reason in verdict.reason


def test_what_is_there_and_could_not_be_compared_is_no_clean_frame_either():
    verdict = one(dict.fromkeys((X13, X23, U13, U23, U12, X12), np.nan), system=WITH_FALLBACK)
    assert verdict.kind is VerdictKind.NOT_AUDITABLE
    assert "too little of what any three of S_0, S_1, S_2 and S_3 see could be compared" in verdict.reason


def test_a_check_that_fires_is_a_finding_also_where_no_three_sensors_were_compared():
    verdict = one({L12: 1.0}, missing=NO_S_3)
    assert (verdict.kind, verdict.evidence[0].check_name) == (VerdictKind.UNIDENTIFIED, "brightness_difference")


@pytest.mark.parametrize(("fired", "kind", "state"), [((), "clean", "0"), ((X12,), "unidentified", "1")])
def test_without_any_other_reference_a_frame_is_judged_by_the_fallback(fired, kind, state):
    verdict = one(dict.fromkeys(fired, 2.0), system=WITH_FALLBACK, missing=NO_S_3)
    assert (verdict.kind, verdict.e, verdict.named) == (kind, "---" + state, None)
    assert "judged without S_3; only S_0, S_1 and S_2 were compared" in verdict.reason


def test_the_fallback_is_no_part_of_e_where_another_triple_was_measured_and_its_checks_count_in_every_frame():
    verdict = one({U12: 2.0, U13: 2.0}, system=WITH_FALLBACK)
    assert (verdict.attacked, verdict.e) == ((1,), "101")
    assert (verdict.e, verdict.named) == (one({U13: 2.0}).e, one({U13: 2.0}).named)
    assert one({U12: 2.0}, system=WITH_FALLBACK).e == "000"
    assert one({X12: 2.0}, system=WITH_FALLBACK).kind is not VerdictKind.CLEAN
    assert WITH_FALLBACK.in_several_pairs == {1, 2, 3}


def test_the_lidar_s_own_checks_in_the_fallback_s_view_count_where_no_other_reference_camera_is_there():
    assert one({DROPOUT_2: 2.0}, system=WITH_FALLBACK).kind is VerdictKind.CLEAN
    assert one({DROPOUT_2: 2.0}, system=WITH_FALLBACK, missing=frozenset({1})).kind is VerdictKind.CLEAN
    lost = one({DROPOUT_2: 2.0}, system=WITH_FALLBACK, missing=NO_S_3)
    assert (lost.kind, lost.evidence[0].check_name) == (VerdictKind.UNIDENTIFIED, "point_dropout")
