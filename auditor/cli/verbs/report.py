"""`auditor report`: pages for people."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit
from auditor.cli.logged import logged, reading, refuse_altered
from auditor.cli.options import PATH
from auditor.cli.output import answer
from auditor.model.pictures import Pictures

if TYPE_CHECKING:
    from auditor.store.store import Store

_REPORTS = ("incident", "evaluation")
_PAGE = ".html"


@click.command("report", short_help="Pages of incidents and of the fleet; the evaluation page.")
@click.argument("name", type=click.Choice(_REPORTS), default="incident")
@options.store_option
@click.option("--recording", help="One page of the recording of this name, or whose id begins so.")
@click.option("--incident", metavar="ID", help="One page of the incident whose id begins so.")
@click.option(
    "--out",
    type=PATH,
    help="The folder to write, or a file NAME.html: then all is one page.  [default: in STORE/reports]",
)
@click.option(
    "--pictures",
    type=click.Choice([one.value for one in Pictures]),
    default=Pictures.INCIDENTS.value,
    show_default=True,
    help="Pictures of an incident: none, those at full resolution (else the strongest one kept), or all kept.",
)
def command(
    name: str,
    store: Path,
    recording: str | None,
    incident: str | None,
    out: Path | None,
    pictures: str,
) -> int:
    """Write pages from a store; the recordings are not needed.

    \b
    auditor report                                  index.html and incidents/ID.html in audit/reports
    auditor report --out pages                      the same in another folder
    auditor report --out incident.html              what was found as one page, which can be mailed
    auditor report --recording drive_0009.mcap      one page of one recording
    auditor report --incident 3f9c0a1b              one page of one incident
    auditor report evaluation --out evaluation.html

    Every page holds its pictures and needs no other file. The evaluation page shows everything that auditor evaluate
    has measured into the store. Every file of the store is hashed first: nothing is reported from a store that is not
    as it was written (auditor verify).
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.output_files import check_page, check_pages  # noqa: PLC0415 - keeps --help quick
    from auditor.store.store import Store  # noqa: PLC0415 - heavy

    one_page = name == "evaluation" or recording or incident or (out is not None and out.suffix == _PAGE)
    if name == "evaluation" and (recording or incident):
        raise click.UsageError("--recording and --incident are for what was found; the evaluation page pools all")
    if recording and incident:
        raise click.UsageError("an incident has a page, and a recording: name one of them")
    if out:
        (check_page if one_page else check_pages)(out)
    kept = Store.open(store)
    target = out or store / "reports" / (f"{name}{_PAGE}" if one_page else "")
    refuse_altered(kept)
    inside = target.resolve().is_relative_to(kept.folder)
    with logged(kept.folder) if inside else reading(kept.folder):
        answer(_written(kept, name, target, recording, incident, Pictures(pictures), one_page=bool(one_page)))
    return Exit.CLEAN


def _written(
    store: "Store",
    name: str,
    target: Path,
    recording: str | None,
    incident: str | None,
    pictures: Pictures,
    *,
    one_page: bool,
) -> Path:
    """Write what was asked for; answer the page to open."""
    from auditor.reporting.evaluation.loading import render_evaluation_report  # noqa: PLC0415 - heavy
    from auditor.reporting.fleet import render_fleet_report  # noqa: PLC0415
    from auditor.reporting.incident.render import render_incident_page, render_incident_report  # noqa: PLC0415

    if name == "evaluation":
        return render_evaluation_report(store, out=target)
    if incident:
        return render_incident_page(store, incident, out=target, pictures=pictures)
    if one_page:
        return render_incident_report(store, out=target, recording=recording, pictures=pictures)
    return render_fleet_report(store, out=target, pictures=pictures)
