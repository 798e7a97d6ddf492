"""Checking a store: every finished file is there, readable and whole, fits the others, and nothing else lies there."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from auditor.errors import StoreError
from auditor.model.calibration import PRIOR
from auditor.store.files import finished, is_part
from auditor.store.log import LOG
from auditor.store.marker import MARKER, UPGRADED
from auditor.store.packs.index import FOLDER, INDEX
from auditor.store.schema import ID_COLUMNS, TABLES
from auditor.store.store import Store
from auditor.store.tables import read_table

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

_BESIDE = ("pictures", "reports", LOG, INDEX, FOLDER)
"""Folders that are no tables; what lies in `reports` is nobody's business here, and `auditor verify` checks the log."""

_KILLED = "left by a run that was killed, and read by nobody: it can be deleted"


def check(store: Store) -> Iterator[str]:
    """One line for each thing that is wrong with a store."""
    for table in TABLES:
        for row_id in store.ids(table):
            place = _short(store, store.path(table, row_id))
            yield from (f"{place}: {problem}" for problem in check_file(store, table, row_id))
    yield from _of_folder(store)


def check_file(store: Store, table: str, row_id: str, *, hashed: bool = False) -> Iterator[str]:
    """One sentence for each thing that is wrong with a finished file.

    Of one that is `hashed`, and so is as it was written, only what ties it to others is read.
    """
    columns = dict.fromkeys((ID_COLUMNS[table], *_COUNTED.get(table, ("", ()))[1], *_named(table))) if hashed else None
    try:
        yield from _of_file(store, table, row_id, None if columns is None else [*columns])
    except StoreError as error:
        yield error.what


def _named(table: str) -> list[str]:
    return [column for column, _ in _NAMED.get(table, ())]


def _of_file(store: Store, table: str, row_id: str, columns: Sequence[str] | None) -> Iterator[str]:
    source = store.source(table, row_id)
    if not store.has(table, row_id):
        if table != "case_verdicts":
            yield "it is missing"
        return
    name = ID_COLUMNS[table]
    content = read_table(table, source, columns)
    others = set(content[name].unique().to_pylist()) - {row_id}
    if others:
        yield f"it has rows of {name} {', '.join(sorted(map(str, others)))[:80]}"
    if table in _COUNTED:
        yield from _of_rows(store, table, row_id, content)
    for column, other in _NAMED.get(table, ()):
        for named in sorted({value for value in content[column].unique().to_pylist() if value not in {None, PRIOR}}):
            if not store.has(other, named):
                yield f"there is no {column} {named} in {other}"


def _of_rows(store: Store, manifest: str, row_id: str, content: pa.Table) -> Iterator[str]:
    """What does not fit between a row that makes a file finished, and the rows of that file."""
    if len(content) != 1:
        yield f"it has {len(content)} rows in place of one"
        return
    row: dict[str, Any] = content.to_pylist()[0]
    table, columns = _COUNTED[manifest]
    declared = sum(row[column] or 0 for column in columns)
    try:
        there = len(read_table(table, store.source(table, row_id), [ID_COLUMNS[table]]))
    except StoreError:
        return  # it is missing or cannot be read: that is said of the file itself
    if there != declared:
        yield f"it counts {declared} rows of {table}, and there are {there}"


def _of_folder(store: Store) -> Iterator[str]:
    """What lies in the folder and does not belong to the store."""
    for path in sorted(store.folder.iterdir()):
        if path.name not in {MARKER, *_BESIDE, *TABLES}:
            abandoned = is_part(path) or path.name == UPGRADED
            yield f"{path.name}: {_KILLED if abandoned else 'it is not of a store'}"
    for table in TABLES:
        folder = store.folder / table
        known = {f"{row_id}.parquet" for row_id in store.ids(table)}
        there = {f"{row_id}.parquet" for row_id in finished(folder)}
        for path in sorted(folder.iterdir()) if folder.is_dir() else ():
            if path.name not in known:
                what = _KILLED if is_part(path) or path.name in there else "it is not of a store"
                yield f"{_short(store, path)}: {what}"
    measurements = set(store.ids("measurements"))
    for path in sorted(store.folder.glob("pictures/*")):
        if path.name not in measurements:
            yield f"{_short(store, path)}: {_KILLED}"
        else:
            yield from (f"{_short(store, one)}: {_KILLED}" for one in sorted(path.iterdir()) if is_part(one))


def _short(store: Store, path: Path) -> str:
    return path.relative_to(store.folder).as_posix()
