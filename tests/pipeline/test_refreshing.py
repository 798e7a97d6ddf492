"""What a refresh decides of logs in memory: which share refuses a night, and what a person is told to do."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

import pytest

from auditor.identification.refreshing.drives import Drive, DriveScores, DriveSource
from auditor.model.calibration import CleanFrames
from auditor.pipeline.refreshing.choosing import Choice, LearntRecording, _within_limits
from auditor.pipeline.refreshing.pool import Log
from auditor.store.versions.decisions import Decision, RefreshOutcome, next_steps
from auditor.store.versions.records import UsedRecording

DAY = date(2026, 3, 1)
CLEAN = DriveScores(40, 0, 0, 8, 0, 0)
EMPTY = CleanFrames("", (), {}, {}, {})  # type: ignore[arg-type]


def used(name: str, day: int | None, *, reason: str = "", raised: bool = False) -> UsedRecording:
    when = None if day is None else DAY + timedelta(days=day)
    return UsedRecording(
        name, name, name, "car", when, not raised, reason, 40, raised, findings_by_others=5 if raised else None
    )


def chosen(name: str, day: int, *, named: bool = False, new: bool = False) -> LearntRecording:
    one = used(name, day, reason="named clean" if named else "judged clean")
    return LearntRecording(one, Drive(DriveSource(name), EMPTY), CLEAN, CLEAN if new else None)


def choice(taken: Sequence[LearntRecording], out: Sequence[UsedRecording]) -> Choice:
    return Choice(tuple(taken), tuple(out), sum(one.new for one in taken), 0)


def test_what_waits_counts_only_as_long_as_its_days_are_learnt_from() -> None:
    taken = [chosen("named", 0, named=True), *(chosen(f"c{day}", day) for day in range(20, 30))]
    old = [used(f"old{day}", day, raised=True) for day in range(10)]
    late = [used("late", 25, raised=True), used("undated", None, raised=True)]
    assert choice(taken, [*old, *late]).waiting_of == (2, 12)
    assert choice(taken[:1], [*old, *late]).waiting_of == (12, 13), "where all are named no day is too old"


def test_what_was_in_force_and_is_raised_now_waits_and_is_none_of_the_new_ones() -> None:
    some = choice([chosen("new", 1, new=True), chosen("before", 0)], [])
    left = some.without({0: "odd", 1: "raised by the others"})
    assert (left.judged, left.raised, left.chosen) == (1, 1, ())
    assert [one.look_at for one in left.out] == [True, True]


def test_what_is_too_many_says_how_many_a_person_named_clean_besides() -> None:
    def log(name: str, vehicle: str, day: int) -> Log:
        return Log(replace(used(name, day), vehicle=vehicle), lambda: EMPTY)

    many = [log(f"a{day}", "a", day) for day in range(6)]
    rest = [log(f"{vehicle}{day}", vehicle, 10 + day) for vehicle in "bc" for day in range(2)]
    named = [log(f"named{day}", "a", 20 + day) for day in range(4)]
    for beside, says in ((named, " (4 of it that a person named clean are not counted)"), (rest[:1], "")):
        left, out = _within_limits([*many, *rest], beside, [])
        assert len(left) + len(out) == 10
        assert {one.reason for one in out} == {
            f"its vehicle has 2 others, and no vehicle has more than its share{says}"
        }


DECISION = Decision("kind", "sgbm", RefreshOutcome.HELD, ("why",), "c" * 32, "b" * 32, "b" * 32, False, ())


@pytest.mark.parametrize(
    ("decision", "commands"),
    [
        (
            DECISION,
            [
                f"auditor calibration diff {'b' * 12} {'c' * 12} --store 'my fleet'",
                f"auditor calibration promote {'c' * 12} --store 'my fleet'",
            ],
        ),
        (
            replace(DECISION, decided=RefreshOutcome.REFUSED, recordings=(used("it's.mcap", 1, raised=True),)),
            [
                "auditor calibration quarantine --store 'my fleet'",
                "auditor label 'it'\"'\"'s.mcap' --clean --store 'my fleet'",
                "auditor label 'it'\"'\"'s.mcap' --sensor S_NUMBER --attack KIND --store 'my fleet'",
            ],
        ),
        (
            replace(DECISION, decided=RefreshOutcome.PROMOTED, provisional=True),
            [f"auditor calibration promote {'c' * 12} --store 'my fleet'"],
        ),
        (
            replace(DECISION, decided=RefreshOutcome.WAITING, calibration_id=None, before=None),
            ["auditor refresh RECORDING --clean --store 'my fleet'"],
        ),
        (replace(DECISION, decided=RefreshOutcome.PROMOTED), []),
        (replace(DECISION, decided=RefreshOutcome.NOTHING_NEW), []),
    ],
)
def test_a_person_is_told_the_commands_of_what_to_do(decision: Decision, commands: list[str]) -> None:
    assert [step.command for step in next_steps(decision, Path("my fleet"))] == commands


def test_the_first_version_that_is_held_has_no_version_to_compare_it_with() -> None:
    [step] = next_steps(replace(DECISION, before=None), Path("s"))
    assert step.command == f"auditor calibration promote {'c' * 12} --store s"
