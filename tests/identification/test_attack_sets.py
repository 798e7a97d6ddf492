from itertools import combinations

import numpy as np
import pytest

from auditor.identification import algorithm2
from auditor.identification.algorithm2 import allowed_attack_sets
from auditor.identification.attack_sets import attack_set_costs, covered_share, covers, expects, triple_states
from auditor.model.checks import LIDAR_CHECKS, Check, PairCheck, pair_checks_of
from auditor.model.rig import triples_of


def full_pair_checks(n):
    """Every pair that a rig with a LiDAR and n cameras matches, all of which can check the LiDAR."""
    matched = tuple(dict.fromkeys((w, t.k) for t in triples_of(n, lidar=True) for w in t[:2] if w))
    return pair_checks_of(n, matched, matched, (n,))


def states(attacked, pair_checks, *, hidden):
    """The scores of exact checks; `hidden`: an attacked camera has no LiDAR conflict."""
    z = []
    for pair_check in pair_checks:
        fires = covers(pair_check, attacked)
        if pair_check.check is Check.LIDAR_CONFLICT:
            fires = 0 in attacked and (not hidden or expects(pair_check, attacked) == 1)
        z.append(1.0 if fires else -1.0)
    return z


@pytest.mark.parametrize("n", [3, 4, 5, 6, 7])
@pytest.mark.parametrize("hidden", [False, True])
def test_exact_states_name_every_allowed_attack_set_exactly(n, hidden):
    pair_checks, sets = full_pair_checks(n), allowed_attack_sets(range(n + 1))
    z = np.array([states(s, pair_checks, hidden=hidden) for s in sets])
    found = attack_set_costs(z, pair_checks, sets)
    assert [sets[b] for b in found.best] == list(sets)
    assert (found.gap > 0.4).all()


@pytest.mark.parametrize("n", [4, 5, 6])
def test_cameras_alone_are_named_too(n):
    matched = tuple(dict.fromkeys((w, t.k) for t in triples_of(n, lidar=False) for w in t[:2]))
    pair_checks = pair_checks_of(n, matched, (), ())
    sets = allowed_attack_sets(range(1, n + 1))
    z = np.array([states(s, pair_checks, hidden=True) for s in sets])
    assert [sets[b] for b in attack_set_costs(z, pair_checks, sets).best] == list(sets)


@pytest.mark.parametrize("n", [3, 4])
def test_the_cost_of_every_set_is_what_counting_it_by_hand_gives(n):
    pair_checks, sets = full_pair_checks(n), allowed_attack_sets(range(n + 1))
    z = np.random.default_rng(n).uniform(-2, 3, (30, len(pair_checks)))
    z[np.random.default_rng(n + 1).random(z.shape) < 0.2] = np.nan
    found = attack_set_costs(z, pair_checks, sets)
    lidar_fired = np.nanmax(z[:, [e.check in LIDAR_CHECKS for e in pair_checks]], axis=1, initial=-1) > 0
    for f, s in np.ndindex(found.cost.shape):
        cost = 0.02 * len(sets[s])
        for value, pair_check in zip(z[f], pair_checks, strict=True):
            if value > 0:
                cost += value * (1 - covered_share(pair_check, sets[s]))
            elif value < 0 and not (lidar_fired[f] and pair_check.check is Check.LIDAR_CONFLICT):
                cost -= value * expects(pair_check, sets[s])
        assert found.cost[f, s] == pytest.approx(cost)
    np.testing.assert_allclose(found.score, found.cost[:, 0] - found.cost[:, 1:].min(axis=1))
    for f in range(len(z)):
        ranked = np.sort(found.cost[f])
        assert ranked[1] - ranked[0] == pytest.approx(found.gap[f])


def test_what_was_not_measured_costs_nothing_and_a_silent_frame_is_clean():
    pair_checks, sets = full_pair_checks(3), allowed_attack_sets(range(4))
    found = attack_set_costs(np.full((1, len(pair_checks)), np.nan), pair_checks, sets)
    assert sets[found.best[0]] == ()
    assert found.cost[0].tolist() == [0.0, 0.02, 0.02, 0.02, 0.02]
    assert found.score[0] < 0


def test_a_brightness_difference_is_never_expected_and_a_lidar_conflict_is_of_the_lidar():
    assert expects(PairCheck(Check.BRIGHTNESS_DIFFERENCE, 1, 3), (1,)) == 0.0
    assert {expects(PairCheck(check, 0, 3), (0,)) for check in LIDAR_CHECKS} == {0.0}
    assert expects(PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, 1, 3), (1,)) == 0.5
    assert expects(PairCheck(Check.LIDAR_CONFLICT, 1, 3), (0,)) == 1.0
    assert expects(PairCheck(Check.LIDAR_CONFLICT, 1, 3), (0, 3)) == 0.0


def test_one_lidar_conflict_alone_names_a_camera_rather_than_the_lidar():
    # A camera with a shifted image sees the same things at wrong places: only its own pair has a LiDAR conflict.
    pair_checks, sets = full_pair_checks(3), allowed_attack_sets(range(4))
    z = [3.0 if e == PairCheck(Check.LIDAR_CONFLICT, 1, 3) else -2.0 for e in pair_checks]
    found = attack_set_costs(np.array([z]), pair_checks, sets)
    assert sets[found.best[0]] == (1,)


def test_without_pair_checks_no_attack_is_better_than_none():
    found = attack_set_costs(np.zeros((2, 0)), (), allowed_attack_sets(range(4)))
    assert found.best.tolist() == [0, 0]


def test_a_system_too_large_to_weigh_all_sets_weighs_whole_sizes(monkeypatch):
    monkeypatch.setattr(algorithm2, "MOST_SETS", 60)
    sets = allowed_attack_sets(range(10))
    assert sets == ((), *combinations(range(10), 1), *combinations(range(10), 2))


def test_with_the_empty_set_alone_the_gap_is_infinite():
    pair_checks = full_pair_checks(3)
    assert attack_set_costs(np.zeros((1, len(pair_checks))), pair_checks, ((),)).gap.tolist() == [np.inf]


def test_a_triple_is_above_where_any_pair_check_inside_it_fires_and_measured_where_its_own_are():
    pair_checks, triples = full_pair_checks(3), triples_of(3, lidar=True)  # triples 013, 023, 123
    fired, measured = np.zeros((4, len(pair_checks)), bool), np.ones((4, len(pair_checks)), bool)
    fired[0, pair_checks.index(PairCheck(Check.LIDAR_CONFLICT, 1, 3))] = True
    fired[1, pair_checks.index(PairCheck(Check.PHOTOMETRIC_INCONSISTENCY, 1, 3))] = True
    fired[2, pair_checks.index(PairCheck(Check.BRIGHTNESS_DIFFERENCE, 1, 2))] = True
    measured[3, pair_checks.index(PairCheck(Check.LIDAR_CONFLICT, 2, 3))] = False
    above, known = triple_states(fired, measured, pair_checks, triples)
    assert above.astype(int).tolist() == [[1, 0, 0], [1, 0, 1], [0, 0, 1], [0, 0, 0]]
    assert known.astype(int).tolist() == [[1, 1, 1], [1, 1, 1], [1, 1, 1], [1, 0, 1]]


def test_a_wall_is_not_taken_for_a_camera_because_one_pair_is_a_little_inconsistent():
    pair_checks, sets = full_pair_checks(3), allowed_attack_sets(range(4))
    z = np.full((1, len(pair_checks)), -2.0)
    for place, pair_check in enumerate(pair_checks):
        if pair_check.check is Check.LIDAR_CONFLICT:
            z[0, place] = 2.5
        if pair_check == (Check.PHOTOMETRIC_INCONSISTENCY, 1, 3):
            z[0, place] = 0.4
    assert sets[attack_set_costs(z, pair_checks, sets).best[0]] == (0,)


def test_a_source_camera_with_the_only_lidar_conflict_is_named_itself():
    pair_checks, sets = full_pair_checks(3), allowed_attack_sets(range(4))
    z = np.full((1, len(pair_checks)), -2.0)
    z[0, pair_checks.index((Check.LIDAR_CONFLICT, 1, 3))] = 3.0
    assert sets[attack_set_costs(z, pair_checks, sets).best[0]] == (1,)


LIDAR_CONFLICT, PHOTOMETRIC_INCONSISTENCY, BRIGHTNESS_DIFFERENCE, POINT_DROPOUT, ISOLATED_POINTS = Check


@pytest.mark.parametrize(
    ("pair_check", "attacked", "covered", "expected"),
    [
        (PairCheck(LIDAR_CONFLICT, 1, 3), (), 0.0, 0.0),
        (PairCheck(LIDAR_CONFLICT, 1, 3), (0,), 1.0, 1.0),
        (PairCheck(LIDAR_CONFLICT, 1, 3), (1,), 0.9, 0.0),
        (PairCheck(LIDAR_CONFLICT, 1, 3), (3,), 0.9, 0.0),
        (PairCheck(LIDAR_CONFLICT, 1, 3), (2,), 0.0, 0.0),
        (PairCheck(LIDAR_CONFLICT, 1, 3), (0, 1), 1.0, 0.0),
        (PairCheck(LIDAR_CONFLICT, 1, 3), (0, 2), 1.0, 1.0),
        (PairCheck(LIDAR_CONFLICT, 1, 3), (0, 3), 1.0, 0.0),
        (PairCheck(PHOTOMETRIC_INCONSISTENCY, 1, 3), (1,), 1.0, 0.5),
        (PairCheck(PHOTOMETRIC_INCONSISTENCY, 1, 3), (3,), 1.0, 0.5),
        (PairCheck(PHOTOMETRIC_INCONSISTENCY, 1, 3), (0, 2), 0.0, 0.0),
        (PairCheck(BRIGHTNESS_DIFFERENCE, 1, 2), (2,), 1.0, 0.0),
        (PairCheck(BRIGHTNESS_DIFFERENCE, 1, 2), (3,), 0.0, 0.0),
        (PairCheck(POINT_DROPOUT, 0, 3), (0,), 1.0, 0.0),
        (PairCheck(POINT_DROPOUT, 0, 3), (3,), 0.0, 0.0),
        (PairCheck(ISOLATED_POINTS, 0, 3), (0,), 1.0, 0.0),
    ],
)
def test_what_an_attack_covers_and_what_it_expects(pair_check, attacked, covered, expected):
    assert (covered_share(pair_check, attacked), expects(pair_check, attacked)) == (covered, expected)


def test_each_attacked_sensor_costs_a_fiftieth_of_z():
    pair_checks, sets = full_pair_checks(4), allowed_attack_sets(range(5))
    cost = attack_set_costs(np.full((1, len(pair_checks)), np.nan), pair_checks, sets).cost[0]
    np.testing.assert_allclose(cost, [0.02 * len(attacked) for attacked in sets])


def test_twenty_thousand_attack_sets_are_weighed_at_most():
    # Of 19 sensors: 1 + 19 + 171 + 969 + 3876 + 11628 are 16,664, and those of the next size would be too many.
    assert len(allowed_attack_sets(range(19))) == 16_664
    assert allowed_attack_sets((3, 0, 1, 2)) == ((), (0,), (1,), (2,), (3,))


def test_as_many_sets_as_may_be_weighed_are(monkeypatch):
    monkeypatch.setattr(algorithm2, "MOST_SETS", 56)
    assert len(allowed_attack_sets(range(10))) == 56
    monkeypatch.setattr(algorithm2, "MOST_SETS", 55)
    assert len(allowed_attack_sets(range(10))) == 11
