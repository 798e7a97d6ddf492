"""The one way in which a process of the package starts another: isolated, with few variables, without network.

A shell may stand in a folder of logs, so nothing there may become code. Python is started with `-I`: neither the
working folder nor PYTHONPATH is searched. What the parent imports from is handed on as a resolved list in place of the
variable.
"""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

_BOOTSTRAP = Path(__file__).with_name("bootstrap.py")
_PACKAGE = Path(__file__).parent.parent

_NAMES = frozenset(
    {"HOME", "LANG", "LANGUAGE", "LOGNAME", "OPENCV_FOR_THREADS_NUM", "TEMP", "TMP", "TMPDIR", "TZ", "USER"}
)
_PREFIXES = ("AUDITOR_", "LC_", "XDG_", "CUDA_", "NVIDIA_", "OMP_", "OPENBLAS_", "MKL_", "KMP_", "GOTO_", "MALLOC_")
"""Variables of the locale, the user's folders, the GPU, and of threads and memory of native libraries."""

_SEARCHED = ("PATH", "LD_LIBRARY_PATH")

_HEAP = {"MALLOC_MMAP_THRESHOLD_": str(16 << 20), "MALLOC_TRIM_THRESHOLD_": str(64 << 20)}
"""glibc keeps what arrays leave, for the next frame's: else the system clears 2,000 pages a frame anew."""


def environment() -> dict[str, str]:
    """The variables that a child process gets; those of the heap are the user's where they are set.

    Lists of folders keep absolute folders only: an empty entry stands for the working folder.
    """
    handed_on = {name: value for name, value in os.environ.items() if name in _NAMES or name.startswith(_PREFIXES)}
    for name in _SEARCHED:
        folders = [folder for folder in os.environ.get(name, "").split(os.pathsep) if Path(folder).is_absolute()]
        if folders:
            handed_on[name] = os.pathsep.join(folders)
    return _HEAP | handed_on


def import_path() -> list[str]:
    """The folders that this process imports from, without those that are relative to the working folder."""
    return [folder for folder in sys.path if Path(folder).is_absolute()]


def start(module: str, *arguments: str, piped: bool = False, handed_on: Sequence[int] = ()) -> subprocess.Popen[bytes]:
    """Start the function `main` of a module of the package in a process of its own; its result is the exit code.

    Parameters
    ----------
    module
        The dotted name.
    arguments
        Its `sys.argv[1:]`.
    piped
        Whether its three streams are pipes. Else it has no input, and shares stdout and stderr with this process.
    handed_on
        Descriptors that stay open in it.
    """
    utf8, request = f"utf8={sys.flags.utf8_mode}", json.dumps([str(_PACKAGE), import_path(), module])
    flags = ["-I", "-X", utf8, *(["-B"] if sys.dont_write_bytecode else [])]
    command = [sys.executable, *flags, str(_BOOTSTRAP), request, *arguments]
    pipe = subprocess.PIPE if piped else None
    return subprocess.Popen(  # noqa: S603  # our own interpreter and file
        command,
        stdin=pipe or subprocess.DEVNULL,
        stdout=pipe,
        stderr=pipe,
        env=environment(),
        pass_fds=handed_on,
    )
