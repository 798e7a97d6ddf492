"""Slots: the folders of the user's cache that mirrors lie in, each one process's alone while it uses it."""

import fcntl
import hashlib
import json
import os
from collections.abc import Iterable
from itertools import count
from pathlib import Path

from auditor.pipeline.remote.addresses import Address
from auditor.pipeline.remote.snapshots import Files
from auditor.store.files import make_folder

BASE, HASHED, USED = "base.json", "hashed.json", "used"
"""What a slot has beside the store: the snapshot that it began with, hashes, and a mark that something was written."""

Stamp = tuple[int, int, int]

_ADDRESS_DIGITS = 16


def free_slot(address: Address, *, left: bool) -> tuple[Path, int]:
    """A folder for a mirror that no process uses, and what this one holds it by.

    Raises FileNotFoundError where there is none in which an ended process `left` something.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "auditor" / "mirrors"
    make_folder(base)
    name = hashlib.sha256(str(address).encode()).hexdigest()[:_ADDRESS_DIGITS]
    known = sorted(one for one in base.glob(f"{name}-*") if "-aside-" not in one.name)
    slots: Iterable[Path] = (base / f"{name}-{number}" for number in count())
    for slot in (one for one in known if (one / USED).exists()) if left else slots:
        make_folder(slot)
        lock = os.open(slot, os.O_RDONLY)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(lock)
        else:
            return slot, lock
    raise FileNotFoundError(name)


def read_hashed(slot: Path) -> dict[str, tuple[Stamp, str]]:
    """The hashes of files by their sizes, times and inodes, as they were when the mirror was last used."""
    try:
        content = json.loads((slot / HASHED).read_bytes())
        return {place: ((size, at, inode), sha256) for place, ((size, at, inode), sha256) in content.items()}
    except (OSError, ValueError):
        return {}


def read_base(slot: Path) -> Files:
    """The files of the snapshot that a mirror was last made equal to."""
    try:
        content = json.loads((slot / BASE).read_bytes())
        return {place: (size, sha256) for place, (size, sha256) in content.items()}
    except (OSError, ValueError):
        return {}
