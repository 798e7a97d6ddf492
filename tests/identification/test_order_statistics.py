"""Values without those of some drives are as if the others had been sorted alone."""

import numpy as np
import pytest

from auditor.identification.thresholds import Largest

SEEDS = range(20)


def drawn(seed):
    """Values of nine drives, many of them equal."""
    draw = np.random.default_rng(seed)
    return [np.append(draw.integers(0, 6, draw.integers(0, 12)) / 8, np.nan) for _ in range(9)]


def largest_of(parts, many, first=0):
    largest = Largest(many)
    for drive, part in enumerate(parts, first):
        largest.add(part, drive)
    return largest


def known(parts):
    values = np.concatenate(parts)
    return np.sort(values[~np.isnan(values)])


@pytest.mark.parametrize("gone", [[], [1], [4, 1], range(9)])
def test_what_is_left_is_as_if_it_had_been_sorted_alone(gone):
    for parts in map(drawn, SEEDS):
        left = known([part for drive, part in enumerate(parts) if drive not in gone] or [np.zeros(0)])
        found = largest_of(parts, 1000).ordered(9).without(gone)
        assert found.size == left.size
        assert [found.at(rank) for rank in range(left.size)] == left.tolist()
        for share in (0.0, 0.37, 0.995, 1.0):
            assert not left.size or found.quantile(share) == np.quantile(left, share)


@pytest.mark.parametrize("many", [1, 9, 30, 100])
@pytest.mark.parametrize("joined", [False, True])
def test_the_largest_values_are_enough_for_the_largest_ranks(many, joined):
    for parts in map(drawn, SEEDS):
        largest = largest_of(parts[:4], many)
        if joined:
            largest.join(largest_of(parts[4:], many), 4)
        else:
            for drive, part in enumerate(parts[4:], 4):
                largest.add(part, drive)
        everything = known(parts)
        assert largest.ordered(9).values.tolist() == everything[max(everything.size - many, 0) :].tolist()
        left = known([*parts[:3], *parts[4:]])
        found = largest.ordered(9).without([3])
        assert found.size == left.size
        fewest = max(left.size - max(many - (known(parts[3:4]).size), 0), 0)
        assert [found.at(rank) for rank in range(fewest, left.size)] == left[fewest:].tolist()


def test_a_drive_may_add_its_values_in_parts_and_another_may_have_none():
    largest = Largest(100)
    largest.add(np.array([0.3, np.nan]), 0)
    largest.add(np.array([0.1]), 0)
    largest.add(np.array([0.2]), 2)
    found = largest.ordered(4)
    assert (found.values.tolist(), found.measured.tolist()) == ([0.1, 0.2, 0.3], [2, 0, 1, 0])
    assert found.without([0]).at(0) == 0.2
    assert Largest(3).ordered(2).without([1]).size == 0


def test_of_many_values_few_are_kept():
    largest = Largest(10)
    for drive, first in enumerate(range(0, 10_000, 100)):
        largest.add(np.arange(first, first + 100, dtype=np.float64), drive)
        assert sum(one.size for one in largest._values) <= 110
    assert largest.ordered(100).values.tolist() == list(range(9990, 10_000))
