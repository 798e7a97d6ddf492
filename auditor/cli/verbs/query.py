"""`auditor query`: the store answers."""

import re
import shlex
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.output import emit, format_option, say
from auditor.errors import QueryError

if TYPE_CHECKING:
    from auditor.store import Store
    from auditor.store.export import Table
    from auditor.store.sql_files import SqlFile

_WIDEST_LIST = 110
_OF_VERDICTS = re.compile(r"\b(verdicts|findings|judgements)\b")
_SENTENCE_END = r"(?<!Fig)\.(?: |$)"


@click.command("query", short_help="Ask the store.")
@click.argument("name", required=False)
@click.argument("parameters", nargs=-1, metavar="[PARAMETER=VALUE]...")
@options.store_option
@click.option("--sql", help="Your own SQL over the store's views, in a sandbox.")
@click.option("--describe", is_flag=True, help="Say what the query answers, its parameters and columns; views too.")
@format_option
def command(
    name: str | None, parameters: tuple[str, ...], store: Path, sql: str | None, form: str, *, describe: bool
) -> None:
    """Ask the store; without a name, list the questions it can answer.

    \b
    auditor query
    auditor query incidents gap_s=1
    auditor query identification_rate --describe
    auditor query --sql "SELECT name, count(*) FROM verdicts WHERE kind = 'attacked' GROUP BY name"
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.store import Store, query, run_query, run_sql  # noqa: PLC0415 - heavy

    if sql is not None:
        if name is not None:
            raise click.UsageError("give a query's name or --sql, not both")
        kept = Store.open(store)
        _show(kept, sql, run_sql(kept, sql), form)
    elif name is None:
        _list()
    elif describe:
        _describe(name)
    else:
        _refuse_view(name)
        wanted, values = query(name), _values(parameters)
        kept = Store.open(store)
        _check_names(kept, wanted, values)
        _show(kept, wanted.sql, run_query(kept, name, values), form)


def _refuse_view(name: str) -> None:
    """A view is asked by SQL. Raises QueryError that says how."""
    from auditor.store import list_views  # noqa: PLC0415 - heavy

    if name in {view.name for view in list_views()}:
        raise QueryError(
            "it is a view, not a query",
            where=name,
            remedy=f'auditor query --sql "FROM {name} LIMIT 20" shows rows of it',
        )


def _check_names(store: "Store", wanted: "SqlFile", values: Mapping[str, str]) -> None:
    """Raises QueryError where a recording or calibration is named that the store has not: no rows would hide it."""
    from auditor.cli.judging import listing_calibrations  # noqa: PLC0415 - keeps --help quick

    named = {parameter.name: values[parameter.name] for parameter in wanted.parameters if parameter.name in values}
    recording, calibration = named.get("recording"), named.get("calibration")
    if recording is not None and not store.recordings_called(recording):
        raise QueryError(
            f"no recording has the name or id {recording!r}",
            where=f"query {wanted.name}",
            remedy=f"auditor query summary --store {shlex.quote(str(store.folder))} lists them",
        )
    if calibration is not None and not store.calibrations_called(calibration):
        raise QueryError(
            f"no calibration has an id that begins with {calibration!r}",
            where=f"query {wanted.name}",
            remedy=listing_calibrations(store.folder),
        )


def _show(store: "Store", sql: str, answer: "Table", form: str) -> None:
    """Print the answer; one without rows, which nothing may be concluded from, says so."""
    emit(answer, form)
    if len(answer) or not _OF_VERDICTS.search(sql):
        return
    measured = store.ids("measurements")
    missing = len(set(measured) - store.current_judgements().keys())
    if not measured:
        say("nothing has been measured: auditor scan audits recordings")
    elif missing:
        what = f"{missing} of {len(measured)} measurements {'is' if missing == 1 else 'are'}"
        say(f"{what} not judged: nothing is known of attacks there; auditor judge reaches verdicts")


def _list() -> None:
    """The questions, and the views that one's own SQL can ask."""
    from auditor.store import list_queries, list_views  # noqa: PLC0415 - heavy

    page = click.HelpFormatter(width=min(shutil.get_terminal_size().columns, _WIDEST_LIST))
    for heading, entries in (("Queries", list_queries()), ("Views for --sql", list_views())):
        with page.section(heading):
            page.write_dl([(entry.name, re.split(_SENTENCE_END, entry.text)[0]) for entry in entries])
    click.echo(page.getvalue().lstrip("\n"))
    click.echo("auditor query NAME --describe tells parameters and columns.")


def _describe(name: str) -> None:
    from auditor.store import describe  # noqa: PLC0415 - heavy

    description = describe(name)
    click.echo(f"{description.text}\n")
    for parameter in description.parameters:
        default = "required" if parameter.required else f"default {parameter.default or 'none'}"
        click.echo(f"  parameter {parameter.name}, {default}: {parameter.sentence}")
    for column in description.columns:
        click.echo(f"  {column.name} {column.type}: {column.sentence}")


def _values(parameters: tuple[str, ...]) -> dict[str, str]:
    values = {}
    for parameter in parameters:
        key, equals, value = parameter.partition("=")
        if not equals:
            raise click.UsageError(f"{parameter!r} is no parameter: write it as name=value")
        values[key] = value
    return values
