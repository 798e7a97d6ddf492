"""What an audit prints: one row a recording, and the incidents."""

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, Any

import click

from auditor.cli.output import emit, print_rows, say, shown

if TYPE_CHECKING:
    from auditor.store import Store

_RECORDING_COLUMNS = ("recording", "frames", "audited", "clean", "attacked", "unidentified", "sensors", "r")
_UNRESOLVED = "*"
_INCIDENT_COLUMNS = ("recording", "verdict", "sensors", "frames", "from", "to", "seconds", "gap")


def show_audit(
    store: "Store",
    form: str,
    recording_ids: Collection[str] | None = None,
    judged: Collection[str] | None = None,
) -> None:
    """Print the summary of some recordings, or of all; as a table with the columns a person wants, and incidents.

    `judged` are the measurements that were judged just now: verdicts that others keep from earlier are not shown, only
    said to be there.
    """
    from auditor.store import rows_of, run_query  # noqa: PLC0415 - DuckDB is heavy

    summary = run_query(store, "summary", {})
    shown_rows, earlier = [], 0
    for place, row in enumerate(rows_of(summary)):
        if recording_ids is not None and row["recording_id"] not in recording_ids:
            continue
        if judged is None or row["measurement_id"] in judged or row["method"] is None:
            shown_rows.append(place)
        else:
            earlier += 1
    if earlier:
        count = "1 measurement keeps its" if earlier == 1 else f"{earlier} measurements keep their"
        say(f"{count} verdicts from earlier, not shown here; auditor query summary shows them")
    summary = summary.take(shown_rows) if shown_rows else summary.slice(0, 0)
    if form != "table":
        emit(summary, form)
        return
    rows = rows_of(summary)
    print_rows([_recording(row) for row in rows], _RECORDING_COLUMNS)
    if any(row["resolvable"] is False for row in rows):
        click.echo(f"{_UNRESOLVED} not resolvable: judged as at r = 0")
    measurements = {row["measurement_id"] for row in rows}
    incidents = [
        _incident(row)
        for row in rows_of(run_query(store, "incidents", {}))
        if any(part["measurement_id"] in measurements for part in row["parts"])
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
        "r": rate if row["resolvable"] is not False else f"{rate}{_UNRESOLVED}",
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
        "gap": row["largest_gap"],
    }
