"""`auditor judge`: verdicts again, without the recordings."""

from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from auditor.cli import judging_options, options
from auditor.cli.logged import logged
from auditor.cli.output import format_option
from auditor.cli.values import PATH


@click.command("judge", short_help="Verdicts again, without recordings.")
@click.argument("place", metavar="[STORE]", required=False, type=PATH)
@options.store_option
@judging_options.recount_option
@options.jobs_option
@judging_options.judging_options
@format_option
def command(place: Path | None, store: Path, form: str, **judging: Any) -> int:  # noqa: ANN401 - handed on to the library
    """Judge everything in a store again: another r, other thresholds, no recordings needed.

    \b
    auditor judge -r 0
    auditor judge --store night/audit -r 2% --method paper --statistic plain
    auditor judge --store night/audit --recount

    The new verdicts become the current ones; earlier ones stay in the store. What could not be judged now is not shown.

    --recount is for measurements made by an auditor with other windows: their stored cells are counted in today's
    windows before they are judged. What was measured stays as it is, and a judgement says that it was recounted. Its
    thresholds must be made with today's windows, too (auditor calibrate --recount).
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.exit_codes import Tally  # noqa: PLC0415 - keeps --help quick
    from auditor.cli.summary import show_audit, show_judging  # noqa: PLC0415
    from auditor.pipeline.library import judge  # noqa: PLC0415
    from auditor.store import Store  # noqa: PLC0415
    from auditor.store.packs.packing import pack_where_many  # noqa: PLC0415

    if place is not None and click.get_current_context().get_parameter_source("store") is ParameterSource.COMMANDLINE:
        raise click.UsageError("name the store once, with --store")
    kept, tally = Store.open(place or store), Tally()
    with logged(kept.folder):
        judged = show_judging(judge(kept, **judging), kept, tally)
        pack_where_many(kept)  # thousands of new files would each be opened by what is shown
    show_audit(kept, form, tally, judged=judged)
    return tally.exit_code()
