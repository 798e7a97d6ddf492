import gc
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from auditor.errors import LimitError, RecordingError
from auditor.measurement.checks.found import measuring_digest
from auditor.model import parameters
from auditor.model.rig_kind import ComparedTo
from auditor.model.settings import MeasureSettings
from auditor.pipeline import fork_server, workers
from auditor.pipeline.many import find_batch
from auditor.pipeline.measure import library_versions, measure_recording
from auditor.pipeline.workers import Limits, Outcome, Progress, limits_of, run_all, run_within
from auditor.safety.bootstrap import give_up_network
from auditor.store.schema import TABLES, table_schema
from tests.making.small_drives import THREE_CAMERAS, write_drive

ROOT = Path(__file__).parents[2]


def square(item: int, progress: Progress) -> int:
    progress("squaring", item)
    if item == 3:
        raise RecordingError("cannot be read", where=item)
    if item == 7:
        raise ValueError(f"{item} is no square")
    if item == 4:
        os.kill(os.getpid(), signal.SIGKILL)
    return item * item


def outcomes(items: Sequence[int], jobs: int) -> tuple[dict[int, Outcome[int, int]], list[tuple[int, str, int]]]:
    reported: list[tuple[int, str, int]] = []
    done = {
        o.item: o for o in run_all(square, items, jobs, lambda item, what, count: reported.append((item, what, count)))
    }
    return done, reported


@pytest.mark.parametrize("jobs", [1, 2])
def test_every_item_has_an_outcome_and_an_error_stays_with_its_item(jobs: int) -> None:
    done, reported = outcomes([1, 2, 3, 5], jobs)
    assert {item: outcome.result for item, outcome in done.items()} == {1: 1, 2: 4, 3: None, 5: 25}
    assert str(done[3].error) == "3: cannot be read"
    assert (2, "squaring", 2) in reported


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_unforeseen_error_is_its_item_s_error_in_one_line(jobs: int) -> None:
    done, _ = outcomes([1, 7, 5], jobs)
    assert {item: outcome.result for item, outcome in done.items()} == {1: 1, 7: None, 5: 25}
    message = str(done[7].error)
    assert message.startswith("7: auditor failed on it: ValueError: 7 is no square (pipeline/test_workers.py:")
    assert "please report" in message
    assert "\n" not in message


def test_a_killed_process_loses_its_item_alone() -> None:
    done, _ = outcomes([1, 4, 2, 5, 6], jobs=2)
    assert "its process died" in str(done[4].error)
    assert {item: outcome.result for item, outcome in done.items() if item != 4} == {1: 1, 2: 4, 5: 25, 6: 36}


def die_at_once(item: int, progress: Progress) -> int:
    if item % 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def test_processes_that_die_at_their_first_moment_lose_their_items_alone() -> None:
    done = {o.item: o for o in run_all(die_at_once, range(4), 2, lambda *_: None)}
    assert {item: outcome.result for item, outcome in done.items()} == {
        item: None if item % 2 else item for item in range(4)
    }
    assert all("its process died (exit code -9)" in str(done[item].error) for item in (1, 3))


def half_a_message(item: int, progress: Progress) -> int:
    if item == 1:
        threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGKILL)).start()
        while True:
            progress("m" * (1 << 20), 0)
    return item


def test_a_process_that_dies_within_a_message_loses_its_item_alone() -> None:
    done = {o.item: o for o in run_all(half_a_message, [1, 2, 4], 2, lambda *_: None)}
    assert {item: outcome.result for item, outcome in done.items()} == {1: None, 2: 2, 4: 4}
    assert "its process died (exit code -9)" in str(done[1].error)


def test_another_thread_than_the_main_one_can_run_tasks() -> None:
    done: list[dict[int, Outcome[int, int]]] = []
    scheduler = threading.Thread(target=lambda: done.append(outcomes([1, 2], jobs=2)[0]))
    scheduler.start()
    scheduler.join()
    assert [outcome.result for outcome in done[0].values()] in ([1, 4], [4, 1])


def stop_at_the_first_progress(item: int, progress: Progress) -> int:
    progress("begun", 0)
    signal.pause()
    return item


def test_an_interrupt_stops_the_workers_and_is_raised() -> None:
    def interrupt(item: int, what: str, count: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(run_all(stop_at_the_first_progress, [1, 2], 2, interrupt))


def greedy(item: str, progress: Progress) -> str:
    if item == "hungry":
        kept = bytearray(600 << 20)
        kept[:: 1 << 12] = bytes(len(kept) >> 12)
    if item in ("hungry", "silent"):
        signal.pause()
    while item == "endless":
        time.sleep(0.05)
        progress("slowly", 0)
    return item


@pytest.mark.parametrize(
    ("item", "limits", "says"),
    [
        ("hungry", Limits(memory_mb=500), "more than 500 MB of memory"),
        ("endless", Limits(seconds=0.5), "longer than 0.5 s"),
        ("silent", Limits(silent_s=0.5), "made no progress for"),
    ],
)
def test_a_task_over_its_budget_is_one_error_and_the_others_go_on(item: str, limits: Limits, says: str) -> None:
    """Only the task that never ends has a budget: however busy the machine, the others come to their end."""
    items = ["modest", item, "modest too"]
    outcomes = run_all(greedy, items, 2, lambda *_: None, lambda one: limits if one == item else Limits())
    done = {o.item: o for o in outcomes}
    assert isinstance(done[item].error, LimitError)
    assert says in str(done[item].error)
    assert "--" in str(done[item].error)
    assert {one: outcome.result for one, outcome in done.items() if one != item} == {
        "modest": "modest",
        "modest too": "modest too",
    }


def twenty_frames(item: str, progress: Progress) -> str:
    for frame in range(20):
        progress("measuring", frame)
    return item


def test_frames_that_come_keep_a_task_alive(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that goes on by 400 s with every frame: 8000 s in all, and never 500 s of silence."""
    now = [0.0]
    monkeypatch.setattr("auditor.pipeline.workers.monotonic", lambda: now[0])

    def goes_on(item: str, what: str, count: int) -> None:
        now[0] += 400

    [done] = run_all(twenty_frames, ["patient"], 1, goes_on, lambda _: Limits(silent_s=500))
    assert done.result == "patient"
    assert now[0] == 8000


def test_large_recordings_may_be_silent_longer() -> None:
    assert limits_of(10**11).silent_s == pytest.approx(10_600)
    assert limits_of(10**11, seconds=5).silent_s is None


def test_workers_end_with_their_parent() -> None:
    program = (
        "import sys; sys.path[0] = sys.argv[1]  # an empty entry would not be handed on\n"
        "from tests.pipeline.test_workers import report_and_wait; from auditor.pipeline.workers import run_all\n"
        "list(run_all(report_and_wait, [1, 2], 2, lambda item, what, done: print(what, flush=True)))"
    )
    with subprocess.Popen([sys.executable, "-c", program, ROOT], stdout=subprocess.PIPE, text=True) as parent:
        assert parent.stdout is not None
        workers = [int(parent.stdout.readline()) for _ in range(2)]
        parent.kill()
    deadline = time.monotonic() + 300  # which only a failing test waits for
    while any(is_running(pid) for pid in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(is_running(pid) for pid in workers)


def test_workers_whose_parent_was_killed_do_not_complain() -> None:
    program = (
        "import sys; sys.path[0] = sys.argv[1]\n"
        "from tests.pipeline.test_workers import report_on; from auditor.pipeline.workers import run_all\n"
        "list(run_all(report_on, [1, 2], 2, lambda item, what, done: print(what, flush=True)))"
    )
    command, pipe = [sys.executable, "-c", program, ROOT], subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True) as parent:
        assert parent.stdout is not None
        assert parent.stderr is not None
        parent.stdout.readline()
        parent.kill()
        assert parent.stderr.read() == ""


def test_an_interrupt_while_workers_start_leaves_none_behind_that_complains() -> None:
    """They start when the process that they are forked from has imported everything, which takes a second."""
    program = (
        "import os, signal, sys, threading; sys.path[0] = sys.argv[1]\n"
        "from tests.pipeline.test_workers import report_and_wait; from auditor.pipeline.workers import run_all\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "try:\n"
        "    threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        "    list(run_all(report_and_wait, [1, 2], 2, lambda *_: None))\n"
        "except KeyboardInterrupt:\n    sys.exit('interrupted')\n"
    )
    done = subprocess.run([sys.executable, "-c", program, ROOT], capture_output=True, text=True, check=False)
    assert done.stderr == "interrupted\n"


def test_who_asks_no_more_leaves_no_process_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    forked = []
    monkeypatch.setattr(workers, "fork", lambda *work: forked.append(fork_server.fork(*work)) or forked[-1])
    running = run_all(square_or_wait, [1, 0, 0], 2, lambda *_: None)
    assert next(running).result == 1
    working = {worker.pid for worker in forked}
    assert len(working) == 3
    running.close()  # type: ignore[attr-defined]  # as an exception in whoever asks does
    assert not any(is_running(pid) for pid in working)


def square_or_wait(item: int, progress: Progress) -> int:
    return square(item, progress) if item else report_and_wait(item, progress)


def report_on(item: int, progress: Progress) -> None:
    while True:
        progress(str(os.getpid()), item)


def report_and_wait(item: int, progress: Progress) -> int:
    progress(str(os.getpid()), 0)
    signal.pause()
    return item


def is_running(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def modules_of(path: str, progress: Progress) -> list[str]:
    """The modules that a process imports for one recording, beside those that it was forked with."""
    before = set(sys.modules)
    [task] = find_batch([Path(path)], Path(path).parent / "audit", MeasureSettings(jobs=1)).tasks
    measure_recording(task, progress)
    return sorted(set(sys.modules) - before)


def test_a_process_imports_hardly_anything_for_its_recording(tmp_path: Path) -> None:
    write_drive(tmp_path / "drive.mcap", 2, seed=1, positions_m=THREE_CAMERAS)
    [outcome] = run_all(modules_of, [str(tmp_path / "drive.mcap")], 1, lambda *_: None, lambda _: Limits())
    assert outcome.result is not None
    assert {name.partition(".")[0] for name in outcome.result} <= {"rosbags"}
    assert len(outcome.result) < 5


def collector(*_: object) -> tuple[bool, int]:
    return gc.isenabled(), gc.get_freeze_count()


def test_what_was_imported_is_no_garbage_to_be_looked_for() -> None:
    [outcome] = run_all(collector, ["any"], 1, lambda *_: None, lambda _: Limits())
    assert outcome.result is not None
    enabled, frozen = outcome.result
    assert enabled
    assert frozen > 0


MADE = (table_schema, library_versions, parameters._canonical_values)


def made_anew(_: Path) -> list[int]:
    """How often a process of a recording makes each of them."""
    before = [one.cache_info().misses for one in MADE]
    for table in TABLES:
        table_schema(table)
    library_versions()
    for compared_to in ComparedTo:
        measuring_digest(compared_to)
    return [one.cache_info().misses - there for one, there in zip(MADE, before, strict=True)]


def test_a_process_reads_no_description_of_tables_and_no_version_again(tmp_path: Path) -> None:
    assert run_within(Limits(), made_anew, tmp_path) == [0, 0, 0]


def interfaces(item: str, progress: Progress) -> list[str]:
    return [name for _, name in socket.if_nameindex()]


def variables(item: str, progress: Progress) -> dict[str, str]:
    return dict(os.environ)


def outcome_of(task, item="drive"):
    [outcome] = run_all(task, [item], 1, lambda *_: None, lambda _: Limits())
    assert outcome.error is None
    return outcome.result


def test_a_worker_has_no_network_where_the_system_allows() -> None:
    if subprocess.run(["unshare", "--net", "true"], capture_output=True, check=False).returncode != 0:
        pytest.skip("this system gives no network namespaces")
    assert outcome_of(interfaces) == ["lo"]


_AS_NOBODY = """
import os, socket
from auditor.safety.bootstrap import give_up_network
if os.getuid() == 0:
    os.setgroups([]); os.setgid(65534); os.setuid(65534)
before = (os.getuid(), os.getgid())
give_up_network()
print([name for _, name in socket.if_nameindex()], before == (os.getuid(), os.getgid()))
"""


def test_who_is_not_root_stays_who_they_are() -> None:
    done = subprocess.run([sys.executable, "-c", _AS_NOBODY], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.stdout.endswith("True\n")


def test_a_system_that_refuses_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("ctypes.CDLL", lambda *_, **__: type("Libc", (), {"unshare": staticmethod(lambda _: -1)}))
    before = socket.if_nameindex()
    give_up_network()
    assert socket.if_nameindex() == before


def test_a_worker_has_none_of_python_s_variables() -> None:
    assert [name for name in outcome_of(variables) if name.startswith(("PYTHON", "PYTEST"))] == []
