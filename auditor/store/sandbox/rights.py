"""Rights that a process gives up for good, and limits that its kernel holds it to."""

import ctypes
import resource
import signal
import struct

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
