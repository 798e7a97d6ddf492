"""The largest attacks that stay unseen, as tables of the evaluation page."""

from collections.abc import Iterator, Mapping
from typing import Any

from auditor.reporting.evaluation.answers import Rows, names
from auditor.reporting.evaluation.page import LEFT_OUT, Grid, Row

_COLUMNS = ("tried", "sizes", "knows nothing", "knows the thresholds")


def unseen_grids(rows: Rows) -> Iterator[Grid]:
    """A table for each sensor, by thresholds from as far away as there were any."""
    modes = [mode for mode in LEFT_OUT if any(row["left_out"] == mode for row in rows)]
    chosen = [row for row in rows if row["left_out"] == modes[-1]]
    for attacked in dict.fromkeys(tuple(row["attacked"]) for row in chosen):
        yield Grid(
            title=f"On {names(attacked)}; {LEFT_OUT[modes[-1]]}",
            groups=(("", 2), ("largest that stays unseen, of one who", 2)),
            columns=_COLUMNS,
            rows=tuple(_row(row) for row in chosen if tuple(row["attacked"]) == attacked),
        )


def _row(row: Mapping[str, Any]) -> Row:
    sizes = f"{row['smallest']:g} to {row['largest']:g}"
    unseen = (_told(row, row[name]) for name in ("unseen_in_half", "unseen_at_best"))
    return Row(f"{row['attack']}, {row['varied']}", (f"{row['tried']:,}", sizes, *unseen))


def _told(row: Mapping[str, Any], size: float) -> str:
    """A size in words: below the smallest, or all that was tried."""
    if not size:
        return f"below {row['smallest']:g}"
    return f"{size:g} and more" if size == row["largest"] else f"{size:g}"
