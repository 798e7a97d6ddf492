"""`auditor query`: rows from the store."""

import re
import shutil
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit
from auditor.cli.logged import reading, tell_altered
from auditor.cli.options import FiniteRange
from auditor.cli.output import answer, emit, format_option, say
from auditor.errors import QueryError

if TYPE_CHECKING:
    from collections.abc import Callable

    from auditor.store.export import Table
    from auditor.store.folder import StoreFolder
    from auditor.store.sql_files import SqlFile

_WIDEST_LIST = 110
_LONGEST_SQL = 1 << 20
_OF_VERDICTS = re.compile(r"\b(verdicts|findings|judgements|incidents|incident_frames)\b")
_OF_CALIBRATIONS = re.compile(r"\bFROM calibrations\b")
_SENTENCE_END = r"(?<!Fig)\.(?: |$)"


@click.command("query", short_help="Query the store.")
@click.argument("name", required=False)
@click.argument("parameters", nargs=-1, metavar="[[PARAMETER=]VALUE]...")
@options.store_option
@click.option("--sql", help="Your own SQL over the store's views: one SELECT, in a sandbox.")
@click.option(
    "--file",
    "-f",
    "source",
    type=click.File("rb"),
    metavar="FILE",
    help="As --sql, from a file; - is the standard input.",
)
@click.option("--verify", is_flag=True, help="Hash every file of the store first, not only those that changed.")
@click.option("--describe", is_flag=True, help="Say what the query answers, its parameters and columns; views too.")
@click.option(
    "--time-limit",
    type=FiniteRange(min=0, min_open=True),
    default=300,
    show_default=True,
    metavar="SECONDS",
    help="Time that your own SQL may take.",
)
@click.option(
    "--memory-limit",
    type=FiniteRange(min=0, min_open=True),
    default=4096,
    show_default=True,
    metavar="MB",
    help="Memory that your own SQL may take, and its answer.",
)
@format_option
def command(
    name: str | None,
    parameters: tuple[str, ...],
    store: Path,
    sql: str | None,
    source: BinaryIO | None,
    time_limit: float,
    memory_limit: float,
    form: str,
    *,
    describe: bool,
    verify: bool,
) -> Exit:
    """Query the store; without a name, list its queries and views.

    \b
    auditor query
    auditor query incidents gap_s=1
    auditor query frame drive_0009.mcap 120
    auditor query identification_rate --describe
    auditor query --sql "SELECT name, count(*) FROM verdicts WHERE kind = 'attacked' GROUP BY name"
    auditor query --file question.sql --format csv
    echo "FROM verdicts" | auditor query --file -
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    if (name is not None) + (sql is not None) + (source is not None) > 1:
        raise click.UsageError("give one of a query's name, --sql and --file")
    if source is not None:
        sql = _read(source)
    if sql is not None:
        from auditor.store.sandbox.limits import SqlLimits  # noqa: PLC0415 - heavy
        from auditor.store.sandbox.process import run_sandboxed  # noqa: PLC0415 - heavy

        limits = SqlLimits(time_limit, memory_limit)
        return _tell(store, sql, partial(run_sandboxed, text=sql, limits=limits), form, every=verify)
    if name is None:
        _list()
    elif describe:
        _describe(name)
    else:
        from auditor.pipeline.asking import query  # noqa: PLC0415 - heavy
        from auditor.store.queries import query as find_query  # noqa: PLC0415
        from auditor.store.sql_files import queries  # noqa: PLC0415

        values = _values(parameters, queries().get(name))
        text = find_query(name).sql
        return _tell(store, text, lambda kept: query(kept, name, **values), form, every=verify)
    return Exit.CLEAN


def _read(source: BinaryIO) -> str:
    """The SQL in a file. Raises QueryError where it is too long for any, or no text."""
    content = source.read(_LONGEST_SQL + 1)
    if len(content) > _LONGEST_SQL:
        raise QueryError(f"it is longer than {_LONGEST_SQL} bytes, which no SQL is", where=source.name)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise QueryError("it is not UTF-8", where=source.name, remedy="name a file that holds one SELECT") from error


def _tell(store: Path, sql: str, answer: "Callable[[StoreFolder], Table]", form: str, *, every: bool) -> Exit:
    """Print what a store answers to SQL."""
    from auditor.store.folder import StoreFolder  # noqa: PLC0415 - heavy

    kept = StoreFolder.open(store)
    altered = tell_altered(kept, every=every)
    with reading(kept.folder):
        _show(kept, sql, answer(kept), form)
    return Exit.INCOMPLETE if altered else Exit.CLEAN


def _show(store: "StoreFolder", sql: str, answer: "Table", form: str) -> None:
    """Print the answer. One without rows may come from missing verdicts or thresholds: then it says so."""
    emit(answer, form)
    if len(answer) or not _OF_VERDICTS.search(sql):
        return
    from auditor.store.store import Store  # noqa: PLC0415 - heavy

    measured, judged = store.ids("measurements"), Store(store.folder).current_judgements()
    missing = len(set(measured) - judged.keys())
    learnt = {one.calibration_id for one in judged.values()} & {*store.ids("calibrations")}
    if not measured:
        say("nothing has been measured: auditor scan audits recordings")
    elif missing:
        subject = f"{missing} of {len(measured)} measurements {'is' if missing == 1 else 'are'}"
        say(f"{subject} not judged: whether they were attacked is unknown; auditor judge reaches verdicts")
    elif not learnt and _OF_CALIBRATIONS.search(sql):
        say(
            "it asks of thresholds learnt from clean recordings, and no verdict is by such: auditor calibrate learns "
            "them, auditor judge judges by them"
        )


def _list() -> None:
    """The queries, and the views for one's own SQL."""
    from auditor.store.queries import list_queries, list_views  # noqa: PLC0415 - heavy

    page = click.HelpFormatter(width=min(shutil.get_terminal_size().columns, _WIDEST_LIST))
    for heading, entries in (("Queries", list_queries()), ("Views for --sql and --file", list_views())):
        with page.section(heading):
            page.write_dl([(entry.name, re.split(_SENTENCE_END, entry.text)[0]) for entry in entries])
    click.echo(page.getvalue().lstrip("\n"))
    click.echo("auditor query NAME --describe shows parameters and columns.")


def _describe(name: str) -> None:
    from auditor.store.queries import describe  # noqa: PLC0415 - heavy

    description = describe(name)
    answer(description.text)
    click.echo()
    for parameter in description.parameters:
        default = "required" if parameter.required else f"default {parameter.default or 'none'}"
        answer(f"  parameter {parameter.name}, {default}: {parameter.sentence}")
    for column in description.columns:
        answer(f"  {column.name} {column.type}: {column.sentence}")


def _values(parameters: tuple[str, ...], asked: "SqlFile | None") -> dict[str, str]:
    """The parameters by name; those of a query that needs some may be given without names, in their order."""
    declared = asked.parameters if asked is not None else ()
    in_order = [one.name for one in declared] if any(one.required for one in declared) else []
    values: dict[str, str] = {}
    for place, parameter in enumerate(parameters):
        key, equals, value = parameter.partition("=")
        if equals and (key in in_order or not in_order):
            values[key] = value
        elif place < len(in_order):
            values[in_order[place]] = parameter
        else:
            raise click.UsageError(f"{parameter!r} is not a parameter: write it as name=value")
    return values
