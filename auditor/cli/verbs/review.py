"""`auditor review`: what somebody says of an incident."""

from datetime import UTC, date, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.logged import logged
from auditor.cli.output import answer, emit_columns, format_option

if TYPE_CHECKING:
    from auditor.store.store import Store

_LIST = "list"
_WORDS = ("confirmed", "false-alarm", "known")
_COLUMNS = ("incident", "recording", "sensors", "said", "reason", "until", "by", "at", "counts")


@click.command("review", short_help="Say what an incident is: confirmed, a false alarm, known.")
@click.argument("incident", metavar="INCIDENT|list")
@click.option("--as", "verdict", type=click.Choice(_WORDS), help="What it is.")
@click.option("--reason", help="Why, in your own words.")
@click.option(
    "--until",
    type=click.DateTime(["%Y-%m-%d"]),
    metavar="YYYY-MM-DD",
    help="The last day (UTC) on which it counts.  [default: for good]",
)
@options.store_option
@format_option
def command(
    incident: str, verdict: str | None, reason: str | None, until: datetime | None, store: Path, form: str
) -> None:
    """Say what an incident is; INCIDENT is its id, or the beginning of one.

    \b
    auditor review 3f9c0a1b --as confirmed --reason "laser seen on site"
    auditor review 3f9c0a1b --as false-alarm --reason "low sun" --until 2026-12-31
    auditor review list

    Reviews are kept in the store with their author, and in its log; none is ever changed, and the last one of an
    incident counts. A review is found again when the recording is measured or judged anew: by recording or drive,
    time and sensors. A false alarm and what is known do not fail a scan, and a recording whose only incidents are false
    alarms may be calibrated on.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.store import Store  # noqa: PLC0415 - keeps --help quick

    given = (verdict, reason, until)
    if incident == _LIST:
        if any(given):
            raise click.UsageError("auditor review list takes no --as, --reason and --until")
        _show(Store.open(store), form)
        return
    if not verdict or not (reason or "").strip():
        raise click.UsageError("say what it is (--as), and why (--reason)")
    day = until.date() if until else None
    if day is not None and day < datetime.now(UTC).date():
        raise click.UsageError(f"--until {day} is over: name today or a later day")
    _review(Store.open(store), incident, verdict, reason or "", day)


def _review(store: "Store", beginning: str, verdict: str, reason: str, until: date | None) -> None:
    from auditor.store.export import rows_of  # noqa: PLC0415 - keeps --help quick
    from auditor.store.queries import run_query  # noqa: PLC0415 - keeps --help quick
    from auditor.store.reviews import ReviewVerdict, incident_called, review_incident  # noqa: PLC0415

    with logged(store.folder):
        row = incident_called(store, rows_of(run_query(store, "incidents", {})), beginning)
        review_incident(store, row, ReviewVerdict(verdict), reason, until)
    sensors = " + ".join(row["attacked_names"]) or "no sensor named"
    answer(f"{row['incident_id']}: {row['name']}, {sensors}: {verdict}{f' until {until}' if until else ''}")


def _show(store: "Store", form: str) -> None:
    from auditor.store.queries import run_query  # noqa: PLC0415 - keeps --help quick

    nothing = f"{store.folder}: nobody has reviewed an incident"
    emit_columns(run_query(store, "review_history", {}), form, _COLUMNS, nothing, wrapped=("reason", "sensors"))
