"""The recordings that a refresh left out and that a person should look at: they stay until somebody labels them."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, date, datetime

from auditor.store.records import to_utc
from auditor.store.store import Store
from auditor.store.tables import read_rows
from auditor.store.versions.history import History


@dataclass(frozen=True)
class Quarantined:
    """A recording that is left out until somebody has looked at it, why, and since when (UTC).

    `judged` says that it was raised, or not like the others: it stays until it is labelled, whatever later thresholds
    say. Else it is there for what it is, and leaves when that is no longer so.
    """

    recording_id: str
    measurement_id: str
    name: str
    vehicle: str | None
    day: date | None
    frames: int
    findings_by_others: int | None
    reason: str
    judged: bool
    since: datetime


def read_quarantine(store: Store, history: History) -> tuple[Quarantined, ...]:
    """The recordings of a rig kind that wait for a person. Raises StoreError."""
    path = store.path("quarantine", history.history_id)
    rows = read_rows("quarantine", path) if path.is_file() else []
    own = ("history_id", "kind", "matcher")
    known = [{name: value for name, value in row.items() if name not in own} for row in rows]
    return tuple(Quarantined(**{**one, "since": one["since"].replace(tzinfo=UTC)}) for one in known)


def write_quarantine(store: Store, history: History, waiting: Sequence[Quarantined]) -> None:
    """Replace the list of a rig kind, where it is another than before. Raises StoreError."""
    if tuple(waiting) == read_quarantine(store, history):
        return
    of_kind = {
        "history_id": history.history_id,
        "kind": str(history.rig_kind),
        "matcher": history.procedure.matcher,
    }
    rows = ({**of_kind, **asdict(one), "since": to_utc(one.since)} for one in waiting)
    store.write("quarantine", history.history_id, rows)
