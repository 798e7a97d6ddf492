"""The views of a store as SQL text that DuckDB runs without auditor: `auditor views`.

The text lists no files. When it is run, it looks up which files are finished, as the program does: the ids of the rows
of a manifest name the files of other tables. So one text stays right after new recordings and judgements.
"""

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from auditor import __version__
from auditor.store.connection import DECLARED, LARGE, connected, in_order, macros_of
from auditor.store.folder import MARKER
from auditor.store.packs.index import FOLDER, INDEX, MEMBERS, PACKED
from auditor.store.schema import SCHEMA_VERSION, TABLES, TableSchema, table_schema
from auditor.store.sql_files import comments, literal, macros, views

_HEAD = f"""\
-- The views of a store of auditor {__version__}, schema version {SCHEMA_VERSION}, for DuckDB without auditor.
--
-- On a command line: duckdb -init views.sql
-- In Python:         duckdb.connect().execute(open("views.sql").read())
--
-- The text reads which files of the store are finished whenever it is run: run it again after a scan or a judgement.
-- It need not be written again, except after an upgrade of the store. If the store was moved, change its folder below.
-- Nothing is written; all views, tables and macros are temporary. What a view or column means stands in
-- duckdb_views() and duckdb_columns().
"""
_IDS = "[0-9a-f]{8,64}"


def views_script(folder: Path) -> str:
    """The SQL text for a store in a folder. The store is not read."""
    parts = [_HEAD, _store(folder), _INDEX, *map(_stored, map(table_schema, TABLES)), _PICTURES, *_macros(), *_views()]
    return "\n".join(parts)


def _store(folder: Path) -> str:
    pattern = r"regexp_replace(getvariable('auditor_store'), '([*?\[])', '[\1]', 'g')"
    version = rf'"schema_version": *{SCHEMA_VERSION}\b'
    lines = [
        f"SET VARIABLE auditor_store = {literal(str(folder))};\n",
        "-- The same as a pattern that matches nothing else; an error where no store of this version is there.",
        "SET VARIABLE auditor_pattern = (",
        "    SELECT CASE",
        "        WHEN count(*) = 0 THEN error('there is no store in this folder')",
        f"        WHEN regexp_matches(any_value(content), {literal(version)}) THEN {pattern}",
        "        ELSE error('the store has another schema version: write this text again with auditor views')",
        f"    END FROM read_text({pattern} || '/{MARKER}')",
        ");",
    ]
    return "\n".join(lines) + "\n"


def _stored(schema: TableSchema) -> str:
    """The table or view `stored_<name>`, which has all columns of its schema whatever the files have."""
    manifest, files = LARGE.get(schema.name), f"auditor_{schema.name}"
    mixed = f"{files}_mixed" if manifest else None
    nothing = f"SELECT {', '.join(f'NULL::{one.type} AS {one.name}' for one in schema.columns)} WHERE false"
    of_files = (files, *([f"{files}_packs"] if schema.name in PACKED else []))
    reads = []
    for name in of_files:
        read = f"FROM read_parquet(getvariable('{name}'), union_by_name = {_variable(mixed) if mixed else 'true'})"
        read += "" if name == files else f" WHERE {_counts(schema, manifest)}"
        reads.append(f"CASE WHEN len({_variable(name)}) > 0 THEN {literal(f'({read}) UNION ALL BY NAME ')} ELSE '' END")
    source = " || ".join([*reads, literal(nothing)])
    columns = ", ".join(f"{one.name}::{one.type} AS {one.name}" for one in schema.columns)
    kind = "VIEW" if schema.name in LARGE else "TABLE"
    query = f"SELECT {columns} FROM query({source})"  # noqa: S608 - our own names
    lines = [
        f"-- {schema.sentence}",
        *(_packs(schema) if schema.name in PACKED else ()),
        f"SET VARIABLE {files} = ({_of_manifest(schema, manifest) if manifest else _in_folder(schema)});",
        *([f"SET VARIABLE {mixed} = ({_differ(manifest)});"] if manifest else []),
        f"CREATE OR REPLACE TEMP {kind} stored_{schema.name} AS {query};",
    ]
    return "\n".join(lines) + "\n"


def _packs(schema: TableSchema) -> Iterator[str]:
    """The packs of a table, the ids that they have rows of, and those that count no longer."""
    packs = f"auditor_{schema.name}_packs"
    path = f"{_variable('auditor_pattern')} || '/{FOLDER}/{schema.name}/' || id || '.parquet'"
    of_table = f"FROM query({_variable('auditor_index')}) WHERE of = '{schema.name}'"
    read = f"FROM parquet_kv_metadata(getvariable('{packs}')) WHERE decode(key) = '{MEMBERS.decode()}'"
    ids = f"SELECT unnest(regexp_extract_all(decode(value), '\\[\"([0-9a-f]+)\"', 1)) AS id {read}"
    nothing = "SELECT NULL::VARCHAR AS id WHERE false"
    yield f"SET VARIABLE {packs} = (SELECT list({path}) {of_table} AND what = 'pack');"
    yield f"SET VARIABLE {packs}_removed = (SELECT list(id) {of_table} AND what = 'removed');"
    chosen = f"CASE WHEN len({_variable(packs)}) > 0 THEN {literal(ids)} ELSE {literal(nothing)} END"
    yield f"SET VARIABLE {packs}_read = (SELECT {chosen});"
    yield f"SET VARIABLE {packs}_ids = (SELECT list(id) FROM query({_variable(f'{packs}_read')}));"  # noqa: S608


def _counts(schema: TableSchema, manifest: str | None) -> str:
    """The condition that rows of packs count: they were not removed, and have no file of their own by now."""
    row_id, alone = schema.id_column, _variable(f"auditor_{schema.name}")
    removed = f"coalesce({_variable(f'auditor_{schema.name}_packs_removed')}, [])"
    finished = f" AND {row_id} IN (SELECT {row_id} FROM stored_{manifest})" if manifest else ""  # noqa: S608
    return (
        f"NOT list_contains({removed}, {row_id}){finished}"
        f" AND NOT list_contains([parse_filename(one, true) FOR one IN coalesce({alone}, [])], {row_id})"
    )


def _of_manifest(schema: TableSchema, manifest: str) -> str:
    """The files of a table that the rows of a manifest name; of packed tables those that are not in packs alone."""
    row_id = schema.id_column
    path = f"{_variable('auditor_pattern')} || '/{schema.name}/' || {row_id} || '.parquet'"
    wanted = ""
    if schema.name in PACKED:
        packed = f"coalesce({_variable(f'auditor_{schema.name}_packs_ids')}, [])"
        own = f"SELECT parse_filename(file, true) {_found_in_folder(schema)}"
        wanted = f" WHERE NOT list_contains({packed}, {row_id}) OR {row_id} IN ({own})"
    return f"SELECT list({path} ORDER BY {row_id}) FROM stored_{manifest}{wanted}"  # noqa: S608 - our own names


def _in_folder(schema: TableSchema) -> str:
    """The files of a table that are whole where they are there."""
    path = f"{_variable('auditor_pattern')} || '/{schema.name}/' || parse_filename(file, true) || '.parquet'"
    return f"SELECT list({path} ORDER BY file) {_found_in_folder(schema)}"


def _found_in_folder(schema: TableSchema) -> str:
    folder = f"{_variable('auditor_pattern')} || '/{schema.name}/*.parquet'"
    return f"FROM glob({folder}) WHERE regexp_full_match(parse_filename(file, true), '{_IDS}')"


def _differ(manifest: str) -> str:
    """Whether the files of a manifest were written with more than one version, so that their columns may differ."""
    versions = "COLUMNS('^(schema|experiments)_version$')"
    return f"SELECT count(*) > 1 FROM (SELECT DISTINCT {versions} FROM stored_{manifest})"  # noqa: S608 - our own names


_INDEX = f"""\
-- Packs, which hold the rows of many ids, and the ids whose rows in packs count no longer.
SET VARIABLE auditor_index = (
    SELECT CASE
        WHEN count(*) > 0 THEN
            'SELECT what, "table" AS of, id FROM read_csv(getvariable(''auditor_pattern'') || ''/{INDEX}'','
            || ' header = true, all_varchar = true)'
        ELSE 'SELECT NULL::VARCHAR AS what, NULL::VARCHAR AS of, NULL::VARCHAR AS id WHERE false'
    END FROM glob(getvariable('auditor_pattern') || '/{INDEX}')
);
"""  # noqa: S608 - our own names
_PICTURES = """\
CREATE OR REPLACE TEMP TABLE stored_pictures AS
SELECT regexp_extract(file, 'pictures/[^/]+/[^/]+$') AS file
FROM glob(getvariable('auditor_pattern') || '/pictures/*/*');
"""


def _macros() -> Iterator[str]:
    for macro in macros_of({*DECLARED, *macros()}):
        yield re.sub(r"^CREATE MACRO ", "CREATE OR REPLACE TEMP MACRO ", macro, flags=re.MULTILINE) + "\n"


def _views() -> Iterator[str]:
    for view in in_order(set(views())):
        yield f"CREATE OR REPLACE TEMP VIEW {view} AS\n{views()[view].sql.strip()};\n"
    yield _comments() + "\n"


@cache
def _comments() -> str:
    """They are the same of every store."""
    with connected(None) as connection:
        return comments(connection)


def _variable(name: str) -> str:
    return f"getvariable('{name}')"
