"""The process that a user's SQL runs in: its limits, its rights, and SQL from a file and the standard input."""

import io
import subprocess
import sys

import pytest

from auditor.cli import run
from auditor.errors import LimitError, QueryError
from auditor.store.sandbox.limits import SqlLimits
from auditor.store.sandbox.process import run_sandboxed
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    store, rig = new_store(tmp_path_factory.mktemp("limits")), make_rig(3)
    add_judgement(store, rig, add_measurement(store, rig, [make_measurement(rig, f) for f in range(3)]), "c1u")
    return store


def test_sql_without_end_is_ended_even_where_duckdb_hears_no_interrupt(store):
    forever = "SELECT levenshtein(repeat('a', 10000000), repeat('b', 10000000)) FROM rigs"
    with pytest.raises(LimitError, match=r"^SQL: it took longer than 0.5 s and was ended; .*--time-limit$"):
        run_sandboxed(store, forever, SqlLimits(seconds=0.5))


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("SELECT list(a.i) FROM range(100000) a(i), range(100000) b, rigs", "took more than 50 MB of memory"),
        ("FROM range(100000000000), rigs", "answer is larger than 50 MB"),
    ],
)
def test_what_takes_too_much_memory_is_ended(store, text, what):
    with pytest.raises(LimitError, match=what) as caught:
        run_sandboxed(store, text, SqlLimits(memory_mb=50))
    assert len(str(caught.value).splitlines()) == 1


def test_errors_and_answers_come_back_as_they_were(store):
    assert run_sandboxed(store, "SELECT kind, 1 AS kind FROM verdicts ORDER BY frame").column_names == ["kind", "kind"]
    with pytest.raises(QueryError, match="only one SELECT statement can be run, not COPY"):
        run_sandboxed(store, f"COPY rigs TO '{store.folder}/x.csv'")


_TRIES = """
import os, sys
from pathlib import Path
from auditor.store.sandbox.child import give_up_writing, limit
give_up_writing()
limit(60, 1 << 33)
folder = Path(sys.argv[1])
kept = folder / "kept"
assert kept.read_text() == "kept"
def grows():
    with kept.open("ab") as file:
        file.write(b"x")
def makes():
    with (folder / "new").open("wb") as file:
        file.write(b"x")
for attempt in (grows, makes):
    try:
        attempt()
    except OSError:
        pass
    else:
        raise SystemExit(f"{attempt.__name__} passed")
"""


def test_a_process_that_gave_up_writing_writes_no_byte(tmp_path):
    (tmp_path / "kept").write_text("kept")
    done = subprocess.run([sys.executable, "-c", _TRIES, tmp_path], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "kept").read_text() == "kept"


def test_sql_comes_from_a_file_or_the_standard_input(store, tmp_path, monkeypatch, capfd):
    question = tmp_path / "question.sql"
    question.write_text("\ufeff-- frames\nSELECT count(*) AS n\nFROM verdicts;\n", encoding="utf-8")
    beginning = ["query", "--store", str(store.folder), "--format", "csv"]
    assert run([*beginning, "--file", str(question)]) == 0
    assert capfd.readouterr().out == '"n"\n3\n'
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"COPY rigs TO 'x'")))
    assert run([*beginning, "--file", "-"]) == 2
    assert "not COPY" in capfd.readouterr().err


@pytest.mark.parametrize("content", [b"\xff\xfe", b" " * ((1 << 20) + 1)])
def test_a_file_that_is_no_sql_is_refused_in_one_line(store, tmp_path, content, capfd):
    (tmp_path / "no.sql").write_bytes(content)
    assert run(["query", "--store", str(store.folder), "--file", str(tmp_path / "no.sql")]) == 2
    assert len(capfd.readouterr().err.splitlines()) == 1


def test_one_question_at_a_time(store, capfd):
    assert run(["query", "--store", str(store.folder), "summary", "--sql", "SELECT 1"]) == 2
    assert "give one of" in capfd.readouterr().err
