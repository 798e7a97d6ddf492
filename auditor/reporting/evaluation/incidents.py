"""Attacks that last, and false incidents, on the evaluation page: both methods."""

from collections.abc import Iterator, Mapping
from typing import Any

from auditor.reporting.evaluation.answers import Answers, names
from auditor.reporting.evaluation.page import LEFT_OUT, Cell, Grid, Rate, Row

_METHODS = {"paper": "E and Algorithm 2", "robust": "robust"}


def incident_grids(methods: Mapping[str, Answers]) -> dict[str, list[Grid]]:
    """False incidents of clean drives, then attacked intervals by each method."""
    shown = {method: answers for method, answers in methods.items() if answers.rows["incidents"]}
    window_kind = [_intervals(method, answers) for method, answers in shown.items()]
    return {
        "false_incidents": [_false(shown)] if shown else [],
        "intervals": [table for table in window_kind if table.rows],
    }


def _false(shown: Mapping[str, Answers]) -> Grid:
    modes = _modes(shown)

    def cells(answers: Answers) -> Iterator[Cell]:
        for mode in modes:
            row = _clean(answers, mode)
            if row is None:
                yield from (None, None, None)
            elif row["hours"] is None:  # no two frames, so no time between them
                yield from (f"{row['incidents']:,}", None, None)
            else:
                yield f"{row['incidents']:,} in {row['hours']:.3f} h"
                yield from (f"{row[name]:,.0f}" for name in ("incidents_an_hour", "at_most_an_hour"))

    return Grid(
        title="False incidents of clean driving, all sensors, r = 1 %",
        groups=tuple((LEFT_OUT[mode], 3) for mode in modes),
        columns=("incidents", "an hour", "at most") * len(modes),
        rows=tuple(Row(_METHODS[method], tuple(cells(answers))) for method, answers in shown.items()),
    )


def _intervals(method: str, answers: Answers) -> Grid:
    modes = _modes({method: answers})
    rows = [row for row in answers.rows["incidents"] if row["attacked"]]
    found = {(row["left_out"], tuple(row["attacked"]), row["variant"]): row for row in rows}
    kinds = list(dict.fromkeys((attacked, variant) for _, attacked, variant in found))

    def cells(kind: tuple[tuple[int, ...], str]) -> Iterator[Cell]:
        for mode in modes:
            row = found.get((mode, *kind))
            yield _rate(row, "found", "low", "high") if row else None
            yield _rate(row, "named", "naming_low", "naming_high") if row else None
            yield f"{row['delay_s']:.1f} s" if row and row["delay_s"] is not None else None

    return Grid(
        title=f"Attacks of one second, and lasting ones, {_METHODS[method]}, all sensors, r = 1 %",
        groups=tuple((LEFT_OUT[mode], 3) for mode in modes),
        columns=("found", "named", "after") * len(modes),
        rows=tuple(
            Row(f"{names(attacked)}, {variant}", tuple(cells((attacked, variant)))) for attacked, variant in kinds
        ),
    )


def _modes(shown: Mapping[str, Answers]) -> list[str]:
    return [mode for mode in LEFT_OUT if any(_clean(answers, mode) for answers in shown.values())]


def _clean(answers: Answers, mode: str) -> Mapping[str, Any] | None:
    rows = (row for row in answers.rows["incidents"] if row["left_out"] == mode and not row["attacked"])
    return next(rows, None)


def _rate(row: Mapping[str, Any], counted: str, low: str, high: str) -> Rate:
    return Rate(row[counted], row["intervals"], row[low], row[high], row["resolvable"])
