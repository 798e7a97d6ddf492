from itertools import combinations

import numpy as np
import pytest

from auditor.identification import algorithm2
from auditor.identification.algorithm2 import allowed_attack_sets
from auditor.identification.attack_sets import demands, explain, explained, explains, triple_states
from auditor.model.checks import OF_THE_LIDAR, Element, Witness, elements_of
from auditor.model.rig import triples_of


def full_elements(n):
    """Every pair that a rig with a LiDAR and n cameras matches, all of them able to contradict the LiDAR."""
    matched = tuple(dict.fromkeys((w, t.k) for t in triples_of(n, lidar=True) for w in t[:2] if w))
    return elements_of(n, matched, matched, (n,))


def states(attacked, elements, *, hidden):
    """What exact witnesses say: `hidden`: a contradiction by an attacked camera is not heard."""
    z = []
    for element in elements:
        said = explains(element, attacked)
        if element.witness is Witness.CONTRADICTED:
            said = 0 in attacked and (not hidden or demands(element, attacked) == 1)
        z.append(1.0 if said else -1.0)
    return z


@pytest.mark.parametrize("n", [3, 4, 5, 6, 7])
@pytest.mark.parametrize("hidden", [False, True])
def test_exact_states_name_every_allowed_attack_set_exactly(n, hidden):
    elements, sets = full_elements(n), allowed_attack_sets(range(n + 1))
    z = np.array([states(s, elements, hidden=hidden) for s in sets])
    found = explain(z, elements, sets)
    assert [sets[b] for b in found.best] == list(sets)
    assert (found.lead > 0.4).all()


@pytest.mark.parametrize("n", [4, 5, 6])
def test_cameras_alone_are_named_too(n):
    matched = tuple(dict.fromkeys((w, t.k) for t in triples_of(n, lidar=False) for w in t[:2]))
    elements = elements_of(n, matched, (), ())
    sets = allowed_attack_sets(range(1, n + 1))
    z = np.array([states(s, elements, hidden=True) for s in sets])
    assert [sets[b] for b in explain(z, elements, sets).best] == list(sets)


@pytest.mark.parametrize("n", [3, 4])
def test_the_cost_of_every_set_is_what_counting_it_by_hand_gives(n):
    elements, sets = full_elements(n), allowed_attack_sets(range(n + 1))
    z = np.random.default_rng(n).uniform(-2, 3, (30, len(elements)))
    z[np.random.default_rng(n + 1).random(z.shape) < 0.2] = np.nan
    found = explain(z, elements, sets)
    own = np.nanmax(z[:, [e.witness in OF_THE_LIDAR for e in elements]], axis=1, initial=-1) > 0
    for f, s in np.ndindex(found.cost.shape):
        cost = 0.02 * len(sets[s])
        for value, element in zip(z[f], elements, strict=True):
            if value > 0:
                cost += value * (1 - explained(element, sets[s]))
            elif value < 0 and not (own[f] and element.witness is Witness.CONTRADICTED):
                cost -= value * demands(element, sets[s])
        assert found.cost[f, s] == pytest.approx(cost)
    np.testing.assert_allclose(found.score, found.cost[:, 0] - found.cost[:, 1:].min(axis=1))
    ranked = found.ranked(0)
    assert [cost for _, cost in ranked] == sorted(cost for _, cost in ranked)
    assert ranked[1][1] - ranked[0][1] == pytest.approx(found.lead[0])


def test_what_was_not_measured_costs_nothing_and_a_silent_frame_is_clean():
    elements, sets = full_elements(3), allowed_attack_sets(range(4))
    found = explain(np.full((1, len(elements)), np.nan), elements, sets)
    assert sets[found.best[0]] == ()
    assert found.cost[0].tolist() == [0.0, 0.02, 0.02, 0.02, 0.02]
    assert found.score[0] < 0


def test_light_s_silence_clears_nobody_but_a_contradiction_s_clears_the_lidar():
    assert demands(Element(Witness.LIGHT, 1, 3), (1,)) == 0.0
    assert {demands(Element(witness, 0, 3), (0,)) for witness in OF_THE_LIDAR} == {0.0}
    assert demands(Element(Witness.UNLIKE, 1, 3), (1,)) == 0.5
    assert demands(Element(Witness.CONTRADICTED, 1, 3), (0,)) == 1.0
    assert demands(Element(Witness.CONTRADICTED, 1, 3), (0, 3)) == 0.0


def test_a_pair_contradicting_the_lidar_alone_accuses_a_camera_rather_than_the_lidar():
    # A camera whose picture is shifted sees the same things at wrong places: only its own pair contradicts the LiDAR.
    elements, sets = full_elements(3), allowed_attack_sets(range(4))
    z = [3.0 if e == Element(Witness.CONTRADICTED, 1, 3) else -2.0 for e in elements]
    found = explain(np.array([z]), elements, sets)
    assert sets[found.best[0]] == (1,)


def test_without_elements_nothing_is_raised():
    found = explain(np.zeros((2, 0)), (), allowed_attack_sets(range(4)))
    assert found.best.tolist() == [0, 0]


def test_a_system_too_large_to_weigh_all_sets_weighs_whole_sizes(monkeypatch):
    monkeypatch.setattr(algorithm2, "MOST_SETS", 60)
    sets = allowed_attack_sets(range(10))
    assert sets == ((), *combinations(range(10), 1), *combinations(range(10), 2))


def test_with_the_empty_set_alone_the_lead_is_infinite():
    elements = full_elements(3)
    assert explain(np.zeros((1, len(elements))), elements, ((),)).lead.tolist() == [np.inf]


def test_a_triple_is_raised_by_any_element_inside_it_and_measured_when_its_own_are():
    elements, triples = full_elements(3), triples_of(3, lidar=True)  # triples 013, 023, 123
    raised, measured = np.zeros((4, len(elements)), bool), np.ones((4, len(elements)), bool)
    raised[0, elements.index(Element(Witness.CONTRADICTED, 1, 3))] = True
    raised[1, elements.index(Element(Witness.UNLIKE, 1, 3))] = True
    raised[2, elements.index(Element(Witness.LIGHT, 1, 2))] = True
    measured[3, elements.index(Element(Witness.CONTRADICTED, 2, 3))] = False
    above, known = triple_states(raised, measured, elements, triples)
    assert above.astype(int).tolist() == [[1, 0, 0], [1, 0, 1], [0, 0, 1], [0, 0, 0]]
    assert known.astype(int).tolist() == [[1, 1, 1], [1, 1, 1], [1, 1, 1], [1, 0, 1]]


def test_a_wall_is_not_taken_for_a_camera_because_one_pair_is_a_little_unlike():
    elements, sets = full_elements(3), allowed_attack_sets(range(4))
    z = np.full((1, len(elements)), -2.0)
    for place, element in enumerate(elements):
        if element.witness is Witness.CONTRADICTED:
            z[0, place] = 2.5
        if element == (Witness.UNLIKE, 1, 3):
            z[0, place] = 0.4
    assert sets[explain(z, elements, sets).best[0]] == (0,)


def test_a_witness_that_alone_denies_the_lidar_is_named_itself():
    elements, sets = full_elements(3), allowed_attack_sets(range(4))
    z = np.full((1, len(elements)), -2.0)
    z[0, elements.index((Witness.CONTRADICTED, 1, 3))] = 3.0
    assert sets[explain(z, elements, sets).best[0]] == (1,)


CONTRADICTED, UNLIKE, LIGHT, EMPTY, SCATTERED = Witness


@pytest.mark.parametrize(
    ("element", "attacked", "accounted", "due"),
    [
        (Element(CONTRADICTED, 1, 3), (), 0.0, 0.0),
        (Element(CONTRADICTED, 1, 3), (0,), 1.0, 1.0),
        (Element(CONTRADICTED, 1, 3), (1,), 0.9, 0.0),
        (Element(CONTRADICTED, 1, 3), (3,), 0.9, 0.0),
        (Element(CONTRADICTED, 1, 3), (2,), 0.0, 0.0),
        (Element(CONTRADICTED, 1, 3), (0, 1), 1.0, 0.0),
        (Element(CONTRADICTED, 1, 3), (0, 2), 1.0, 1.0),
        (Element(CONTRADICTED, 1, 3), (0, 3), 1.0, 0.0),
        (Element(UNLIKE, 1, 3), (1,), 1.0, 0.5),
        (Element(UNLIKE, 1, 3), (3,), 1.0, 0.5),
        (Element(UNLIKE, 1, 3), (0, 2), 0.0, 0.0),
        (Element(LIGHT, 1, 2), (2,), 1.0, 0.0),
        (Element(LIGHT, 1, 2), (3,), 0.0, 0.0),
        (Element(EMPTY, 0, 3), (0,), 1.0, 0.0),
        (Element(EMPTY, 0, 3), (3,), 0.0, 0.0),
        (Element(SCATTERED, 0, 3), (0,), 1.0, 0.0),
    ],
)
def test_what_an_attack_accounts_for_and_what_it_should_have_raised(element, attacked, accounted, due):
    assert (explained(element, attacked), demands(element, attacked)) == (accounted, due)


def test_each_attacked_sensor_costs_a_fiftieth_of_a_margin():
    elements, sets = full_elements(4), attack_sets(range(5), 2)
    cost = explain(np.full((1, len(elements)), np.nan), elements, sets).cost[0]
    np.testing.assert_allclose(cost, [0.02 * len(attacked) for attacked in sets])


def test_twenty_thousand_attack_sets_are_weighed_at_most():
    # Of 19 sensors: 1 + 19 + 171 + 969 + 3876 + 11628 are 16,664, and those of the next size would be too many.
    assert len(attack_sets(range(19), 16)) == 16_664
    assert attack_sets((3, 1, 2), 1) == ((), (1,), (2,), (3,))


def test_as_many_sets_as_may_be_weighed_are(monkeypatch):
    monkeypatch.setattr(joint, "MOST_SETS", 56)
    assert len(attack_sets(range(10), 7)) == 56
    monkeypatch.setattr(joint, "MOST_SETS", 55)
    assert len(attack_sets(range(10), 7)) == 11
