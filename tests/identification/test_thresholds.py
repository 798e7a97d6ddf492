"""Thresholds at r, and the order statistics that they come from."""

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from auditor.errors import SettingError, ThresholdsError
from auditor.identification.thresholds import Largest, check_calibration, parse_r, resolvable, threshold, thresholds_at
from auditor.model.calibration import Calibration
from auditor.model.measurement import Procedure, Statistic
from auditor.model.rig import triples_of
from auditor.model.rig_kind import RigKind, Similarity
from tests.making.calibrations import clean_frames

TRIPLES = triples_of(3, lidar=True)
KIND = RigKind(lidar=True, sizes_px=((1242, 375),) * 3, focals_px=(721.5,) * 3, baselines_m=(0.07, 0.53))
PROCEDURE = Procedure(matcher="sgbm", settings='{"range":128,"scale":0.5}')
SAMPLES = {(Statistic.GATED, triple): [number / 100 for number in range(1, 101)] for triple in TRIPLES}
CALIBRATION = Calibration("ab12", KIND, PROCEDURE, clean_frames(SAMPLES))

rates = st.one_of(
    st.decimals(min_value=0, max_value=1, places=4),
    st.sampled_from([Decimal(0), Decimal(1), Decimal("0.01"), Decimal("1E-40"), Decimal("0." + "9" * 40)]),
)


def floor_of(r, N):
    numerator, denominator = r.as_integer_ratio()
    return numerator * N // denominator


@given(N=st.integers(1, 300), r=rates)
def test_without_ties_exactly_floor_r_n_samples_lie_above(N, r):
    samples = [number / 7 for number in range(N)]
    theta = threshold(samples, r)
    assert sum(sample > theta for sample in samples) == floor_of(r, N)


@given(samples=st.lists(st.sampled_from([0.0, 0.1, 0.25, 1.0]), min_size=1, max_size=60).map(sorted), r=rates)
def test_with_ties_at_most_floor_r_n_samples_lie_above(samples, r):
    theta = threshold(samples, r)
    assert sum(sample > theta for sample in samples) <= floor_of(r, len(samples))
    assert theta == -1.0 or theta in samples


@pytest.mark.parametrize("N", [1, 2, 40, 99, 100, 101, 1000])
def test_r_of_zero_is_the_maximum_and_r_of_one_lies_under_everything(N):
    samples = [number / N for number in range(N)]
    assert threshold(samples, Decimal(0)) == samples[-1]
    assert threshold(samples, Decimal(1)) == -1.0


def test_the_rank_is_exact_where_floating_point_is_not():
    # 0.29 * 100 is 28.999999999999996 in floating point.
    assert threshold(list(range(100)), Decimal("0.29")) == 70.0


def test_no_samples_give_no_threshold():
    with pytest.raises(ThresholdsError, match="no clean samples"):
        threshold([], Decimal("0.01"))


@pytest.mark.parametrize("r", ["-0.01", "1.01", "NaN", "Infinity"])
def test_a_rate_outside_zero_to_one_is_refused(r):
    with pytest.raises(SettingError, match="between 0 and 1"):
        threshold([0.1], Decimal(r))


@pytest.mark.parametrize(
    ("r", "N", "answer"),
    [("0", 1, True), ("0.01", 99, False), ("0.01", 100, True), ("0.0099", 101, False), ("1", 1, True)],
)
def test_a_rate_below_one_over_n_is_not_resolvable(r, N, answer):
    assert resolvable(Decimal(r), N) is answer


@pytest.mark.parametrize(
    ("text", "r"), [("0.01", "0.01"), ("1%", "0.01"), (" 0.5 % ", "0.005"), ("0", "0"), ("100%", "1"), ("1", "1")]
)
def test_a_rate_is_read_as_a_decimal_or_a_percentage(text, r):
    assert parse_r(text) == Decimal(r)


@pytest.mark.parametrize("text", ["", "%", "one", "1.5", "101%", "-1%", "nan", "inf%", "1%%"])
def test_a_rate_that_makes_no_sense_is_refused(text):
    with pytest.raises(SettingError):
        parse_r(text)


def test_thresholds_at_a_rate_carry_their_samples():
    thresholds = thresholds_at(CALIBRATION, Statistic.GATED, Decimal("0.01"))
    assert thresholds.theta == dict.fromkeys(TRIPLES, 0.99)
    assert thresholds.samples == dict.fromkeys(TRIPLES, 100)
    assert thresholds.resolvable
    assert not thresholds.transferred


def test_thresholds_at_an_unresolvable_rate_are_the_maximum_and_say_so():
    thresholds = thresholds_at(CALIBRATION, Statistic.GATED, Decimal("0.001"))
    assert set(thresholds.theta.values()) == {1.0}
    assert not thresholds.resolvable


def test_one_triple_with_too_few_samples_makes_a_rate_unresolvable():
    clean = clean_frames({**SAMPLES, (Statistic.GATED, TRIPLES[1]): [0.1, 0.2]})
    assert not thresholds_at(replace(CALIBRATION, clean=clean), Statistic.GATED, Decimal("0.01")).resolvable


def test_a_triple_without_samples_has_no_theta():
    clean = clean_frames({**SAMPLES, (Statistic.GATED, TRIPLES[1]): []})
    thresholds = thresholds_at(replace(CALIBRATION, clean=clean), Statistic.GATED, Decimal(0))
    assert set(thresholds.theta) == {TRIPLES[0], TRIPLES[2]}


def test_a_single_sample_is_enough_for_a_theta():
    clean = clean_frames({**SAMPLES, (Statistic.GATED, TRIPLES[1]): [0.25]})
    thresholds = thresholds_at(replace(CALIBRATION, clean=clean), Statistic.GATED, Decimal(0))
    assert (thresholds.theta[TRIPLES[1]], thresholds.samples[TRIPLES[1]]) == (0.25, 1)


def test_a_statistic_without_samples_is_an_error():
    with pytest.raises(ThresholdsError, match="plain"):
        thresholds_at(CALIBRATION, Statistic.PLAIN, Decimal(0))


def test_a_calibration_of_the_same_kind_and_procedure_fits():
    other_vehicle = replace(KIND, focals_px=(718.9,) * 3)
    assert check_calibration(CALIBRATION, rig_kind=other_vehicle, procedure=PROCEDURE) is Similarity.SAME


def test_a_similar_kind_needs_no_transfer():
    second_year = replace(KIND, sizes_px=((1226, 370),) * 3, focals_px=(707.1,) * 3)
    assert check_calibration(CALIBRATION, rig_kind=second_year, procedure=PROCEDURE) is Similarity.SIMILAR


def test_another_rig_kind_is_refused_unless_a_transfer_is_asked_for():
    other = replace(KIND, baselines_m=(0.07, 0.30))
    with pytest.raises(ThresholdsError, match=r"another rig kind.*ask for a transfer"):
        check_calibration(CALIBRATION, rig_kind=other, procedure=PROCEDURE)
    assert check_calibration(CALIBRATION, rig_kind=other, procedure=PROCEDURE, transfer=True) is Similarity.OTHER


@pytest.mark.parametrize(
    ("procedure", "words"),
    [
        (replace(PROCEDURE, matcher="psmnet"), "matcher sgbm, not psmnet"),
        (replace(PROCEDURE, settings='{"range":256,"scale":0.5}'), "settings range 128, not 256"),
        (replace(PROCEDURE, settings='{"scale":0.5}'), "settings range 128, not None"),
        (replace(PROCEDURE, settings="half"), "settings .*not half"),
        (replace(PROCEDURE, settings="[1]"), r"settings .*not \[1\]"),
        (
            replace(PROCEDURE, counting_version=PROCEDURE.counting_version + 1),
            f"counting version {PROCEDURE.counting_version}, not {PROCEDURE.counting_version + 1}",
        ),
    ],
)
def test_measurements_made_otherwise_are_refused_by_name_even_for_a_transfer(procedure, words):
    with pytest.raises(ThresholdsError, match=words):
        check_calibration(CALIBRATION, rig_kind=KIND, procedure=procedure, transfer=True)


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
