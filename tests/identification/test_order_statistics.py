"""Values without some of them are as if the others had been sorted alone."""

import numpy as np
import pytest

from auditor.identification.order_statistics import Without, ascending


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
