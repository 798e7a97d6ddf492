"""`auditor report`: pages for people."""

from pathlib import Path

import click

from auditor.cli import options
from auditor.cli.logged import logged, reading, refuse_altered
from auditor.cli.output import answer
from auditor.model.pictures import Pictures

_REPORTS = ("incident", "evaluation")


@click.command("report", short_help="The incident page, the evaluation page.")
@click.argument("name", type=click.Choice(_REPORTS), default="incident")
@options.store_option
@click.option("--recording", help="Only the recording of this name, or whose id begins so.")
@click.option("--out", type=click.Path(path_type=Path), help="The file to write.  [default: STORE/reports/NAME.html]")
@click.option(
    "--pictures",
    type=click.Choice([*Pictures]),
    default=Pictures.INCIDENTS,
    show_default=True,
    help="Pictures on the incident page: none, the strongest one kept of each incident, or all kept of it.",
)
def command(name: str, store: Path, recording: str | None, out: Path | None, pictures: str) -> None:
    """Write a self-contained page from a store; the recordings are not needed.

    \b
    auditor report
    auditor report incident --recording drive_0009.mcap --out incident.html
    auditor report evaluation --out evaluation.html

    The evaluation page shows everything that auditor evaluate has measured into the store. Every file of the store is
    hashed first: nothing is reported from a store that is not as it was written (auditor verify).
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.output_files import check_page  # noqa: PLC0415 - keeps --help quick
    from auditor.reporting import render_evaluation_report, render_incident_report  # noqa: PLC0415 - heavy
    from auditor.store import Store  # noqa: PLC0415 - heavy

    if out:
        check_page(out)
    kept = Store.open(store)
    target = out or store / "reports" / f"{name}.html"
    if name == "evaluation" and recording is not None:
        raise click.UsageError("--recording is for the incident page; the evaluation page pools all recordings")
    refuse_altered(kept)
    inside = target.resolve().is_relative_to(kept.folder)
    with logged(kept.folder) if inside else reading(kept.folder):
        if name == "evaluation":
            answer(render_evaluation_report(kept, out=target))
        else:
            answer(render_incident_report(kept, out=target, recording=recording, pictures=Pictures(pictures)))
