"""What ties the rows of one table of a store to those of others: rows that are counted, and ids that are named."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any

from auditor.errors import StoreError
from auditor.model.calibration import PRIOR
from auditor.store.packs.index import finished_files
from auditor.store.schema import ID_COLUMNS
from auditor.store.store import Store
from auditor.store.tables import read_table, rows_of_files

_COUNTED = {
    "measurements": ("frames", ("frames",)),
    "judgements": ("verdicts", ("clean", "attacked", "unidentified", "suspect", "not_auditable")),
    "evaluations": ("cases", ("cases",)),
    "object_evaluations": ("object_cases", ("cases",)),
}
"""By manifest: the table whose rows it counts, and the columns whose sum that is."""

_NAMED = {
    "measurements": (("recording_id", "recordings"), ("rig_id", "rigs")),
    "judgements": (("measurement_id", "measurements"), ("calibration_id", "calibrations")),
    "calibration_versions": (("calibration_id", "calibrations"),),
    "calibration_history": (("calibration_id", "calibrations"),),
    "calibration_conditions": (("calibration_id", "calibrations"),),
    "labels": (("recording_id", "recordings"),),
    "given_labels": (("recording_id", "recordings"),),
}
"""By table: the columns that name rows of other tables."""


def untied(store: Store, table: str, row_ids: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Ids of a table whose rows do not fit others, each with a sentence; the rows are as they were written.

    A pack is read once for all of its ids. Raises StoreError.
    """
    there = [one for one in row_ids if store.has(table, one)]
    if table != "case_verdicts":
        yield from ((one, "it is missing") for one in sorted({*row_ids} - {*there}))
    named, counted = _NAMED.get(table, ()), _COUNTED.get(table)
    if not named and counted is None:
        return
    columns = [ID_COLUMNS[table], *(counted[1] if counted else ()), *(column for column, _ in named)]
    rows: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for row in rows_of_files(table, finished_files(store.packs, store.folder, table, there), [*dict.fromkeys(columns)]):
        rows[row[ID_COLUMNS[table]]].append(row)
    counts = _counts(store, counted[0], there) if counted else {}
    for row_id, of_id in rows.items():
        if counted:
            yield from ((row_id, what) for what in _of_counts(*counted, of_id, counts.get(row_id)))
        for column, other in named:
            yield from ((row_id, what) for what in _of_names(store, column, other, {row[column] for row in of_id}))


def _counts(store: Store, table: str, row_ids: Iterable[str]) -> dict[str, int]:
    """How many rows there are of each id, but for files that cannot be read, of which that is said."""
    column = ID_COLUMNS[table]
    files = finished_files(store.packs, store.folder, table, [one for one in row_ids if store.has(table, one)])
    found = Counter[str]()
    for path in files.packs:
        found.update(read_table(table, path, [column])[column].to_pylist())
    counts = {one: found[one] for path in files.packs for one in store.packs.members(path) if one not in files.hidden}
    for path in files.alone:
        with suppress(StoreError):
            counts[path.stem] = len(read_table(table, path, [column]))
    return counts


def _of_names(store: Store, column: str, other: str, named: Iterable[str | None]) -> Iterator[str]:
    """What is named and is not there."""
    for name in sorted({one for one in named if one is not None and one != PRIOR}):
        if not store.has(other, name):
            yield f"there is no {column} {name} in {other}"


def _of_counts(table: str, columns: Sequence[str], rows: Sequence[dict[str, Any]], there: int | None) -> Iterator[str]:
    """What does not fit between a row that makes a file finished, and the rows of that file."""
    if len(rows) != 1:
        yield f"it has {len(rows)} rows in place of one"
        return
    declared = sum(rows[0][column] or 0 for column in columns)
    if there not in {None, declared}:
        yield f"it counts {declared} rows of {table}, and there are {there}"
