from itertools import product

import pytest

from auditor.identification.paper import Identification, codeword, identify
from auditor.model.rig import triples_of
from tests.identification.definitions import allowed_attack_sets, explaining_sets

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
