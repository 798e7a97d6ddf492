"""Values without some of them are as if the others had been sorted alone."""

import numpy as np
import pytest

from auditor.identification.order_statistics import Largest, Without, ascending


@pytest.mark.parametrize("seed", range(20))
def test_what_is_left_is_as_if_it_had_been_sorted_alone(seed):
    draw = np.random.default_rng(seed)
    parts = [draw.integers(0, 6, draw.integers(1, 12)) / 8 for _ in range(4)]  # many of them are equal
    parts[1] = np.append(parts[1], np.nan)
    left = np.sort(np.concatenate([parts[0], parts[2], parts[3]]))
    found = Without(ascending(parts), ascending(parts[1:2]))
    assert found.size == left.size
    assert [found.at(rank) for rank in range(left.size)] == left.tolist()
    for share in (0.0, 0.37, 0.995, 1.0):
        assert found.quantile(share) == np.quantile(left, share)


def test_without_nothing_all_is_left():
    values = ascending([np.array([0.3, np.nan, 0.1])])
    found = Without(values, ascending([]))
    assert [found.at(0), found.at(1)] == [0.1, 0.3]
    assert ascending([]).size == 0


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("many", [1, 9, 30, 100])
def test_the_largest_values_are_enough_for_the_largest_ranks(seed, many):
    draw = np.random.default_rng(seed)
    parts = [np.append(draw.integers(0, 6, draw.integers(1, 12)) / 8, np.nan) for _ in range(9)]  # many are equal
    largest = Largest(many)
    for part in parts:
        largest.add(part)
    values, below = largest.ascending
    everything = ascending(parts)
    assert below + values.size == everything.size
    assert values.tolist() == everything[below:].tolist()
    left_out = ascending(parts[3:4])
    whole, known = Without(everything, left_out), Without(values, left_out, below)
    assert known.size == whole.size
    ranks = range(below, whole.size)
    assert [known.at(rank) for rank in ranks] == [whole.at(rank) for rank in ranks]


def test_of_many_values_few_are_kept():
    largest = Largest(10)
    for first in range(0, 10_000, 100):
        largest.add(np.arange(first, first + 100, dtype=np.float64))
        assert sum(one.size for one in largest._values) <= 110
    assert largest.ascending[0][-10:].tolist() == list(range(9990, 10_000))
