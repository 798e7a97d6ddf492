"""Parquet files of the store's tables: written with their schema, read one by one."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from operator import itemgetter
from pathlib import Path
from typing import Any, TypeVar

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from auditor.errors import StoreError
from auditor.model.text import storable
from auditor.store.files import Announce, PartFile, WrittenFile, part_file
from auditor.store.packs.index import Files, PackPart
from auditor.store.schema import SCHEMA_VERSION, TableSchema, id_column, newer_version, table_schema, version_of

Row = Mapping[str, object]
T = TypeVar("T")


@dataclass(frozen=True)
class StoredRows:
    """The rows of one id, wherever they lie when they are read; `path` is where a file of its own would."""

    path: Path
    find: Callable[[], Path | PackPart]

    def __str__(self) -> str:
        return str(self.path)


Source = Path | StoredRows

_UNREADABLE = (OSError, pa.ArrowException, ValueError, KeyError, OverflowError, MemoryError)
"""What Arrow raises on a damaged file, as where a name is not UTF-8 or a length is any number."""

BATCH_ROWS = 256
ROW_GROUP_BATCHES = 32
"""Batches in a row group; of tables whose rows hold whole grids it is one."""

FEW_ROWS = BATCH_ROWS * ROW_GROUP_BATCHES
"""Rows that one thread reads: to share the columns of a small file among threads takes a third more CPU."""

GROUP_BYTES = 32 << 20
"""A row group ends with so many bytes where its rows are long, as those of calibrations are."""

KEPT_GROUPS = 4
"""Row groups of packs that stay in memory: what is judged reads two tables, each in the order of ids."""


LEVEL = 3
LEVEL_OF_GRIDS = 1
"""Levels of zstd. Grids are nine tenths of a store. At 9 they take 5 % less room, and writing them 2.5 ms of CPU a
frame more with three cameras; at 3 more of both. Differences along rows, or from frame to frame, save nothing."""


class TableWriter:
    """Rows leave in row groups of so many batches of BATCH_ROWS, so memory stays bounded however many come."""

    def __init__(self, schema: TableSchema, part: PartFile) -> None:
        self._schema = schema.arrow
        self._group_batches = 1 if schema.holds_grids else ROW_GROUP_BATCHES
        self._part = part
        self._rows: list[Row] = []
        self._batches: list[pa.RecordBatch] = []
        with part.reporting():
            self._parquet = pq.ParquetWriter(
                part.file,
                schema.arrow,
                compression="zstd",
                compression_level=LEVEL_OF_GRIDS if schema.holds_grids else LEVEL,
                use_dictionary=schema.dictionary_columns,
                column_encoding=schema.encodings,
            )

    def add(self, row: Row) -> None:
        """Take one row; keys are column names."""
        self._rows.append(row)
        if len(self._rows) == BATCH_ROWS:
            self._make_batch()

    def add_columns(self, columns: Mapping[str, Sequence[object]]) -> None:
        """Take rows by their columns, all of the schema's, which are at hand: many rows cost less so."""
        self._make_batch()
        rows = len(columns[self._schema.names[0]])
        for first in range(0, rows, BATCH_ROWS):
            values = [columns[name][first : first + BATCH_ROWS] for name in self._schema.names]
            arrays = [pa.array(one, field.type) for one, field in zip(values, self._schema, strict=True)]
            self._batches.append(pa.RecordBatch.from_arrays(arrays, schema=self._schema))
            self._end_group()

    def commit(self, announce: Announce | None = None) -> WrittenFile:
        """Write what is left and the footer, and give the file its place within the block of `announce`."""
        self._make_batch()
        self._write_group()
        with self._part.reporting():
            self._parquet.close()
        return self._part.commit(announce)

    def abandon(self) -> None:
        """Let go of the file, whatever state it is in."""
        with suppress(OSError):  # the part file goes; what a full disk did not take is of no interest any more
            self._parquet.close()

    def _make_batch(self) -> None:
        if self._rows:
            self._batches.append(_batch(self._rows, self._schema))
            self._rows = []
        self._end_group()

    def _end_group(self) -> None:
        long = sum(batch.nbytes for batch in self._batches) >= GROUP_BYTES
        if len(self._batches) == self._group_batches or long:
            self._write_group()

    def _write_group(self) -> None:
        if self._batches:
            table = pa.Table.from_batches(self._batches, schema=self._schema)
            with self._part.reporting():
                self._parquet.write_table(table, row_group_size=len(table))
            self._batches = []


def _batch(rows: list[Row], schema: pa.Schema) -> pa.RecordBatch:
    """Rows as a batch; text that UTF-8 cannot hold, as of a file's name, is written out."""
    try:
        return pa.RecordBatch.from_pylist(rows, schema=schema)
    except UnicodeEncodeError:
        return pa.RecordBatch.from_pylist(_storable(rows), schema=schema)


def _storable(value: Any) -> Any:  # noqa: ANN401 - whatever a cell holds
    if isinstance(value, str):
        return storable(value)
    if isinstance(value, Mapping):
        return {name: _storable(item) for name, item in value.items()}
    return [_storable(item) for item in value] if isinstance(value, list | tuple) else value


@contextmanager
def writing(table: str, path: Path) -> Iterator[TableWriter]:
    """A file of a table under way, discarded at the end of the block unless it was committed. Raises StoreError."""
    with part_file(path) as part:
        writer = TableWriter(table_schema(table), part)
        try:
            yield writer
        finally:
            writer.abandon()


def write_rows(table: str, path: Path, rows: Iterable[Row], announce: Announce | None = None) -> WrittenFile:
    """Write a file of a table in one go, and give it its place within the block of `announce`. Raises StoreError."""
    with writing(table, path) as writer:
        for row in rows:
            writer.add(row)
        return writer.commit(announce)


def row_groups(path: Path) -> int:
    """How many row groups a file of a table has. Raises StoreError."""
    with _reporting(path), pq.ParquetFile(path) as file:
        _check_version(file.schema_arrow, path)
        return int(file.num_row_groups)


def read_table(
    table: str, source: Source, columns: Sequence[str] | None = None, *, group: int | None = None
) -> pa.Table:
    """Read the rows of a file of a table, or of a `group` of them, or of an id; columns that it lacks are NULL.

    Raises StoreError where it is missing, torn, or of another version.
    """
    schema = table_schema(table).arrow
    wanted = schema if columns is None else pa.schema([schema.field(name) for name in columns])
    stored = _read(source, lambda place: _stored(place, wanted.names, group, source))
    present = set(stored.column_names)
    arrays = [
        stored.column(field.name).cast(field.type) if field.name in present else pa.nulls(len(stored), field.type)
        for field in wanted
    ]
    return pa.Table.from_arrays(arrays, schema=wanted)


def _stored(place: Path | PackPart, columns: Sequence[str], group: int | None, source: Source) -> pa.Table:
    """Those of some columns that a file, a group of it or the part of a pack has."""
    if isinstance(place, PackPart):
        return _of_part(place, columns, source)
    with pq.ParquetFile(place) as file:
        schema: pa.Schema = file.schema_arrow
        _check_version(schema, source)
        present, threads = _common(columns, schema), file.metadata.num_rows > FEW_ROWS
        if group is None:
            return file.read(columns=present, use_threads=threads)
        return file.read_row_group(group, columns=present, use_threads=threads)


def _of_part(part: PackPart, columns: Sequence[str], source: Source) -> pa.Table:
    """Those of some columns that a pack has, of the rows of one id."""
    schema = _footer(part.path)[1]
    _check_version(schema, source)
    present = _common(columns, schema)
    if part.group is None:
        return schema.empty_table().select(present)
    group = _group(part.path, part.group, (part.column, *(name for name in present if name != part.column)))
    return _rows_of(group, pc.equal(group[part.column], part.row_id)).select(present)


def _rows_of(group: pa.Table, own: pa.ChunkedArray) -> pa.Table:
    """The rows that are an id's own; nothing is copied where they follow one another, as they do in packs."""
    count = pc.sum(own).as_py() or 0
    rows = slice(first := max(0, pc.index(own, pa.scalar(value=True)).as_py()), first + count)
    if pc.sum(own[rows]).as_py() in {count, None}:
        return group[rows]
    return group.filter(own)


def _common(columns: Sequence[str], schema: pa.Schema) -> list[str]:
    names = set(schema.names)
    return [name for name in columns if name in names]


@lru_cache(maxsize=KEPT_GROUPS)
def _group(pack: Path, group: int, columns: tuple[str, ...]) -> pa.Table:
    """Some columns of a row group of a pack. It has the rows of several ids, which are mostly asked for in order."""
    with pq.ParquetFile(pack, metadata=_footer(pack)[0]) as file:
        return file.read_row_group(group, columns=list(columns))


@lru_cache(maxsize=32)
def _footer(pack: Path) -> tuple[pq.FileMetaData, pa.Schema]:
    """The footer of a pack, whose name is a hash of its content: it is long, and asked for with each id."""
    footer = pq.read_metadata(pack)
    return footer, footer.schema.to_arrow_schema()


def stream_rows(table: str, source: Source) -> Iterator[dict[str, Any]]:
    """The rows of a file of a table, or of an id, some at a time; its columns are those it was written with.

    Raises StoreError.
    """
    for rows in stream_tables(source, table_schema(table).arrow.names):
        yield from rows.to_pylist()


def stream_tables(source: Source, names: Sequence[str]) -> Iterator[pa.Table | pa.RecordBatch]:
    """Some columns of a file of a table, or of an id, some rows at a time. Raises StoreError."""

    def opened(place: Path | PackPart) -> pa.Table | pq.ParquetFile:
        return _of_part(place, names, source) if isinstance(place, PackPart) else pq.ParquetFile(place)

    content = _read(source, opened)
    with _reporting(source):
        if isinstance(content, pa.Table):
            yield content
            return
        with content as file:
            _check_version(file.schema_arrow, source)
            yield from file.iter_batches(batch_size=BATCH_ROWS, columns=list(names))


def read_rows(table: str, source: Source) -> list[dict[str, Any]]:
    """The rows of a file of a table, or of an id, as dictionaries. Raises StoreError."""
    return listed(read_table(table, source), source)


def listed(content: pa.Table, source: Source) -> list[dict[str, Any]]:
    """Rows that were read as dictionaries. Raises StoreError."""
    try:
        rows: list[dict[str, Any]] = content.to_pylist(maps_as_pydicts="strict")
    except _UNREADABLE as error:
        raise StoreError(f"it has rows that cannot be read ({in_one_line(error)})", where=source) from error
    return rows


def rows_of_files(table: str, files: Files, columns: Sequence[str] | None = None) -> list[dict[str, Any]]:
    """All rows of them, by id, or these columns, the id among them. Raises StoreError."""
    rows = [row for path in files.alone for row in listed(read_table(table, path, columns), path)]
    if not files.packs:
        return rows
    column = id_column(table)
    for path in files.packs:
        content = read_table(table, path, columns)
        hidden = pc.is_in(content[column], pa.array(sorted(files.hidden), pa.string()))
        rows += listed(content.filter(pc.invert(hidden)), path)
    return sorted(rows, key=itemgetter(column))


def in_one_line(error: Exception) -> str:
    """What an error of Arrow says, on one line."""
    return " ".join(str(error).split()) or type(error).__name__


def _read(source: Source, read: Callable[[Path | PackPart], T]) -> T:
    """What is read in the place of some rows; they may be packed just now.

    Raises StoreError where it is missing, torn, or of another version.
    """
    with _reporting(source):
        if isinstance(source, Path):
            return read(source)
        with suppress(FileNotFoundError):
            return read(source.find())
        return read(source.find())


@contextmanager
def _reporting(source: Source) -> Iterator[None]:
    """Errors in the block are errors of the store."""
    try:
        yield
    except FileNotFoundError as error:
        raise StoreError("it does not exist", where=source) from error
    except StoreError:
        raise
    except _UNREADABLE as error:
        raise StoreError(f"it is no readable Parquet file ({in_one_line(error)})", where=source) from error


def _check_version(schema: pa.Schema, path: object) -> None:
    version = version_of(schema)
    if version is None:
        raise StoreError("it was not written by auditor", where=path)
    if version > SCHEMA_VERSION:
        raise newer_version(version, path)
    if version < SCHEMA_VERSION:
        raise StoreError(
            f"it has schema version {version}, and this auditor reads version {SCHEMA_VERSION}",
            where=path,
            remedy="make it again, or upgrade its store with auditor store upgrade",
        )
