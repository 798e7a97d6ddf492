import numpy as np
import pytest

from auditor.identification.windows import window_means

MS = 1_000_000


def by_hand(z, stamps, seconds):
    step = np.median(np.diff(stamps))
    result = np.full(z.shape, np.nan)
    for f in range(len(z)):
        first = last = f
        while first > 0 and stamps[first] - stamps[first - 1] <= 2.5 * step:
            first -= 1
        while last < len(z) - 1 and stamps[last + 1] - stamps[last] <= 2.5 * step:
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
