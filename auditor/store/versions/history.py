"""Which calibration is in force: a history for each rig kind and procedure, whose last move says it.

No date decides. A history is one small file that is replaced whole, under the lock of the store: whenever a process is
killed there is the old history or the new one.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from typing import Any

from auditor.errors import StoreError
from auditor.model.calibration import Calibration
from auditor.model.measurement import Procedure
from auditor.model.rig_kind import RigKind
from auditor.store.calibrations import OutdatedCalibrationError
from auditor.store.files import held, locked, make_folder
from auditor.store.log.entry import EntryKind
from auditor.store.log.runs import logged
from auditor.store.records import content_id, rig_kind_fields, rig_kind_of, to_utc
from auditor.store.store import Store
from auditor.store.tables import Row, read_rows


class EntryIntoForce(StrEnum):
    """How a calibration came into force."""

    CALIBRATED = "calibrated"
    REFRESHED = "refreshed"
    PROMOTED = "promoted"
    ROLLED_BACK = "rolled back"
    UPGRADED = "upgraded"
    """By the upgrade of a store of before there were histories."""

    @property
    def by_person(self) -> bool:
        """Whether somebody asked for it, and not a refresh at night."""
        return self is not EntryIntoForce.REFRESHED


@dataclass(frozen=True)
class Move:
    """One time that a calibration came into force. `moved_at` (UTC) is for people; it decides nothing."""

    calibration_id: str
    how: EntryIntoForce
    moved_at: datetime
    reason: str = ""


@dataclass(frozen=True)
class History:
    """The calibrations that were in force for a rig kind and procedure, the last of them now."""

    rig_kind: RigKind
    procedure: Procedure
    moves: tuple[Move, ...] = ()

    @property
    def history_id(self) -> str:
        """The id that follows from rig kind and procedure."""
        procedure = self.procedure
        return content_id(
            "history",
            rig_kind_fields(self.rig_kind),
            [procedure.matcher, procedure.settings, procedure.counting_version],
        )

    @property
    def in_force(self) -> str | None:
        """The calibration that is in force; None where none ever was."""
        return self.moves[-1].calibration_id if self.moves else None

    @property
    def previous(self) -> str | None:
        """The calibration that a rollback returns to: a rollback itself takes back what it rolled back."""
        stack = self._stack()
        return stack[-2].calibration_id if len(stack) > 1 else None

    @property
    def confirmed(self) -> str | None:
        """The calibration that a person put in force last; the first of all where nobody did."""
        stack = self._stack()
        moves = [move for move in stack if move.how.by_person] or stack[:1]
        return moves[-1].calibration_id if moves else None

    @property
    def vouched(self) -> bool:
        """Whether a person put one of the versions in force that led to this one."""
        return any(move.how.by_person for move in self._stack())

    @property
    def withdrawn(self) -> frozenset[str]:
        """The calibrations that were rolled back and that nobody promoted since."""
        gone: set[str] = set()
        for before, move in zip(self.moves, self.moves[1:], strict=False):
            if move.how is EntryIntoForce.ROLLED_BACK:
                gone.add(before.calibration_id)
            gone.discard(move.calibration_id)
        return frozenset(gone)

    def _stack(self) -> list[Move]:
        """The moves that were not rolled back, in order."""
        stack: list[Move] = []
        for move in self.moves:
            while move.how is EntryIntoForce.ROLLED_BACK and stack and stack[-1].calibration_id != move.calibration_id:
                stack.pop()
            if stack and stack[-1].calibration_id == move.calibration_id:
                stack.pop()
            stack.append(move)
        return stack


def histories(store: Store) -> list[History]:
    """All histories of a store, by id."""
    return [_history(read_rows("calibration_history", path)) for path in store.finished_paths("calibration_history")]


def history_of(all_histories: Sequence[History], calibration: Calibration) -> History:
    """The history that a calibration is of; an empty one of its own rig kind where there is none yet."""
    return history_for(all_histories, calibration.rig_kind, calibration.procedure)


def history_for(all_histories: Sequence[History], rig_kind: RigKind, procedure: Procedure) -> History:
    """The history of a rig kind and procedure, of several that of exactly it; an empty one where there is none."""
    fitting = [one for one in all_histories if one.procedure == procedure and one.rig_kind.matches(rig_kind)]
    exact = [one for one in fitting if one.rig_kind == rig_kind]
    return (exact or fitting or [History(rig_kind, procedure)])[0]


def calibrations_in_force(store: Store) -> list[Calibration]:
    """The calibrations that are in force, each for its rig kind; outdated ones are left out."""
    return in_force_of(store, histories(store))


def put_in_force(
    store: Store, calibration: Calibration, how: EntryIntoForce, reason: str = "", *, after: str | None = None
) -> None:
    """Put a calibration in force for its rig kind: the one place that moves a version.

    The store keeps the calibration first. `after` is the calibration that must be in force until then; None where any
    may be. Raises StoreError where it is another, or where the history cannot be written: then all is as it was.
    """
    store.keep_calibration(calibration)
    with logged(store.folder) as entry, locked(store.folder):
        history = history_of(histories(store), calibration)
        if after is not None and history.in_force != after:
            raise StoreError(
                f"calibration {history.in_force} came into force meanwhile, in place of {after}",
                where=store.folder,
                remedy="run the command again",
            )
        move = Move(calibration.calibration_id, how, datetime.now(UTC), reason)
        changed = History(history.rig_kind, history.procedure, (*history.moves, move))
        store.write("calibration_history", changed.history_id, history_rows(changed))
        entry.say(EntryKind.IN_FORCE, _entry(history, move))


@contextmanager
def only_refresh(store: Store) -> Iterator[None]:
    """Be the only refresh of a store. Raises StoreError where another one is running."""
    folder = store.folder / "calibration_history"
    try:
        make_folder(folder)
    except OSError as error:
        raise StoreError(f"it cannot be made ({error.strerror or error})", where=folder) from error
    with held(folder) as free:
        if not free:
            raise StoreError(
                "another refresh of this store is running", where=store.folder, remedy="wait until it has ended"
            )
        yield


def put_first_in_force(store: Store, calibration: Calibration) -> bool:
    """Keep a calibration, and put it in force where none is for its rig kind; returns whether it is in force."""
    store.keep_calibration(calibration)
    before = history_of(histories(store), calibration).in_force
    if before is None:
        put_in_force(store, calibration, EntryIntoForce.CALIBRATED)
    return before in (None, calibration.calibration_id)


def in_force_of(store: Store, all_histories: Sequence[History]) -> list[Calibration]:
    """The calibrations of some histories that are in force; outdated ones are left out."""
    calibrations = []
    for calibration_id in (history.in_force for history in all_histories if history.in_force is not None):
        with suppress(OutdatedCalibrationError):
            calibrations.append(store.calibration(calibration_id))
    return calibrations


def _entry(before: History, move: Move) -> dict[str, Any]:
    """What the log says of a move."""
    return {
        "calibration": move.calibration_id,
        "instead_of": before.in_force,
        "how": move.how.value,
        "reason": move.reason,
        "rig_kind": str(before.rig_kind),
    }


def history_rows(history: History) -> Iterator[Row]:
    """The rows of a history's file."""
    for number, move in enumerate(history.moves):
        yield {
            "history_id": history.history_id,
            "number": number,
            "calibration_id": move.calibration_id,
            "how": move.how.value,
            "reason": move.reason or None,
            "moved_at": to_utc(move.moved_at),
            "kind": str(history.rig_kind),
            "rig_kind": rig_kind_fields(history.rig_kind),
            "matcher": history.procedure.matcher,
            "settings": history.procedure.settings,
            "counting_version": history.procedure.counting_version,
        }


def _history(rows: Sequence[dict[str, Any]]) -> History:
    first = rows[0]
    return History(
        rig_kind_of(first["rig_kind"]),
        Procedure(first["matcher"], first["settings"], first["counting_version"]),
        tuple(
            Move(
                row["calibration_id"],
                EntryIntoForce(row["how"]),
                row["moved_at"].replace(tzinfo=UTC),
                row["reason"] or "",
            )
            for row in sorted(rows, key=lambda row: row["number"])
        ),
    )
