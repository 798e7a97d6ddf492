"""The paper's method: Algorithm 2, and verdicts by it."""

import time
from dataclasses import replace
from decimal import Decimal
from itertools import product

import numpy as np
import pytest

from auditor.errors import ThresholdsError
from auditor.identification.paper import Identification, codeword, identify, judge, judge_frames, without
from auditor.model.calibration import Thresholds
from auditor.model.measurement import Statistic
from auditor.model.rig import Triple, triples_of
from auditor.model.verdict import VerdictKind
from tests.identification.definitions import allowed_attack_sets, explaining_sets, state_vector

CAMERAS = range(3, 8)


def sensors_of(n, *, lidar):
    return tuple(range(0 if lidar else 1, n + 1))


def test_there_are_381_allowed_attack_sets_for_three_to_seven_cameras_with_a_lidar():
    assert [len(allowed_attack_sets(sensors_of(n, lidar=True))) for n in CAMERAS] == [5, 16, 42, 99, 219]


@pytest.mark.parametrize("n", CAMERAS)
def test_algorithm_2_returns_the_true_set_for_every_allowed_attack(n):
    triples = triples_of(n, lidar=True)
    sensors = sensors_of(n, lidar=True)
    for attacked in allowed_attack_sets(sensors):
        assert identify(codeword(attacked, triples), triples, sensors) == Identification(attacked)


@pytest.mark.parametrize("n", [4, 5, 6, 7])
def test_algorithm_2_returns_the_true_set_without_a_lidar(n):
    triples = triples_of(n, lidar=False)
    sensors = sensors_of(n, lidar=False)
    for attacked in allowed_attack_sets(sensors):
        assert identify(codeword(attacked, triples), triples, sensors) == Identification(attacked)


@pytest.mark.parametrize("lidar", [True, False])
@pytest.mark.parametrize("n", [4, 5, 6, 7])
def test_algorithm_2_returns_the_true_set_with_any_one_sensor_missing(n, lidar):
    triples = triples_of(n, lidar=lidar)
    for missing in sensors_of(n, lidar=lidar):
        present = tuple(sensor for sensor in sensors_of(n, lidar=lidar) if sensor != missing)
        if len(present) < 4:
            continue
        for attacked in allowed_attack_sets(present):
            e = "".join(
                "-" if missing in triple else state
                for state, triple in zip(codeword(attacked, triples), triples, strict=True)
            )
            assert identify(e, triples, present) == Identification(attacked)


@pytest.mark.parametrize(("n", "patterns", "explained"), [(3, 8, 5), (4, 512, 16)])
def test_few_e_vectors_can_come_from_an_allowed_attack(n, patterns, explained):
    triples = triples_of(n, lidar=True)
    vectors = ["".join(states) for states in product("01", repeat=len(triples))]
    sets = [explaining_sets(e, triples, sensors_of(n, lidar=True)) for e in vectors]
    assert len(vectors) == patterns
    assert sum(1 for found in sets if found) == explained
    assert all(len(found) <= 1 for found in sets)


def test_algorithm_2_names_sensors_even_where_no_attack_explains_e():
    triples = triples_of(3, lidar=True)
    assert identify("100", triples, (0, 1, 2, 3)) == Identification((1,))
    assert explaining_sets("100", triples, (0, 1, 2, 3)) == ()


def test_three_cameras_and_a_lidar_with_all_ones_name_the_reference_only():
    assert identify("111", triples_of(3, lidar=True), (0, 1, 2, 3)) == Identification((3,))


def test_all_ones_descend_to_the_next_reference():
    triples = triples_of(4, lidar=True)
    assert identify("111111" + "110", triples, range(5)) == Identification((0, 4))


def test_the_first_measured_zero_in_triple_order_decides():
    # e_{0,2,3} = 0 clears S_0 and names S_1; e_{1,2,3} = 0 would clear S_1 and name S_0.
    assert identify("100", triples_of(3, lidar=True), range(4)) == Identification((1,))


def test_an_unmeasured_element_is_replaced_by_the_one_with_j0():
    triples = triples_of(3, lidar=True)
    assert identify("-01", triples, range(4)) == Identification((1,))
    assert identify("-00", triples, range(4)) == Identification(())


def test_a_sensor_without_a_measured_element_stays_undetermined():
    triples = triples_of(3, lidar=True)
    assert identify("0--", triples, range(4)) == Identification((), undetermined=(2,))


def test_lemma_2_needs_every_element_of_the_reference_measured():
    triples = triples_of(3, lidar=True)
    assert identify("11-", triples, range(4)) == Identification((), undetermined=(0, 1, 2, 3))


def test_what_lemma_2_found_before_an_unmeasured_element_is_kept():
    triples = triples_of(4, lidar=True)
    assert identify("111111" + "1-1", triples, range(5)) == Identification((4,), undetermined=(0, 1, 2, 3))


def test_three_sensors_are_cleared_but_never_named():
    triples = triples_of(3, lidar=False)
    assert identify("0", triples, (1, 2, 3)) == Identification(())
    assert identify("1", triples, (1, 2, 3)) == Identification((), undetermined=(1, 2, 3))


@pytest.mark.parametrize("lidar", [True, False])
def test_an_answer_that_fits_the_measured_elements_is_the_only_one_that_does(lidar):
    triples = triples_of(4, lidar=lidar)
    sensors = sensors_of(4, lidar=lidar)
    fitting = 0
    for states in product("01-", repeat=len(triples)):
        e = "".join(states)
        found = identify(e, triples, sensors)
        allowed = len(found.attacked) <= len(sensors) - 3
        if not found.undetermined and allowed and found.attacked in explaining_sets(e, triples, sensors):
            assert explaining_sets(e, triples, sensors) == (found.attacked,)
            fitting += 1
    assert fitting > (100 if lidar else 10)


N3 = triples_of(3, lidar=True)
N4 = triples_of(4, lidar=True)
FOUR = (0, 1, 2, 3)
FIVE = (0, 1, 2, 3, 4)


def thresholds_for(triples, theta=0.2):
    return Thresholds(
        calibration_id="ab12",
        statistic=Statistic.GATED,
        r=Decimal(0),
        theta=dict.fromkeys(triples, theta),
        samples=dict.fromkeys(triples, 20),
        resolvable=True,
    )


def test_all_zeros_are_clean():
    verdict = judge("000", N3, FOUR)
    assert (verdict.kind, verdict.attacked, verdict.named, verdict.reason) == (VerdictKind.CLEAN, (), (), "")


@pytest.mark.parametrize(("e", "sensor"), [("110", 0), ("101", 1), ("011", 2), ("111", 3)])
def test_each_single_attack_on_four_sensors_is_attributed(e, sensor):
    verdict = judge(e, N3, FOUR)
    assert (verdict.kind, verdict.attacked, verdict.named) == (VerdictKind.ATTACKED, (sensor,), (sensor,))


@pytest.mark.parametrize(("e", "named"), [("100", (1,)), ("010", (2,)), ("001", ())])
def test_an_e_that_no_allowed_attack_explains_is_unidentified_but_keeps_the_name(e, named):
    verdict = judge(e, N3, FOUR)
    assert (verdict.kind, verdict.attacked, verdict.named) == (VerdictKind.UNIDENTIFIED, (), named)
    assert "explains" in verdict.reason


def test_two_attacked_of_five_are_attributed_over_both_references():
    for attacked in allowed_attack_sets(FIVE)[1:]:
        verdict = judge(codeword(attacked, N4), N4, FIVE)
        assert (verdict.kind, verdict.attacked) == (VerdictKind.ATTACKED, attacked)


def test_a_second_reference_that_disagrees_with_the_first_is_unidentified():
    # Over S_4 alone this e says that S_0 is attacked; the triples of S_3 say that nobody is.
    verdict = judge("111000" + "000", N4, FIVE)
    assert (verdict.kind, verdict.named) == (VerdictKind.UNIDENTIFIED, (0,))


def test_algorithm_2_uses_the_leftmost_reference_only_where_that_has_zeros():
    verdict = judge("000000" + "110", N4, FIVE)
    assert (verdict.kind, verdict.named) == (VerdictKind.UNIDENTIFIED, ())


def test_every_pattern_is_attributed_exactly_where_its_only_explanation_is_algorithm_2_s():
    for states in product("01-", repeat=3):
        e = "".join(states)
        system = sorted({sensor for triple, state in zip(N3, e, strict=True) if state != "-" for sensor in triple})
        verdict = judge(e, N3, FOUR)
        if e == "---":
            assert verdict.kind is VerdictKind.NOT_AUDITABLE
        elif "1" not in e:
            assert verdict.kind is VerdictKind.CLEAN
        elif verdict.kind is VerdictKind.ATTACKED:
            assert explaining_sets(e, N3, system) == (verdict.attacked,)
        else:
            assert verdict.kind is VerdictKind.UNIDENTIFIED
            assert verdict.attacked == ()


def test_two_cameras_and_a_lidar_detect_but_never_name():
    triples = triples_of(2, lidar=True)
    assert triples == (Triple(0, 1, 2),)
    assert judge("0", triples, (0, 1, 2)).kind is VerdictKind.CLEAN
    verdict = judge("1", triples, (0, 1, 2))
    assert (verdict.kind, verdict.named) == (VerdictKind.UNIDENTIFIED, None)
    assert "one of 3 sensors" in verdict.reason


def test_three_cameras_without_a_lidar_detect_but_never_name():
    verdict = judge("1", triples_of(3, lidar=False), (1, 2, 3))
    assert (verdict.kind, verdict.named, verdict.out_of_system) == (VerdictKind.UNIDENTIFIED, None, ())


def test_four_cameras_without_a_lidar_attribute_one_attack():
    triples = triples_of(4, lidar=False)
    for attacked in allowed_attack_sets((1, 2, 3, 4))[1:]:
        assert judge(codeword(attacked, triples), triples, (1, 2, 3, 4)).attacked == attacked


def test_a_missing_sensor_is_taken_out_of_the_system_first():
    attacked = (2,)
    e = without(codeword(attacked, N4), N4, frozenset({1}))
    verdict = judge(e, N4, FIVE, frozenset({1}))
    assert (verdict.kind, verdict.attacked, verdict.out_of_system) == (VerdictKind.ATTACKED, (2,), (1,))
    assert verdict.reason == "judged without S_1"


def test_elements_of_a_missing_sensor_do_not_count():
    assert judge("110", N3, FOUR, frozenset({1})).e == "-1-"


def test_a_missing_leftmost_camera_leaves_the_next_reference():
    e = without(codeword((0,), N4), N4, frozenset({4}))
    assert e == "------110"
    assert judge(e, N4, FIVE, frozenset({4})).attacked == (0,)


def test_with_a_sensor_missing_of_four_an_attack_has_no_name():
    verdict = judge("1--", N3, FOUR, frozenset({2}))
    assert (verdict.kind, verdict.named, verdict.out_of_system) == (VerdictKind.UNIDENTIFIED, None, (2,))


def test_a_clean_frame_without_a_sensor_says_so():
    verdict = judge("0--", N3, FOUR, frozenset({2}))
    assert (verdict.kind, verdict.out_of_system, verdict.reason) == (VerdictKind.CLEAN, (2,), "judged without S_2")


def test_a_blind_sensor_is_out_of_the_system_though_it_is_there():
    assert judge("-0-", N3, FOUR).out_of_system == (1,)


def test_an_unmeasured_element_that_leaves_a_sensor_open_is_unidentified():
    verdict = judge("11-", N3, FOUR)
    assert (verdict.kind, verdict.named) == (VerdictKind.UNIDENTIFIED, None)
    assert "undetermined" in verdict.reason


def test_too_few_valid_pixels_everywhere_are_not_auditable():
    verdict = judge("---", N3, FOUR)
    assert (verdict.kind, verdict.out_of_system) == (VerdictKind.NOT_AUDITABLE, FOUR)
    assert "valid pixels" in verdict.reason


def test_a_missing_reference_of_four_is_not_auditable_and_named():
    verdict = judge("---", N3, FOUR, frozenset({3}))
    assert verdict.kind is VerdictKind.NOT_AUDITABLE
    assert "S_3 missing" in verdict.reason


def test_a_rig_of_two_sensors_is_not_auditable_with_the_reason():
    verdict = judge("", (), (0, 1))
    assert verdict.kind is VerdictKind.NOT_AUDITABLE
    assert "the rig has 2" in verdict.reason


def test_frames_are_judged_as_one_by_one():
    random = np.random.default_rng(7)
    errors = random.uniform(0.0, 0.5, (400, len(N4)))
    errors[random.uniform(size=errors.shape) < 0.1] = np.nan
    missing = [frozenset({int(random.integers(5))} if random.uniform() < 0.3 else set()) for _ in errors]
    thresholds = thresholds_for(N4)
    for row, absent, verdict in zip(errors, missing, judge_frames(errors, thresholds, N4, FIVE, missing), strict=True):
        e = without(state_vector(row.tolist(), thresholds, N4), N4, absent)
        measured = [abs(E - 0.2) for E, state in zip(row, e, strict=True) if state != "-"]
        alone = judge(e, N4, FIVE, absent, min(measured) if measured else None)
        assert replace(verdict, evidence=()) == alone
        above = sorted((row[place] - 0.2, N4[place]) for place, state in enumerate(e) if state == "1")
        assert [(x.check_name, x.i, x.j, x.k, pytest.approx(x.score)) for x in verdict.evidence] == [
            ("gated", *triple, margin) for margin, triple in reversed(above)
        ]


def test_a_verdict_names_the_next_best_explanations():
    verdict = judge("110000000", N4, FIVE)  # S_0 would make two elements more 1, S_1 another one
    assert verdict.kind is VerdictKind.UNIDENTIFIED
    assert [other.worse_by for other in verdict.alternatives] == sorted(o.worse_by for o in verdict.alternatives)
    assert judge("101", N3, FOUR).alternatives == (((3,), 1.0), ((), 2.0))
    assert judge("010", N3, FOUR).alternatives == (((), 0.0), ((0,), 0.0))  # S_2, too, leaves one element unexplained
    assert judge("1", triples_of(3, lidar=False), (1, 2, 3)).alternatives == ()


def test_a_verdict_has_the_smallest_distance_from_theta():
    (verdict,) = judge_frames(np.array([[0.5, 0.25, np.nan]]), thresholds_for(N3), N3, FOUR, [frozenset()])
    assert verdict.e == "11-"
    assert verdict.gap == pytest.approx(0.05)


def test_a_frame_with_nothing_measured_has_no_distance_from_theta():
    (verdict,) = judge_frames(np.full((1, 3), np.nan), thresholds_for(N3), N3, FOUR, [frozenset()])
    assert (verdict.kind, verdict.gap) == (VerdictKind.NOT_AUDITABLE, None)


@pytest.mark.parametrize(
    ("errors", "e"),
    [
        ([np.nan, np.nan, np.nan, 0.5], "---1"),
        ([0.1, 0.1, 0.1, 0.5], "000"),
        ([0.1, np.nan, np.nan, 0.5], "0--"),
        ([np.nan, np.nan, 0.1, 0.5], "--0"),
    ],
)
def test_the_fallback_counts_where_no_other_triple_was_measured(errors, e):
    thresholds = thresholds_for([*N3, (1, 2, 4)])
    (verdict,) = judge_frames(np.array([errors]), thresholds, N3, FOUR, [frozenset()], (1, 2, 4))
    assert verdict.e == e


def test_judging_leaves_the_disparity_errors_as_they_are():
    errors = np.full((1, 3), 0.1)
    judge_frames(errors, thresholds_for(N3), N3, FOUR, [frozenset({1})])
    assert np.array_equal(errors, np.full((1, 3), 0.1))


def test_no_frames_give_no_verdicts():
    assert judge_frames(np.empty((0, 3)), thresholds_for(N3), N3, FOUR, []) == []


def test_a_rig_without_triples_gets_not_auditable_frames():
    (verdict,) = judge_frames(np.empty((1, 0)), thresholds_for(()), (), (0, 1), [frozenset()])
    assert (verdict.kind, verdict.e) == (VerdictKind.NOT_AUDITABLE, "")


def test_e_is_one_above_theta_zero_at_theta_and_a_dash_where_not_measured():
    errors = np.array([[0.21, 0.2, 0.9], [np.nan, 0.0, 0.9]])
    above, unmeasured = judge_frames(errors, thresholds_for(N3[:2]), N3, FOUR, [frozenset()] * 2)
    assert (above.e, unmeasured.e) == ("10-", "-0-")


def test_a_triple_without_theta_is_not_measured():
    (verdict,) = judge_frames(np.full((1, 3), 0.1), thresholds_for(N3[:1]), N3, FOUR, [frozenset()])
    assert (verdict.e, verdict.out_of_system) == ("0--", (2,))


def test_thresholds_without_any_of_the_rigs_triples_are_refused():
    with pytest.raises(ThresholdsError, match="no theta for any triple"):
        judge_frames(np.full((1, 3), 0.1), thresholds_for((Triple(3, 4, 5),)), N3, FOUR, [frozenset()])


def test_a_night_of_frames_is_judged_in_seconds():
    errors = np.random.default_rng(1).uniform(0.0, 0.4, (20_000, len(N4)))
    started = time.process_time()
    verdicts = judge_frames(errors, thresholds_for(N4), N4, FIVE, [frozenset()] * len(errors))
    assert len(verdicts) == len(errors)
    assert time.process_time() - started < 2.0


@pytest.mark.parametrize(("above", "state"), [(-1e-9, "0"), (0.0, "0"), (1e-9, "1")])
def test_an_element_is_one_above_theta_and_not_at_it(above, state):
    theta = dict.fromkeys(N4, 0.25)
    errors = np.full((1, len(N4)), 0.125)
    errors[0, 2] = 0.25 + above
    [verdict] = judge_frames(errors, replace(thresholds_for(N4), theta=theta), N4, FIVE, [frozenset()])
    assert verdict.e == "00" + state + "0" * (len(N4) - 3)
    assert len(verdict.evidence) == int(state)
    assert verdict.gap == pytest.approx(abs(above), abs=1e-15)


def test_the_evidence_of_an_attacked_frame_is_what_lies_above_theta_and_nothing_that_lies_at_it():
    errors = np.full((1, len(N4)), 0.125)
    errors[0, :3] = 0.5, 0.25, 0.75
    theta = replace(thresholds_for(N4), theta=dict.fromkeys(N4, 0.25))
    [verdict] = judge_frames(errors, theta, N4, FIVE, [frozenset()])
    assert [(one.i, one.j, one.k, one.score) for one in verdict.evidence] == [(*N4[2], 0.5), (*N4[0], 0.25)]


def test_three_sensors_that_measured_nothing_are_not_too_few():
    triples = triples_of(3, lidar=False)
    assert "three overlapping sensors" not in judge("-", triples, (1, 2, 3)).reason
    assert "the rig has 2" in judge("", (), (1, 2)).reason


def test_the_fallback_counts_only_where_no_other_disparity_error_was_measured():
    nan = np.nan
    errors = np.array([[0.1, 0.1, 0.1, 0.9], [nan, nan, 0.1, 0.9], [nan, nan, nan, 0.9], [nan] * 3 + [0.1], [nan] * 4])
    fallback = Triple(0, 1, 2)
    missing = [frozenset(), frozenset({0}), *[frozenset({3})] * 3]
    verdicts = judge_frames(errors, thresholds_for((*N3, fallback)), N3, FOUR, missing, fallback)
    assert [v.e for v in verdicts] == ["000", "--0", "---1", "---0", "---"]
    kinds = ["clean", "clean", "unidentified", "clean", "not_auditable"]
    assert [v.kind for v in verdicts] == kinds
    assert verdicts[2].reason == "an attack on one of 3 sensors cannot be attributed; judged without S_3"
    assert (verdicts[3].out_of_system, verdicts[3].gap) == ((3,), pytest.approx(0.1))
    assert [(e.i, e.j, e.k) for e in verdicts[2].evidence] == [fallback]
    assert judge_frames(errors[:2, :3], thresholds_for(N3), N3, FOUR, missing[:2]) == verdicts[:2]
