"""Names of files, topics and sensors, vehicles and errors never reach a screen, a log, a CSV file or a page raw."""

import ast
import csv
import io
import json
import os
import pty
import subprocess
import sys
import unicodedata
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from auditor.cli import run
from auditor.recordings import write_mcap
from auditor.store.queries import run_sql
from auditor.store.store import Store
from tests.making.scenes import plane_rig
from tests.making.small_drives import THREE_CAMERAS, drive_frames, write_drive

FORGED = "\nauditor: all clean"
EVIL = f"=1{FORGED}\r\x1b[2J\x1b]0;title\x07\x9b31m\u202e\u2028|<b>&\0"
NAME = os.fsdecode(f"=1{FORGED}\x1b[2J\u202e".encode() + b"\xff.mcap")
STORED = r"=1\nauditor: all clean\x1b[2J\u202e\xff.mcap"
UNSAFE = {"Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording whose name, topics and sensors are hostile, and which is attacked; a store with what was found."""
    folder = tmp_path_factory.mktemp("evil")
    rig = plane_rig(THREE_CAMERAS, True)
    cameras = tuple(replace(c, name=f"{c.name}{EVIL}", topic=f"{c.topic}{EVIL}") for c in rig.cameras)
    evil = replace(rig, cameras=cameras, lidar=replace(rig.lidar, topic=f"{rig.lidar.topic}{EVIL}"))
    write_mcap(folder / "clean.mcap", evil, drive_frames(evil, 8))
    write_mcap(folder / NAME, evil, drive_frames(evil, 8, attacked={2: range(2, 6)}))
    return folder


def assert_only_shown(output: bytes) -> str:
    """The text of an output, which is lines of characters that do nothing, none of them forged."""
    text = output.decode()
    found = {f"U+{ord(c):04X}" for c in text if c != "\n" and unicodedata.category(c) in UNSAFE}
    assert not found
    assert not [line for line in text.splitlines() if line.startswith("auditor: all clean")]
    return text


def test_every_verb_shows_hostile_names_on_one_line(folder, tmp_path, capfdbinary):
    store = str(tmp_path / "audit")
    drive, clean = str(folder / NAME), str(folder / "clean.mcap")
    of = ["--store", store, "--vehicle", EVIL, "--jobs", "1"]
    commands = [
        (["calibrate", clean, *of], 0),
        (["inspect", drive], None),
        (["inspect", drive, "--format", "json"], None),
        (["scan", drive, str(folder / f"none{EVIL.strip(chr(0))}"), "--pictures", "none", *of], None),
        (["scan", drive, "-r", "0.01", "--pictures", "none", *of], None),
        (["scan", drive, *of, "--pictures", "none", "--format", "json"], None),
        (["judge", "--store", store], None),
        (["label", NAME, "--sensor", "S_2", "--attack", EVIL, "--store", store], 0),
        (["label", NAME, "--topic", f"/x{EVIL}", "--attack", EVIL, "--store", store], 2),
        (["query", "summary", "--store", store], 0),
        (["query", "summary", f"recording={NAME}", "--store", store, "--format", "csv"], 0),
        (["query", "incidents", "--store", store, "--format", "csv"], 0),
        (["query", "incidents", "--store", store, "--format", "json"], 0),
        (["query", "frame", NAME, "5", "--store", store], 0),
        (["query", "coverage", "--store", store], 0),
        (["query", "--store", store, "--sql", 'SELECT chr(27) AS "a\nb", * FROM labels'], 0),
        (["query", "--store", store, "--sql", "SELECT \x1b[2J"], 2),
        (["query", f"no{EVIL}", "--store", store], 2),
        (["report", "--store", store], 0),
        (["report", "--store", f"{store}{EVIL.strip(chr(0))}"], 2),
        (["scan", f"--no{FORGED}\x1b[2J"], 2),
        (["scan", drive, "--method", f"x{FORGED}"], 2),
        (["scan", drive, "-r", f"x{FORGED}"], 2),
        (["attack", drive, str(tmp_path / NAME), "--on", "S_1"], 0),
        (["convert", drive, str(tmp_path / f"2{NAME}")], 0),
        (["calibrate", store, "--store", store], 0),
    ]
    for command, code in commands:
        capfdbinary.readouterr()
        ended = run(command)
        out, err = capfdbinary.readouterr()
        assert code is None or ended == code, (command, err)
        assert b"Traceback" not in err, err.decode()
        text = assert_only_shown(out)
        assert_only_shown(err)
        if "json" in command:
            json.loads(text)
    [page] = (tmp_path / "audit" / "reports").glob("*.html")
    assert "&lt;b&gt;&amp;" in assert_only_shown(page.read_bytes())
    assert NAME.replace("\udcff", r"\xff") in {known.name for known in Store.open(tmp_path / "audit").recordings()}


@pytest.mark.parametrize("ending", [".bag", ".db3"])
def test_a_file_name_that_is_no_utf_8_is_read_in_each_container(ending, tmp_path, capfd):
    drive = write_drive(tmp_path / f"drive{ending}", count=2, positions_m=THREE_CAMERAS)
    odd = drive.rename(tmp_path / os.fsdecode(b"\xff" + ending.encode()))
    assert run(["inspect", str(odd)]) == 0
    assert f"\\xff{ending}" in capfd.readouterr().out


def test_a_file_name_that_is_no_utf_8_is_audited_stored_and_asked_for(tmp_path, capfd):
    store = tmp_path / "audit"
    odd = write_drive(tmp_path / "drive.mcap", 8, positions_m=THREE_CAMERAS).rename(
        tmp_path / os.fsdecode(b"\xff.mcap")
    )
    assert run(["calibrate", str(odd), "--store", str(store)]) == 0
    assert run(["scan", str(odd), "--store", str(store), "--jobs", "1"]) == 0
    assert r"\xff.mcap" in capfd.readouterr().out
    for name in (odd.name, r"\xff.mcap"):
        assert run(["query", "summary", f"recording={name}", "--store", str(store), "--format", "json"]) == 0
        [row] = json.loads(capfd.readouterr().out)
        assert (row["name"], row["clean"]) == (r"\xff.mcap", 8)
    assert run(["report", "--recording", odd.name, "--store", str(store)]) == 0
    assert r"\xff.mcap" in (store / "reports" / "incident.html").read_text()
    before = {path: path.stat().st_mtime_ns for path in store.glob("recordings/*")}
    assert run(["scan", str(odd), "--store", str(store), "--jobs", "1"]) == 0
    assert {path: path.stat().st_mtime_ns for path in before} == before, "it is known again"


def test_a_store_whose_path_is_no_utf_8_is_refused(tmp_path, capfd):
    drive = write_drive(tmp_path / "drive.mcap", count=2)
    assert run(["scan", str(drive), "--store", str(tmp_path / os.fsdecode(b"\xff"))]) == 2
    assert r"/\xff: its path is not UTF-8, as Parquet and SQL need it; name another" in capfd.readouterr().err


def test_csv_and_parquet_hold_the_name_safe_and_as_it_is(folder, tmp_path, capfdbinary):
    store = ["--store", str(tmp_path / "audit")]
    assert run(["scan", str(folder / NAME), "--measure-only", "--jobs", "1", *store]) == 3
    capfdbinary.readouterr()
    sql = ["query", "--sql", "SELECT name, size_bytes, -1.5 AS number FROM recordings", *store, "--format"]
    assert run([*sql, "csv"]) == 0
    [row] = csv.DictReader(io.StringIO(capfdbinary.readouterr().out.decode(), newline=""))
    assert (row["name"], row["number"]) == (f"'{STORED}", "-1.5")
    assert run([*sql, "parquet"]) == 0
    [kept] = pq.read_table(pa.BufferReader(capfdbinary.readouterr().out)).to_pylist()
    assert kept["name"] == NAME.replace("\udcff", r"\xff")


def test_a_terminal_gets_no_control_sequence_of_a_recording(tmp_path):
    store = Store.open(tmp_path / "audit", create=True)
    assert run_sql(store, "SELECT 1").num_rows == 1
    master, slave = pty.openpty()
    sql = "SELECT chr(27) || '[2Jevil' || chr(13) || chr(155) || '31m' AS name"
    command = [sys.executable, "-m", "auditor", "query", "--store", str(store.folder), "--sql", sql]
    subprocess.run(
        command, stdout=slave, stderr=slave, check=True, env={**os.environ, "COLUMNS": "80", "TERM": "xterm"}
    )
    os.close(slave)
    shown = os.read(master, 65536).decode()
    os.close(master)
    assert r"\x1b[2Jevil\r\x9b31m" in shown
    assert "\x1b[2J" not in shown
    assert "\x9b" not in shown


def test_a_defect_is_told_without_what_others_wrote(monkeypatch, capfdbinary):
    def defect(*_: object, **__: object) -> None:
        raise ValueError(f"no such thing: {EVIL}")

    monkeypatch.setattr("auditor.cli.auditor.main", defect)
    assert run(["scan"]) == 2
    text = assert_only_shown(capfdbinary.readouterr().err)
    assert r"ValueError: no such thing: =1\nauditor: all clean" in text


def test_everything_printed_goes_through_one_function():
    """`click.echo` prints constants, what `shown` and `one_line` made safe, and JSON; nothing else prints."""
    safe = {"shown", "one_line", "dumps", "getvalue", "get_usage"}
    for path in Path("auditor/cli").rglob("*.py"):
        for call in (node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, ast.Call)):
            name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
            if name in {"echo", "secho"} and call.args:
                made_by = {
                    part.func.attr if isinstance(part.func, ast.Attribute) else getattr(part.func, "id", "")
                    for part in ast.walk(call.args[0])
                    if isinstance(part, ast.Call)
                }
                assert isinstance(call.args[0], ast.Constant) or made_by & safe, f"{path}:{call.lineno}"
            elif name == "print":
                assert isinstance(call.func, ast.Attribute), f"{path}:{call.lineno}"
                assert path.name == "output.py", f"{path}:{call.lineno}"
            elif name == "write" and path.name != "output.py":
                raise AssertionError(f"{path}:{call.lineno}: it writes past cli/output.py")
