"""What became of the sensors of a fleet from day to day."""

from dataclasses import dataclass, field
from datetime import date

DRIFTS, CHANGED, STEADY = "drifts", "changed", "steady"


@dataclass(frozen=True)
class LevelChange:
    """A level that changed after one day and by another, the next with data: the medians of days beside it.

    `calibrated_anew` says whether the rig's calibration changed there.
    """

    after_day: date
    on_day: date
    before: float
    now: float
    calibrated_anew: bool

    @property
    def size(self) -> float:
        """How far it changed."""
        return self.now - self.before


@dataclass(frozen=True)
class SensorDrift:
    """What became of a check of a sensor of a vehicle.

    `level` is that of the last days, in `unit`, and changes by `per_day`; `days_left` until frames are raised as those
    of a displaced camera, where that is known. `change` is the last one. `chance` is how likely as much is seen
    anywhere in a fleet without drift, `deviation` what a day's level differs by chance. `levels` has its days.
    """

    vehicle: str
    sensor: int
    check: str
    level: float
    unit: str
    per_day: float
    drifting: bool
    days_left: float | None
    change: LevelChange | None
    chance: float
    deviation: float
    kind: str
    levels: tuple[tuple[date, float], ...] = field(repr=False)

    @property
    def what(self) -> str:
        """What became of it, in a word."""
        return DRIFTS if self.drifting else CHANGED if self.change is not None else STEADY

    @property
    def named(self) -> bool:
        """Whether it drifts or has changed."""
        return self.what != STEADY

    @property
    def first_day(self) -> date:
        """Its first day."""
        return self.levels[0][0]

    @property
    def last_day(self) -> date:
        """Its last day."""
        return self.levels[-1][0]


COLUMNS = {
    "vehicle": "string",
    "sensor": "int8",
    "check": "string",
    "what": "string",
    "level": "double",
    "unit": "string",
    "per_day": "double",
    "days_left": "double",
    "after_day": "date32",
    "changed_on": "date32",
    "before": "double",
    "now": "double",
    "calibrated_anew": "bool",
    "chance": "double",
    "deviation": "double",
    "days": "int32",
    "first_day": "date32",
    "last_day": "date32",
    "kind": "string",
}
"""The columns of an answer, and their types in Arrow's words."""


@dataclass(frozen=True)
class FleetDrift:
    """The drift of a fleet, the most certain first.

    `false_alarms` is the chance that anything is named in a fleet without drift. `of_nobody` of the `recordings` have
    no vehicle, or no day that has come.
    """

    sensors: tuple[SensorDrift, ...]
    first_day: date | None
    last_day: date | None
    recordings: int
    of_nobody: int
    false_alarms: float

    @property
    def named(self) -> tuple[SensorDrift, ...]:
        """Those that drift or have changed."""
        return tuple(one for one in self.sensors if one.named)

    @property
    def vehicles(self) -> int:
        """How many vehicles have enough days."""
        return len({one.vehicle for one in self.sensors})


def row_of(drift: SensorDrift) -> dict[str, object]:
    """One row of an answer, by COLUMNS."""
    change = drift.change
    return {
        "vehicle": drift.vehicle,
        "sensor": drift.sensor,
        "check": drift.check,
        "what": drift.what,
        "level": drift.level,
        "unit": drift.unit,
        "per_day": drift.per_day,
        "days_left": drift.days_left,
        "after_day": change and change.after_day,
        "changed_on": change and change.on_day,
        "before": change and change.before,
        "now": change and change.now,
        "calibrated_anew": change and change.calibrated_anew,
        "chance": drift.chance,
        "deviation": drift.deviation,
        "days": len(drift.levels),
        "first_day": drift.first_day,
        "last_day": drift.last_day,
        "kind": drift.kind,
    }
