"""The process that one SQL text of a user runs in; `process` starts it.

The request comes as JSON on its stdin, the answer leaves as Arrow's stream on its stdout, an error as JSON on its
stderr. Libraries that print find neither. It gives up rights for good, and its kernel holds it to limits.
"""

import ctypes
import json
import os
import resource
import signal
import struct
import sys
from typing import IO, Any

import pyarrow as pa

from auditor.errors import AuditorError, QueryError
from auditor.store.folder import StoreFolder
from auditor.store.queries import stream_sql
from auditor.store.sandbox.limits import SqlLimits

_PR_SET_PDEATHSIG = 1
_PR_SET_NO_NEW_PRIVS = 38
_LANDLOCK_CREATE_RULESET = 444
_LANDLOCK_RESTRICT_SELF = 446
_VERSION_ONLY = 1
_WRITING = sum(1 << bit for bit in (1, 4, 5, 6, 7, 8, 9, 10, 11, 12))
"""Landlock's first rights that change files or folders: write, remove, and make entries of every kind."""
_LATER = ((2, 13), (3, 14))
"""Rights that came with later versions of Landlock: to move between folders, and to cut a file."""
_TCP = 0b11
_TCP_SINCE = 4


def main() -> int:
    """Answer one request; returns the exit code."""
    request = json.load(sys.stdin)
    answer, trouble = os.dup(sys.stdout.fileno()), os.dup(sys.stderr.fileno())
    nothing = os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        os.dup2(nothing, stream.fileno())
    limits = SqlLimits(**request["limits"])
    give_up_writing()
    limit(limits.seconds, limits.process_bytes)
    try:
        with open(answer, "wb") as sink:  # noqa: PTH123 - a descriptor
            _send(request, limits, sink)
    except AuditorError as error:
        _tell(trouble, error)
    except MemoryError:
        _tell(trouble, limits.out_of_memory())
    except Exception as error:  # noqa: BLE001 - whatever it is: one line, as of any other query
        _tell(trouble, QueryError(" ".join(f"{type(error).__name__}: {error}".split()), where="SQL"))
    else:
        return 0
    return 1


def _send(request: dict[str, Any], limits: SqlLimits, sink: IO[bytes]) -> None:
    store = StoreFolder.open(request["store"])
    with stream_sql(store, request["sql"], limits) as batches, pa.ipc.new_stream(sink, batches.schema) as stream:
        for batch in batches:
            stream.write_batch(batch)


def _tell(trouble: int, error: AuditorError) -> None:
    told = {"kind": type(error).__name__, "what": error.what, "where": error.where, "remedy": error.remedy}
    os.write(trouble, json.dumps(told).encode())


def give_up_writing() -> None:
    """From here on this process, and each thread that it starts, can write to no file and make none.

    It ends with its parent. The kernel refuses every byte that would go to a file, and leaves no core dump. Where it
    has Landlock, it refuses also to open a file for writing, to remove, rename or make one, and to connect anywhere.
    """
    for limit in (resource.RLIMIT_FSIZE, resource.RLIMIT_CORE):
        resource.setrlimit(limit, (0, 0))
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    version = libc.syscall(_LANDLOCK_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION_ONLY)
    if version < 1:
        return
    rights = _WRITING | sum(1 << bit for since, bit in _LATER if version >= since)
    refused = struct.pack("QQ", rights, _TCP) if version >= _TCP_SINCE else struct.pack("Q", rights)
    ruleset = libc.syscall(_LANDLOCK_CREATE_RULESET, refused, ctypes.c_size_t(len(refused)), 0)
    libc.prctl(_PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)
    libc.syscall(_LANDLOCK_RESTRICT_SELF, ruleset, 0)


def limit(seconds: float, memory_bytes: int) -> None:
    """The kernel ends this process after so many seconds, and gives it no more memory than that."""
    resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.setitimer(signal.ITIMER_REAL, seconds)
