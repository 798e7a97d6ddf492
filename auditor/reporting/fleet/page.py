"""What the index of a fleet shows: the template reads these and nothing else."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import date

from auditor.reporting.numbers import count


@dataclass(frozen=True)
class UnauditedLine:
    """Something that was not audited, and why, over all recordings; `frames` is None of what is no frame."""

    what: str
    reason: str
    recordings: int
    frames: int | None
    name: str
    remedy: str | None


@dataclass(frozen=True)
class DayCell:
    """A vehicle on a day. `excused` of the incidents are false alarms or known, by their reviews."""

    recordings: int
    frames: int
    audited: int
    incidents: int
    excused: int

    @property
    def open(self) -> int:
        """Incidents that no review excuses."""
        return self.incidents - self.excused


@dataclass(frozen=True)
class VehicleRow:
    """A vehicle (None where it is not known) and its days; days without a recording are not among them."""

    vehicle: str | None
    cells: Mapping[date | None, DayCell]


@dataclass(frozen=True)
class ListedIncident:
    """An incident of the list; `when` says when it began, `review` what somebody said of it.

    `excuse` is why it needs nobody's attention; empty where it does.
    """

    incident_id: str
    grade: str
    kind: str
    sensors: tuple[str, ...]
    recordings: tuple[str, ...]
    vehicle: str | None
    when: str
    seconds: float
    frames: int
    evidence: str
    causes: str
    review: str | None
    excuse: str

    @property
    def file(self) -> str:
        """Its page, beside the index."""
        return f"incidents/{self.incident_id}.html"


@dataclass(frozen=True)
class FleetPage:
    """The whole index. What is shown is bounded; the counts are of everything."""

    made_at: str
    auditor_version: str
    store: str
    cells: tuple[DayCell, ...]
    vehicles: tuple[VehicleRow, ...]
    vehicle_count: int
    days: tuple[date | None, ...]
    day_count: int
    unaudited: tuple[UnauditedLine, ...]
    reason_count: int
    incidents: tuple[ListedIncident, ...]
    incident_count: int
    excused_count: int
    alert_count: int

    @property
    def recordings(self) -> int:
        """All recordings."""
        return sum(cell.recordings for cell in self.cells)

    @property
    def frames(self) -> int:
        """All frames, the skipped ones included."""
        return sum(cell.frames for cell in self.cells)

    @property
    def audited(self) -> int:
        """Frames whose verdict is one about attacks."""
        return sum(cell.audited for cell in self.cells)

    @property
    def coverage(self) -> float | None:
        """Share of all frames that were audited; None where there are none."""
        return self.audited / self.frames if self.frames else None

    @property
    def open_count(self) -> int:
        """Incidents and alerts that no review excuses."""
        return self.incident_count - self.excused_count

    @property
    def open_words(self) -> str:
        """How many incidents and alerts there are that no review excuses."""
        counts = ((self.open_count - self.alert_count, "incident"), (self.alert_count, "alert"))
        return " and ".join(count(number, what) for number, what in counts if number)
