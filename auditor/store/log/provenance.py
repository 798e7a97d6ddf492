"""Who runs what: user, host, command, versions, and the code of others that is loaded."""

import getpass
import hashlib
import os
import platform
import socket
import sys
from collections.abc import Sequence
from functools import cache
from importlib.metadata import PackageNotFoundError, distribution, version
from pathlib import Path
from typing import Any

from auditor import __version__
from auditor.resources import plug_ins

_VERSIONED = ("duckdb", "numpy", "onnxruntime", "opencv-python-headless", "pyarrow", "torch")


def provenance(command: Sequence[str]) -> dict[str, Any]:
    """What the first entry of a run says of it."""
    return {
        "command": list(command),
        "user": user(),
        "host": socket.gethostname(),
        "folder": str(Path.cwd()),
        "versions": dict(_versions()),
        "plug_ins": dict(_plug_ins()),
    }


def user() -> str:
    """The user's name, or number where it has none."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # Python 3.13 raises OSError where older ones raise KeyError
        return str(os.getuid())


@cache
def _versions() -> dict[str, str]:
    found = {"auditor": __version__, "python": platform.python_version(), "system": platform.platform()}
    for name in _VERSIONED:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@cache
def _plug_ins() -> dict[str, dict[str, str]]:
    """Installed plug-ins by name: their version, and the hash of the list of their files, which has a hash of each."""
    return {name: {"version": its, "sha256": _record(name)} for name, its in plug_ins().items()}


def _record(name: str) -> str:
    record = distribution(name).read_text("RECORD") or ""
    return hashlib.sha256(record.encode()).hexdigest()


def this_program() -> list[str]:
    """The command of a program that uses the library."""
    return [Path(sys.argv[0]).name or "python", *sys.argv[1:]] if sys.argv else ["python"]
