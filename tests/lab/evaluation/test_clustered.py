import numpy as np
import pytest

from tests.benchmarks.long_drives import hourly_interval, poisson_interval
from tests.benchmarks.rates import clustered_interval


def test_clusters_that_are_all_or_nothing_give_a_wider_interval_than_mixed_ones() -> None:
    low, high = clustered_interval([12, 0] * 10, [12] * 20)
    mixed_low, mixed_high = clustered_interval([6] * 20, [12] * 20)
    assert (mixed_low, mixed_high) == (0.5, 0.5)
    assert low == pytest.approx(0.3, abs=0.05)
    assert high == pytest.approx(0.7, abs=0.05)


def test_no_hit_is_bounded_by_the_number_of_clusters_not_of_cases() -> None:
    assert clustered_interval([0] * 10, [50] * 10) == pytest.approx((0, 0.3085), abs=1e-3)
    assert clustered_interval([50] * 10, [50] * 10) == pytest.approx((0.6915, 1), abs=1e-3)


@pytest.mark.parametrize(("seen", "low", "high"), [(0, 0.0, 3.689), (1, 0.0253, 5.572), (18, 10.67, 28.45)])
def test_the_interval_of_a_count_is_garwoods(seen: int, low: float, high: float) -> None:
    assert poisson_interval(seen) == pytest.approx((low, high), abs=0.005)


def test_incidents_an_hour_come_by_drives() -> None:
    assert hourly_interval([0, 0], [0.1, 0.1]) is None
    low, high = hourly_interval([2, 0, 0, 0, 0], [0.1] * 5) or (np.nan, np.nan)
    assert low == 0
    assert 4 < high <= 20
