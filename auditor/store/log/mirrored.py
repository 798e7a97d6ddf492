"""Mirrors: folders that stand for a store that lies elsewhere, on an object store.

Beside such a folder a file names the chains of the log that other machines write: nothing is appended to them here.
"""

import json
from collections.abc import Iterable
from pathlib import Path

from auditor.store.files import write_whole

_FOREIGN = "foreign.json"


def is_mirror(folder: Path) -> bool:
    """Whether a folder is a mirror of a store that lies elsewhere."""
    return (folder.parent / _FOREIGN).is_file()


def foreign_chains(folder: Path) -> frozenset[str]:
    """The names of the chains in a folder that others write; none in a store that is no mirror."""
    path = folder.parent / _FOREIGN
    return frozenset(json.loads(path.read_bytes())) if path.is_file() else frozenset()


def note_foreign(folder: Path, chains: Iterable[str]) -> None:
    """Make a folder a mirror, with these chains of others. Raises StoreError."""
    write_whole(folder.parent / _FOREIGN, json.dumps(sorted(chains)).encode())
