"""Runs: from the entry that opens one to the entry that closes it, by whoever does so."""

import re
import secrets
import socket
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auditor.errors import AuditorError, StoreError
from auditor.store.files import Written, held
from auditor.store.log.chains import LOG, append, chain_paths, entries_from, heads, last_entry, log_lock, whole_lines
from auditor.store.log.entry import Entry, Kind, Outcome
from auditor.store.log.mirrored import foreign_chains
from auditor.store.log.outputs import Output, hash_file, place_in
from auditor.store.log.provenance import provenance, this_program
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

    def used(self, what: str, sha256: str, name: str = "") -> None:
        """Say what the run reads: a recording, a calibration or a model, by its hash. Raises StoreError."""
        self.say(Kind.USED, {"what": what, "hash": sha256, "name": name})

    def output(self, path: str | Path, sha256: str, size: int | None = None) -> None:
        """Say that a file lies in its place. Raises StoreError."""
        place = place_in(self.folder, Path(path)) if Path(path).is_absolute() else str(path)
        size = size if size is not None else (self.folder / place).stat().st_size
        self.say(Kind.WROTE, {"files": [Output(place, size, sha256).fields]})

    @contextmanager
    def saying(self, kind: Kind, what: dict[str, Any]) -> Iterator[None]:
        """Append an entry, and do within the block what it says. Raises StoreError."""
        with log_lock(self.folder):
            append(self.chain, kind, self.run_id, what)
            yield

    def writing(self, outputs: Sequence[Output], kind: Kind = Kind.WROTE) -> AbstractContextManager[None]:
        """Say that files are put in their places, and do so within the block. Raises StoreError."""
        return self.saying(kind, {"files": [output.fields for output in outputs]})

    def announce(self, written: Written) -> AbstractContextManager[None]:
        """Say that a file is put in its place, and do so within the block. Raises StoreError."""
        return self.writing([Output.of_written(written, self.folder)])

    def packing(self, outputs: Sequence[Output], places: Sequence[str]) -> AbstractContextManager[None]:
        """Say that files are put in their places of what lies in others, which go, and do so within the block.

        Raises StoreError.
        """
        files = [*(output.fields for output in outputs), *({"path": place} for place in places)]
        return self.saying(Kind.PACKED, {"files": files})

    def removing(self, places: Sequence[str], why: str) -> AbstractContextManager[None]:
        """Say that files of the store are removed, and do so within the block. Raises StoreError."""
        return self.saying(Kind.REMOVED, {"files": [{"path": one} for one in places], "why": why})

    def say(self, kind: Kind, what: dict[str, Any]) -> None:
        """Append an entry. Raises StoreError."""
        with self.saying(kind, what):
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
            append(chain, Kind.OPENED, opened.run_id, {**provenance(command), "heads": _heads(folder, chain)})
        _current[folder] = opened
        stack.callback(_current.pop, folder)
        try:
            yield opened
        except BaseException as error:
            with suppress(StoreError):  # the error itself is what is to be told
                _close(opened, Outcome.FAILED, _reason(error), signer)
            raise
        _close(opened, Outcome.DONE, signer=signer)


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
            found = open_run(path) if free and _is_usable(path) else None
            if found is not None:
                interrupted = Run(folder, path, found.run)
                _append_closing(interrupted, Outcome.INTERRUPTED, "its process was gone when the next run began")


def open_run(path: Path) -> Entry | None:
    """The last entry of the run of a chain that was not closed; None where all were. Raises StoreError."""
    last = last_entry(path)
    return None if last is None or last.kind in {Kind.CLOSED, Kind.SIGNED} else last


def pending(entries: Sequence[Entry], run_id: str) -> list[Entry]:
    """The last entry of each process of a run that puts files in their places or removes them.

    Only these may not have come true: before it says what it does next, a process has done what it said.
    """
    last: dict[int, Entry] = {}
    for entry in entries:
        if entry.run == run_id:
            last[entry.pid] = entry
    return [entry for entry in last.values() if entry.kind in {Kind.WROTE, Kind.REMOVED, Kind.UPGRADED, Kind.PACKED}]


def _close(ended: Run, outcome: Outcome, reason: str = "", signer: Signer | None = None) -> None:
    with log_lock(ended.folder):
        _append_closing(ended, outcome, reason)
        if signer is not None:
            seen = {name: head.sha256 for name, head in heads(ended.folder).items()}
            append(ended.chain, Kind.SIGNED, ended.run_id, {"heads": seen, "signature": signer(seen)})


def _append_closing(ended: Run, outcome: Outcome, reason: str) -> None:
    """Close a run, and say which of its last files are not in the places where they should be."""
    found = entries_from(ended.chain, ended.begin)
    unwritten = [
        [entry.order, file["path"]]
        for entry in pending(found, ended.run_id)
        for file in entry.what["files"]
        if not _is_true(ended.folder, file)
    ]
    what = {
        "outcome": outcome.value,
        "reason": reason,
        "unwritten": unwritten,
        "heads": _heads(ended.folder, ended.chain),
    }
    append(ended.chain, Kind.CLOSED, ended.run_id, what)


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
