"""The benchmark that varies every parameter varies it, and nothing else."""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from auditor.model.parameter import digest, parameter
from tests.benchmarks.parameter_effects import FACTORS, change, keep_all, variants, varied


@dataclass(frozen=True)
class Group:
    share: float = parameter(-0.5, unit="share", source="somebody")
    fewest: int = parameter(100, unit="px", source="somebody")
    window: tuple[int, int] = parameter((5, 8), unit="px", source="somebody")
    nothing: float = parameter(0.0, unit="px", source="somebody")


@pytest.mark.parametrize(
    ("value", "lower", "higher"), [(10, 8, 12), (7, 6, 8), (2, 1, 3), (1, 0, 2), (0.5, 0.4, 0.6), (-0.5, -0.4, -0.6)]
)
def test_whole_numbers_change_by_one_at_least(value: float, lower: float, higher: float) -> None:
    assert [varied(value, factor) for factor in FACTORS] == pytest.approx([lower, higher])
    assert type(varied(value, FACTORS[0])) is type(value)


def test_every_number_but_zero_is_varied_by_itself() -> None:
    tried = list(variants([Group()]))
    assert [(one.name, one.place) for one in tried[::2]] == [
        ("share", None),
        ("fewest", None),
        ("window", 0),
        ("window", 1),
    ]
    assert {one.factor for one in tried} == set(FACTORS)


def test_a_changed_group_differs_in_that_number_alone() -> None:
    group = Group()
    change(group, "window", 1, 1.2)
    assert group == replace(Group(), window=(5, 10))
    changed = [Group() for _ in variants([Group()])]
    for group, one in zip(changed, variants([Group()]), strict=True):
        change(group, one.name, one.place, one.factor)
    assert len({digest(group) for group in (Group(), *changed)}) == len(changed) + 1


def test_a_file_of_another_commit_is_not_gone_on_with(tmp_path: Path) -> None:
    kept = tmp_path / "judging.jsonl"
    before = json.dumps({"variant": None, "value": None, "found": {"raised": 1}, "commit": "0000000", "date": "then"})
    kept.write_text(before + "\n")
    with pytest.raises(SystemExit, match="it is of commit 0000000"):
        keep_all(kept, lambda _: {"raised": 2}, {"group": Group()}, ())
    assert kept.read_text() == before + "\n"
