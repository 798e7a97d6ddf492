import time
from pathlib import Path

import duckdb
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from auditor.errors import QueryError, StoreError
from auditor.store.export import encode
from auditor.store.queries import run_query, run_sql, run_sqls
from auditor.store.sandbox.read_only_files import ReadOnlyFile, ReadOnlyFiles
from auditor.store.schema import TABLES
from auditor.store.sql_files import views
from auditor.store.store import Store
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store


@pytest.fixture
def store(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    measurement_id = add_measurement(store, rig, [make_measurement(rig, f) for f in range(3)])
    add_judgement(store, rig, measurement_id, "c1u")
    return store


def everything_under(folder):
    return sorted((str(path), path.stat().st_mtime_ns) for path in folder.rglob("*"))


def test_the_views_answer(store):
    counts = run_sqls(store, {view: f"SELECT count(*) AS n FROM {view}" for view in views()})
    assert {count.num_rows for count in counts.values()} == {1}
    assert run_sql(store, "WITH x AS (FROM verdicts) SELECT kind FROM x WHERE frame = 1;").to_pylist() == [
        {"kind": "attacked"}
    ]
    assert {"frames", "verdicts"} <= set(run_sql(store, "SHOW TABLES").column("name").to_pylist())
    assert run_sql(store, "DESCRIBE errors").num_rows > 10
    assert run_sql(store, "SELECT 'no view at all' AS x").num_rows == 1


@pytest.mark.parametrize(
    "text",
    [
        "",
        "SELECT 1; SELECT 2",
        "SELECT 1; COPY (SELECT 1) TO '{out}'",
        "COPY (SELECT * FROM frames) TO '{out}'",
        "COPY frames TO '{inside}'",
        "EXPLAIN ANALYZE COPY (SELECT 1) TO '{out}'",
        "WITH x AS (COPY (SELECT 1) TO '{out}' (FORMAT csv, USE_TMP_FILE false)) FROM x",
        "SELECT * FROM (WITH x AS (COPY (SELECT 1) TO '{out}') FROM x)",
        "WITH x AS (INSERT INTO stored_recordings FROM stored_recordings RETURNING 1) FROM x",
        "WITH x AS (UPDATE stored_recordings SET name = 'clean' RETURNING name) FROM x",
        "WITH x AS (DELETE FROM stored_recordings RETURNING name) FROM x",
        "ATTACH '{out}'",
        "ATTACH ':memory:' AS other",
        "CREATE TABLE x AS SELECT 1",
        "CREATE MACRO disparity_error(a, b) AS 0",
        "INSERT INTO frames VALUES (1)",
        "DROP VIEW frames",
        "SET enable_external_access = true",
        "SET lock_configuration = false",
        "PRAGMA database_list",
        "INSTALL httpfs",
        "LOAD httpfs",
        "EXPORT DATABASE '{out}'",
        "CALL pragma_version()",
        "SELECT * FROM read_text('/etc/passwd')",
        "SELECT * FROM read_csv('/etc/passwd')",
        "SELECT * FROM '/etc/passwd'",
        "SELECT * FROM glob('/etc/*')",
        "SELECT * FROM read_blob('{secret}')",
        "SELECT * FROM read_parquet('{inside}')",
        "SELECT * FROM read_parquet('https://example.org/x.parquet')",
        "SELECT * FROM query('SELECT * FROM read_text(''{secret}'')')",
        "SELECT getenv('HOME')",
        "SELECT * FROM text",
        "SELECT * FROM store",
        "SELECT $a",
        "SELEC 1",
        "SELECT * FROM nowhere",
        "SELECT 1/0::UTINYINT FROM frames WHERE frame > error('stop')",
    ],
)
def test_everything_else_is_refused_and_nothing_is_written(store, tmp_path, text, monkeypatch):
    monkeypatch.chdir(tmp_path)
    secret = tmp_path / "secret.txt"
    secret.write_text("secret")
    inside = store.folder / "frames" / "x.parquet"
    pq.write_table(pa.table({"x": [1]}), inside)
    before = everything_under(tmp_path)
    with pytest.raises(QueryError) as caught:
        run_sql(store, text.format(out=tmp_path / "out.parquet", inside=inside, secret=secret))
    assert "\n" not in str(caught.value)
    assert everything_under(tmp_path) == before


def test_even_finished_files_cannot_be_written_over(store):
    path = store.path("frames", store.ids("frames")[0])
    content = path.read_bytes()
    for text in (
        f"COPY (SELECT 1) TO '{path}'",
        f"COPY (SELECT 1 AS x) TO '{path}' (FORMAT parquet, OVERWRITE_OR_IGNORE)",
        f"WITH x AS (COPY (SELECT 1) TO '{path}' (FORMAT parquet, USE_TMP_FILE false)) SELECT frames.* FROM frames, x",
        f"FROM frames, (WITH y AS (COPY (SELECT 1) TO '{path}' (FORMAT csv, USE_TMP_FILE false)) FROM y)",
    ):
        with pytest.raises(QueryError):
            run_sql(store, text)
    assert path.read_bytes() == content


def test_an_inserting_cte_changes_nothing_that_stays(store):
    with pytest.raises(QueryError):
        run_sql(store, "WITH x AS (INSERT INTO stored_frames VALUES (1) RETURNING 1) SELECT * FROM x")


@pytest.mark.parametrize(
    "name", ["it's here", "all[0-9]*?", "a{b,c}", "semi;colon -- x", "ümläut", 'quo"te', "back\\slash"]
)
def test_a_store_may_lie_in_a_folder_of_any_name(tmp_path, name):
    (tmp_path / name).mkdir()
    store, rig = new_store(tmp_path / name), make_rig(3)
    add_measurement(store, rig, [make_measurement(rig, 0)])
    assert run_query(store, "summary").num_rows == 1
    assert run_sql(store, "SELECT count(*) AS n FROM errors").to_pylist() == [{"n": 4}]


def test_a_pattern_in_a_folders_name_reads_no_neighbour(tmp_path):
    for name in ("a[b]", "ab"):
        (tmp_path / name).mkdir()
        rig = make_rig(3)
        add_measurement(new_store(tmp_path / name), rig, [make_measurement(rig, f) for f in range(len(name))])
    assert run_sql(Store.open(tmp_path / "a[b]" / "audit"), "SELECT count(*) AS n FROM frames").to_pylist() == [
        {"n": 4}
    ]


def test_hostile_names_are_only_text(tmp_path):
    name = "x'; DROP VIEW frames; -- \" ${recording} \0"
    store, rig = new_store(tmp_path), make_rig(3, name="cam'); --")
    measurement_id = add_measurement(store, rig, [make_measurement(rig, f) for f in range(3)], name=name)
    add_judgement(store, rig, measurement_id, "c1u")
    assert run_query(store, "summary", {"recording": name}).column("name").to_pylist() == [name]
    assert run_query(store, "incidents", {"recording": "x' OR '1'='1"}).num_rows == 0
    assert run_query(store, "incidents").column("attacked_names").to_pylist()[0] == ["S_1 cam'); --1"]


def test_an_empty_store_answers_every_view(tmp_path):
    store = new_store(tmp_path)
    for view in views().keys() - {"checks"}:  # which are of no store
        assert run_sql(store, f"FROM {view}").num_rows == 0


def test_columns_that_old_files_lack_are_null(store):
    path = store.path("recordings", store.ids("recordings")[0])
    pq.write_table(pq.read_table(path).drop_columns(["vehicle", "damage"]), path)
    assert run_sql(store, "SELECT vehicle, damage, clock FROM recordings").to_pylist() == [
        {"vehicle": None, "damage": None, "clock": "relative"}
    ]


@pytest.mark.parametrize("old", ["a", "b"])
def test_frames_of_older_versions_are_read_beside_new_ones(tmp_path, old):
    store, rig = new_store(tmp_path), make_rig(3)
    ids = {name: add_measurement(store, rig, [make_measurement(rig, 0)], recording=name) for name in "ab"}
    path = store.path("frames", ids[old])
    pq.write_table(pq.read_table(path).drop_columns(["valid_px"]), path)
    row = store.path("measurements", ids[old])
    measurement = pq.read_table(row)
    at = measurement.schema.get_field_index("schema_version")
    pq.write_table(measurement.set_column(at, measurement.schema.field(at), pa.array([0], pa.int32())), row)
    rows = run_sql(store, "SELECT measurement_id, valid_px, E_gated FROM errors WHERE position = 1").to_pylist()
    seen = {row["measurement_id"]: (row["valid_px"], row["E_gated"]) for row in rows}
    assert seen == {ids[name]: (None if name == old else 2000, 0.01) for name in "ab"}


def test_no_table_is_left_without_a_view_that_reads_it():
    texts = " ".join(view.sql for view in views().values())
    assert all(f"stored_{table}" in texts for table in TABLES)


@pytest.mark.parametrize(
    "text",
    [
        "SELECT CAST('a' AS INTEGER)",
        "SELECT 10000000000000000000000::INTEGER",
        "SELECT repeat('a', 10000000000)",
        "SELECT error('x')",
        "SELECT " + "(" * 3000 + "1" + ")" * 3000,
        "SELECT strftime(DATE '2020-01-01', '%Q')",
        "SELECT regexp_matches('a', '(')",
        "SELECT chr(-1)",
        "SELECT $x",
        "SELECT '\udcff'",
    ],
)
def test_an_error_of_any_class_is_one_line(store, text):
    with pytest.raises(QueryError) as caught:
        run_sql(store, text)
    assert len(str(caught.value).splitlines()) == 1


def test_a_file_of_the_store_that_is_not_what_it_was_is_one_line(store):
    [path] = store.finished_paths("verdicts")
    pq.write_table(pa.table({"judgement_id": [{"a": 1}], "frame": ["x"]}), path)
    with pytest.raises((QueryError, StoreError)) as caught:
        run_sql(store, "FROM verdicts")
    assert len(str(caught.value).splitlines()) == 1


def test_an_answer_that_csv_cannot_hold_is_refused_in_one_line(store):
    with pytest.raises(QueryError, match="cannot be written as csv") as caught:
        encode(run_sql(store, "SELECT '1'::BIGNUM AS x"), "csv")
    assert len(str(caught.value).splitlines()) == 1


ROWS = 200_000


def test_threads_that_read_one_file_read_their_own_places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Between a seek and its read another thread always has time to seek."""
    path = tmp_path / "frames" / "a.parquet"
    path.parent.mkdir()
    pq.write_table(pa.table({"n": np.arange(ROWS), "text": [str(n) for n in range(ROWS)]}), path, row_group_size=2000)
    seek = ReadOnlyFile.seek

    def slowly(file: ReadOnlyFile, *where: int) -> int:
        place = seek(file, *where)
        time.sleep(0.0001)
        return place

    monkeypatch.setattr(ReadOnlyFile, "seek", slowly)
    files = ReadOnlyFiles()
    [name] = files.names([path])
    with duckdb.connect(config={"threads": 8}) as connection:
        connection.register_filesystem(files)
        rows = f"SELECT sum(n), count(DISTINCT text) FROM read_parquet('{name}')"
        assert connection.execute(rows).fetchall() == [(ROWS * (ROWS - 1) // 2, ROWS)]
