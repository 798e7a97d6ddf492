"""The table of ablations leaves out rules that the judge has, each under the name that it has there."""

from auditor.identification import drive_level
from tests.benchmarks.ablations import left_out, rules


def test_each_rule_can_be_left_out_and_is_there_again() -> None:
    names = [rule.name for rule in rules()]
    assert len(names) == len(set(names)) > 40
    usual = drive_level.own_level
    for rule in rules():
        with left_out(rule):
            pass
    assert drive_level.own_level is usual
