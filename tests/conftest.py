"""What holds for the whole suite, and where the real recorded data lies."""

import gc
import os
import shutil
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

from auditor.pipeline import fork_server

if TYPE_CHECKING:
    from tests.making.case_stores import AttackedStore

# Each process of the suite has a core of its own: threads of libraries, which read this when they are loaded, only wait
# for each other there.
for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"):
    os.environ.setdefault(_threads, "1")

# What Python compiles it keeps, whatever the shell says: the processes that tests start would each compile the program.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# What is imported and collected stays: to look through it again and again takes a third of collecting.
gc.disable()

# Where there is room, what tests write stays in memory: a disk takes 3 ms to keep a file, and a store has many. A run
# without failures leaves nothing there (`tmp_path_retention_policy`).
_MEMORY, _ROOM_BYTES = Path("/dev/shm"), 8 * 2**30
if "TMPDIR" not in os.environ and os.access(_MEMORY, os.W_OK) and shutil.disk_usage(_MEMORY).free >= _ROOM_BYTES:
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(_MEMORY))

# Each recording has a process of its own, and is written by our own writers: what these say of their messages is parsed
# once, for the process that the others are forked from.
fork_server._PRELOADED.append("tests.making.own_definitions")

# So is what `inspect` describes a recording by: it imports what measures, a quarter of a second in each process.
fork_server._PRELOADED.append("auditor.cli.recording_description")

# However busy the machine, no example fails for the time that it took.
settings.register_profile("without time limits", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("without time limits")


def pytest_collection_finish() -> None:
    """From here on garbage is collected, and what there is by now is passed over."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _own_cache(tmp_path_factory: pytest.TempPathFactory) -> None:
    """What auditor remembers of stores, it remembers in a folder of the tests; nobody's settings are read."""
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))
    os.environ["XDG_CONFIG_HOME"] = str(tmp_path_factory.mktemp("config"))
    os.environ["XDG_STATE_HOME"] = str(tmp_path_factory.mktemp("state"))


@pytest.fixture(scope="session", autouse=True)
def _one_thread_a_connection() -> None:
    """DuckDB's threads wait for each other as well; they take a twentieth of its time on small stores."""
    from auditor.store import connection  # noqa: PLC0415 - behind the variables above, which its libraries read

    connection.SHUT["threads"] = 1


@pytest.fixture(scope="session")
def attacked(tmp_path_factory: pytest.TempPathFactory) -> "AttackedStore":
    """A judged store of two attacked drives, for the tests of several folders; tests do not change it."""
    from tests.making.case_stores import attacked_store  # noqa: PLC0415 - what few tests need

    return attacked_store(tmp_path_factory.mktemp("attacked"))


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of real recorded data; a test that uses it is skipped, with the reason, where there is none."""
    folder = os.environ.get("AUDITOR_TEST_DATA")
    if not folder:
        pytest.skip("AUDITOR_TEST_DATA is not set: no real recorded data")
    path = Path(folder)
    assert path.is_dir(), f"AUDITOR_TEST_DATA names {path}, which is no folder"
    return path
