"""Which calibration is in force: by its history, never by a date."""

import multiprocessing
import os
import signal
from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest

from auditor.errors import StoreError
from auditor.model.verdict import Cause
from auditor.store import files
from auditor.store.calibrations import make_calibration
from auditor.store.maintenance.verify import verify
from auditor.store.queries import run_query, run_sql
from auditor.store.versions.history import (
    EntryIntoForce,
    History,
    Move,
    calibrations_in_force,
    histories,
    put_first_in_force,
    put_in_force,
)
from tests.making.calibrations import clean_frames
from tests.making.stores import PROCEDURE, make_rig, new_store

RIG = make_rig(4)
NOW = datetime(2026, 5, 1, tzinfo=UTC)


def make(recording="a", rig=RIG, procedure=PROCEDURE, made_at=NOW):
    clean = clean_frames({}, (recording * 64,), {}, {(Cause.DARK, None): [0.1, 0.2]})
    return replace(make_calibration(rig.kind, procedure, clean), calibrated_at=made_at)


def in_force(store):
    return [one.calibration_id for one in calibrations_in_force(store)]


def test_a_kept_calibration_is_in_force_once_it_is_put_there_whatever_its_date(tmp_path):
    store, first, later = new_store(tmp_path), make("a"), make("b", made_at=NOW + timedelta(days=36500))
    store.write_calibration(first)
    assert in_force(store) == []
    assert put_first_in_force(store, first)
    assert not put_first_in_force(store, later)
    assert in_force(store) == [first.calibration_id]
    put_in_force(store, later, EntryIntoForce.PROMOTED, "looked at")
    put_in_force(store, first, EntryIntoForce.PROMOTED)
    assert in_force(store) == [first.calibration_id]
    rows = run_sql(store, "SELECT how, reason, in_force FROM calibration_history ORDER BY number").to_pylist()
    assert [(row["how"], row["reason"], row["in_force"]) for row in rows] == [
        ("calibrated", None, False),
        ("promoted", "looked at", False),
        ("promoted", None, True),
    ]
    states = {row["calibration_id"]: row["state"] for row in run_query(store, "versions").to_pylist()}
    assert states == {first.calibration_id: "in force", later.calibration_id: "earlier"}
    assert verify(store).problems == ()


def test_rig_kinds_and_procedures_have_histories_of_their_own_and_vehicles_of_one_kind_share_theirs(tmp_path):
    store = new_store(tmp_path)
    kinds = [make("a"), make("b", make_rig(3)), make("c", procedure=replace(PROCEDURE, matcher="psmnet"))]
    for one in kinds:
        assert put_first_in_force(store, one)
    assert sorted(in_force(store)) == sorted(one.calibration_id for one in kinds)
    of_one_kind = make("d", make_rig(4, focal_px=705.0))
    assert not put_first_in_force(store, of_one_kind)
    put_in_force(store, of_one_kind, EntryIntoForce.PROMOTED)
    assert len(histories(store)) == 3
    assert of_one_kind.calibration_id in in_force(store)
    assert kinds[0].calibration_id not in in_force(store)


def history(*moves):
    return History(RIG.kind, PROCEDURE, tuple(Move(known, how, NOW) for known, how in moves))


@pytest.mark.parametrize(
    ("moves", "previous", "confirmed", "withdrawn"),
    [
        ([("a", EntryIntoForce.CALIBRATED)], None, "a", set()),
        ([("a", EntryIntoForce.REFRESHED), ("b", EntryIntoForce.REFRESHED)], "a", "a", set()),
        (
            [("a", EntryIntoForce.CALIBRATED), ("b", EntryIntoForce.REFRESHED), ("c", EntryIntoForce.REFRESHED)],
            "b",
            "a",
            set(),
        ),
        (
            [("a", EntryIntoForce.CALIBRATED), ("b", EntryIntoForce.REFRESHED), ("b", EntryIntoForce.PROMOTED)],
            "a",
            "b",
            set(),
        ),
        (
            [("a", EntryIntoForce.CALIBRATED), ("b", EntryIntoForce.REFRESHED), ("a", EntryIntoForce.ROLLED_BACK)],
            None,
            "a",
            {"b"},
        ),
        (
            [
                ("a", EntryIntoForce.CALIBRATED),
                ("b", EntryIntoForce.PROMOTED),
                ("c", EntryIntoForce.PROMOTED),
                ("b", EntryIntoForce.ROLLED_BACK),
            ],
            "a",
            "b",
            {"c"},
        ),
        (
            [
                ("a", EntryIntoForce.CALIBRATED),
                ("b", EntryIntoForce.REFRESHED),
                ("a", EntryIntoForce.ROLLED_BACK),
                ("b", EntryIntoForce.PROMOTED),
            ],
            "a",
            "b",
            set(),
        ),
    ],
)
def test_a_history_says_what_was_before_what_a_person_confirmed_and_what_was_withdrawn(
    moves, previous, confirmed, withdrawn
):
    found = history(*moves)
    assert (found.in_force, found.previous, found.confirmed) == (moves[-1][0], previous, confirmed)
    assert found.withdrawn == withdrawn


def test_a_version_that_came_into_force_meanwhile_is_not_replaced(tmp_path):
    store, a, b, c = new_store(tmp_path), make("a"), make("b"), make("c")
    for one in (a, b):
        put_in_force(store, one, EntryIntoForce.PROMOTED)
    with pytest.raises(StoreError, match="came into force meanwhile"):
        put_in_force(store, c, EntryIntoForce.REFRESHED, after=a.calibration_id)
    assert in_force(store) == [b.calibration_id]


def test_a_full_disk_leaves_the_version_in_force(tmp_path, monkeypatch):
    store, a, b = new_store(tmp_path), make("a"), make("b")
    put_in_force(store, a, EntryIntoForce.CALIBRATED)
    store.write_calibration(b)
    monkeypatch.setattr(files.os, "fsync", lambda _: (_ for _ in ()).throw(OSError(28, "No space left on device")))
    with pytest.raises(StoreError, match="No space left"):
        put_in_force(store, b, EntryIntoForce.PROMOTED)
    monkeypatch.undo()
    assert in_force(store) == [a.calibration_id]
    assert verify(store).problems == ()


def _promote_and_die(folder, moment, calibration):
    """Put a calibration in force in a process that is killed at the so-many-th call into the system."""
    calls = 0

    def counted(function):
        def call(*given, **how):
            nonlocal calls
            calls += 1
            if calls == moment:
                os.kill(os.getpid(), signal.SIGKILL)
            return function(*given, **how)

        return call

    files.os.fsync, files.os.open, files.open_part = map(counted, (os.fsync, os.open, files.open_part))
    files.PartFile.commit = counted(files.PartFile.commit)
    from auditor.store.store import Store  # noqa: PLC0415 - after what it uses was changed

    put_in_force(Store.open(folder), calibration, EntryIntoForce.PROMOTED)
    os._exit(0)


def test_whenever_it_is_killed_one_whole_version_is_in_force(tmp_path):
    store, a, b = new_store(tmp_path), make("a"), make("b")
    put_in_force(store, a, EntryIntoForce.CALIBRATED)
    fork, ends, seen = multiprocessing.get_context("fork"), [], set()
    for moment in range(1, 30):
        process = fork.Process(target=_promote_and_die, args=(store.folder, moment, b))
        process.start()
        process.join()
        ends.append(process.exitcode)
        [now] = in_force(store)
        seen.add(now)
        assert now in (a.calibration_id, b.calibration_id)
        assert verify(store).grave == ()
        if process.exitcode == 0:
            break
    assert ends[-1] == 0, "the last one was not killed"
    assert ends.count(-signal.SIGKILL) >= 4
    assert seen == {a.calibration_id, b.calibration_id}


def _promote(folder, calibrations):
    from auditor.store.store import Store  # noqa: PLC0415 - in the process

    for one in calibrations:
        put_in_force(Store.open(folder), one, EntryIntoForce.PROMOTED)


def test_processes_that_promote_at_once_lose_no_move(tmp_path):
    store, every = new_store(tmp_path), [make(digit) for digit in "abcd"]
    for one in every:
        store.write_calibration(one)
    fork = multiprocessing.get_context("fork")
    processes = [fork.Process(target=_promote, args=(store.folder, every * 2)) for _ in range(3)]
    for process in processes:
        process.start()
    for process in processes:
        process.join()
    [found] = histories(store)
    assert len(found.moves) == 3 * 2 * 4
    assert found.in_force == every[-1].calibration_id
