"""Runs: from the entry that opens one to the entry that closes it, by whoever does so, and what they say of files."""

import re
import secrets
import socket
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

from auditor.errors import AuditorError, StoreError
from auditor.store.files import WrittenFile, held
from auditor.store.log.chains import (
    LOG,
    append,
    chain_paths,
    entries_from,
    foreign_chains,
    heads,
    last_entry,
    log_lock,
    whole_lines,
)
from auditor.store.log.entry import (
    Entry,
    EntryKind,
    OutputFile,
    RunOutcome,
    hash_file,
    place_in,
    provenance,
    this_program,
)
from auditor.store.log.signatures import Signer, signer_of

_LONGEST_HOST = 40
_ID_BYTES = 8

_current: "dict[Path, Run]" = {}
"""The run of this process, by its store."""


@dataclass(frozen=True)
class Run:
    """A run that is under way: its store, its chain and its id. It may be handed to other processes."""

    folder: Path
    chain: Path
    run_id: str
    begin: int = 0
    """Where in its chain it begins, in bytes, or before that."""

    def used(self, subject: str, sha256: str, name: str = "") -> None:
        """Say what the run reads: a recording, a calibration or a model, by its hash. Raises StoreError."""
        self.say(EntryKind.USED, {"what": subject, "hash": sha256, "name": name})

    def output(self, path: str | Path, sha256: str, size: int | None = None) -> None:
        """Say that a file lies in its place. Raises StoreError."""
        place = place_in(self.folder, Path(path)) if Path(path).is_absolute() else str(path)
        size = size if size is not None else (self.folder / place).stat().st_size
        self.say(EntryKind.WROTE, {"files": [OutputFile(place, size, sha256).fields]})

    @contextmanager
    def saying(self, kind: EntryKind, content: dict[str, Any]) -> Iterator[None]:
        """Append an entry, and do within the block what it says. Raises StoreError."""
        with log_lock(self.folder):
            append(self.chain, kind, self.run_id, content)
            yield

    def writing(self, outputs: Sequence[OutputFile], kind: EntryKind = EntryKind.WROTE) -> AbstractContextManager[None]:
        """Say that files are put in their places, and do so within the block. Raises StoreError."""
        return self.saying(kind, {"files": [output.fields for output in outputs]})

    def announce(self, written: WrittenFile) -> AbstractContextManager[None]:
        """Say that a file is put in its place, and do so within the block. Raises StoreError."""
        return self.writing([OutputFile.of_written(written, self.folder)])

    def packing(self, outputs: Sequence[OutputFile], places: Sequence[str]) -> AbstractContextManager[None]:
        """Say that files are put in their places of what lies in others, which go, and do so within the block.

        Raises StoreError.
        """
        files = [*(output.fields for output in outputs), *({"path": place} for place in places)]
        return self.saying(EntryKind.PACKED, {"files": files})

    def removing(self, places: Sequence[str], why: str) -> AbstractContextManager[None]:
        """Say that files of the store are removed, and do so within the block. Raises StoreError."""
        return self.saying(EntryKind.REMOVED, {"files": [{"path": one} for one in places], "why": why})

    def say(self, kind: EntryKind, content: dict[str, Any]) -> None:
        """Append an entry. Raises StoreError."""
        with self.saying(kind, content):
            pass


@contextmanager
def run(folder: Path, command: Sequence[str], key: Path | None = None) -> Iterator[Run]:
    """A run on the store in a folder: all that is written to it inside the block belongs to it.

    Inside another run of this process on the same store it is that one. Runs that were killed are closed first. At its
    end the heads of all chains are signed by the private key of a file, or of the one that the environment names.
    Raises StoreError where the log cannot be written, and SettingError where that is no key.
    """
    folder = folder.resolve()
    if folder in _current:
        yield _current[folder]
        return
    signer = signer_of(key)
    with ExitStack() as stack:
        with log_lock(folder):
            close_interrupted(folder)
            chain = stack.enter_context(_free_chain(folder))
            opened = Run(folder, chain, secrets.token_hex(_ID_BYTES), whole_lines(chain))
            append(chain, EntryKind.OPENED, opened.run_id, {**provenance(command), "heads": _heads(folder, chain)})
        _current[folder] = opened
        stack.callback(_current.pop, folder)
        try:
            yield opened
        except BaseException as error:
            with suppress(StoreError):  # the error itself is what is to be told
                _close(opened, RunOutcome.FAILED, _reason(error), signer)
            raise
        _close(opened, RunOutcome.DONE, signer=signer)


@contextmanager
def logged(folder: Path) -> Iterator[Run]:
    """The run of this process on a store; where there is none, one of this program for the block alone."""
    with run(folder, this_program()) as entry:
        yield entry


def current_runs() -> tuple[Run, ...]:
    """The runs of this process, to be adopted by those that work for it."""
    return tuple(_current.values())


def adopt(runs: Sequence[Run]) -> None:
    """Belong to runs of another process: what this one writes to their stores is theirs."""
    _current.update({one.folder: one for one in runs})


def close_interrupted(folder: Path) -> None:
    """Close the runs of processes that are gone; the log must be locked. Raises StoreError."""
    for path in _own_chains(folder):
        with held(path) as free:
            opening = open_run(path) if free and _is_usable(path) else None
            if opening is not None:
                interrupted = Run(folder, path, opening.run)
                _append_closing(interrupted, RunOutcome.INTERRUPTED, "its process was gone when the next run began")


def open_run(path: Path) -> Entry | None:
    """The last entry of the run of a chain that was not closed; None where all were. Raises StoreError."""
    last = last_entry(path)
    return None if last is None or last.kind in {EntryKind.CLOSED, EntryKind.SIGNED} else last


def pending(entries: Sequence[Entry], run_id: str) -> list[Entry]:
    """The last entry of each process of a run that puts files in their places or removes them.

    Only these may not have come true: before it says what it does next, a process has done what it said.
    """
    last: dict[int, Entry] = {}
    for entry in entries:
        if entry.run == run_id:
            last[entry.pid] = entry
    return [
        entry
        for entry in last.values()
        if entry.kind in {EntryKind.WROTE, EntryKind.REMOVED, EntryKind.UPGRADED, EntryKind.PACKED}
    ]


def _close(ended: Run, outcome: RunOutcome, reason: str = "", signer: Signer | None = None) -> None:
    with log_lock(ended.folder):
        _append_closing(ended, outcome, reason)
        if signer is not None:
            seen = {name: head.sha256 for name, head in heads(ended.folder).items()}
            append(ended.chain, EntryKind.SIGNED, ended.run_id, {"heads": seen, "signature": signer(seen)})


def _append_closing(ended: Run, outcome: RunOutcome, reason: str) -> None:
    """Close a run, and say which of its last files are not in the places where they should be."""
    entries = entries_from(ended.chain, ended.begin)
    unwritten = [
        [entry.order, file["path"]]
        for entry in pending(entries, ended.run_id)
        for file in entry.what["files"]
        if not _is_true(ended.folder, file)
    ]
    content = {
        "outcome": outcome.value,
        "reason": reason,
        "unwritten": unwritten,
        "heads": _heads(ended.folder, ended.chain),
    }
    append(ended.chain, EntryKind.CLOSED, ended.run_id, content)


def _is_true(folder: Path, file: dict[str, Any]) -> bool:
    path = folder / file["path"]
    try:
        return hash_file(path) == (file["size"], file["sha256"]) if "sha256" in file else not path.exists()
    except StoreError:
        return False


def _reason(error: BaseException) -> str:
    return str(error) if isinstance(error, AuditorError) else type(error).__name__


def _heads(folder: Path, chain: Path) -> dict[str, str]:
    """The hashes of the heads of all chains but one."""
    return {name: head.sha256 for name, head in heads(folder).items() if name != chain.stem}


@contextmanager
def _free_chain(folder: Path) -> Iterator[Path]:
    """A chain of this host that no process holds, or a new one, held until the end of the block: its run goes on."""
    host = re.sub(r"[^A-Za-z0-9.]+", "-", socket.gethostname())[:_LONGEST_HOST].strip("-.") or "host"
    new = folder / LOG / f"{host}-{secrets.token_hex(_ID_BYTES)}.jsonl"
    for path in [*(one for one in _own_chains(folder) if one.name.startswith(f"{host}-")), new]:
        with ExitStack() as stack:
            if path == new:
                path.touch(0o600)
            if _is_usable(path) and stack.enter_context(held(path)):
                yield path
                return


def _own_chains(folder: Path) -> list[Path]:
    """The chains that runs of this machine may go on with: where they are held by nobody, their processes are gone."""
    foreign = foreign_chains(folder)
    return [path for path in chain_paths(folder) if path.name not in foreign]


def _is_usable(path: Path) -> bool:
    """False where the end of a chain was changed: nothing may follow it."""
    try:
        last_entry(path)
    except StoreError:
        return False
    return True


_CHANGES = frozenset({EntryKind.WROTE, EntryKind.REMOVED, EntryKind.UPGRADED, EntryKind.PACKED})


@dataclass(frozen=True)
class Place:
    """What may lie in one place: the `accepted` outputs, None where nothing may; `entry` is the last one about it.

    There are several only while the run that changes it is open.
    """

    accepted: tuple[OutputFile | None, ...]
    entry: Entry

    def accepts(self, file: OutputFile | None) -> bool:
        """Whether this is what should lie there."""
        return file in self.accepted


@dataclass(frozen=True)
class LogState:
    """What the log says: `places` by path, the runs by their ids, and those that were not closed."""

    places: dict[str, Place] = field(default_factory=dict)
    runs: dict[str, Entry] = field(default_factory=dict)
    open_runs: tuple[Entry, ...] = ()

    def told(self, place: str) -> str:
        """Which command changed a place last, and when."""
        entry = self.places[place].entry
        opened = self.runs.get(entry.run)
        words = opened.what.get("command", ()) if opened is not None else ()
        return f"{' '.join(words[:2]) or 'a run'} at {entry.at[:19]}Z"


def expected(entries: Sequence[Entry]) -> LogState:
    """What entries, in their order, say of files."""
    opened = {entry.run: entry for entry in entries if entry.kind == EntryKind.OPENED}
    closed = {entry.run for entry in entries if entry.kind == EntryKind.CLOSED}
    under_way = [entry for run, entry in opened.items() if run not in closed]
    unsettled = {entry.order for one in under_way for entry in pending(entries, one.run)}
    untrue = {
        (order, path)
        for entry in entries
        if entry.kind == EntryKind.CLOSED
        for order, path in entry.what.get("unwritten", ())
    }
    places: dict[str, Place] = {}
    for entry in entries:
        if entry.kind in _CHANGES:
            changes = [file for file in entry.what["files"] if (entry.order, file["path"]) not in untrue]
            if entry.kind == EntryKind.UPGRADED and changes:
                places.clear()
            for file in changes:
                _change(places, entry, file, settled=entry.order not in unsettled)
    return LogState(places, opened, tuple(under_way))


def _change(places: dict[str, Place], entry: Entry, file: dict[str, object], *, settled: bool) -> None:
    path = str(file["path"])
    if not _is_inside(path):
        return
    new = OutputFile.of_fields(file) if "sha256" in file else None
    if new is None and not settled and path not in places:
        return  # it may be there still, and the row that finished it says how it was
    before: tuple[OutputFile | None, ...] = places[path].accepted if path in places else (None,)
    places[path] = Place((new,) if settled else (new, *before), entry)


def _is_inside(path: str) -> bool:
    place = PurePosixPath(path)
    return not place.is_absolute() and ".." not in place.parts
