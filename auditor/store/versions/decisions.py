"""What a refresh decided, for scripts, metrics and the page, and what is left to a person."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, date, datetime
from decimal import Decimal
from enum import StrEnum
from pathlib import Path
from shlex import join
from typing import NamedTuple

from auditor.model.calibration import ConditionRate
from auditor.model.text import one_line
from auditor.store.records import to_utc
from auditor.store.store import Store
from auditor.store.tables import read_rows
from auditor.store.versions.history import History
from auditor.store.versions.records import UsedRecording


class RefreshOutcome(StrEnum):
    """What became of a rig kind in a refresh."""

    PROMOTED = "promoted"
    NOTHING_NEW = "nothing new"
    WAITING = "waiting"
    HELD = "held"
    REFUSED = "refused"


class Interval(NamedTuple):
    """A share, and both ends of its 95 % interval by drives."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Rise:
    """The threshold of a sensor check by `others` before and after, as a statistic, and its rise in deviations."""

    check: str
    sensor: int
    others: tuple[int, ...]
    before: float
    after: float
    deviations: float


@dataclass(frozen=True)
class Decision:
    """What was decided for a rig kind, and why.

    `calibration_id` is the candidate; None where none was made. `in_force` is in force afterwards. `recordings` are all
    that were looked at; `new` of those that the candidate is made of are not in the version of before. The shares are
    None where there is nothing to compare: `by_others` of windows with findings when others judge, `new_by_others` of
    those of new recordings, `new_before` of these by the version in force, `found_before` and `found_after` of planted
    attacks. `lost` of
    them are lost by this refresh, `lost_in_all` since the version that a person confirmed; so is `creep`, the largest
    rise of a threshold.
    """

    kind: str
    matcher: str
    decided: RefreshOutcome
    reasons: tuple[str, ...]
    calibration_id: str | None
    before: str | None
    in_force: str | None
    provisional: bool
    recordings: tuple[UsedRecording, ...]
    new: int = 0
    by_others: Interval | None = None
    new_by_others: Interval | None = None
    new_before: Interval | None = None
    found_before: Interval | None = None
    found_after: Interval | None = None
    lost: Interval | None = None
    lost_in_all: Interval | None = None
    creep: float | None = None
    rises: tuple[Rise, ...] = ()
    conditions: tuple[ConditionRate, ...] = ()

    @property
    def included(self) -> tuple[UsedRecording, ...]:
        """The recordings that the candidate is made of; where there is none, those in force."""
        return tuple(one for one in self.recordings if one.included)

    @property
    def left_out(self) -> tuple[UsedRecording, ...]:
        """The recordings that are not learnt from, each with its reason."""
        return tuple(one for one in self.recordings if not one.included)

    @property
    def look_at(self) -> tuple[UsedRecording, ...]:
        """The recordings that a person should look at, and why: what others find in one that was named clean."""
        return tuple(
            replace(
                one, reason=f"{one.reason}, and others find {one.findings_by_others} of {one.frames} frames not clean"
            )
            if one.included
            else one
            for one in self.recordings
            if one.look_at
        )


@dataclass(frozen=True)
class Failure:
    """A recording that could not be measured, and why."""

    recording: str
    reason: str


@dataclass(frozen=True)
class PlannedRecording:
    """A recording that a dry run was given: its rig kinds, whether the store has measured it, or what is wrong."""

    recording: str
    rig_kinds: tuple[str, ...]
    measured: bool
    error: str = ""


@dataclass(frozen=True)
class Refresh:
    """One refresh of a store: what was measured, what failed, and what was decided for each rig kind.

    `found` are the recordings that were given or judged now and that a person should look at, and why: those with
    findings, and those that are in doubt. `planned` are the recordings that a dry run was given; what it decides is of
    those that are measured already.
    """

    store: Path
    at: datetime
    r: Decimal
    dry_run: bool
    measured: tuple[str, ...]
    failed: tuple[Failure, ...]
    decisions: tuple[Decision, ...]
    found: tuple[UsedRecording, ...] = ()
    planned: tuple[PlannedRecording, ...] = ()


class NextStep(NamedTuple):
    """What to do, and the command for it."""

    what: str
    command: str


def next_steps(decision: Decision, store: Path) -> list[NextStep]:
    """What a person does about a rig kind, in order; nothing where nothing waits for a person."""
    return [NextStep(what, one_line(join([*words, "--store", str(store)]))) for what, words in _steps(decision)]


def _steps(decision: Decision) -> Iterator[tuple[str, list[str]]]:
    candidate, before = decision.calibration_id or "", decision.before
    if decision.look_at:
        action = f"look at the recordings that wait ({len(decision.look_at)}) and at their incidents"
        yield action, ["auditor", "calibration", "quarantine"]
        first = decision.look_at[0].recording_id[:12]
        yield "of each that is clean say so: the next refresh learns from it", ["auditor", "label", first, "--clean"]
        attack = ["--sensor", "S_NUMBER", "--attack", "KIND"]
        yield "of each that was attacked say what: it is never learnt from", ["auditor", "label", first, *attack]
    if decision.decided is RefreshOutcome.WAITING:
        yield "name recordings that you know to be clean", ["auditor", "refresh", "RECORDING", "--clean"]
    if decision.decided is RefreshOutcome.HELD:
        if before is not None:
            yield "look at what the candidate changes", ["auditor", "calibration", "diff", before[:12], candidate[:12]]
        action = "put it in force if that is right, else leave it: the next refresh makes another"
        yield action, ["auditor", "calibration", "promote", candidate[:12]]
    if decision.decided is RefreshOutcome.PROMOTED and decision.provisional:
        action = "confirm the version in force: nobody named its recordings clean, or they are too few"
        yield action, ["auditor", "calibration", "promote", candidate[:12]]


@dataclass(frozen=True)
class QuarantineEntry:
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


def read_quarantine(store: Store, history: History) -> tuple[QuarantineEntry, ...]:
    """The recordings of a rig kind that wait for a person. Raises StoreError."""
    path = store.path("quarantine", history.history_id)
    rows = read_rows("quarantine", path) if path.is_file() else []
    own = ("history_id", "kind", "matcher")
    entries = [{name: value for name, value in row.items() if name not in own} for row in rows]
    return tuple(QuarantineEntry(**{**one, "since": one["since"].replace(tzinfo=UTC)}) for one in entries)


def write_quarantine(store: Store, history: History, waiting: Sequence[QuarantineEntry]) -> None:
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
