"""All that SQL may try, on the closed connection itself: no file changes, whatever DuckDB answers."""

from contextlib import contextmanager, suppress
from hashlib import sha256

import duckdb
import pytest

from auditor.errors import AuditorError
from auditor.store import queries
from auditor.store.connection import connected
from auditor.store.queries import run_sql
from auditor.store.sandbox.read_only_files import name_of
from tests.making.sandbox_attempts import HARMLESS, READING, REFUSED, WRITING
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("attempts")


@pytest.fixture(scope="module")
def store(folder):
    store, rig = new_store(folder), make_rig(3)
    add_judgement(store, rig, add_measurement(store, rig, [make_measurement(rig, f) for f in range(3)]), "c1u")
    (folder / "secret.txt").write_text("secret,words\n1,2\n")
    (store.folder / "verdicts" / "unfinished.parquet").write_bytes(store.finished_paths("verdicts")[0].read_bytes())
    return store


@pytest.fixture(scope="module")
def closed(store):
    """One connection for all attempts, each in a read-only transaction of its own as a user's only one is."""
    with connected(store, "verdicts recordings stored_recordings") as connection:
        yield connection


def without_transaction(connection):
    with suppress(duckdb.Error):
        connection.execute("ROLLBACK")
    return connection


def anew(connection):
    """The closed connection in a read-only transaction that has seen nothing yet, as a user's SQL finds it."""
    without_transaction(connection).execute("BEGIN TRANSACTION READ ONLY")
    return connection


@pytest.fixture
def filled(folder, store, monkeypatch):
    monkeypatch.chdir(folder)
    [finished] = store.finished_paths("verdicts")
    paths = {
        "out": folder / "out.parquet",
        "secret": folder / "secret.txt",
        "inside": finished.with_name("unfinished.parquet"),
        "finished": finished,
        "known": name_of(finished, finished.stat()),
        "folder": folder,
    }
    return lambda text: text.format(**paths)


def tree(folder):
    return {path: path.is_file() and sha256(path.read_bytes()).hexdigest() for path in folder.rglob("*")}


def test_there_are_two_hundred_attempts_and_no_two_are_the_same():
    assert len(set(REFUSED)) == len(REFUSED) >= 200


def test_what_writes_or_reads_outside_is_refused_in_one_line(closed, filled, folder, store, monkeypatch):
    @contextmanager
    def shared(*_):
        yield without_transaction(closed)

    monkeypatch.setattr(queries, "asking", shared)
    before, answered = tree(folder), []
    for text in map(filled, REFUSED):
        try:
            run_sql(store, text)
        except AuditorError as error:
            if len(str(error).splitlines()) == 1 and "Traceback" not in str(error):
                continue
        answered.append(text)
    assert answered == []
    assert tree(folder) == before


def test_nothing_changes_even_where_no_statement_is_refused(closed, filled, folder):
    before = tree(folder)
    for text in map(filled, [*WRITING, *HARMLESS]):
        with suppress(duckdb.Error):
            anew(closed).execute(text).fetchall()
        assert tree(folder) == before, text


def test_nothing_outside_is_read_even_where_no_statement_is_refused(closed, filled):
    read = []
    for text in map(filled, READING):
        with suppress(duckdb.Error):
            anew(closed).execute(text).fetchall()
            read.append(text)
    assert read == []


def test_what_only_looks_is_answered(closed, filled):
    for text in map(filled, HARMLESS):
        assert anew(closed).sql(text).columns, text
