"""`auditor judge`: verdicts again, without the recordings."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.logged import logged, note_altered
from auditor.cli.output import format_option

if TYPE_CHECKING:
    from auditor.model.settings import Criteria


@click.command("judge", short_help="Verdicts again, without recordings.")
@options.store_argument_or_option()
@options.setting("jobs")
@options.judging_options("recount", *options.JUDGING)
@format_option
def command(store: Path, jobs: int, judging: "Criteria", form: str) -> int:
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
    from auditor.pipeline.library import judge_store  # noqa: PLC0415
    from auditor.store.packs.packing import pack_where_many  # noqa: PLC0415
    from auditor.store.store import Store  # noqa: PLC0415

    kept, tally = Store.open(store), Tally()
    with logged(kept.folder) as entry:
        tally.incomplete = note_altered(kept, entry)
        judged = show_judging(judge_store(kept, judging, jobs), kept, tally)
        pack_where_many(kept)  # thousands of new files would each be opened by what is shown
    show_audit(kept, form, tally, judged=judged)
    return tally.exit_code()
