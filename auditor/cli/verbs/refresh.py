"""`auditor refresh`: new calibrations from clean recordings, night after night."""

from dataclasses import replace
from decimal import Decimal
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.logged import logged, note_altered
from auditor.cli.options import PATH, PLACE
from auditor.cli.output import answer, say

if TYPE_CHECKING:
    from auditor.model.settings import MeasureSettings
    from auditor.pipeline.remote.addresses import Address
    from auditor.pipeline.scan import Scan
    from auditor.store.store import Store
    from auditor.store.versions.decisions import Failure, Refresh

_ALTERED = "files of the store are not as they were written: auditor verify names them"


@click.command("refresh", short_help="Calibrate anew from clean recordings, every night.")
@click.argument("sources", nargs=-1, metavar="[RECORDING|STORE...]", type=PLACE)
@options.store_option
@click.option("--clean", is_flag=True, help="The recordings and stores that are named here are known to be clean.")
@options.setting("r", "The r that recordings are judged at.")
@click.option("--metrics", type=PATH, help="Also write metrics for Prometheus to this file.")
@click.option("--dry-run", is_flag=True, help="Measure and write nothing: only say what would be decided.")
@options.setting("no_sensors")
@options.measuring_options(*options.MEASURING)
def command(
    sources: "tuple[Path | Address, ...]",
    store: Path,
    r: Decimal,
    metrics: Path | None,
    measuring: "MeasureSettings",
    no_sensors: tuple[str, ...],
    *,
    clean: bool,
    dry_run: bool,
) -> int:
    """Calibrate anew from recordings that are clean, and put in force what may be: one command for a line of cron.

    \b
    auditor refresh clean_logs/*.mcap --clean
    auditor refresh /logs/today --store fleet --metrics /var/lib/node_exporter/auditor.prom
    auditor refresh --store fleet --dry-run

    Recordings are measured as far as the store does not have them, and judged. For each rig kind those are learnt from
    that somebody named clean (--clean, auditor label --clean) or that the version in force finds clean. Each is judged
    by others, of other vehicles and days. What was raised is left out, and listed to be looked at.

    A candidate comes into force where it is no worse than the version in force, and moves no threshold far. Else it is
    held for a person (auditor calibration promote), or refused.

    Prints one line of JSON, and writes the page STORE/reports/refresh.html. Exit codes: 0 promoted, or nothing new;
    1 held for a person, some recordings of this call have findings or are in doubt, or some failed; 2 could not run;
    4 refused.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.refresh_answers import exit_code, json_line, left_out_lines, planned_lines  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415
    from auditor.store.versions.decisions import next_steps  # noqa: PLC0415

    if clean and not sources:
        raise click.UsageError("--clean says that the recordings or stores that are named are clean: name some")
    stores = [one for one in sources if isinstance(one, Path) and Store.is_at(one)]
    others = [Store.open(path) for path in stores]
    recordings = [one for one in sources if one not in stores]
    if dry_run:
        night = _tried(recordings, others, store, r, measuring.rig, no_sensors, clean=clean)
    else:
        kept = Store.open(store, create=bool(sources))
        night = _refreshed(recordings, others, kept, r, metrics, measuring, no_sensors, clean=clean)
    for line in planned_lines(night):
        say(line)
    for decision in night.decisions:
        say(f"{decision.kind}: {decision.decided}{': ' * bool(decision.reasons)}{'; '.join(decision.reasons)}")
        for line in left_out_lines(decision):
            say(f"  {line}")
        for step in next_steps(decision, night.store):
            say(f"  {step.what}: {step.command}")
    for finding in night.found:
        say(f"{finding.called}: to be looked at: {finding.reason}")
    answer(json_line(night))
    return exit_code(night)


def _tried(
    recordings: "list[Path | Address]",
    others: "list[Store]",
    store: Path,
    r: Decimal,
    rig: Path | None,
    no_sensors: tuple[str, ...],
    *,
    clean: bool,
) -> "Refresh":
    """What a refresh would decide of what is measured already, and what it would measure.

    Before the first night there is no store yet: an empty one stands for it.
    """
    from auditor.pipeline.refreshing.night import plan, refresh  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415

    with TemporaryDirectory() as empty:
        first = (recordings or others) and not (store.exists() and any(store.iterdir()))
        kept = Store.open(empty, create=True) if first else Store.open(store)
        named = [known for other in others for known in other.ids("measurements")] if clean else []
        night = refresh(kept, others, named, r, no_sensors=no_sensors, dry_run=True)
        return replace(night, store=store.resolve(), planned=tuple(plan(recordings, kept, rig)))


def _refreshed(
    recordings: "list[Path | Address]",
    others: "list[Store]",
    kept: "Store",
    r: Decimal,
    metrics: Path | None,
    measuring: "MeasureSettings",
    no_sensors: tuple[str, ...],
    *,
    clean: bool,
) -> "Refresh":
    """Measure, judge, learn, and write the page and the metrics of it."""
    from auditor.cli.refresh_answers import (  # noqa: PLC0415 - keeps --help quick
        drift_metrics,
        refresh_metrics,
        write_metrics,
    )
    from auditor.pipeline.refreshing.drift import fleet_drift  # noqa: PLC0415
    from auditor.pipeline.refreshing.night import default_page, new_ones, refresh  # noqa: PLC0415
    from auditor.reporting.refresh_page import render_refresh_page  # noqa: PLC0415
    from auditor.store.versions.decisions import Failure  # noqa: PLC0415
    from auditor.store.versions.history import only_refresh  # noqa: PLC0415

    with only_refresh(kept), logged(kept.folder) as entry:
        altered = note_altered(kept, entry)
        scan, failed = _measure(recordings, kept, measuring)
        failed += [Failure(str(kept), _ALTERED)] if altered else []
        measured = scan.measurement_ids
        judged = list(scan.judge(*new_ones(kept, r, no_sensors)))
        for result in judged:
            if result.error is not None:
                say(f"{result.recording}: {result.error}")
        for remark in scan.finish():
            say(remark)
        named = [known for other in others for known in other.ids("measurements")] + measured
        named = named if clean else []
        new = [one.measurement_id for one in judged]
        night = refresh(kept, others, named, r, measured=measured, judged=new, failed=failed, no_sensors=no_sensors)
        render_refresh_page(night, kept, out=default_page(kept.folder))
        if metrics:
            write_metrics((*refresh_metrics(night), *drift_metrics(fleet_drift(kept))), metrics)
    return night


def _measure(
    recordings: "list[Path | Address]", store: "Store", measuring: "MeasureSettings"
) -> "tuple[Scan, list[Failure]]":
    """Measure what the store does not have; the scan of all that was given, and what failed."""
    from auditor.cli.exit_codes import Tally  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.summary import show_measuring  # noqa: PLC0415
    from auditor.pipeline.many import find_batch  # noqa: PLC0415
    from auditor.pipeline.scan import Scan  # noqa: PLC0415
    from auditor.store.versions.decisions import Failure  # noqa: PLC0415

    scan, tally = Scan(find_batch(recordings, store.folder, measuring), store.folder), Tally()
    show_measuring(scan, tally)
    for superseded in scan.relate():
        say(superseded)
    return scan, [Failure(one.path, one.reason) for one in tally.not_audited]
