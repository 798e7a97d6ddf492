"""What became of the sensors of a fleet from day to day."""

from dataclasses import dataclass, field
from datetime import date

STEADY = "steady"
"""What neither drifts nor has changed."""


@dataclass(frozen=True)
class SensorDrift:
    """What became of a check of a sensor of a vehicle; columns are those that `auditor drift` prints.

    `before` and `now` are the levels beside the last change, which came between `after_day` and `changed_on`;
    `calibrated_anew` says whether the rig's calibration changed there; `levels` has its days.
    """

    vehicle: str
    sensor: int
    check: str
    what: str
    level: float
    unit: str
    per_day: float
    days_left: float | None
    after_day: date | None
    changed_on: date | None
    before: float | None
    now: float | None
    calibrated_anew: bool | None
    chance: float
    deviation: float
    days: int
    first_day: date
    last_day: date
    kind: str
    levels: tuple[tuple[date, float], ...] = field(repr=False)

    @property
    def named(self) -> bool:
        """Whether it drifts or has changed."""
        return self.what != STEADY


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

    `false_alarms` is the chance that anything is named in a fleet without drift. `of_nobody` of the `recordings` have no
    vehicle or no day.
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


def row_of(one: SensorDrift) -> dict[str, object]:
    """One row of an answer."""
    return {name: getattr(one, name) for name in COLUMNS}
