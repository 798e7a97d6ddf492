"""`auditor views`: the views of a store for DuckDB without auditor."""

from pathlib import Path

import click

from auditor.cli import options
from auditor.cli.output import write_bytes


@click.command("views", short_help="Write the views as SQL for plain DuckDB.")
@options.store_option
def command(store: Path) -> None:
    """Write SQL text that gives plain DuckDB the views of a store, with the answers of auditor query.

    The text runs in any folder, and looks up what is finished whenever it is run: it stays right after new recordings
    and judgements. Unlike auditor query, plain DuckDB is no sandbox.

    \b
    auditor views > views.sql
    duckdb -init views.sql -c "FROM summary"
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store.store import Store  # noqa: PLC0415 - heavy
    from auditor.store.views import views_script  # noqa: PLC0415 - heavy

    write_bytes(views_script(Store.open(store).folder).encode(errors="surrogateescape"))
