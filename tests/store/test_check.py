"""A check of a store finds what is missing, altered, inconsistent or foreign, one line each."""

from datetime import UTC, datetime
from pathlib import Path

import pytest

from auditor.store.maintenance.verify import verify
from auditor.store.records import GivenLabel, RecordingRecord
from auditor.store.tables import read_rows
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store

RIG = make_rig(3)


@pytest.fixture
def store(tmp_path):
    """A recording, measured, judged and labelled by a person."""
    store = new_store(tmp_path)
    measurement = add_measurement(store, RIG, [make_measurement(RIG, number) for number in range(4)])
    add_judgement(store, RIG, measurement, "cc2c")
    [recording] = store.ids("recordings")
    store.write_given_labels(recording, [GivenLabel(datetime(2026, 1, 31, tzinfo=UTC))])
    return store


def problems(store):
    every = map(str, verify(store).problems)
    return [line for line in every if "calibration_id" not in line]  # no calibration was made for this store


def written(table, **changed):
    """A damage: the first row of a table is written again, with other values, as the store writes it."""

    def change(store, path):
        rows = [{**row, **changed} for row in read_rows(table, path)]
        store.write(table, path.stem, rows)

    return change


def altered(change):
    """A damage of a file by somebody else."""
    return lambda _, path: change(path)


def test_a_whole_store_has_no_problem(store):
    assert problems(store) == []
    assert len(verify(store).problems) == 1  # the calibration that the judgement names


@pytest.mark.parametrize(
    ("table", "damage", "found"),
    [
        ("frames", altered(Path.unlink), "it is missing"),
        ("verdicts", altered(Path.unlink), "it is missing"),
        ("frames", altered(lambda path: path.write_bytes(path.read_bytes()[:-9])), "it is not as it was"),
        ("measurements", written("measurements", frames=5), "counts 5 rows of frames, and there are 4"),
        ("judgements", written("judgements", clean=7), "counts 8 rows of verdicts, and there are 4"),
        ("given_labels", written("given_labels", recording_id="f" * 64), "there is no recording_id ffff"),
        ("recordings", altered(Path.unlink), "there is no recording_id"),
        ("rigs", altered(Path.unlink), "there is no rig_id"),
        ("measurements", altered(Path.unlink), "there is no measurement_id"),
    ],
)
def test_each_damage_is_found(store, table, damage, found):
    [row_id] = store.ids(table)
    damage(store, store.path(table, row_id))
    assert any(found in line for line in problems(store)), problems(store)


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("notes.txt", "it was added"),
        ("frames/notes.txt", "it was added"),
        ("frames/.aa.parquet.0123456789abcdef.part", "killed"),
        (f"frames/{'e' * 32}.parquet", "killed"),
        (f"pictures/{'e' * 32}/0_S1.jpg", "killed"),
        (".upgraded/x", "killed"),
    ],
)
def test_what_does_not_belong_there_is_found(store, name, found):
    path = store.folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"x")
    [line] = problems(store)
    assert line.startswith(name)
    assert found in line


def test_a_check_changes_nothing_and_goes_on_behind_a_problem(store):
    store.write_recording(RecordingRecord("b" * 64, "b.mcap", "/b.mcap"))
    for path in store.finished_paths("recordings"):
        path.write_bytes(b"")
    before = {path: path.stat().st_mtime_ns for path in store.folder.rglob("*")}
    assert sum("it is not as" in line for line in problems(store)) == 2
    assert {path: path.stat().st_mtime_ns for path in store.folder.rglob("*")} == before
