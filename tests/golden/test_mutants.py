"""The benchmark of mutants draws from what is there."""

from tests.benchmarks.mutants import DEFAULT_SEED, draw


def test_every_equivalent_mutant_that_is_listed_is_a_mutant_of_today_and_a_hundred_others_are_drawn():
    assert len(draw(DEFAULT_SEED, 100)) == 100
