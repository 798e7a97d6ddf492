"""A store opened for a notebook."""

import sys

import duckdb
import pandas
import polars
import pytest

import auditor
from auditor.store.queries import list_views, run_query, run_sql
from tests.making.report_stores import add_recording, new_store


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    store = new_store(tmp_path_factory.mktemp("opened"))
    add_recording(store, "a.mcap", attacks=[((1,), 10, 19)], drives=2)
    return store.folder


@pytest.fixture(scope="module")
def opened(folder):
    return auditor.open_store(folder)


def test_a_question_is_a_query_a_view_or_sql(opened):
    store = opened.store
    assert opened.query("incidents", gap_s=1).equals(run_query(store, "incidents", {"gap_s": 1}))
    assert opened.query("verdicts").equals(run_sql(store, "FROM verdicts"))
    assert opened.query("SELECT count(*) AS n FROM verdicts WHERE kind = 'attacked'").to_pylist() == [{"n": 10}]


def test_every_view_becomes_a_table_of_pandas_and_of_polars(opened):
    for view in ("verdicts", "rigs", "incidents"):
        frame, columns, arrow = opened.df(view), opened.pl(view), run_sql(opened.store, f"FROM {view}")
        assert isinstance(frame, pandas.DataFrame)
        assert isinstance(columns, polars.DataFrame)
        assert list(frame.columns) == columns.columns == arrow.column_names
        assert len(frame) == len(columns) == arrow.num_rows > 0


def test_what_is_no_question_says_so(opened):
    with pytest.raises(auditor.QueryError, match="summery: there is no such query or view"):
        opened.query("summery")
    with pytest.raises(auditor.QueryError, match="verdicts: only a query has parameters"):
        opened.query("verdicts", recording="a.mcap")
    with pytest.raises(auditor.QueryError, match="no recording has the name or id 'z'"):
        opened.df("incidents", recording="z")
    with pytest.raises(auditor.StoreError, match="no store"):
        auditor.open_store(opened.store.folder.parent)


@pytest.mark.parametrize(("package", "form"), [("pandas", "df"), ("polars", "pl")])
def test_without_the_package_it_says_what_to_install(opened, monkeypatch, package, form):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(auditor.SettingError, match=f"package {package} is not installed; pip install {package}"):
        getattr(opened, form)("SELECT 1 AS x")


def test_the_connection_stays_open_after_a_mistake_and_cannot_write_files(opened, folder, tmp_path):
    connection = auditor.open_store(folder).connection()
    with pytest.raises(duckdb.CatalogException):
        connection.execute("FROM verdict")
    for refused in (f"COPY (SELECT 1) TO '{tmp_path / 'x.csv'}'", f"FROM read_text('{folder / 'store.json'}')"):
        with pytest.raises(duckdb.Error):
            connection.execute(refused)
    connection.execute("CREATE TABLE mine AS SELECT kind FROM verdicts")
    assert connection.execute("SELECT count(*) FROM mine").fetchall() == [(opened.query("verdicts").num_rows,)]
    names = {
        name for (name,) in connection.execute("SELECT view_name FROM duckdb_views() WHERE NOT internal").fetchall()
    }
    assert names >= {view.name for view in list_views()}
    assert list(tmp_path.iterdir()) == []
