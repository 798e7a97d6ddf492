"""Rows of a store that cannot be: counts that no measurement gives, and rows tied to others that are not there."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from auditor.errors import StoreError
from auditor.model.calibration import PRIOR
from auditor.model.checks import SIGNED_CHECKS
from auditor.model.optics.common_view import view_size_px
from auditor.model.rig import LIDAR, Rig
from auditor.store.packs.index import finished_files
from auditor.store.schema import id_column
from auditor.store.store import Store
from auditor.store.tables import read_table, rows_of_files, stream_tables

_WITHIN = (
    ("inconsistent_px", "valid_px"),
    ("gated_valid_px", "valid_px"),
    ("gated_inconsistent_px", "gated_valid_px"),
    ("gated_inconsistent_px", "inconsistent_px"),
    ("out_of_range_px", "valid_px"),
)
"""Counts that are parts of others."""

_SHARES = ("saturated_share", "textureless_share", "unmatched_share", "compared_share", "compared_by_two_share")
_OF_CELLS = ("frame", "check_name", "rows", "columns", "valid", "total")
_SIGNED = frozenset(str(check) for check in SIGNED_CHECKS)
_MOST_IN_CELL = 127
_BRIGHTEST = 255.0
_EDGES = ("left_px", "top_px", "right_px", "bottom_px")


def implausible(store: Store, measurement_id: str, rig: Rig) -> Iterator[tuple[str, str]]:
    """Tables of a measurement, each with a sentence on what in it cannot be. Raises StoreError."""
    width, height = view_size_px(rig)
    names = [*{name for pair in _WITHIN for name in pair}, *_SHARES, "level", "returns", "frame"]
    frames = read_table("frames", store.source("frames", measurement_id), names)
    yield from (("frames", what) for what in _of_frames(frames, width * height))
    yield from (("cells", what) for what in _of_cells(store, measurement_id))
    regions = read_table("regions", store.source("regions", measurement_id), ["frame", "view", *_EDGES, "share"])
    yield from (("regions", what) for what in _of_regions(regions, width, height))


def _of_frames(frames: pa.Table, area_px: int) -> Iterator[str]:
    values = {name: _flat(frames, name) for name in frames.column_names}
    for part, whole in _WITHIN:
        if len(values[part]) == len(values[whole]) and (values[part] > values[whole]).any():
            yield f"{part} is larger than {whole}, of which it is a part"
    for name in {name for pair in _WITHIN for name in pair}:
        if _outside(values[name], 0, area_px):
            yield f"{name} is not within 0 and the {area_px} pixels of the image"
    for name, most in (*((name, 1.0) for name in _SHARES), ("level", _BRIGHTEST), ("returns", np.inf)):
        if _outside(values[name], 0, most):
            yield f"{name} is not within 0 and {most:g}"
    if (np.diff(values["frame"]) <= 0).any():
        yield "its frames are not in their order"


def _of_cells(store: Store, measurement_id: str) -> Iterator[str]:
    for cells in stream_tables(store.source("cells", measurement_id), _OF_CELLS):
        row, problem = _first_wrong(cells)
        if problem:
            yield f"frame {cells['frame'][row].as_py()}: {problem}"
            return


def _first_wrong(cells: pa.Table | pa.RecordBatch) -> tuple[int, str]:
    """The first row of some cells that cannot be, and why; an empty reason where all of them can."""
    rows, columns = (np.asarray(cells[name], dtype=np.int64) for name in ("rows", "columns"))
    sizes = rows * columns
    (valid, valid_sizes), (total, total_sizes) = (_bytes_of(cells[name]) for name in ("valid", "total"))
    misshapen = np.flatnonzero((valid_sizes != sizes) | (total_sizes != sizes))
    whole = int(misshapen[0]) if len(misshapen) else len(sizes)
    counted = np.array([name not in _SIGNED for name in cells["check_name"].to_pylist()[:whole]], bool)
    wrong = _over(valid, total, sizes[:whole], counted)
    if len(wrong):
        return int(wrong[0]), "a cell counts more than it can hold"
    if whole < len(sizes):
        return whole, f"a grid does not have its {rows[whole]} x {columns[whole]} cells"
    return 0, ""


def _over(
    valid: NDArray[np.uint8], total: NDArray[np.uint8], sizes: NDArray[np.int64], counted: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """The rows of which a cell counts more than it can hold; empty grids have none.

    A negative total is 128 or more as an unsigned number, and so larger than what a cell may hold.
    """
    there = sizes > 0
    starts = np.cumsum(sizes[there]) - sizes[there]
    if not len(starts):
        return np.empty(0, np.int64)
    count = int(sizes.sum())
    most = np.maximum.reduceat(valid[:count], starts) > _MOST_IN_CELL
    larger = np.logical_or.reduceat(total[:count] > valid[:count], starts)
    rows = np.flatnonzero(there)[most | (larger & counted[there])]
    return np.asarray(rows, dtype=np.int64)


def _bytes_of(column: pa.Array | pa.ChunkedArray) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """The bytes of all values of a column, one after the other, and the length of each."""
    pieces = []
    for part in column.chunks if isinstance(column, pa.ChunkedArray) else [column]:
        _, offsets, data = part.buffers()
        places = np.frombuffer(offsets, np.int32)[part.offset : part.offset + len(part) + 1]
        if len(part) and data is not None:
            pieces.append(np.frombuffer(data, np.uint8)[places[0] : places[-1]])
    whole = pieces[0] if len(pieces) == 1 else np.concatenate([np.empty(0, np.uint8), *pieces])
    return whole, np.asarray(pc.fill_null(pc.binary_length(column), 0), dtype=np.int64)


def _of_regions(regions: pa.Table, width: int, height: int) -> Iterator[str]:
    left, top, right, bottom = (_flat(regions, name) for name in _EDGES)
    in_image = (_flat(regions, "view") > LIDAR) & (width > 0)  # what a LiDAR says has no pixels
    outside = (left < 0) | (top < 0) | (right > width * in_image) | (bottom > height * in_image)
    if (outside | (in_image & ((left >= right) | (top >= bottom)))).any():
        yield f"a region lies outside the image of {width} x {height} px"
    if _outside(_flat(regions, "share"), 0, 1):
        yield "share is not within 0 and 1"


def _outside(values: NDArray[np.float64], least: float, most: float) -> bool:
    return bool(((values < least) | (values > most)).any())  # NaN, which is NULL, is neither


def _flat(table: pa.Table, name: str) -> NDArray[np.float64]:
    """The values of a column, of all lists, as floats; NULL is NaN."""
    column = table[name].combine_chunks()
    values = column.flatten() if pa.types.is_list(column.type) else column
    return np.asarray(values.cast("float64").to_numpy(zero_copy_only=False), dtype=np.float64)


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
    columns = [id_column(table), *(counted[1] if counted else ()), *(column for column, _ in named)]
    rows: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for row in rows_of_files(table, finished_files(store.packs, store.folder, table, there), [*dict.fromkeys(columns)]):
        rows[row[id_column(table)]].append(row)
    counts = _counts(store, counted[0], there) if counted else {}
    for row_id, of_id in rows.items():
        if counted:
            yield from ((row_id, what) for what in _of_counts(*counted, of_id, counts.get(row_id)))
        for column, other in named:
            yield from ((row_id, what) for what in _of_names(store, column, other, {row[column] for row in of_id}))


def _counts(store: Store, table: str, row_ids: Iterable[str]) -> dict[str, int]:
    """How many rows there are of each id, but for files that cannot be read, of which that is said."""
    column = id_column(table)
    files = finished_files(store.packs, store.folder, table, [one for one in row_ids if store.has(table, one)])
    totals = Counter[str]()
    for path in files.packs:
        totals.update(read_table(table, path, [column])[column].to_pylist())
    counts = {one: totals[one] for path in files.packs for one in store.packs.members(path) if one not in files.hidden}
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
