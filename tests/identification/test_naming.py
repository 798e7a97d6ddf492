import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.identification.evidence_parameters import LIKELIHOOD
from auditor.identification.naming import attack_scores, name_attacked, sensor_scores
from auditor.identification.systems import System
from auditor.model.checks import CAMERA_CHECKS, Check, SensorCheck, sensor_checks_of
from auditor.model.rig import LIDAR, Triple, triples_of
from auditor.model.verdict import VerdictKind

NONE = frozenset()
LIMIT = 3.0


def system_of(cameras, pairs=None, *, views=None, fallback=None, conflicts=None):
    pairs = tuple((i, k) for k in range(2, cameras + 1) for i in range(1, k)) if pairs is None else pairs
    views = (cameras,) if views is None else views
    checks = sensor_checks_of(pairs, pairs if conflicts is None else conflicts, views)
    return System(checks, triples_of(cameras, lidar=True), tuple(range(cameras + 1)), fallback)


THREE, FOUR = system_of(3), system_of(4)
LIT, DARK, ODD = CAMERA_CHECKS
CONFLICT, DROPOUT, ISOLATED = Check.LIDAR_CONFLICT, Check.POINT_DROPOUT, Check.ISOLATED_POINTS
UNMATCHED = Check.UNMATCHED_LIGHT


def of(sensor, check=LIT):
    """All checks of that kind of a sensor, whoever its voters are."""
    return lambda one: (one.sensor, one.check) == (sensor, check)


def by(sensor, *others, check=LIT):
    return lambda one: one == SensorCheck(check, sensor, others)


def of_all(sensor, check=LIT):
    """That check of a sensor by two voters or more."""
    return lambda one: (one.sensor, one.check) == (sensor, check) and len(one.others) > 1


def scores(system, fired, others):
    """One frame's z: the last of `fired` that a check fits decides."""
    z = np.full((1, len(system.sensor_checks)), others)
    for fits, value in fired.items():
        z[0, [fits(one) for one in system.sensor_checks]] = value
    return z


def one(fired, *, system=FOUR, missing=NONE, others=-1.0, limit=LIMIT):
    (verdict,) = name_attacked(scores(system, fired, others), system, [missing], limit)
    return verdict


def test_a_frame_in_which_no_check_exceeds_the_limit_is_clean():
    verdict = one({})
    assert (verdict.kind, verdict.attacked, verdict.e, verdict.reason) == (VerdictKind.CLEAN, (), "0" * 9, "")
    assert (verdict.gap, verdict.evidence, verdict.alternatives) == (LIMIT + 1, (), ())


@pytest.mark.parametrize("sensor", [1, 2, 3, 4])
@pytest.mark.parametrize("check", [LIT, ODD])
def test_a_camera_s_own_checks_name_it(sensor, check):
    verdict = one({of(sensor, check): 4.0})
    assert (verdict.kind, verdict.attacked) == (VerdictKind.ATTACKED, (sensor,))
    assert verdict.named == (sensor,)
    others = [n for n in (1, 2, 3, 4) if n != sensor]
    assert verdict.evidence == ((check.value, sensor, None, None, 4.0),)
    assert SensorCheck(check, sensor, tuple(others)) in FOUR.sensor_checks
    assert 0.9 < verdict.posterior < 1


@pytest.mark.parametrize(("system", "others"), [(THREE, (2, 3)), (FOUR, (2, 3, 4))])
def test_a_camera_that_only_lacks_light_is_not_named_since_all_others_may_be_lit_alike(system, others):
    verdict = one({of(1, DARK): 5.0}, system=system)
    assert (verdict.kind, verdict.attacked) == (VerdictKind.UNIDENTIFIED, ())
    assert verdict.alternatives[0].attacked == others
    assert verdict.reason.endswith(" rather than S_1, which lacks light that they show: more than can be told apart")
    lit = one({of(1, DARK): 5.0, of(1): 5.0}, system=system)
    assert lit.attacked == (1,)


def test_of_two_cameras_lit_alike_and_the_two_that_lack_it_the_lit_ones_are_named():
    lit = {by(1, 2, 3, 4): 5.0, by(2, 1, 3, 4): 5.0, by(1, 3, 4): 9.0, by(2, 3, 4): 9.0}
    alike = lit | {by(3, 1, 2, check=DARK): 9.0, by(4, 1, 2, check=DARK): 9.0}
    verdict = one(alike)
    assert (verdict.kind, verdict.attacked) == (VerdictKind.ATTACKED, (1, 2))
    assert verdict.alternatives[0].attacked == ()


def test_of_three_cameras_one_that_is_lit_does_not_clear_the_lidar_that_its_votes_accuse():
    lit, wall = {of(1): 6.0}, {by(0, 1, 2, 3, check=Check.FALSE_RANGES): 6.0, by(0, 1, 3, check=CONFLICT): 4.0}
    assert one(lit, system=THREE).attacked == (1,)
    verdict = one(lit | wall, system=THREE)
    assert (verdict.kind, verdict.attacked) == (VerdictKind.UNIDENTIFIED, ())
    assert verdict.reason == "checks of S_0 and S_1 exceed the limit, and at most 1 of 4 sensors can be told apart"


def test_a_patch_of_all_others_that_one_camera_lacks_is_evidence_and_no_dirt_on_it():
    alike = {of(1, DARK): 5.0, by(2, 1, check=UNMATCHED): 7.0, by(3, 1, check=UNMATCHED): 6.0}
    verdict = one(alike, system=THREE)
    assert (verdict.kind, verdict.alternatives[0].attacked) == (VerdictKind.UNIDENTIFIED, (2, 3))
    assert {(line.check_name, line.i, line.k) for line in verdict.evidence} == {
        (DARK, 1, None),
        (UNMATCHED, 2, 1),
        (UNMATCHED, 3, 1),
    }


@pytest.mark.parametrize("check", [CONFLICT, DROPOUT, ISOLATED])
def test_the_lidar_s_checks_name_it(check):
    verdict = one({of(0, check): 4.0})
    assert (verdict.kind, verdict.attacked, verdict.evidence[0].check_name) == (VerdictKind.ATTACKED, (0,), check.value)


def test_what_two_cameras_alone_show_names_the_one_that_the_votes_of_the_others_confirm():
    apart = {by(1, 2): 5.0}
    for check in (LIT, ODD):
        verdict = one(apart | {of_all(2, check): 2.0})
        assert (verdict.kind, verdict.attacked) == (VerdictKind.ATTACKED, (2,))
        assert [(e.check_name, e.i, e.k, e.score) for e in verdict.evidence] == [
            (LIT.value, 1, 2, 5.0),
            (check.value, 2, None, 2.0),
        ]
    assert one(apart | {of_all(2): 2.0, of_all(1): 1.9}).kind is VerdictKind.UNIDENTIFIED, "the other one is as likely"
    assert one({of_all(2): 2.9}).kind is VerdictKind.CLEAN


def test_what_two_cameras_show_is_evidence_above_the_limit_only():
    for z, number in ((LIMIT, 2), (np.nextafter(LIMIT, 9), 3)):
        verdict = one({by(1, 2): 5.0, by(2, 3): z, of_all(2): 2.0})
        assert (verdict.attacked, len(verdict.evidence)) == ((2,), number)
        shown = [evidence.k for evidence in one({by(1, 2): 5.0, of_all(2): z}).evidence]
        assert shown == ([2, None] if z == LIMIT else [None]), "a pair is none of what its camera shows by itself"


def test_where_no_set_is_likely_enough_none_is_named_and_the_shares_are_said():
    verdict = one({by(1, 2): 5.0, of_all(2): 2.0, of_all(1): 1.9})
    assert (verdict.kind, verdict.attacked) == (VerdictKind.UNIDENTIFIED, ())
    assert verdict.reason == "S_2 (56 %) or S_1 (44 %): less than 70 % for any set of sensors"
    assert verdict.alternatives[0] == ((2,), 0.0)
    assert verdict.alternatives[1].attacked == (1,)
    assert verdict.posterior * 10 ** -verdict.alternatives[1].worse_by < verdict.posterior < 0.6


def test_the_posterior_and_the_ratio_grow_with_what_a_sensor_shows_up_to_what_clean_frames_carry():
    weak, clear, strong = (one({of_all(2): z}) for z in (3.1, 3.5, 9.0))
    assert weak.posterior < clear.posterior < strong.posterior < 1
    assert weak.log10_ratio < clear.log10_ratio < strong.log10_ratio
    assert strong.log10_ratio == pytest.approx(np.log10(LIKELIHOOD.clean_worth))
    nothing = one({})
    assert (nothing.posterior, nothing.log10_ratio) == (None, None)


def test_the_states_of_triples_are_above_where_they_hold_a_named_sensor():
    for sensor in range(5):
        e = one({of(sensor, CONFLICT if sensor == 0 else LIT): 4.0}).e
        assert e == "".join("1" if sensor in triple else "0" for triple in FOUR.triples)


def test_a_check_at_the_limit_is_no_finding():
    assert one({of(2): LIMIT}).kind is VerdictKind.CLEAN
    assert one({of(2): np.nextafter(LIMIT, 9)}).attacked == (2,)
    assert one({of(2): 3.5}, limit=3.6).kind is VerdictKind.CLEAN


def test_the_gap_is_to_the_strongest_sensor_that_is_not_named_or_to_the_limit():
    verdict = one({of_all(2): 5.0, of_all(3, DARK): 2.9})
    assert (verdict.attacked, verdict.gap) == ((2,), pytest.approx(2.0))
    assert len(verdict.alternatives) == 2
    assert one({of_all(2): 5.0, of_all(3, DARK): 3.2}).gap == pytest.approx(1.8)
    assert one({of_all(2): 5.0}).gap == pytest.approx(2.0)


def test_evidence_are_the_checks_of_named_sensors_above_the_limit_the_strongest_first():
    verdict = one({of_all(2): 4.0, of_all(2, ODD): 6.0, of_all(2, DARK): 2.9})
    assert verdict.evidence == (("photometric_inconsistency", 2, None, None, 6.0), ("added_light", 2, None, None, 4.0))


def test_what_an_attacked_sensor_says_of_the_others_is_left_out():
    """S_2 votes too: by all its voters S_3 fires, by those that are left once S_2 is named it does not."""
    fired = {of(2): 8.0, of(3): 5.0, by(3, 1, 4): -1.0}
    assert one(fired).attacked == (2,)
    assert {evidence.i for evidence in one(fired).evidence} == {2}


def test_two_attacked_of_five_are_named_in_turn():
    fired = {of(2): 8.0, of(3): 5.0}
    assert one(fired).attacked == (2, 3)
    assert one({of(2): 8.0, of(0, CONFLICT): 6.0}).attacked == (0, 2)


def test_a_second_sensor_is_named_where_the_first_does_not_explain_it():
    assert one({of_all(2): 8.0, of_all(3): 2.0}).attacked == (2,)
    assert one({of_all(2): 8.0, of_all(3): 4.5}).attacked == (2, 3)


def test_two_cameras_alone_that_differ_are_a_finding_where_no_vote_is():
    """Where only two cameras see a place nobody else votes."""
    found = one({by(2, 3): 5.0})
    assert (found.kind, found.attacked) == (VerdictKind.UNIDENTIFIED, ())
    assert {one.attacked for one in found.alternatives} == {(), (2,), (3,)}
    assert ("added_light", 2, None, 3, 5.0) in found.evidence


def test_as_many_as_the_rig_can_tell_apart_are_named_and_no_more():
    verdict = one({of(1): 8.0, of(2): 7.0, of(0, CONFLICT): 6.0})
    assert (verdict.kind, verdict.attacked) == (VerdictKind.UNIDENTIFIED, ())
    assert verdict.reason == "checks of S_0, S_1 and S_2 exceed the limit, and at most 2 of 5 sensors can be told apart"
    three = one({of(1): 8.0, of(0, CONFLICT): 6.0}, system=THREE)
    assert three.kind is VerdictKind.UNIDENTIFIED
    assert "at most 1 of 4" in three.reason


def test_of_three_cameras_one_named_leaves_two_that_must_agree_with_each_other():
    both = {of(1): 8.0, of(3): 5.0, by(2, 3): -1.0, by(3, 2): -1.0}
    assert one(both, system=THREE).attacked == (1,)
    apart = one({**both, by(3, 2): 5.0}, system=THREE)
    assert apart.kind is VerdictKind.UNIDENTIFIED
    assert "S_2 and S_3 do not see the same, and no third camera tells which of them is wrong" in apart.reason
    assert apart.alternatives[0] == ((1,), 0.0), "what is known of the others is not lost"
    assert ("added_light", 3, None, 2, 5.0) in apart.evidence


def test_with_three_sensors_an_attack_is_found_and_not_attributed():
    verdict = one({of(0, CONFLICT): 6.0, by(2, 1): 4.0}, system=system_of(2))
    assert verdict.kind is VerdictKind.UNIDENTIFIED
    assert "an attack on one of 3 sensors cannot be attributed" in verdict.reason
    assert verdict.named is None
    assert one({}, system=THREE, missing=frozenset({0})).kind is VerdictKind.CLEAN


def test_of_three_cameras_alone_two_that_agree_outvote_the_third():
    alone = frozenset({0})
    verdict = one({of(3): 5.0}, system=THREE, missing=alone)
    assert (verdict.kind, verdict.attacked) == (VerdictKind.ATTACKED, (3,))
    assert verdict.posterior > 0.9
    apart = one({of(3): 5.0, by(2, 1): 4.5}, system=THREE, missing=alone)
    assert (apart.kind, apart.attacked) == (VerdictKind.UNIDENTIFIED, ())
    lacks = {of_all(3, Check.REMOVED_LIGHT): 5.0, by(1, 3): 4.5, by(2, 3): 4.5}
    alike = one(lacks, system=THREE, missing=alone)
    assert (alike.kind, alike.attacked) == (VerdictKind.UNIDENTIFIED, ())


def test_of_three_cameras_in_two_pairs_the_third_vouches_for_the_second():
    alone, pairs = frozenset({0}), system_of(3, pairs=((1, 3), (2, 3)))
    verdict = one({by(1, 3): 5.0}, system=pairs, missing=alone)
    assert (verdict.kind, verdict.attacked) == (VerdictKind.ATTACKED, (1,))
    lacking = one({by(1, 3, check=Check.REMOVED_LIGHT): 5.0}, system=pairs, missing=alone)
    assert (lacking.kind, lacking.attacked) == (VerdictKind.UNIDENTIFIED, ()), "light may be on the two others alike"
    both = one({by(1, 3): 5.0, by(2, 3): 5.0}, system=pairs, missing=alone)
    assert (both.kind, both.attacked) == (VerdictKind.UNIDENTIFIED, ())


def test_a_patch_that_saturates_in_one_of_two_cameras_names_none():
    verdict = one({by(2, 1, check=UNMATCHED): 9.0}, system=system_of(2))
    assert (verdict.kind, verdict.attacked) == (VerdictKind.UNIDENTIFIED, ())


@pytest.mark.parametrize("check", [DROPOUT, ISOLATED, Check.FREE_SPACE_CONFLICT, Check.SURROUNDING_CONFLICT])
def test_of_three_sensors_the_lidar_is_named_by_what_its_own_scans_show(check):
    two = system_of(2)
    verdict = one({of(0, check): 6.0, of(0, CONFLICT): 5.0}, system=two)
    assert (verdict.kind, verdict.attacked) == (VerdictKind.ATTACKED, (LIDAR,))
    assert verdict.posterior > 0.9
    assert {value for *_, value in verdict.evidence} == {6.0, 5.0}
    by_cameras = one({of(0, CONFLICT): 6.0}, system=two)
    assert (by_cameras.kind, by_cameras.attacked) == (VerdictKind.UNIDENTIFIED, ())
    lit = one({of(0, check): 6.0, by(2, 1): 5.0}, system=two)
    assert (lit.kind, lit.attacked) == (VerdictKind.UNIDENTIFIED, ())


def test_of_two_cameras_that_do_not_see_the_same_none_is_named():
    two = system_of(2)
    verdict = one({by(2, 1): 5.0}, system=two)
    assert verdict.kind is VerdictKind.UNIDENTIFIED
    assert verdict.evidence == (("added_light", 2, None, 1, 5.0),)
    assert verdict.e == "1"
    assert one({of(0, CONFLICT): 5.0}, system=two).kind is VerdictKind.UNIDENTIFIED


def test_without_a_sensor_the_others_are_judged_by_the_voters_that_are_there():
    fired = {by(3, 1, 2, 4): 9.0, by(3, 1, 4): -1.0}
    assert one(fired).attacked == (3,)
    verdict = one(fired, missing=frozenset({2}))
    assert (verdict.kind, verdict.out_of_system) == (VerdictKind.CLEAN, (2,))
    assert verdict.reason == "judged without S_2"
    assert one({by(3, 1, 4): 9.0}, missing=frozenset({2})).attacked == (3,)


def test_what_was_not_measured_neither_fires_nor_excuses():
    assert one({of(2): np.nan}).kind is VerdictKind.CLEAN
    assert one({of(2): np.nan, of(3): 5.0}).attacked == (3,)
    everything = one({}, others=np.nan)
    assert everything.kind is VerdictKind.NOT_AUDITABLE
    assert "too little of what any three of S_0, S_1, S_2, S_3 and S_4 see could be compared" in everything.reason


def test_a_triple_is_measured_where_all_its_sensors_were_compared():
    unlit = {of(2, check): np.nan for check in CAMERA_CHECKS}
    states = dict(zip(FOUR.triples, one(unlit).e, strict=True))
    assert {tuple(t) for t, state in states.items() if state == "-"} == {(1, 2, 3), (1, 2, 4), (2, 3, 4)}
    blind = dict(zip(FOUR.triples, one({of(0, CONFLICT): np.nan}).e, strict=True))
    assert {tuple(t) for t, state in blind.items() if state == "-"} == {t for t in map(tuple, FOUR.triples) if 0 in t}


def test_a_lidar_that_no_camera_pair_can_check_is_remarked_whatever_else_is_found():
    unchecked = {of(0, CONFLICT): np.nan}
    assert "no camera pair can check the LiDAR here" in one(unchecked).reason
    assert "no camera pair can check the LiDAR here" in one({**unchecked, of(2): 4.0}).reason
    assert one(unchecked, missing=frozenset({0})).reason == "judged without S_0"
    assert one({}).reason == ""


@pytest.mark.parametrize(
    ("conflicts", "missing", "reason"),
    [
        (((1, 3), (2, 3)), {3}, "S_3 missing: S_1 and S_2 lie too close together to check the LiDAR"),
        (None, {0, 3}, "S_0 and S_3 missing: three sensors have to be compared, and only S_1 and S_2 were there"),
        (None, {0, 1, 2, 3}, "and only none were there"),
    ],
)
def test_no_frame_is_clean_in_which_no_three_sensors_were_compared(conflicts, missing, reason):
    system = system_of(3, conflicts=conflicts)
    verdict = one({}, system=system, missing=frozenset(missing))
    assert (verdict.kind, verdict.e) == (VerdictKind.NOT_AUDITABLE, "---")
    assert verdict.out_of_system == tuple(sorted(missing))
    assert reason in verdict.reason


def test_two_cameras_far_enough_apart_to_check_the_lidar_are_not_said_to_lie_too_close_together():
    verdict = one({}, system=THREE, missing=frozenset({3}), others=np.nan)
    assert verdict.kind is VerdictKind.NOT_AUDITABLE
    assert verdict.reason == "S_3 missing: too little of what any three of S_0, S_1 and S_2 see could be compared"
    three = one({}, system=system_of(3, conflicts=()), others=np.nan)
    assert three.reason == "too little of what any three of S_0, S_1, S_2 and S_3 see could be compared"


def test_a_check_that_fires_is_a_finding_also_where_no_three_sensors_were_compared():
    system = system_of(3, conflicts=((1, 3), (2, 3)))
    verdict = one({by(1, 2): 5.0}, system=system, missing=frozenset({3}))
    assert (verdict.kind, verdict.evidence[0].check_name) == (VerdictKind.UNIDENTIFIED, "added_light")


WITH_FALLBACK = system_of(3, views=(3, 2), fallback=Triple(0, 1, 2))
NO_S_3 = frozenset({3})


@pytest.mark.parametrize(
    ("fired", "kind", "state"), [({}, "clean", "0"), ({of(0, CONFLICT): 5.0}, "unidentified", "1")]
)
def test_without_any_other_reference_a_frame_is_judged_by_the_fallback(fired, kind, state):
    verdict = one(fired, system=WITH_FALLBACK, missing=NO_S_3)
    assert (verdict.kind, verdict.e, verdict.named) == (kind, "---" + state, None)
    assert "judged without S_3; only S_0, S_1 and S_2 were compared" in verdict.reason


def test_the_fallback_is_no_part_of_e_where_another_triple_was_measured():
    verdict = one({of(1): 5.0}, system=WITH_FALLBACK)
    assert (verdict.attacked, verdict.e) == ((1,), "101")


def test_frames_keep_their_order_whatever_each_of_them_lacks():
    fired = [{}, {of(3): 9.0}, {by(1, 2, 3, 4): 9.0}, {of(1): 9.0}]
    z = np.concatenate([scores(FOUR, each, -1.0) for each in fired])
    missing = [NONE, frozenset({0}), frozenset({1}), NONE]
    verdicts = name_attacked(z, FOUR, missing, LIMIT)
    assert [v.attacked for v in verdicts] == [(), (3,), (), (1,)]
    assert [v.out_of_system for v in verdicts] == [(), (0,), (1,), ()]
    expected = [-1.0, 9.0, -1.0, 9.0]
    assert attack_scores(z, FOUR, missing).tolist() == expected


def test_a_frame_of_which_nothing_was_measured_has_no_score():
    assert attack_scores(scores(FOUR, {}, np.nan), FOUR, [NONE]).tolist() == [-np.inf]


ALL_Z = st.one_of(st.floats(-4, 12), st.just(float("nan")))


@given(st.data(), st.sampled_from([THREE, FOUR, WITH_FALLBACK]), st.sets(st.integers(0, 4), max_size=3))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_a_frame_is_a_finding_where_its_score_exceeds_the_limit_and_names_only_what_is_there(data, system, absent):
    count = len(system.sensor_checks)
    z = np.array([data.draw(st.lists(ALL_Z, min_size=count, max_size=count))])
    missing = frozenset(absent)
    (verdict,) = name_attacked(z, system, [missing], LIMIT)
    score = attack_scores(z, system, [missing])[0]
    present = set(system.sensors) - missing
    assert (verdict.kind in {VerdictKind.ATTACKED, VerdictKind.UNIDENTIFIED}) == (score > LIMIT)
    assert set(verdict.attacked) <= present
    assert set(verdict.out_of_system) == set(system.sensors) - present
    assert len(verdict.attacked) <= {0: 0, 1: 0, 2: 0, 3: 1}.get(len(present), len(present) - 3)
    assert all(one.score > LIMIT for one in verdict.evidence if one.k is not None)
    assert [one.score for one in verdict.evidence] == sorted((one.score for one in verdict.evidence), reverse=True)
    if verdict.attacked:
        assert verdict.evidence[0].score > LIMIT
        assert {one.i for one in verdict.evidence if one.k is None} == set(verdict.attacked)


@given(st.sampled_from([1, 2, 3, 4]), st.sampled_from([LIT, ODD]), st.floats(4.0, 12), st.floats(-4, 1.0))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_camera_is_named_whatever_the_quiet_checks_say(sensor, check, loud, quiet):
    assert one({of_all(sensor, check): loud}, others=quiet).attacked == (sensor,)


def test_scores_by_sensor_are_of_the_checks_that_count_and_of_no_two_cameras_alone():
    z = scores(THREE, {of_all(1): 4.0, by(2, 3): 9.0, of(0, CONFLICT): 5.0}, -1.0)
    assert sensor_scores(z, THREE, [NONE]).tolist() == [[5.0, 4.0, -1.0, -1.0]]
    assert attack_scores(z, THREE, [NONE]).tolist() == [9.0]


def test_where_only_two_cameras_are_left_what_they_say_is_a_score_of_both():
    z = scores(THREE, {by(2, 3): 6.0}, -1.0)
    assert sensor_scores(z, THREE, [frozenset({1})]).tolist() == [[-1.0, -np.inf, 6.0, 6.0]]


LONE = System(sensor_checks_of((), (), (), (1,)), triples_of(1, lidar=True), (0, 1))


def test_of_a_lone_camera_and_a_lidar_either_is_named_by_its_own_check():
    for sensor, shows in ((0, Check.PARALLAX_CONFLICT), (1, Check.STILL_LIGHT), (1, Check.STILL_TEXTURE)):
        found = one({lambda check, shows=shows: check.check is shows: 6.0}, system=LONE)
        assert (found.kind, found.attacked, found.e, found.named) == (VerdictKind.ATTACKED, (sensor,), "1", None)
        assert [entry.check_name for entry in found.evidence] == [shows]
        assert [other.attacked for other in found.alternatives] == [(), (1 - sensor,)]


def test_where_a_lone_camera_and_a_lidar_both_show_a_little_neither_is_named():
    found = one({lambda check: len(check.others) > 0: 3.2}, system=LONE)
    assert (found.kind, found.attacked, found.e) == (VerdictKind.UNIDENTIFIED, (), "1")
    assert "S_0" in found.reason
    assert "S_1" in found.reason


def test_what_the_lidar_shows_by_itself_names_it_beside_a_lone_camera():
    found = one({lambda check: check.sensor == LIDAR: 3.2}, system=LONE)
    assert (found.kind, found.attacked) == (VerdictKind.ATTACKED, (0,))


def test_a_lone_camera_s_frame_is_clean_below_the_limit_and_not_auditable_where_nothing_was_compared():
    clean = one({}, system=LONE)
    assert (clean.kind, clean.e, clean.reason) == (VerdictKind.CLEAN, "0", "")
    standing = one({}, system=LONE, others=np.nan)
    assert (standing.kind, standing.e) == (VerdictKind.NOT_AUDITABLE, "-")
    assert "the vehicle stands" in standing.reason
    blind = one({}, system=LONE, missing=frozenset({1}))
    assert blind.kind is VerdictKind.NOT_AUDITABLE


UNMATCHED = Check.UNMATCHED_LIGHT


def alike_in(first, second, value=8.0):
    """What one light shows that lies at the same place in two of four cameras: only the others see that it is none."""
    rest = tuple(n for n in (1, 2, 3, 4) if n not in (first, second))
    return {by(sensor, *rest, check=UNMATCHED): value for sensor in (first, second)}


@pytest.mark.parametrize(("first", "second"), [(1, 2), (1, 3), (2, 4), (3, 4)])
def test_light_that_is_alike_in_two_of_four_cameras_is_found_and_both_are_named(first, second):
    verdict = one(alike_in(first, second))
    assert (verdict.kind, verdict.attacked) == (VerdictKind.ATTACKED, (first, second))
    assert {entry.i for entry in verdict.evidence} == {first, second}
    assert verdict.gap == pytest.approx(8.0 - 4.0 - LIMIT), "by what it exceeds the limit less the margin"
    z = scores(FOUR, alike_in(first, second), -1.0)
    assert attack_scores(z, FOUR, [NONE]).tolist() == [4.0]
    assert np.flatnonzero(sensor_scores(z, FOUR, [NONE])[0] > LIMIT).tolist() == [first, second]


def test_what_two_of_three_other_cameras_say_of_unmatched_light_has_to_exceed_the_limit_clearly():
    assert one(alike_in(1, 2, LIMIT + 3.9)).kind is VerdictKind.CLEAN
    assert one(alike_in(1, 2, LIMIT + 4.1)).kind is not VerdictKind.CLEAN


def test_of_three_cameras_two_that_see_the_same_light_are_found_and_none_is_named():
    def lit(z):
        return {by(sensor, 3, check=UNMATCHED): z for sensor in (1, 2)}

    assert one(lit(LIMIT + 3.9), system=THREE).kind is VerdictKind.CLEAN
    verdict = one(lit(8.0), system=THREE)
    assert (verdict.kind, verdict.alternatives[0].attacked) == (VerdictKind.UNIDENTIFIED, (1, 2))
    assert {(line.i, line.k) for line in verdict.evidence} >= {(1, 3), (2, 3)}
    z = scores(THREE, lit(8.0), -1.0)
    assert np.flatnonzero(sensor_scores(z, THREE, [NONE])[0] > LIMIT).tolist() == [1, 2]
    assert one({by(1, 3, check=UNMATCHED): 12.0}, system=THREE).kind is VerdictKind.CLEAN, "what one says of another"


def test_without_a_camera_three_are_left_and_nothing_is_said_by_all_but_one():
    assert FOUR.but_one(frozenset({2})).size == 0
    by_two = [FOUR.sensor_checks[column] for column in FOUR.but_one(NONE).tolist()]
    assert {(one.check, len(one.others)) for one in by_two} == {(UNMATCHED, 2)}
    assert len(by_two) == 4 * 3
