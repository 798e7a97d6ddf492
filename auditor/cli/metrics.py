"""Metrics as text for the textfile collector of Prometheus' node exporter."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from auditor.model.text import one_line

if TYPE_CHECKING:
    from auditor.model.drift import FleetDrift, SensorDrift

_DRIFT = "auditor_drift_"


def gauge(name: str, text: str, rows: Iterable[tuple[str, float]]) -> Iterator[str]:
    """The lines of one metric: each row has its labels, as `labels` gives them, and its number."""
    yield f"# HELP {name} {text}"
    yield f"# TYPE {name} gauge"
    for known, number in rows:
        yield f"{name}{known} {number!r}"


def labels(**known: str) -> str:
    """Labels with their values, escaped."""
    return "{" + ",".join(f'{name}="{_escaped(value)}"' for name, value in known.items()) + "}"


def _escaped(text: str) -> str:
    return one_line(text).replace("\\", "\\\\").replace('"', '\\"')


def drift_metrics(found: "FleetDrift") -> Iterator[str]:
    """The lines of what drifts and has changed in a fleet."""

    def of(one: "SensorDrift") -> str:
        return labels(vehicle=one.vehicle, sensor=f"S_{one.sensor}", check=one.check)

    drifting = [one for one in found.named if one.drifting]
    changes = [(one, one.change) for one in found.named if one.change is not None]
    for name, text, rows in (
        ("levels", "Levels of sensors and checks that were looked at.", [("", len(found.sensors))]),
        ("vehicles", "Vehicles with enough days.", [("", found.vehicles)]),
        ("false_alarm_chance", "Chance of any alarm in a fleet without drift.", [("", found.false_alarms)]),
        ("per_day", "Change of a drifting level in a day.", [(of(one), one.per_day) for one in drifting]),
        ("level", "Level of what drifts or has changed.", [(of(one), one.level) for one in found.named]),
        (
            "days_left",
            "Days until frames are raised as those of a displaced camera.",
            [(of(one), one.days_left) for one in drifting if one.days_left is not None],
        ),
        (
            "change",
            "How far a level has changed on a day.",
            [(of(one), change.size) for one, change in changes],
        ),
        (
            "changed_days_ago",
            "Days since a level changed, by the last day of its vehicle.",
            [(of(one), (one.last_day - change.on_day).days) for one, change in changes],
        ),
    ):
        yield from gauge(f"{_DRIFT}{name}", text, rows)


def write_metrics(lines: Iterable[str], path: Path) -> None:
    """Write metrics in one go: the collector reads the old file or the new one. Raises StoreError."""
    from auditor.store.files import write_whole  # noqa: PLC0415 - keeps --help quick

    write_whole(path, "".join(f"{line}\n" for line in lines).encode())
