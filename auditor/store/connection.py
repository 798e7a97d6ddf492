"""A DuckDB connection that sees the finished files of one store through its views, and nothing else.

No file can be written through it, by what it is and not by what it is told: the file systems that can write are closed
before the first table is read, and the one that is left can only read (`sandbox/read_only_files.py`). No list of
statements or functions decides.
"""

import atexit
import os
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
from graphlib import TopologicalSorter
from importlib import import_module
from operator import attrgetter

import duckdb
import pyarrow as pa

from auditor.errors import StoreError
from auditor.store.folder import MARKER, StoreFolder
from auditor.store.packs.index import Files
from auditor.store.sandbox.limits import SqlLimits
from auditor.store.sandbox.read_only_files import PROTOCOL, ReadOnlyFiles
from auditor.store.schema import MANIFESTS, TABLES, TableSchema, table_schema
from auditor.store.sql_files import comments, macros, views

SHUT: dict[str, str | bool | int | float | list[str]] = {
    "autoinstall_known_extensions": False,
    "autoload_known_extensions": False,
    "python_enable_replacements": False,  # a name in SQL is never a variable of ours
    "allow_persistent_secrets": False,
    "temp_directory": "",  # nothing is written, not even what does not fit into memory
}
"""The configuration of every connection: it loads no code and writes nothing."""
DECLARED = {
    "robust_block_frames": ("()", "store.evaluation_tables", "CHUNK_FRAMES"),
    "interval_frames": ("()", "store.evaluation_tables", "INTERVAL_FRAMES"),
    "min_valid_px": ("()", "model.measurement", "MIN_VALID_PX"),
    "kind_tolerance_share": ("()", "model.parameters", "RIG_KIND_TOLERANCE.share"),
    "kind_tolerance_m": ("()", "model.parameters", "RIG_KIND_TOLERANCE.baseline_m"),
    "declared_checks": ("()", "store.sql_files", "DECLARED_CHECKS"),
    "evidence_template": ("(check_name, by_two)", "store.sql_files", "EVIDENCE_TEMPLATE"),
}
"""Macros of what Python declares: their parameters, the module and the name, which is imported when it is needed."""
LARGE: dict[str, str | None] = {**MANIFESTS, "calibrations": None, "case_verdicts": None}
"""Tables too large to be read into memory, and the manifest that lists their finished files."""

_CATALOG = re.compile(r"duckdb_|information_schema|pg_", re.IGNORECASE)
_WORD = re.compile(r"\w+")
_READ = re.compile(r"\b(?:FROM|JOIN)\s+\w+(?:\([\w\s,]*)?|\w+\(", re.IGNORECASE)
_SELECT = re.compile(
    r"(?P<with>(?:\s|--[^\n]*\n)*WITH\b(?!\s+RECURSIVE\b))|(?:\s|--[^\n]*\n)*(?:SELECT|FROM)\b", re.IGNORECASE
)


def macros_of(names: Collection[str]) -> Iterator[str]:
    """The statements that make the macros among some names, each after those that it calls."""
    for name in DECLARED.keys() & names:
        parameters, module, attribute = DECLARED[name]
        yield f"CREATE MACRO {name}{parameters} AS {attrgetter(attribute)(import_module(f'auditor.{module}'))};"
    yield from (macros()[name] for name in _in_order(macros()) if name in names)


def with_views(text: str) -> str:
    """A SELECT statement, or one that is left as it is, with the views that it reads as its first CTEs.

    DuckDB binds and plans a view anew wherever one of its name stands, and all views behind it with it; a CTE once.
    Rows of frames are not gathered there: what a question does not want of them is not even read.
    """
    select, named = _SELECT.match(text), " ".join(_read_in(text) & views().keys())
    if not named or select is None:
        return text
    ctes = ",\n".join(map(_cte, in_order(needed_by(named))))
    return f"WITH {ctes},\n{text[select.end() :]}" if select["with"] else f"WITH {ctes}\n{text}"


@cache
def _cte(view: str) -> str:
    sql = views()[view].sql
    how = "NOT MATERIALIZED " if _words(sql) & {f"stored_{table}" for table in LARGE} else ""
    return f"{view} AS {how}(\n{sql}\n)"


def connected(store: StoreFolder | None, text: str = "", limits: SqlLimits | None = None) -> duckdb.DuckDBPyConnection:
    """A connection with the views and macros that a SQL text needs (all, where it names no view), then locked.

    For a `with`. Without a store all views are empty. Raises StoreError where a file of the store cannot be read.
    """
    files = _files_of(store)
    with ExitStack() as on_error:
        connection = on_error.enter_context(_opened(files, limits))
        filling = _Filling(connection)
        with _reading(store, needed_by(text)):
            _fill(filling, store, files, needed_by(text))
            for view in _words(text.lower()) & views().keys() or views().keys() & needed_by(text):
                connection.execute(f"CREATE VIEW {view} AS {with_views(views()[view].sql)}")
            if _shows_comments(text):
                connection.execute(comments(connection))
        _lock(connection, "allowed_paths", filling.readable)
        on_error.pop_all()
        return connection


Connection = duckdb.DuckDBPyConnection


def plain_connection(store: StoreFolder) -> Connection:
    """A connection with all views of a store as they are now, with their comments.

    It can read the store's finished files and no others, and write none; tables of one's own live in its memory. Raises
    StoreError where a file of the store cannot be read.
    """
    connection = connected(store)
    with suppress(duckdb.TransactionException):  # within one, the first mistake would be the last question
        connection.rollback()
    return connection


@contextmanager
def asking(store: StoreFolder | None, text: str) -> Iterator[duckdb.DuckDBPyConnection]:
    """As `connected`, for questions of our own `with_views`: the macros that the next ones of this process need, they
    find made. What is of the store goes with the question.
    """
    if _shows_comments(text) or _SELECT.match(text) is None:
        with connected(store, text) as connection:
            yield connection
        return
    kept = _KEPT.pop(os.getpid(), None) or _IdleConnection(_without_files())
    with ExitStack() as on_error:
        connection = on_error.enter_context(kept.connection)
        filling = _lent(kept, store, needed_by(" ".join(_read_in(text))))
        try:
            yield connection
        finally:
            if filling.undone():
                on_error.pop_all()
                _KEPT[os.getpid()] = kept


@dataclass(frozen=True)
class _IdleConnection:
    """A locked connection between two questions: it has macros, by their names, and nothing of a store."""

    connection: duckdb.DuckDBPyConnection
    made: set[str] = field(default_factory=set)


_KEPT: dict[int, _IdleConnection] = {}
"""By process, for one that was forked has none of DuckDB's threads. While it is lent it is not here."""


@dataclass(frozen=True)
class _Filling:
    """What was made of a store: the files that are read later on, and the statements that undo the rest."""

    connection: duckdb.DuckDBPyConnection
    readable: list[str] = field(default_factory=list)
    undoing: list[str] = field(default_factory=list)

    def create(self, kind: str, name: str, sql: str, values: list[object] | None = None) -> None:
        """Make a table or view."""
        self.connection.execute(f"CREATE {kind} {name} AS {sql}", values)
        self.undoing.append(f"DROP {kind} {name};")

    def undone(self) -> bool:
        """Leave nothing of the store in the database; False where an error has ended that."""
        try:
            with suppress(duckdb.TransactionException):  # there is none
                self.connection.rollback()
            self.connection.execute("".join(self.undoing))
            self.connection.unregister_filesystem(PROTOCOL)
        except duckdb.Error:
            return False
        return True


@atexit.register
def _close_kept() -> None:
    """Close what is kept while DuckDB is still whole: at the end of Python it is taken down in no order."""
    if kept := _KEPT.pop(os.getpid(), None):
        kept.connection.close()


def _without_files() -> duckdb.DuckDBPyConnection:
    connection = _opened(ReadOnlyFiles())
    _lock(connection, "allowed_directories", [f"{PROTOCOL}://"])
    connection.unregister_filesystem(PROTOCOL)
    return connection


def shut_connection() -> duckdb.DuckDBPyConnection:
    """A connection to an empty database in memory."""
    connection = duckdb.connect(config=SHUT)
    with suppress(duckdb.InvalidInputException):  # a notebook without the package for bars has none
        connection.execute("SET enable_progress_bar = false")  # it would stand in redirected output
    return connection


def _lent(kept: _IdleConnection, store: StoreFolder | None, needed: frozenset[str]) -> _Filling:
    """Give a kept connection what it needs of a store."""
    files, filling = _files_of(store), _Filling(kept.connection)
    kept.connection.register_filesystem(files)
    with _reading(store, needed):
        _fill(filling, store, files, needed, kept.made)
    kept.made.update(needed)
    return filling


def _files_of(store: StoreFolder | None) -> ReadOnlyFiles:
    return ReadOnlyFiles(store.folder / MARKER if store is not None else None)


def _opened(files: ReadOnlyFiles, limits: SqlLimits | None = None) -> duckdb.DuckDBPyConnection:
    """A connection to an empty database that can read these files, and write none."""
    with ExitStack() as on_error:
        connection = on_error.enter_context(shut_connection())
        connection.register_filesystem(files)
        connection.execute("SET disabled_filesystems = 'LocalFileSystem'")
        connection.execute("SET parquet_metadata_cache = true")  # each view over a file would read its footer again
        if limits is not None:
            connection.execute("SET memory_limit = ?", [f"{limits.memory_bytes}B"])
        on_error.pop_all()
        return connection


def _lock(connection: duckdb.DuckDBPyConnection, allowed: str, names: list[str]) -> None:
    """Let SQL open what has these names alone, and set nothing any more."""
    connection.execute(f"SET {allowed} = ?", [names])
    connection.execute("SET enable_external_access = false")
    connection.execute("SET lock_configuration = true")


@contextmanager
def _reading(store: StoreFolder | None, needed: Collection[str]) -> Iterator[None]:
    """Errors of DuckDB inside the block are of the store's files."""
    try:
        yield
    except duckdb.Error as error:
        if store is not None:
            raise_damage(store, needed, error)
        raise StoreError(in_one_line(error), where=store.folder if store else "") from error


def raise_damage(store: StoreFolder, needed: Collection[str], error: Exception) -> None:
    """Raise StoreError where a file cannot be read that SQL of these names reads; nothing happens where all can.

    What DuckDB says of a damaged file is about the inside of Parquet, in the words of several libraries. So each file
    is read by itself, and named.
    """
    files = _files_of(store)
    with _opened(files) as connection:
        for table in (table for table in TABLES if f"stored_{table}" in needed):
            table_files = store.files(table)
            for name in files.names([*table_files.alone, *table_files.packs]):
                try:
                    for _ in connection.sql(f"FROM read_parquet('{name}')").to_arrow_reader():
                        pass
                except (duckdb.Error, pa.ArrowException):
                    problem = f"it is damaged and cannot be read ({in_one_line(error)})"
                    remedy = "restore it from a copy, or scan its recording again into a new store"
                    raise StoreError(problem, where=files.path(name), remedy=remedy) from error


def _fill(
    filling: _Filling,
    store: StoreFolder | None,
    files: ReadOnlyFiles,
    needed: frozenset[str],
    made: Collection[str] = (),
) -> None:
    """Make the macros and stored tables that are needed; macros that are made are there."""
    new = needed.difference(made)
    filling.connection.execute("\n".join(macros_of(new)))
    for table in (table for table in TABLES if f"stored_{table}" in needed):
        table_files = store.files(table) if store else Files((), (), frozenset())
        alone, packs = files.names(table_files.alone), files.names(table_files.packs)
        _create_stored(filling, table_schema(table), alone, packs, table_files.hidden)
    if "stored_pictures" in needed:
        from auditor.store.pictures import picture_files  # noqa: PLC0415 - heavy

        _create_pictures(filling, picture_files(store.folder / "pictures") if store else [])


def in_one_line(error: Exception) -> str:
    """DuckDB's message and suggestion on one line, without its drawing of the place, or Python's of its calls."""
    text = re.split(r"\n\s*\n|\nLINE \d+:", str(error).strip())[0]
    if text.startswith("Traceback"):  # DuckDB 2 hands on what our files raise with all calls before it
        text = text.splitlines()[-1]
    return " ".join(text.split())


def _create_stored(
    filling: _Filling, schema: TableSchema, alone: list[str], packs: list[str], hidden: Collection[str]
) -> None:
    """The table `stored_<name>` with the columns of its schema file; those that no file has yet are NULL.

    The files of one id of small tables are read here and now: thousands of files of one row each would else be opened
    whenever a view over them is made. Files of large tables are all opened only where their manifest shows that their
    columns differ.
    """
    name, manifest = schema.name, LARGE.get(schema.name)
    mixed = manifest is None or _versions(filling.connection, manifest) > 1
    kind = "VIEW" if name in LARGE else "TABLE"
    if packs:
        _create_of_files(filling, kind, f"raw_{name}_alone", schema, alone, mixed=mixed)
        _create_of_files(filling, "VIEW", f"raw_{name}_packs", schema, packs, mixed=mixed)
        filling.create("TABLE", f"raw_{name}_hidden", "SELECT unnest(CAST(? AS VARCHAR[])) AS id", [[*hidden]])
        counting = f" ANTI JOIN raw_{name}_hidden ON {schema.id_column} = id" if hidden else ""
        both = f"FROM raw_{name}_alone UNION ALL FROM raw_{name}_packs{counting}"
        filling.create("VIEW", f"stored_{name}", both)  # our own names
    else:
        _create_of_files(filling, kind, f"stored_{name}", schema, alone, mixed=mixed)
    filling.readable.extend([*(alone if name in LARGE else ()), *packs])


def _create_of_files(
    filling: _Filling, kind: str, name: str, schema: TableSchema, files: list[str], *, mixed: bool
) -> None:
    """A table or view of the rows of some files, with the columns of the schema."""
    if not files:
        filling.create(kind, name, _select(schema, "WHERE false", present=()))
        return
    # Through SQL: before DuckDB 2, read_parquet() of Python keeps the interpreter while it waits for our files.
    listed = ", ".join(f"'{file}'" for file in files)  # our own names: <table>/<id>
    rows = f"FROM read_parquet([{listed}], union_by_name = {str(mixed).lower()})"
    try:
        filling.create(kind, name, _select(schema, rows))
    except duckdb.BinderException:  # an earlier version wrote fewer columns; to ask each time takes twice as long
        present = {column for column, *_ in filling.connection.execute(f"DESCRIBE {rows}").fetchall()}
        filling.create(kind, name, _select(schema, rows, present))


def _select(schema: TableSchema, rows: str, present: Collection[str] | None = None) -> str:
    """SQL of the schema's columns of these rows; those that are not `present` are NULL."""
    have = {column.name for column in schema.columns} if present is None else present
    columns = ", ".join(f"{c.name if c.name in have else 'NULL'}::{c.type} AS {c.name}" for c in schema.columns)
    return f"SELECT {columns} {rows}"  # our own names


def _create_pictures(filling: _Filling, files: list[str]) -> None:
    """The table `stored_pictures`: the files of pictures, which are no Parquet."""
    filling.create("TABLE", "stored_pictures", "SELECT unnest(CAST(? AS VARCHAR[])) AS file", [files])


def _versions(connection: duckdb.DuckDBPyConnection, manifest: str) -> int:
    """How many versions the finished files of a manifest were written with."""
    versions = "COLUMNS('^(schema|experiments)_version$')"
    distinct = f"SELECT count(*) FROM (SELECT DISTINCT {versions} FROM stored_{manifest})"  # noqa: S608  # our own name
    [(versions,)] = connection.execute(distinct).fetchall()
    return int(versions)


def _shows_comments(text: str) -> bool:
    """True where a SQL text may ask for comments, which take longer to make than most questions to answer."""
    return not text or _CATALOG.search(text) is not None


@cache
def needed_by(text: str) -> frozenset[str]:
    """The views, stored tables and macros behind the names in a SQL text; perhaps more than it uses, never fewer."""
    tables = {*views(), "stored_pictures", *(f"stored_{table}" for table in TABLES)}
    bodies = macros() | {name: view.sql for name, view in views().items()}
    names = frozenset(tables | bodies.keys() | DECLARED.keys())
    needs = _words(text.lower()) & names
    if not needs & tables:
        return names
    while True:
        behind = {word for name in needs & bodies.keys() for word in _read_in(bodies[name])} & names
        behind |= {f"stored_{manifest}" for table, manifest in LARGE.items() if manifest and f"stored_{table}" in needs}
        if behind <= needs:
            return needs
        needs |= behind


@cache
def _read_in(sql: str) -> frozenset[str]:
    """The names of SQL of our own that stand where a table or function does: columns may be called as a view is."""
    return _words(" ".join(_READ.findall(sql)).lower())


@cache
def _words(sql: str) -> frozenset[str]:
    return frozenset(_WORD.findall(sql))


def in_order(needed: Collection[str]) -> Iterable[str]:
    """The views among `needed`, each after those that it reads; graphlib's CycleError where two read each other."""
    return _in_order({name: view.sql for name, view in views().items() if name in needed})


def _in_order(texts: Mapping[str, str]) -> Iterable[str]:
    """Names of SQL texts, each after those that its text has."""
    names = texts.keys()
    return TopologicalSorter({name: _words(sql) & names - {name} for name, sql in texts.items()}).static_order()
