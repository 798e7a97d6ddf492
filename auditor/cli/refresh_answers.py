"""What a refresh answers: one line of JSON, a file of metrics, and an exit code."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING

from auditor.model.text import one_line

if TYPE_CHECKING:
    from pathlib import Path

    from auditor.store.versions.decisions import Decision, Refresh
    from auditor.store.versions.drift import FleetDrift, SensorDrift
    from auditor.store.versions.records import UsedRecording


_DRIFT = "auditor_drift_"


def gauge(name: str, text: str, rows: Iterable[tuple[str, float]]) -> Iterator[str]:
    """The lines of one metric: each row has its labels, as `labels` gives them, and its number."""
    yield f"# HELP {name} {text}"
    yield f"# TYPE {name} gauge"
    for values, number in rows:
        yield f"{name}{values} {number!r}"


def labels(**pairs: str) -> str:
    """Labels with their values, escaped."""
    return "{" + ",".join(f'{name}="{_escaped(value)}"' for name, value in pairs.items()) + "}"


def _escaped(text: str) -> str:
    return one_line(text).replace("\\", "\\\\").replace('"', '\\"')


def drift_metrics(drift: "FleetDrift") -> Iterator[str]:
    """The lines of what drifts and has changed in a fleet."""

    def of(sensor: "SensorDrift") -> str:
        return labels(vehicle=sensor.vehicle, sensor=f"S_{sensor.sensor}", check=sensor.check)

    drifting = [one for one in drift.named if one.drifting]
    changes = [(one, one.change) for one in drift.named if one.change is not None]
    for name, text, rows in (
        ("levels", "Levels of sensors and checks that were looked at.", [("", len(drift.sensors))]),
        ("vehicles", "Vehicles with enough days.", [("", drift.vehicles)]),
        ("false_alarm_chance", "Chance of any alarm in a fleet without drift.", [("", drift.false_alarms)]),
        ("per_day", "Change of a drifting level in a day.", [(of(one), one.per_day) for one in drifting]),
        ("level", "Level of what drifts or has changed.", [(of(one), one.level) for one in drift.named]),
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


_PREFIX = "auditor_refresh_"
_MOST_LEFT_OUT = 50


class RefreshExit(IntEnum):
    """How a refresh ended: for a line of cron."""

    DONE = 0
    HELD = 1
    FAILED = 2
    REFUSED = 4


def exit_code(refresh: "Refresh") -> RefreshExit:
    """0 promoted or nothing new, 1 something for a person to look at or failed, 2 all failed, 4 something refused."""
    decided = {one.decided.value for one in refresh.decisions}
    if not decided and refresh.failed:
        return RefreshExit.FAILED
    if "refused" in decided:
        return RefreshExit.REFUSED
    return RefreshExit.HELD if "held" in decided or refresh.failed or refresh.found else RefreshExit.DONE


def json_line(refresh: "Refresh") -> str:
    """One line of JSON: what was measured and failed, and what was decided for each rig kind."""
    answer = {
        "exit": int(exit_code(refresh)),
        "store": one_line(str(refresh.store)),
        "at": refresh.at.isoformat(timespec="seconds"),
        "r": float(refresh.r),
        "dry_run": refresh.dry_run,
        "measured": len(refresh.measured),
        "failed": [vars(one) for one in refresh.failed],
        "found": [_used(one) for one in refresh.found],
        **({"planned": [vars(one) for one in refresh.planned]} if refresh.dry_run else {}),
        "rig_kinds": [_rig_kind(one, refresh.store) for one in refresh.decisions],
    }
    return json.dumps(answer, ensure_ascii=False)


def _rig_kind(decision: "Decision", store: "Path") -> dict[str, object]:
    from auditor.store.versions.decisions import next_steps  # noqa: PLC0415 - keeps --help quick

    return {
        "kind": decision.kind,
        "matcher": decision.matcher,
        "decided": decision.decided.value,
        "reasons": list(decision.reasons),
        "calibration": decision.calibration_id,
        "before": decision.before,
        "in_force": decision.in_force,
        "provisional": decision.provisional,
        "recordings": len(decision.included),
        "new": decision.new,
        "by_others": decision.by_others and decision.by_others._asdict(),
        "new_by_others": decision.new_by_others and decision.new_by_others._asdict(),
        "new_before": decision.new_before and decision.new_before._asdict(),
        "planted_found_before": decision.found_before and decision.found_before._asdict(),
        "planted_found": decision.found_after and decision.found_after._asdict(),
        "planted_lost": decision.lost and decision.lost._asdict(),
        "planted_lost_in_all": decision.lost_in_all and decision.lost_in_all._asdict(),
        "largest_rise": max((rise.deviations for rise in decision.rises), default=None),
        "creep": decision.creep,
        "to_do": [step._asdict() for step in next_steps(decision, store)],
        "look_at": [_used(one) for one in decision.look_at],
        "left_out": [_used(one) for one in decision.left_out],
    }


def _used(used: "UsedRecording") -> dict[str, str | None]:
    return {
        "recording": used.name,
        "recording_id": used.recording_id,
        "vehicle": used.vehicle,
        "day": used.day.isoformat() if used.day else None,
        "reason": used.reason,
    }


def left_out_lines(decision: "Decision") -> Iterator[str]:
    """One line for each recording that is not learnt from, with its reason; of very many the first."""
    for used in decision.left_out[:_MOST_LEFT_OUT]:
        yield f"left out: {used.called}: {used.reason}"
    more = len(decision.left_out) - _MOST_LEFT_OUT
    if more > 0:
        yield f"left out: {more} more recordings, which the line of JSON names"


def planned_lines(refresh: "Refresh") -> Iterator[str]:
    """What a dry run says of the recordings that it was given: how many of each rig kind, and what is wrong."""
    kinds = Counter(kind for one in refresh.planned for kind in one.rig_kinds)
    measured = Counter(kind for one in refresh.planned if one.measured for kind in one.rig_kinds)
    for kind, count in kinds.items():
        yield f"{kind}: {count} recording{'s' * (count > 1)} given, {measured[kind]} measured so far"
    for recording in refresh.planned:
        if recording.error:
            yield recording.error


def refresh_metrics(refresh: "Refresh") -> Iterator[str]:
    """The lines of what a refresh did."""
    decisions = refresh.decisions
    yield from gauge(
        f"{_PREFIX}exit_code",
        "How the last refresh ended: 0 done, 1 held, 2 failed, 4 refused.",
        [("", int(exit_code(refresh)))],
    )
    yield from gauge(f"{_PREFIX}end_time_seconds", "When the last refresh ended.", [("", refresh.at.timestamp())])
    yield from gauge(
        f"{_PREFIX}measured_recordings",
        "Recordings given to the last refresh that are measured.",
        [("", len(refresh.measured))],
    )
    yield from gauge(
        f"{_PREFIX}failed_recordings", "Recordings and rig kinds that failed.", [("", len(refresh.failed))]
    )
    for name, text, value in (
        ("decided", "1 for what was decided for a rig kind.", None),
        ("recordings", "Recordings that the version in force or the candidate is made of.", lambda d: len(d.included)),
        ("new_recordings", "Those of them that the version of before has not.", lambda d: d.new),
        ("look_at_recordings", "Recordings that a person should look at.", lambda d: len(d.look_at)),
        (
            "windows_by_others",
            "Share of windows judged by others with findings.",
            lambda d: d.by_others and d.by_others.value,
        ),
        ("planted_found", "Share of planted attacks that are found.", lambda d: d.found_after and d.found_after.value),
        ("creep_deviations", "Largest rise of a threshold since a person confirmed.", lambda d: d.creep),
        (
            "provisional",
            "1 where a person should confirm it: no recording was named clean, or too few are.",
            lambda d: int(d.provisional),
        ),
    ):
        rows = [
            (labels(**_of(one), decided=one.decided.value), 1.0) if value is None else (labels(**_of(one)), value(one))
            for one in decisions
        ]
        yield from gauge(_PREFIX + name, text, [(known, number) for known, number in rows if number is not None])


def _of(decision: "Decision") -> dict[str, str]:
    return {"kind": decision.kind, "matcher": decision.matcher}
