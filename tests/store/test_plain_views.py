"""The views without auditor: the text of `auditor views` in plain DuckDB, also after new judgements and recordings."""

import json
import os
import subprocess
import sysconfig
from pathlib import Path

import duckdb
import pandas
import polars
import pytest

from auditor.cli import run
from auditor.model.verdict import AttackLabel
from auditor.store.connection import plain_connection
from auditor.store.queries import list_queries, list_views, run_query, run_sql
from auditor.store.store import Store
from auditor.store.views import views_script
from tests.making.report_stores import add_recording
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig

VIEWS = [view.name for view in list_views()]
RIG = make_rig(3)
AWKWARD = "it's [a] *store*?"
"""A folder whose name has signs that mean something to SQL and to patterns of file names."""


def plain(script):
    connection = duckdb.connect()
    connection.execute(script)
    return connection


def rows(connection, view):
    """All rows of a view, in an order that does not depend on who asks."""
    return sorted(connection.execute(f"FROM {view}").fetchall(), key=repr)


def judged(store, recording, kinds, judgements=1):
    """A recording that was judged so often, each time otherwise."""
    measurement_id = add_measurement(store, RIG, [make_measurement(RIG, f) for f in range(6)], recording=recording)
    for number in range(judgements):
        judge_again(store, measurement_id, kinds[number:] + kinds[:number], number)
    return measurement_id


def judge_again(store, measurement_id, kinds, number):
    calibration_id = "cd"[number % 2] * 32
    add_judgement(store, RIG, measurement_id, kinds, r=f"0.0{number}", minutes=number, calibration_id=calibration_id)


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """A store, the text that was written while it held two recordings, and the plain answers before and after.

    After: a third recording, a label, and three more judgements with other r and calibrations.
    """
    store = Store.open(tmp_path_factory.mktemp("plain") / AWKWARD, create=True)
    ids = [judged(store, recording, "cc112u") for recording in "ab"]
    script = views_script(store.folder)
    connection = plain(script)
    before = {view: rows(connection, view) for view in ("verdicts", "labels", "recordings", "incidents")}
    for number in (1, 2, 3):
        for measurement_id in ids:
            judge_again(store, measurement_id, "cc112u"[number:] + "cc112u"[:number], number)
    add_recording(store, "c.mcap", attacks=[((1,), 10, 19)], pictured=(12,), labelled=False)
    store.write_labels("a" * 64, [AttackLabel("/cam1", "facula", 0, 10**12, {})], RIG)
    return store, script, before


@pytest.fixture(scope="module")
def connections(told):
    """Plain DuckDB, and a connection of the program."""
    store, script, _ = told
    return {"text": plain(script), "program": plain_connection(store)}


def test_plain_duckdb_answers_as_the_program_after_three_more_judgements(told, connections):
    store, _, before = told
    after, program = ({view: rows(one, view) for view in VIEWS} for one in connections.values())
    assert after == program
    assert len(after["verdicts"]) == 6 + 6 + 40 < len(run_sql(store, "FROM stored_verdicts")) == 8 * 6 + 40
    assert len(after["judgements"]) == 9
    assert [len(before[view]) for view in ("verdicts", "labels", "recordings")] == [12, 0, 2]
    assert [len(after[view]) for view in ("verdicts", "labels", "recordings")] == [52, 1, 3]
    assert before["incidents"] != after["incidents"]


def test_the_counts_of_pandas_and_polars_are_those_of_the_program(told, connections):
    known = {row["recording_id"]: row for row in run_query(told[0], "summary").to_pylist()}
    connection = connections["text"]
    for frame in (connection.sql("FROM verdicts").df(), connection.sql("FROM verdicts").pl().to_pandas()):
        assert isinstance(frame, pandas.DataFrame)
        counted = frame.groupby(["recording_id", "kind"]).size()
        for recording_id, row in known.items():
            assert {kind: counted.get((recording_id, kind), 0) for kind in ("clean", "attacked", "unidentified")} == {
                kind: row[kind] for kind in ("clean", "attacked", "unidentified")
            }
    incidents = connection.sql("FROM incidents").pl()
    assert isinstance(incidents, polars.DataFrame)
    assert incidents["incident_id"].to_list() == run_query(told[0], "incidents")["incident_id"].to_pylist()


def test_a_text_that_was_read_is_renewed_by_reading_it_again(tmp_path):
    store = Store.open(tmp_path / "audit", create=True)
    connection = plain(views_script(store.folder))
    judged(store, "a", "cc112u")
    assert rows(connection, "verdicts") == []
    connection.execute(views_script(store.folder))
    assert len(rows(connection, "verdicts")) == 6


def test_the_command_line_of_duckdb_runs_what_the_verb_writes_in_any_folder(told, tmp_path, capfdbinary):
    store, script, _ = told
    assert run(["views", "--store", str(store.folder)]) == 0
    text = capfdbinary.readouterr().out
    assert text.decode() == script
    (tmp_path / "views.sql").write_bytes(text)
    question = "SELECT name, clean, attacked FROM summary"
    command = [Path(sysconfig.get_path("scripts")) / "duckdb", "-json", "-init", "views.sql", "-c", question]
    done = subprocess.run(
        command, cwd=tmp_path, env={**os.environ, "HOME": str(tmp_path)}, capture_output=True, text=True, check=True
    )
    assert json.loads(done.stdout) == [
        {key: row[key] for key in ("name", "clean", "attacked")} for row in run_query(store, "summary").to_pylist()
    ]


def test_an_empty_store_has_all_views_and_no_rows(tmp_path):
    connection = plain(views_script(Store.open(tmp_path / "audit", create=True).folder))
    of_stores = set(VIEWS) - {"checks"}
    assert {view: rows(connection, view) for view in of_stores} == {view: [] for view in of_stores}


def test_columns_that_older_files_lack_are_null(tmp_path):
    store = Store.open(tmp_path / "audit", create=True)
    judged(store, "a", "cc112u", judgements=2)
    path = store.path("recordings", "a" * 64)
    duckdb.execute(f"COPY (SELECT * EXCLUDE (conflicts) FROM '{path}') TO '{path}'")
    connection = plain(views_script(store.folder))
    assert connection.sql("SELECT name, conflicts FROM recordings").fetchall() == [("a.mcap", None)]


def test_where_the_store_is_gone_or_of_another_version_nothing_is_answered(tmp_path):
    store = Store.open(tmp_path / "audit", create=True)
    script = views_script(store.folder)
    (store.folder / "store.json").write_text('{"format": "auditor store", "schema_version": 1}\n')
    with pytest.raises(duckdb.Error, match="another schema version: write this text again"):
        plain(script)
    store.folder.rename(tmp_path / "elsewhere")
    with pytest.raises(duckdb.Error, match=r"there is no store in this folder|No files found"):
        plain(script)


def test_a_missing_finished_file_is_an_error_and_no_smaller_count(tmp_path):
    store = Store.open(tmp_path / "audit", create=True)
    judged(store, "a", "cc112u")
    judged(store, "b", "cc112u")
    [first, _] = store.finished_paths("verdicts")
    first.unlink()
    with pytest.raises(duckdb.IOException, match=first.name):
        plain(views_script(store.folder)).sql("SELECT count(*) FROM verdicts").fetchall()


# Comments


@pytest.mark.parametrize("of", ["program", "text"])
def test_every_view_and_every_column_has_its_comment(connections, of):
    connection = connections[of]
    columns = connection.execute(
        "SELECT table_name, column_name, comment FROM duckdb_columns()"
        " WHERE NOT internal AND table_name NOT LIKE 'raw_%' AND table_name <> 'stored_pictures'"
    ).fetchall()
    assert [(table, name) for table, name, comment in columns if not comment] == []
    assert {table for table, _, _ in columns} >= {*VIEWS, "stored_verdicts"}
    about = dict(connection.execute("SELECT view_name, comment FROM duckdb_views() WHERE NOT internal").fetchall())
    assert {view.name: view.text for view in list_views()} == {view: about[view] for view in VIEWS}


def test_sql_of_the_user_sees_the_comments(told):
    store, _, _ = told
    sql = "SELECT comment FROM duckdb_columns() WHERE table_name = 'verdicts' AND column_name IN ('kind', 'stamp_ns')"
    kind, stamp = run_sql(store, f"{sql} ORDER BY column_name")["comment"].to_pylist()
    assert kind == "clean, attacked, unidentified, suspect or not_auditable."
    assert stamp.endswith("(ns)")
    assert run_sql(store, "SELECT comment FROM duckdb_views() WHERE view_name = 'incidents'").num_rows == 1


# Joins


def test_incidents_and_summary_are_views_and_queries_with_one_answer(told):
    store, _, _ = told
    assert {"incidents", "summary"} <= {*VIEWS} & {query.name for query in list_queries()}
    for name in ("incidents", "summary"):
        assert run_sql(store, f"FROM {name}").equals(run_query(store, name))
    ids = run_query(store, "incidents")["incident_id"].to_pylist()
    assert len(ids) == len(set(ids)) > 3


def test_incidents_join_to_recordings_frames_and_pictures(told):
    store, _, _ = told
    sql = """
        SELECT incident_id, recording.path, incident.frames, count(frame.frame) AS joined
        FROM incidents AS incident
        JOIN recordings AS recording USING (recording_id)
        JOIN summary USING (judgement_id, measurement_id)
        LEFT JOIN incident_frames AS frame USING (incident_id)
        GROUP BY ALL
    """
    found = run_sql(store, sql).to_pylist()
    assert len(found) == run_query(store, "incidents").num_rows
    assert all(row["frames"] == row["joined"] for row in found)
    seen = run_sql(
        store,
        "SELECT frame, sensor, content, file FROM incident_frames JOIN pictures USING (measurement_id, frame)"
        " WHERE list_contains(attacked, sensor) ORDER BY ALL",
    ).to_pylist()
    assert [(row["frame"], row["sensor"], row["content"]) for row in seen] == [(12, 1, "view")]
    assert (store.folder / seen[0]["file"]).read_bytes().startswith(b"\xff\xd8")


def test_frames_of_two_incidents_that_alternate_keep_apart(tmp_path):
    store = Store.open(tmp_path / "audit", create=True)
    judged(store, "a", "121211")
    rows = run_sql(
        store, "SELECT attacked, list(frame ORDER BY frame) AS f FROM incident_frames GROUP BY ALL ORDER BY 1"
    )
    assert [tuple(row.values()) for row in rows.to_pylist()] == [([1], [0, 2, 4, 5]), ([2], [1, 3])]


def test_a_picture_without_its_mask_is_not_finished(tmp_path):
    store = Store.open(tmp_path / "audit", create=True)
    measurement_id = add_recording(store, pictured=(3, 4))
    [mask] = (store.folder / "pictures" / measurement_id).glob("4_S*.png")
    mask.unlink()
    assert set(run_sql(store, "SELECT frame FROM pictures")["frame"].to_pylist()) == {3}
