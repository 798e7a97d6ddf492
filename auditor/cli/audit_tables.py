"""The tables of an audit: one row a recording and rig, and one an incident, with what is to be said below them."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from auditor.cli.calibration_tables import learnt
from auditor.cli.output import answer, print_rows, shown
from auditor.model.text import first_few

_WHERE_KNOWN = ("vehicle", "date")
_COUNTS = ("clean", "attacked", "unidentified", "suspect")
_RECORDING_COLUMNS = (
    *("recording", "rig", *_WHERE_KNOWN, "frames", "audited", "looked at"),
    *(*_COUNTS, "sensors", "r", "by"),
)
_MOST_BESIDE = 0.5
"""The share of a LiDAR's points compared with cameras, below which it is said."""
_EXPENDABLE = ("date", "r", "by", "vehicle", "looked at", "audited", "frames")
_UNRESOLVED = "*"
_INCIDENT_COLUMNS = ("incident", "recording", "rig", "verdict", "sensors", "frames", "from", "to", "seconds", "gap")
_ID_SHOWN = 8
_REMARK = "remark"
_MOST_NAMED = 3

Rows = Sequence[Mapping[str, Any]]


def show_recordings(rows: Rows) -> None:
    """Print what was found in each recording by each of its rigs, and what a finding had to exceed there."""
    unknown = {column for column in _WHERE_KNOWN if all(row[column] is None for row in rows)}
    rigs = _rig_names(rows)
    if not rigs:
        unknown.add("rig")
    columns = [column for column in _RECORDING_COLUMNS if column not in unknown]
    print_rows([_recording(row) for row in rows], columns, expendable=_EXPENDABLE, wrapped=("sensors",))
    if unresolved := sorted({shown(row["r"]) for row in rows if row["resolvable"] is False}):
        answer(f"{_UNRESOLVED} r = {', '.join(unresolved)} is not resolvable: judged as at r = 0")
    _say_limits(rows, "rig_name" if rigs else "kind")
    compared = [row["lidar_share"] for row in rows if row["lidar_share"] is not None]
    if compared and min(compared) < _MOST_BESIDE:
        least, most = (f"{100 * share:.0f} %" for share in (min(compared), max(compared)))
        answer(
            f"LiDAR: {least if least == most else f'{least} to {most}'} of its points are compared with cameras; "
            "elsewhere only what appears is noticed, by its own last scan"
        )


def _say_limits(rows: Rows, of: str) -> None:
    """What a finding had to exceed, one line a limit; where there are several, with the rigs by their column `of`."""
    limits: dict[tuple[int, float], list[str]] = {}
    for row in rows:
        if row["drives"] is not None:
            limits.setdefault((row["drives"], row["z_limit"]), []).append(shown(row[of]))
    for (drives, limit), rigs in sorted(limits.items()):
        which = f" for {first_few(sorted(set(rigs)), _MOST_NAMED)}" if len(limits) > 1 else ""
        answer(f"thresholds {learnt(drives)}{which}: a finding has a z above {limit:.2f}")


def show_incidents(rows: Rows, incidents: Rows) -> None:
    """Print the incidents and alerts, each once; `rows` are those of their recordings."""
    if not incidents:
        return
    rigs = _rig_names(rows)
    shown_rows = _each_once(incidents, rigs)
    told = [_REMARK] if any(row[_REMARK] for row in shown_rows) else []
    alerts = any(row["grade"] == "alert" for row in incidents)
    graded = (_INCIDENT_COLUMNS[0], "grade", *_INCIDENT_COLUMNS[1:]) if alerts else _INCIDENT_COLUMNS
    columns = [column for column in graded if column != "rig" or any(row["rig"] for row in shown_rows)]
    several = ["rigs"] if len(shown_rows) < len(incidents) else []
    print_rows(
        shown_rows,
        (*columns, *several, *told),
        "Incidents and alerts" if alerts else "Incidents",
        expendable=("gap", "seconds", "incident"),
        wrapped=("sensors", *told),
    )
    if weak := [row["incident"] for row in shown_rows if row["weak"]]:
        which = "its frames" if len(weak) == 1 else "their frames"
        answer(f"{first_few(weak, _MOST_NAMED)}: weak evidence that lasts; none of {which} is a finding by itself")


def _rig_names(rows: Rows) -> dict[str, str]:
    """The names of rigs by their measurements, of recordings that have several."""
    rigs = Counter(row["recording_id"] for row in rows)
    return {row["measurement_id"]: row["rig_name"] for row in rows if rigs[row["recording_id"]] > 1}


def _recording(row: Mapping[str, Any]) -> dict[str, Any]:
    rate = shown(row["r"])
    return {
        "recording": row["name"],
        "rig": row["rig_name"],
        **{column: row[column] for column in (*_WHERE_KNOWN, *_COUNTS)},
        "frames": row["frames"],
        "audited": None if row["audited_share"] is None else f"{100 * row['audited_share']:.1f} %",
        "looked at": None if row["looked_share"] is None else f"{100 * row['looked_share']:.0f} %",
        "sensors": first_few([_named(one) for one in row["attacked_sets"]], _MOST_NAMED) or None,
        "r": rate if row["resolvable"] is not False else f"{rate}{_UNRESOLVED}",
        "by": row["by"],
    }


def _named(row: Mapping[str, Any]) -> str:
    """A set of attacked sensors with its number of frames, as 'S_0 + S_2 (3)'."""
    return f"{' + '.join(f'S_{sensor}' for sensor in row['attacked'])} ({row['frames']})"


def _each_once(incidents: Rows, rigs: Mapping[str, str]) -> list[dict[str, Any]]:
    """The incidents with the number of rigs that say each; those that say the same as one of them are left out."""
    ids = {row["incident_id"] for row in incidents}
    said = Counter(row["same_as"] for row in incidents)
    return [
        _incident(row) | {"rig": rigs.get(row["measurement_id"]), "rigs": 1 + said[row["incident_id"]]}
        for row in incidents
        if row["same_as"] not in ids
    ]


def _incident(row: Mapping[str, Any]) -> dict[str, Any]:
    from auditor.store.reviews import in_words  # noqa: PLC0415 - DuckDB is heavy

    return {
        _REMARK: in_words(row) if row["review"] else None,
        "incident": row["incident_id"][:_ID_SHOWN],
        "grade": row["grade"],
        "recording": first_few(list(dict.fromkeys(part["name"] for part in row["parts"])), _MOST_NAMED),
        "verdict": row["kind"],
        "sensors": row["attacked_names"],
        "frames": row["frames"],
        "from": row["first_frame"],
        "to": row["last_frame"],
        "seconds": row["seconds"],
        "gap": row["largest_gap"],
        "weak": row["weak"],
    }
