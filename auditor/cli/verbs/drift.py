"""`auditor drift`: which sensors of a fleet change from day to day."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit
from auditor.cli.logged import logged, reading
from auditor.cli.options import PATH
from auditor.cli.output import emit, format_option, print_rows, say

if TYPE_CHECKING:
    from auditor.store.store import Store
    from auditor.store.versions.drift import FleetDrift

_COLUMNS = (
    "vehicle",
    "sensor",
    "check",
    "what",
    "level",
    "unit",
    "per_day",
    "days_left",
    "changed_on",
    "before",
    "now",
    "calibrated_anew",
    "chance",
)


@click.command("drift", short_help="Sensors that change from day to day, before they fail.")
@options.store_option
@click.option("--days", type=click.IntRange(min=6), default=60, show_default=True, help="Days that are looked at.")
@click.option("--vehicle", help="Show this vehicle only; chances are those of the fleet.")
@click.option("--all", "every", is_flag=True, help="Show also what is steady.")
@click.option("--page", type=PATH, help="Also write a page with the levels day by day.")
@format_option
def command(store: Path, days: int, vehicle: str | None, page: Path | None, form: str, *, every: bool) -> Exit:
    """Say which sensors of which vehicles drift or have changed, from the daily levels of a store.

    \b
    auditor drift
    auditor drift --vehicle car7 --days 30 --all
    auditor drift --page drift.html
    auditor query before_after day=2026-03-04       what a visit to a workshop changed
    auditor query --sql "FROM daily_levels"         the levels themselves

    A level is the median of a check over a vehicle's day. What all vehicles share, as a season, is subtracted where
    three or more drove. A level that lies on a sloping line drifts; where two lines fit far better than one it has
    changed. In a fleet without drift anything is named on one evening of a hundred: chances are corrected for all
    vehicles, sensors and checks. Recordings need a vehicle and a day (--vehicle or --path-pattern of a scan).

    Exit codes: 0 nothing drifts; 1 something drifts or has changed; 2 could not run; 3 no vehicle has enough days.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.pipeline.asking import refuse_unknown_vehicle  # noqa: PLC0415
    from auditor.pipeline.refreshing.drift import fleet_drift  # noqa: PLC0415
    from auditor.store.export import table_of  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415
    from auditor.store.versions.drift import COLUMNS, row_of  # noqa: PLC0415 - keeps --help quick

    kept = Store.open(store)
    if vehicle is not None:
        refuse_unknown_vehicle(kept, vehicle, "--vehicle")
    with reading(kept.folder):
        drift = fleet_drift(kept, days)
    shown = [one for one in (drift.sensors if every else drift.named) if vehicle in (None, one.vehicle)]
    rows = [row_of(one) for one in shown]
    if form == "table":
        print_rows(rows, _COLUMNS, expendable=("calibrated_anew", "before", "now"))
    else:
        emit(table_of(rows, COLUMNS), form)
    if page is not None:
        _write_page(drift, kept, page)
    _remark(drift)
    if not drift.sensors:
        return Exit.INCOMPLETE
    return Exit.FINDINGS if any(one.named for one in shown) else Exit.CLEAN


def _remark(drift: "FleetDrift") -> None:
    """Say what was looked at, and how sure it is."""
    if drift.of_nobody:
        say(
            f"{drift.of_nobody} of {drift.recordings} recordings have no vehicle, or no day that has come, and are "
            "left out"
        )
    if not drift.sensors:
        say("no vehicle has enough days: six of 20 measured frames each are needed")
        return
    say(
        f"{drift.first_day} to {drift.last_day}: {len(drift.sensors)} levels of {drift.vehicles} vehicles, "
        f"{len(drift.named)} drift or have changed; without drift any would be named on {drift.false_alarms:.0%} of "
        "evenings"
    )


def _write_page(drift: "FleetDrift", store: "Store", page: Path) -> None:
    """Write the page, into the store's log where it lies in the store."""
    from auditor.cli.output_files import check_page  # noqa: PLC0415 - keeps --help quick
    from auditor.reporting.refresh_page import render_drift_page  # noqa: PLC0415

    check_page(page)
    inside = page.resolve().is_relative_to(store.folder)
    with logged(store.folder) if inside else reading(store.folder):
        say(str(render_drift_page(drift, store, out=page)))
