"""The page of a refresh: one self-contained HTML page of what was decided for each rig kind, and why."""

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from auditor import __version__
from auditor.reporting.templates import fill
from auditor.store.store import Store
from auditor.store.versions.decisions import Refresh, RefreshOutcome, next_steps
from auditor.store.versions.drift import FleetDrift, SensorDrift

_OF_ONE = {
    RefreshOutcome.REFUSED: "Refused: the version in force stays.",
    RefreshOutcome.HELD: "The new calibration is held for a person.",
    RefreshOutcome.PROMOTED: "A new calibration is in force.",
    RefreshOutcome.WAITING: "Too few clean recordings so far.",
    RefreshOutcome.NOTHING_NEW: "Nothing new to learn.",
}
"""The page's headline where there is one rig kind; the worst first."""


def render_refresh_page(refresh: Refresh, store: Store, *, out: Path) -> Path:
    """Write the page of a refresh; answer `out`. Raises StoreError where it cannot be written.

    All of its text is escaped; it refers to nothing outside itself.
    """
    values = {
        "refresh": refresh,
        "auditor_version": __version__,
        "at": f"{refresh.at:%Y-%m-%d %H:%M} UTC",
        "headline": _headline(refresh),
        "store": str(store.folder),
        "next_steps": lambda decision: next_steps(decision, store.folder),
    }
    return store.write_page(out, fill("refresh.html", values))


def _headline(refresh: Refresh) -> str:
    if not refresh.decisions:
        return "Nothing was learnt: no recording could be looked at."
    if len(refresh.decisions) == 1:
        return _OF_ONE[refresh.decisions[0].decided]
    count = Counter(one.decided for one in refresh.decisions)
    told = [f"{count[decided]} {decided}" for decided in _OF_ONE if count[decided]]
    return f"Of {len(refresh.decisions)} rig kinds: {', '.join(told)}."


_WIDTH_PX, _HEIGHT_PX = 600.0, 120.0
_TOP_PX, _LEFT_PX = 8.0, 56.0
_MOST_PLOTS = 40


@dataclass(frozen=True)
class Plot:
    """The levels of one sensor's check, in the pixels of its drawing; `changed_px` is where it changed."""

    drift: SensorDrift
    path: str
    low: float
    high: float
    changed_px: float | None


def render_drift_page(drift: FleetDrift, store: Store, *, out: Path) -> Path:
    """Write the page of a fleet's drift; answer `out`. Raises StoreError where it cannot be written.

    All of its text is escaped; it refers to nothing outside itself.
    """
    values = {
        "found": drift,
        "plots": [_plot(one) for one in drift.named[:_MOST_PLOTS]],
        "headline": _drift_headline(drift),
        "auditor_version": __version__,
        "store": str(store.folder),
        "size": (_WIDTH_PX, _HEIGHT_PX, _LEFT_PX),
    }
    return store.write_page(out, fill("drift.html", values))


def _drift_headline(drift: FleetDrift) -> str:
    if not drift.sensors:
        return "No vehicle has enough days."
    if not drift.named:
        return "Nothing drifts."
    sensors = {(one.vehicle, one.sensor) for one in drift.named}
    vehicles = len({vehicle for vehicle, _ in sensors})
    several = "s drift or have" if len(sensors) > 1 else " drifts or has"
    return f"{len(sensors)} sensor{several} changed, of {vehicles} vehicle{'s' * (vehicles > 1)}."


def _plot(sensor: SensorDrift) -> Plot:
    first, last = sensor.levels[0][0], sensor.levels[-1][0]
    values = [level for _, level in sensor.levels]
    low, high = min(values), max(values)
    days, span = max((last - first).days, 1), (high - low) or 1.0

    def at(day_count: float) -> float:
        return _LEFT_PX + (_WIDTH_PX - _LEFT_PX - _TOP_PX) * day_count / days

    def down(level: float) -> float:
        return _TOP_PX + (_HEIGHT_PX - 2 * _TOP_PX) * (high - level) / span

    points = " ".join(f"{at((day - first).days):.1f},{down(level):.1f}" for day, level in sensor.levels)
    changed = at((sensor.change.on_day - first).days - 0.5) if sensor.change is not None else None
    return Plot(sensor, f"M{points}", low, high, changed)
