"""The log of a store has the command line of each verb that writes to it."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli.output import say
from auditor.errors import AuditorError, StoreError

if TYPE_CHECKING:
    from auditor.store.folder import StoreFolder
    from auditor.store.log.runs import Run
    from auditor.store.maintenance.verify import Problem

_REMEDY = "auditor verify names everything that differs"


@contextmanager
def logged(store: Path, key: Path | None = None) -> Iterator["Run"]:
    """All that is written to a store inside the block belongs to this command, signed at its end with a private key.

    Raises StoreError, also where the store was altered and cannot be read for that, and SettingError for a wrong key.
    """
    from auditor.store.log.runs import run  # noqa: PLC0415 - heavy

    arguments = click.get_current_context().find_root().obj or ()
    with reading(store), run(store.expanduser(), ["auditor", *arguments], key) as entry:
        yield entry


@contextmanager
def reading(store: Path) -> Iterator[None]:
    """An unforeseen error inside the block is a StoreError where the store was altered: that is what explains it."""
    try:
        yield
    except AuditorError:
        raise
    except Exception as error:
        altered = _altered(store)
        if not altered:
            raise
        raise StoreError(
            f"it cannot be read ({type(error).__name__}): {altered}", where=store, remedy=_REMEDY
        ) from error


def refuse_altered(store: "StoreFolder") -> None:
    """Hash every file of a store. Raises StoreError where one is not as it was finished, pages apart."""
    altered = _altered(store.folder)
    if altered:
        raise StoreError(altered, where=store.folder, remedy=_REMEDY)


def tell_altered(store: "StoreFolder", *, every: bool) -> "Sequence[Problem]":
    """Name the files that are not as they were finished, among those that changed, or among all."""
    from auditor.store.maintenance.hashes import changed, read_checked  # noqa: PLC0415 - heavy

    if not every and not changed(store.folder, read_checked(store.folder)):
        return ()
    from auditor.store.maintenance.verify import verify_changes, verify_hashes  # noqa: PLC0415 - heavier still

    result = verify_hashes(store) if every else verify_changes(store)
    for problem in result.grave:
        say(f"{store.folder}: {problem}")
    return result.grave


def note_altered(store: "StoreFolder | None", entry: object) -> bool:
    """Name the changed files that are not as they were finished, and keep it in the log; True where any is.

    A run that may put others in their places begins so: afterwards nothing else would tell of them. `entry` is the run.
    """
    from auditor.store.log.entry import EntryKind  # noqa: PLC0415 - heavy
    from auditor.store.log.runs import Run  # noqa: PLC0415

    altered = tell_altered(store, every=False) if store is not None else ()
    if altered and isinstance(entry, Run):
        entry.say(EntryKind.ALTERED, {"files": [{"path": one.place, "how": one.what} for one in altered]})
    return bool(altered)


def _altered(folder: Path) -> str:
    """What was altered of a store, as a sentence; empty where nothing was."""
    from auditor.store.folder import StoreFolder  # noqa: PLC0415 - heavy
    from auditor.store.maintenance.verify import verify_hashes  # noqa: PLC0415

    wrong = [
        problem for problem in verify_hashes(StoreFolder.open(folder)).grave if not problem.place.startswith("reports/")
    ]
    if not wrong:
        return ""
    more = f", and {len(wrong) - 1} more" if len(wrong) > 1 else ""
    return f"it was altered: {wrong[0]}{more}"
