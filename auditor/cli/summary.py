"""What an audit prints: a line for each recording, then one row a recording, and the incidents."""

from collections.abc import Collection, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import click

from auditor.cli.exit_codes import Tally
from auditor.cli.output import emit, print_rows, progress, say, shown

if TYPE_CHECKING:
    from auditor.pipeline.many import Batch, Judged
    from auditor.pipeline.measure import Measured
    from auditor.store import Store

_RECORDING_COLUMNS = ("recording", "frames", "audited", "clean", "attacked", "unidentified", "sensors", "r")
_UNRESOLVED = "*"
_INCIDENT_COLUMNS = ("recording", "verdict", "sensors", "frames", "from", "to", "seconds", "gap")


def show_measuring(batch: "Batch", tally: Tally) -> "list[Measured]":
    """Measure a batch, print what became of each recording, and return what is measured, in the order given."""
    from auditor.pipeline.many import measure_all, was_examined  # noqa: PLC0415 - keeps --help quick

    for error in batch.errors:
        say(f"auditor: {error}")
        tally.failed = True
    measured = {}
    with progress(len(batch.tasks), "measuring") as (advanced, finished):
        for outcome in measure_all(batch, advanced):
            if outcome.error is not None:
                finished(f"auditor: {outcome.error}")
                tally.incomplete |= was_examined(outcome.error)
                tally.failed = True
            elif outcome.result is not None:
                measured[outcome.item] = outcome.result
                how = "measured" if outcome.result.fresh else "measured before"
                finished(f"{outcome.item}: {outcome.result.frames} frames {how}")
                for warning in outcome.result.calibration_warnings:
                    finished(f"{outcome.item}: WARNING: {warning}")
    return [measured[task] for task in batch.tasks if task in measured]


def show_judging(results: "Iterable[Judged]", tally: Tally) -> list[str]:
    """Print what could not be judged or not fully audited, and why; return the measurements that were judged."""
    judged = []
    for one in results:
        for remark in (*one.warnings, *([one.error] if one.error else [])):
            say(f"{one.recording}: {remark}")
        tally.failed |= one.error is not None
        tally.incomplete |= one.error is None and not one.complete
        tally.found |= one.found
        if one.judgement is not None:
            tally.audited = True
            judged.append(one.measurement_id)
    return judged


def show_audit(
    store: "Store",
    form: str,
    recording_ids: Collection[str] | None = None,
    judged: Collection[str] | None = None,
) -> None:
    """Print the summary of some recordings, or of all; as a table with the columns a person wants, and incidents.

    `judged` are the measurements that were judged just now: earlier verdicts on others are counted, not shown.
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
