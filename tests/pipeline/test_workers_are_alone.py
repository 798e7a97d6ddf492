"""What a process that reads a recording has not: a network, and the variables of a shell."""

import os
import socket
import subprocess
import sys

import pytest

from auditor.pipeline.workers import Limits, Progress, run_all
from auditor.safety.bootstrap import give_up_network


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
