"""What a refresh decided, for scripts, metrics and the page."""

from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

from auditor.model.conditions import ConditionRate
from auditor.store.versions.records import UsedRecording


class Decided(StrEnum):
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
    decided: Decided
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
        """The recordings that a person should look at."""
        return tuple(one for one in self.recordings if one.look_at)


@dataclass(frozen=True)
class Failure:
    """A recording that could not be measured, and why."""

    recording: str
    reason: str


@dataclass(frozen=True)
class Finding:
    """A recording of this refresh that a person should look at, and why."""

    recording: str
    reason: str


@dataclass(frozen=True)
class Planned:
    """A recording that a dry run was given: its rig kinds, whether the store has measured it, or what is wrong."""

    recording: str
    rig_kinds: tuple[str, ...]
    measured: bool
    error: str = ""


@dataclass(frozen=True)
class Refresh:
    """One refresh of a store: what was measured, what failed, and what was decided for each rig kind.

    `found` are the recordings that were given or judged now and that a person should look at: those with findings, and
    those that are in doubt. `planned` are the recordings that a dry run was given; what it decides is of those that are
    measured already.
    """

    store: Path
    at: datetime
    r: Decimal
    dry_run: bool
    measured: tuple[str, ...]
    failed: tuple[Failure, ...]
    decisions: tuple[Decision, ...]
    found: tuple[Finding, ...] = ()
    planned: tuple[Planned, ...] = ()
