import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.identification.statistics import window_means

MS = 1_000_000
STEPS_MS = st.sampled_from([-1000, -100, 0, 50, 100, 200, 225, 250, 251])
"""At 10 Hz 250 ms is the longest step that is no gap, and half a window of 0.5 s."""


def by_hand(z, stamps, seconds):
    step = np.median(np.diff(stamps)) if len(stamps) > 1 else 0
    result = np.full(z.shape, np.nan)
    for f in range(len(z)):
        first = last = f
        while first > 0 and 0 <= stamps[first] - stamps[first - 1] <= 2.5 * step:
            first -= 1
        while last < len(z) - 1 and 0 <= stamps[last + 1] - stamps[last] <= 2.5 * step:
            last += 1
        near = [g for g in range(first, last + 1) if abs(stamps[g] - stamps[f]) <= seconds * 1e9 / 2]
        for m in range(z.shape[1]):
            values = [z[g, m] for g in near if not np.isnan(z[g, m])]
            if values:
                result[f, m] = np.mean(values)
    return result


@pytest.mark.parametrize("seed", range(10))
def test_means_are_those_counted_by_hand(seed):
    rng = np.random.default_rng(seed)
    stamps = np.cumsum(rng.choice([90, 100, 110, 700], 40, p=[0.3, 0.4, 0.2, 0.1])).astype(np.int64) * MS
    z = rng.uniform(-2, 3, (40, 3))
    z[rng.random(z.shape) < 0.3] = np.nan
    np.testing.assert_allclose(window_means(z, stamps, 0.5), by_hand(z, stamps, 0.5), atol=1e-12)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(steps=st.lists(STEPS_MS, max_size=12), seconds=st.sampled_from([0.5, 0.2]), missing=st.sets(st.integers(0, 12)))
def test_means_are_those_counted_by_hand_whatever_the_clock_does(steps, seconds, missing):
    stamps = np.cumsum([10_000, *steps]).astype(np.int64) * MS
    z = np.arange(1.0, len(stamps) + 1)[:, None] ** 2
    z[[f for f in missing if f < len(z)]] = np.nan
    np.testing.assert_allclose(window_means(z, stamps, seconds), by_hand(z, stamps, seconds), atol=1e-9)


@pytest.mark.parametrize(("step_ms", "mean"), [(225, 1.25), (250, 1.25), (251, 1.0)])
def test_a_step_of_more_than_two_and_a_half_usual_ones_is_a_gap(step_ms, mean):
    stamps = np.cumsum([0, 100, 100, 100, step_ms]).astype(np.int64) * MS
    z = np.array([[1.0], [1.0], [1.0], [1.0], [2.0]])
    assert window_means(z, stamps, 0.55)[3, 0] == mean


def test_two_frames_alone_have_no_gap_between_them():
    assert window_means(np.array([[1.0], [3.0]]), np.array([0, 90 * MS]), 0.5).tolist() == [[2.0], [2.0]]


def test_frames_of_one_stamp_share_a_window():
    stamps = np.array([0, 100, 100, 200], dtype=np.int64) * MS
    assert window_means(np.array([[0.0], [3.0], [9.0], [0.0]]), stamps, 0.1).ravel().tolist() == [0, 6, 6, 0]


def test_a_window_of_two_seconds_reaches_a_second_either_way_and_not_a_nanosecond_more():
    stamps = np.array([0, 1_000_000_000, 2_000_000_001], dtype=np.int64)
    assert window_means(np.array([[1.0], [2.0], [6.0]]), stamps, 2.0).ravel().tolist() == [1.5, 1.5, 6.0]


def test_a_clock_set_back_inside_a_window_parts_it_though_the_stamps_are_near():
    stamps = np.array([1000, 1100, 1050, 1150, 1250], dtype=np.int64) * MS
    z = np.array([[3.0], [3.0], [-2.0], [-2.0], [-2.0]])
    assert window_means(z, stamps, 2.0).ravel().tolist() == [3, 3, -2, -2, -2]


def test_an_attack_before_a_gap_is_not_carried_across_it():
    stamps = np.array([0, 100, 200, 600, 700], dtype=np.int64) * MS
    z = np.array([[3.0], [3.0], [3.0], [-2.0], [-2.0]])
    assert window_means(z, stamps, 1.0)[3:].tolist() == [[-2.0], [-2.0]]


def test_five_frames_at_ten_hertz_make_half_a_second():
    stamps = np.arange(7, dtype=np.int64) * 100 * MS
    z = np.arange(7, dtype=np.float64)[:, None] ** 2
    assert window_means(z, stamps, 0.5)[3, 0] == pytest.approx(np.mean([1, 4, 9, 16, 25]))


def test_one_frame_alone_and_none_at_all_are_their_own_means():
    assert window_means(np.array([[1.5]]), np.array([7], dtype=np.int64), 0.5).tolist() == [[1.5]]
    assert window_means(np.zeros((0, 2)), np.zeros(0, dtype=np.int64), 0.5).shape == (0, 2)


def test_a_clock_that_is_set_back_ends_a_window():
    stamps = np.array([1000, 1100, 1200, 1000, 1100], dtype=np.int64) * MS
    z = np.array([[3.0], [3.0], [3.0], [-2.0], [-2.0]])
    assert window_means(z, stamps, 0.5)[:, 0].tolist() == [3, 3, 3, -2, -2]
