"""`auditor query`: the store answers."""

import re
from pathlib import Path

import click

from auditor.cli import options
from auditor.cli.output import emit, format_option

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
    from auditor.store import Store, run_query, run_sql  # noqa: PLC0415 - heavy

    if sql is not None:
        if name is not None:
            raise click.UsageError("give a query's name or --sql, not both")
        emit(run_sql(Store.open(store), sql), form)
    elif name is None:
        _list()
    elif describe:
        _describe(name)
    else:
        emit(run_query(Store.open(store), name, _values(parameters)), form)


def _list() -> None:
    """The questions, and the views that one's own SQL can ask."""
    from auditor.store import list_queries, list_views  # noqa: PLC0415 - heavy

    for heading, entries in (("Queries", list_queries()), ("Views for --sql", list_views())):
        click.echo(f"{heading}:")
        width = max(len(entry.name) for entry in entries)
        for entry in entries:
            click.echo(f"  {entry.name:<{width}}  {re.split(_SENTENCE_END, entry.text)[0]}")
        click.echo()
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
