"""`auditor query`: the store answers."""

from pathlib import Path

import click

from auditor.cli import options
from auditor.cli.output import emit, format_option, print_rows


@click.command("query", short_help="Ask the store.")
@click.argument("name", required=False)
@click.argument("parameters", nargs=-1, metavar="[PARAMETER=VALUE]...")
@options.store_option
@click.option("--sql", help="Your own SQL over the store's views, in a sandbox.")
@click.option("--describe", is_flag=True, help="Say what the query answers, its parameters and columns.")
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
    from auditor.store import Store, list_queries, query, run_query, run_sql  # noqa: PLC0415 - heavy

    if sql is not None:
        if name is not None:
            raise click.UsageError("give a query's name or --sql, not both")
        emit(run_sql(Store.open(store), sql), form)
    elif name is None:
        rows = [
            {
                "query": q.name,
                "answers": q.text.split(". ")[0].rstrip("."),
                "parameters": " ".join(p.name for p in q.parameters),
            }
            for q in list_queries()
        ]
        print_rows(rows, ("query", "answers", "parameters"))
    elif describe:
        click.echo(query(name).text)
    else:
        emit(run_query(Store.open(store), name, _values(parameters)), form)


def _values(parameters: tuple[str, ...]) -> dict[str, str]:
    values = {}
    for parameter in parameters:
        key, equals, value = parameter.partition("=")
        if not equals:
            raise click.UsageError(f"{parameter!r} is no parameter: write it as name=value")
        values[key] = value
    return values
