"""The log of runs: what its entries say, how its chains hold together, and what is left where a run is killed."""

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from auditor import __version__
from auditor.errors import StoreError
from auditor.store.log import runs
from auditor.store.log.chains import chain_paths, entries, heads, read_chains
from auditor.store.log.entry import EntryKind, RunOutcome
from auditor.store.log.runs import adopt, current_runs, logged, run
from auditor.store.maintenance.removal import remove_recordings
from auditor.store.maintenance.verify import verify
from auditor.store.records import RecordingRecord
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store

WRITER = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from auditor.store import tables
from auditor.store.files import PartFile
from auditor.store.log.runs import run
from auditor.store.records import RecordingRecord
from auditor.store.store import Store

folder, point, name = Path(sys.argv[2]), sys.argv[3], sys.argv[4]
die = lambda *_: os.kill(os.getpid(), signal.SIGKILL)
store = Store.open(folder, create=True)
with run(store.folder, ["writer", point]):
    store.write_recording(RecordingRecord("a" * 64, name, "/logs/a.mcap"))
    if point == "between":
        die()
    if point == "before its place":
        Path.replace = die
    for number in range(10):
        store.write_recording(RecordingRecord(f"{number:064x}"[::-1], name, "/logs/b.mcap"))
"""


def writer(folder, point, name="w"):
    command = [sys.executable, "-c", WRITER, str(Path(__file__).parents[2]), str(folder), point, name]
    return subprocess.Popen(command)


@pytest.fixture
def store(tmp_path):
    return new_store(tmp_path)


def record(letter="a", name="a.mcap"):
    return RecordingRecord(letter * 64, name, f"/logs/{name}")


def kinds(store):
    return [entry.kind for entry in entries(store.folder)]


def test_a_run_says_who_did_what_with_what(store):
    with run(store.folder, ["auditor", "scan", "a.mcap"]) as entry:
        entry.used("recording", "a" * 64, "a.mcap")
        store.write_recording(record())
    opened, used, wrote, closed = entries(store.folder)
    assert opened.what["command"] == ["auditor", "scan", "a.mcap"]
    assert opened.what["user"]
    assert opened.what["host"]
    assert opened.what["versions"]["auditor"] == __version__
    assert {"python", "duckdb", "numpy", "pyarrow"} <= opened.what["versions"].keys()
    assert used.what == {"what": "recording", "hash": "a" * 64, "name": "a.mcap"}
    [file] = wrote.what["files"]
    assert file["path"] == f"recordings/{'a' * 64}.parquet"
    assert file["size"] == store.path("recordings", "a" * 64).stat().st_size
    assert (closed.kind, closed.what["outcome"], closed.what["unwritten"]) == (EntryKind.CLOSED, RunOutcome.DONE, [])
    assert {entry.run for entry in entries(store.folder)} == {opened.run}


def test_what_is_written_outside_of_a_run_is_a_run_of_its_own(store):
    store.write_recording(record())
    assert kinds(store) == [EntryKind.OPENED, EntryKind.WROTE, EntryKind.CLOSED]


def test_a_run_within_a_run_is_the_same(store):
    with run(store.folder, ["outer"]) as outer, logged(store.folder) as inner:
        assert inner is outer
    assert kinds(store) == [EntryKind.OPENED, EntryKind.CLOSED]
    assert current_runs() == ()


def test_what_fails_is_closed_as_failed_with_its_reason(store):
    with pytest.raises(StoreError), run(store.folder, ["auditor"]):
        raise StoreError("the disk is full", where="here")
    last = entries(store.folder)[-1]
    assert (last.what["outcome"], last.what["reason"]) == (RunOutcome.FAILED, "here: the disk is full")


def test_a_process_that_works_for_a_run_writes_to_its_chain(store):
    with run(store.folder, ["auditor"]) as opened:
        handed = current_runs()
    adopt(handed)
    try:
        store.write_recording(record())
    finally:
        runs._current.clear()
    assert entries(store.folder)[-1].run == opened.run_id


def test_superseding_and_removal_are_entries_of_their_own(store):
    rig = make_rig(3)
    known = add_measurement(store, rig, [make_measurement(rig, 0)])
    add_judgement(store, rig, known, "c")
    remove_recordings(store, ["a" * 64])
    removed = [entry.what["files"] for entry in entries(store.folder) if entry.kind == EntryKind.REMOVED]
    assert {file["path"].split("/")[0] for files in removed for file in files} >= {
        "recordings",
        "measurements",
        "judgements",
    }
    assert not verify(store).grave


def test_every_entry_follows_the_one_before_it(store):
    for letter in "abc":
        store.write_recording(record(letter))
    found = entries(store.folder)
    assert [entry.order for entry in found] == list(range(1, 10))
    assert [entry.before for entry in found[1:]] == [entry.sha256 for entry in found[:-1]]
    assert [head.order for head in heads(store.folder).values()] == [9]


def test_writers_at_once_have_chains_of_their_own_that_know_each_other(store):
    both = [writer(store.folder, "never", f"w{number}") for number in range(2)]
    with run(store.folder, ["the third"]):
        assert [each.wait() for each in both] == [0, 0]
        store.write_recording(record("c"))
    chains = read_chains(store.folder)
    assert 2 <= len(chains) <= 3
    assert not [problem for chain in chains for problem in chain.problems]
    last = entries(store.folder)[-1]
    assert set(last.what["heads"]) == {chain.name for chain in chains} - {name_of(store, last)}
    assert not verify(store).problems


def name_of(store, entry):
    [name] = [chain.name for chain in read_chains(store.folder) if entry in chain.entries]
    return name


@pytest.mark.parametrize("point", ["between", "before its place"])
def test_a_killed_run_is_closed_by_the_next_one(store, point):
    assert writer(store.folder, point).wait() == -signal.SIGKILL
    assert kinds(store)[0] == EntryKind.OPENED
    assert EntryKind.CLOSED not in kinds(store)
    assert not verify(store).grave
    assert len(verify(store).open_runs) == 1
    store.write_recording(record("c"))
    [closed] = [entry for entry in entries(store.folder) if entry.what.get("outcome") == RunOutcome.INTERRUPTED]
    assert len(closed.what["unwritten"]) == (point == "before its place")
    assert not verify(store).grave
    assert verify(store).open_runs == ()


def test_half_an_entry_that_a_killed_run_left_goes(store):
    store.write_recording(record())
    [path] = chain_paths(store.folder)
    with path.open("ab") as file:
        file.write(path.read_bytes()[:100])
    assert not verify(store).grave
    store.write_recording(record("b"))
    assert kinds(store) == [EntryKind.OPENED, EntryKind.WROTE, EntryKind.CLOSED] * 2
    assert not verify(store).grave


def test_every_flipped_bit_of_a_chain_is_told(store):
    store.write_recording(record())
    [path] = chain_paths(store.folder)
    content = path.read_bytes()
    for place in range(0, len(content), 7):
        changed = bytearray(content)
        changed[place] ^= 1 << place % 8
        path.write_bytes(changed)
        assert read_chains(store.folder)[0].problems, place
    path.write_bytes(content[:-1] + b"\x0b")
    assert read_chains(store.folder)[0].problems


def test_a_chain_whose_end_was_changed_is_left_as_it_is_and_another_begun(store):
    store.write_recording(record())
    [path] = chain_paths(store.folder)
    path.write_bytes(path.read_bytes()[:-10] + b"x" * 9 + b"\n")
    changed = path.read_bytes()
    store.write_recording(record("b"))
    assert path.read_bytes() == changed
    assert len(chain_paths(store.folder)) == 2
    with pytest.raises(StoreError, match=path.name):
        entries(store.folder)


def test_a_log_that_cannot_be_written_is_told(store):
    store.write_recording(record())
    shutil.rmtree(store.folder / "log")
    (store.folder / "log").write_text("no folder")
    with pytest.raises(StoreError, match="log"):
        store.write_recording(record("b"))
    assert not store.has_recording("b" * 64)


def test_entries_are_canonical_json(store):
    store.write_recording(record())
    [path] = chain_paths(store.folder)
    for line in path.read_text().splitlines():
        assert line == json.dumps(json.loads(line), sort_keys=True, separators=(",", ":"))
