"""Real clocks count nanoseconds: a recording with such stamps is audited, queried and reported."""

import csv
import io
import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from auditor.cli import run
from auditor.cli.output import emit
from auditor.store.queries import list_queries, run_queries
from auditor.store.store import Store
from tests.making.small_drives import PERIOD_NS, THREE_CAMERAS, write_drive

START_NS = 1_317_042_145_964_389_445
ATTACKED = {2: range(5, 9)}
SMALL = {"count": 12, "seed": 1, "positions_m": THREE_CAMERAS}
FROM_UTC = "2011-09-26T13:02:26.464389445Z"
PARAMETERS = {"frame": {"frame": "7"}, "vehicle": {"vehicle": "car 7"}, "before_after": {"day": "2011-09-26"}}
FORMATS = ("table", "json", "csv", "parquet")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clean recording and an attacked one, scanned with exit code 1 into the store `audit`."""
    folder = tmp_path_factory.mktemp("nanoseconds")
    clean, attacked = (folder / name for name in ("clean.mcap", "attacked.mcap"))
    write_drive(clean, **SMALL, start_ns=START_NS - 60 * 10**9)
    write_drive(attacked, **SMALL, start_ns=START_NS, attacked=ATTACKED)
    store = ["--store", str(folder / "audit")]
    assert run(["calibrate", str(clean), *store]) == 0
    assert run(["scan", str(attacked), "--pictures", "none", *store]) == 1
    return folder


def answered(folder: Path, capfdbinary: pytest.CaptureFixture[bytes], *arguments: str) -> bytes:
    """What a query prints, with exit code 0."""
    capfdbinary.readouterr()
    assert run(["query", *arguments, "--store", str(folder / "audit")]) == 0
    return capfdbinary.readouterr().out


def test_incidents_hold_the_moment_in_every_form(folder, capfdbinary):
    printed = {form: answered(folder, capfdbinary, "incidents", "--format", form) for form in FORMATS}
    assert FROM_UTC in printed["table"].decode()
    [row] = json.loads(printed["json"])
    assert (row["from_utc"], row["from_ns"]) == (FROM_UTC, START_NS + 5 * PERIOD_NS)
    [row] = csv.DictReader(io.StringIO(printed["csv"].decode()))
    assert (row["from_utc"], row["from_ns"]) == (FROM_UTC, str(START_NS + 5 * PERIOD_NS))
    [moment] = pq.read_table(pa.BufferReader(printed["parquet"])).column("from_utc")
    assert moment.value == START_NS + 5 * PERIOD_NS


def test_every_query_answers_in_every_form(folder, capfdbinary):
    """All are asked once; the verb prints an answer in the form that it is given."""
    names = [known.name for known in list_queries()]
    answers = run_queries(Store.open(folder / "audit"), {name: PARAMETERS.get(name, {}) for name in names})
    assert answers.keys() == set(names)
    capfdbinary.readouterr()
    for name, answer in answers.items():
        for form in FORMATS:
            emit(answer, form)
            assert capfdbinary.readouterr().out, (name, form)


@pytest.mark.parametrize("form", ["table", "json"])
def test_a_moment_of_ones_own_sql_is_printed(form, folder, capfdbinary):
    sql = "SELECT make_timestamp_ns(stamp_ns) AS moment, [moment] AS moments FROM verdicts ORDER BY frame LIMIT 1"
    printed = answered(folder, capfdbinary, "--sql", sql, "--format", form)
    assert b"2011-09-26T13:02:25.964389445Z" in printed


def test_the_report_tells_the_moment(folder, tmp_path):
    page = tmp_path / "page.html"
    assert run(["report", "--store", str(folder / "audit"), "--out", str(page)]) == 0
    assert "2011-09-26 13:02:26.464 UTC" in page.read_text()
