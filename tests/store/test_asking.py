"""Questions of one process share a database: macros are made once, and nothing of one store is seen in another."""

import fcntl
import os
import warnings
from concurrent.futures import ThreadPoolExecutor

import pytest

from auditor.errors import QueryError, StoreError
from auditor.store.connection import asking, with_views
from auditor.store.folder import MARKER
from auditor.store.queries import run_queries, run_sql
from auditor.store.store import Store
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store

NAMES = "SELECT name FROM recordings ORDER BY name"
FRAMES = "SELECT frame FROM frames ORDER BY frame"


@pytest.fixture(scope="module")
def stores(tmp_path_factory):
    """Two stores of the same ids, whose measurement has another number of frames."""
    made = []
    for frames in (2, 3):
        store, rig = new_store(tmp_path_factory.mktemp("asking")), make_rig(3)
        add_judgement(store, rig, add_measurement(store, rig, [make_measurement(rig, f) for f in range(frames)]), "c")
        made.append(store)
    assert made[0].ids("measurements") == made[1].ids("measurements")
    return made


def shared_by(store, text=FRAMES):
    with asking(store, text) as connection:
        return connection


def test_the_next_question_has_the_same_database_whichever_store_it_is_about(stores):
    first, second = stores
    assert shared_by(first) is shared_by(second) is shared_by(first, NAMES)


def test_each_question_sees_its_own_store_as_it_is_now(stores, tmp_path):
    first, second = stores
    for _ in range(2):
        assert [run_sql(store, FRAMES).num_rows for store in (first, second)] == [2, 3]
    empty = new_store(tmp_path)
    assert run_sql(empty, FRAMES).num_rows == 0
    rig = make_rig(3)
    add_measurement(empty, rig, [make_measurement(rig, 0)])
    assert run_sql(empty, FRAMES).num_rows == 1
    assert run_queries(first, {"contents": {}})["contents"].num_rows > 0


def test_files_of_one_name_and_one_time_of_change_are_not_taken_for_each_other(stores):
    for store in stores:
        for path in store.folder.rglob("*.parquet"):
            os.utime(path, (1_700_000_000, 1_700_000_000))
    for _ in range(2):
        assert [run_sql(store, FRAMES).num_rows for store in stores] == [2, 3]


def test_nothing_of_a_store_is_left_between_questions(stores):
    first, _ = stores
    connection = shared_by(first)
    tables = "SELECT table_name FROM duckdb_tables() UNION ALL SELECT view_name FROM duckdb_views() WHERE NOT internal"
    left = {name for (name,) in connection.execute(tables).fetchall()}
    assert left == set()
    with (first.folder / MARKER).open() as marker:
        fcntl.flock(marker, fcntl.LOCK_EX | fcntl.LOCK_NB)  # nobody reads the store


@pytest.mark.parametrize("wrong", ["FROM frames, nowhere", "SELECT error('stop') FROM frames"])
def test_a_question_that_fails_leaves_nothing_behind(stores, wrong):
    first, second = stores
    before = shared_by(first)
    with pytest.raises(QueryError, match=r"nowhere|stop"):
        run_sql(first, wrong)
    assert shared_by(second) is before
    assert [run_sql(store, FRAMES).num_rows for store in stores] == [2, 3]


def test_a_database_that_an_error_has_ended_is_not_kept(stores):
    before = shared_by(stores[0])
    with asking(stores[0], FRAMES) as connection:
        connection.close()
    assert shared_by(stores[0]) is not before


def test_a_file_that_cannot_be_read_is_named_and_the_next_question_is_answered(stores, tmp_path):
    broken, rig = new_store(tmp_path), make_rig(3)
    add_measurement(broken, rig, [make_measurement(rig, 0)])
    [path] = broken.finished_paths("frames")
    path.write_bytes(b"PAR1")
    with pytest.raises(StoreError, match=path.name):
        run_sql(broken, FRAMES)
    assert run_sql(stores[0], FRAMES).num_rows == 2


def test_a_question_reads_no_table_that_a_column_is_called_as(tmp_path):
    store, rig = new_store(tmp_path), make_rig(3)
    add_judgement(store, rig, add_measurement(store, rig, [make_measurement(rig, 0)]), "c")
    [path] = store.finished_paths("frames")
    path.write_bytes(b"PAR1")
    assert run_sql(store, "SELECT frames FROM incidents").num_rows == 0


def test_questions_at_the_same_time_have_a_database_each(stores):
    with asking(stores[0], FRAMES) as one, asking(stores[1], FRAMES) as other:
        assert [len(connection.execute(with_views(FRAMES)).fetchall()) for connection in (one, other)] == [2, 3]
    with ThreadPoolExecutor(4) as threads:
        counts = list(threads.map(lambda number: run_sql(stores[number % 2], FRAMES).num_rows, range(8)))
    assert counts == [2, 3] * 4


def test_a_forked_process_has_a_database_of_its_own(stores):
    run_sql(stores[0], FRAMES)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # Python 3.12 says that threads are not forked
        child = os.fork()
    if child == 0:
        os._exit(run_sql(Store.open(stores[1].folder), FRAMES).num_rows)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 3
