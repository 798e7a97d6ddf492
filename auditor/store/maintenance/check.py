"""Checking a store: every finished file is there, readable and whole, fits the others, and nothing else lies there."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from auditor.errors import StoreError
from auditor.model.calibration import PRIOR
from auditor.store.files import finished, is_part
from auditor.store.log import LOG
from auditor.store.marker import MARKER, UPGRADED
from auditor.store.packs.index import FOLDER, INDEX
from auditor.store.schema import ID_COLUMNS, TABLES
from auditor.store.store import Store
from auditor.store.tables import listed, read_table

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
    try:
        yield from _of_file(store, table, row_id, _tying(table) if hashed else None)
    except StoreError as error:
        yield error.what


def check_packed(store: Store, table: str, row_ids: Collection[str]) -> Iterator[tuple[str, str]]:
    """As `check_file` of ids whose rows are in packs that are as they were written: the id, and a sentence.

    A pack is read once for all of its ids. Raises StoreError.
    """
    packed = store.packs.ids(table)
    if table != "case_verdicts":
        yield from ((one, "it is missing") for one in row_ids if one not in packed)
    if not _tying(table)[1:]:
        return  # what a pack has of an id is by that id
    rows: dict[str, list[dict[str, Any]]] = {one: [] for one in row_ids if one in packed}
    for row in _packed_rows(store, table, rows):
        rows[row[ID_COLUMNS[table]]].append(row)
    counts = _packed_counts(store, _COUNTED[table][0]) if table in _COUNTED else {}
    for row_id, of_id in rows.items():
        if table in _COUNTED:
            yield from ((row_id, what) for what in _of_rows(store, table, row_id, of_id, counts.get(row_id)))
        for column, other in _NAMED.get(table, ()):
            yield from ((row_id, what) for what in _of_names(store, column, other, {row[column] for row in of_id}))


def _packed_rows(store: Store, table: str, wanted: Mapping[str, object]) -> Iterator[dict[str, Any]]:
    for path in store.packs.paths(table):
        here = [one for one in _of_pack(store, table, path) if one in wanted]
        content = read_table(table, path, _tying(table))
        own = pc.is_in(content[ID_COLUMNS[table]], pa.array(here, pa.string()))
        yield from listed(content.filter(own), path)


def _packed_counts(store: Store, table: str) -> dict[str, int]:
    """How many rows packs have of each id that has no file of its own."""
    alone, column, found = {*finished(store.folder / table)}, ID_COLUMNS[table], dict[str, int]()
    for path in store.packs.paths(table):
        counted = Counter(read_table(table, path, [column])[column].to_pylist())
        found |= {one: counted[one] for one in _of_pack(store, table, path) if one not in alone}
    return found


def _of_pack(store: Store, table: str, path: Path) -> list[str]:
    """The ids whose rows are taken from a pack: not those that are removed, or that an earlier pack has."""
    packs = store.packs
    return [one for one in packs.members(path) if (found := packs.member(table, one)) and found[0] == path]


def _tying(table: str) -> list[str]:
    """The columns of a table that tie its rows to those of others, and its id."""
    named = (column for column, _ in _NAMED.get(table, ()))
    return [*dict.fromkeys((ID_COLUMNS[table], *_COUNTED.get(table, ("", ()))[1], *named))]


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
        yield from _of_rows(store, table, row_id, content.select(_tying(table)).to_pylist())
    for column, other in _NAMED.get(table, ()):
        yield from _of_names(store, column, other, content[column].unique().to_pylist())


def _of_names(store: Store, column: str, other: str, named: Iterable[str | None]) -> Iterator[str]:
    """What is named and is not there."""
    for name in sorted({one for one in named if one is not None and one != PRIOR}):
        if not store.has(other, name):
            yield f"there is no {column} {name} in {other}"


def _of_rows(
    store: Store, manifest: str, row_id: str, rows: Sequence[dict[str, Any]], there: int | None = None
) -> Iterator[str]:
    """What does not fit between a row that makes a file finished, and the rows of that file, where they are counted."""
    if len(rows) != 1:
        yield f"it has {len(rows)} rows in place of one"
        return
    table, columns = _COUNTED[manifest]
    declared = sum(rows[0][column] or 0 for column in columns)
    if there is None:
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
