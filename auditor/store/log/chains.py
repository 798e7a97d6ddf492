"""The chains of a store: files of entries, each appended to under one lock of the log.

A mirror is a folder that stands for a store that lies elsewhere, on an object store. Beside such a folder a file names
the chains of the log that other machines write: nothing is appended to them here.
"""

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, suppress
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

from auditor.errors import StoreError
from auditor.store.files import for_owner, locked, make_folder, write_whole
from auditor.store.log.entry import Entry, EntryKind

LOG = "log"
"""The folder of the chains in a store."""

START = "0" * 64
"""What the first entry of a chain names as the one before it."""

_BLOCK = 1 << 16


@dataclass(frozen=True)
class ChainHead:
    """The last entry of a chain: its hash and its place in the order of all entries."""

    sha256: str
    order: int


@dataclass(frozen=True)
class Chain:
    """The entries of one file as far as they can be read, and one sentence for each thing that is wrong with it."""

    name: str
    entries: tuple[Entry, ...]
    problems: tuple[str, ...] = field(default=())


def chain_paths(folder: Path) -> list[Path]:
    """The chains of a store, by name."""
    return sorted((folder / LOG).glob("*.jsonl"))


def heads(folder: Path) -> dict[str, ChainHead]:
    """The head of each chain, by its name; chains are left out whose last entry was changed. Raises StoreError."""
    chain_heads = {}
    for path in chain_paths(folder):
        with suppress(StoreError):
            last = last_entry(path)
            if last is not None:
                chain_heads[path.stem] = ChainHead(last.sha256, last.order)
    return chain_heads


def entries(folder: Path) -> list[Entry]:
    """All entries of a store in their order. Raises StoreError where a chain is not whole."""
    chains = read_chains(folder)
    for chain in chains:
        if chain.problems:
            raise StoreError(chain.problems[0], where=folder / LOG / f"{chain.name}.jsonl")
    return in_order(chains)


def in_order(chains: list[Chain]) -> list[Entry]:
    """The entries of some chains in their order."""
    return sorted((entry for chain in chains for entry in chain.entries), key=lambda entry: entry.order)


def read_chains(folder: Path) -> list[Chain]:
    """All chains, each as far as it can be read. Raises StoreError where a file cannot be read at all."""
    return [read_chain(path) for path in chain_paths(folder)]


def read_chain(path: Path) -> Chain:
    """One chain, as far as it can be read. Raises StoreError where the file cannot be read at all."""
    with _opened(path) as file:
        content = file.read()
    lines = content.split(b"\n")
    torn, chain_entries, problems = lines.pop(), list[Entry](), list[str]()
    before: str | None = START
    order = 0
    for number, line in enumerate(lines, start=1):
        try:
            entry = Entry.of_line(line)
        except StoreError as error:
            problems.append(f"line {number}: {error.what}")
            before = None
            continue
        if before not in {None, entry.before} or entry.order <= order:
            problems.append(f"line {number}: it does not follow the line before it: entries were removed or replaced")
        before, order = entry.sha256, entry.order
        chain_entries.append(entry)
    if torn and _is_whole(torn):
        problems.append(f"line {len(lines) + 1}: its end was changed after it was written")
    return Chain(path.stem, tuple(chain_entries), tuple(problems))


def _is_whole(tail: bytes) -> bool:
    """True where what stands behind the last line end is an entry but for its end; else a writer was killed."""
    for line in (tail, tail[:-1]):
        with suppress(StoreError):
            Entry.of_line(line)
            return True
    return False


def append(path: Path, kind: EntryKind, run: str, content: Mapping[str, Any]) -> Entry:
    """Append an entry to a chain and make it durable; the log must be locked. Raises StoreError.

    What a killed process left of an entry goes.
    """
    all_heads = heads(path.parent.parent)
    mine = all_heads.get(path.stem)
    entry = Entry(
        order=1 + max((head.order for head in all_heads.values()), default=0),
        at=datetime.now(UTC).isoformat(timespec="microseconds"),
        kind=kind.value,
        run=run,
        pid=os.getpid(),
        before=START if mine is None else mine.sha256,
        what=content,
    )
    try:
        with open(path, "r+b" if path.exists() else "x+b", opener=for_owner) as file:
            file.truncate(_end_of_lines(file))
            file.seek(0, os.SEEK_END)
            file.write(entry.line)
            file.flush()
            os.fsync(file.fileno())
    except OSError as error:
        raise StoreError(
            f"the log cannot be written ({error.strerror or error})",
            where=path,
            remedy="make room, or make it writable: nothing is written to a store without its log",
        ) from error
    return entry


def last_entry(path: Path) -> Entry | None:
    """The last entry of a chain; None where it has no whole one. Raises StoreError where it was changed."""
    with _opened(path) as file:
        line = _last_line(file)
    return None if line is None else Entry.of_line(line)


def entries_from(path: Path, begin: int) -> list[Entry]:
    """The entries of a chain from a place in its file on. Raises StoreError."""
    with _opened(path) as file:
        file.seek(begin)
        return [Entry.of_line(line[:-1]) for line in file if line.endswith(b"\n")]


def whole_lines(path: Path) -> int:
    """The length of a chain's whole lines in bytes. Raises StoreError."""
    with _opened(path) as file:
        return _end_of_lines(file)


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """A chain that is read in the block. Raises StoreError where it cannot be."""
    try:
        with path.open("rb") as file:
            yield file
    except OSError as error:
        raise StoreError(f"it cannot be read ({error.strerror or error})", where=path) from error


def _last_line(file: BinaryIO) -> bytes | None:
    """The last whole line of a file, without its end."""
    end = _end_of_lines(file)
    if end == 0:
        return None
    begin = _end_of_lines(file, end - 1)
    file.seek(begin)
    return file.read(end - 1 - begin)


def _end_of_lines(file: BinaryIO, end: int | None = None) -> int:
    """Where the whole lines of a file's first `end` bytes end; without it, of the whole file."""
    end = file.seek(0, os.SEEK_END) if end is None else end
    while end > 0:
        begin = max(0, end - _BLOCK)
        file.seek(begin)
        place = file.read(end - begin).rfind(b"\n")
        if place >= 0:
            return begin + place + 1
        end = begin
    return 0


def log_lock(folder: Path) -> AbstractContextManager[None]:
    """Hold the lock of a store's log, which is made where there is none. Raises StoreError."""
    place = folder / LOG
    try:
        make_folder(place)
    except OSError as error:
        raise StoreError(f"the log cannot be made ({error.strerror or error})", where=place) from error
    return locked(place)


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
