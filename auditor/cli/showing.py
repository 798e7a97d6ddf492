"""What an audit prints: one row a recording, and the incidents."""

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

from auditor.cli.output import emit, print_rows, shown

if TYPE_CHECKING:
    from auditor.store import Store

_RECORDING_COLUMNS = ("recording", "frames", "audited", "clean", "attacked", "unidentified", "sensors", "r")
_INCIDENT_COLUMNS = ("recording", "verdict", "sensors", "frames", "from", "to", "seconds", "margin")


def show_audit(store: "Store", form: str, recording_ids: Collection[str] | None = None) -> None:
    """Print the summary of some recordings, or of all; as a table with the columns a person wants, and incidents."""
    from auditor.store import run_query  # noqa: PLC0415 - DuckDB is heavy

    summary = run_query(store, "summary", {})
    if recording_ids is not None:
        ids = summary["recording_id"].to_pylist()
        summary = summary.take([row for row, known in enumerate(ids) if known in recording_ids])
    if form != "table":
        emit(summary, form)
        return
    print_rows([_recording(row) for row in summary.to_pylist()], _RECORDING_COLUMNS)
    incidents = [
        _incident(row)
        for row in run_query(store, "incidents", {}).to_pylist()
        if recording_ids is None or any(part["recording_id"] in recording_ids for part in row["parts"])
    ]
    if incidents:
        print_rows(incidents, _INCIDENT_COLUMNS, title="Incidents")


def _recording(row: Mapping[str, Any]) -> dict[str, Any]:
    rate = shown(row["r"])
    return {
        "recording": row["name"],
        "frames": row["frames"],
        "audited": None if row["audited_share"] is None else f"{100 * row['audited_share']:.1f} %",
        "clean": row["clean"],
        "attacked": row["attacked"],
        "unidentified": row["unidentified"],
        "sensors": row["attacked_names"],
        "r": rate if row["resolvable"] is not False else f"{rate} (not resolvable)",
    }


def _incident(row: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "recording": ", ".join(part["name"] for part in row["parts"]),
        "verdict": row["kind"],
        "sensors": row["attacked_names"],
        "frames": row["frames"],
        "from": row["first_frame"],
        "to": row["last_frame"],
        "seconds": row["seconds"],
        "margin": row["strongest_margin"],
    }
