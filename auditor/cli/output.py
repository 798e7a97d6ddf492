"""What verbs print: rows on stdout, progress and remarks on stderr."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from decimal import Decimal
from time import monotonic
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import click

from auditor.cli.log_lines import Level, is_json, named, tell
from auditor.model.text import one_line

if TYPE_CHECKING:
    from rich.console import Console, JustifyMethod
    from rich.table import Table as TableOnScreen

    from auditor.store.export import Table

WIDEST_TABLE = 200
_BRIEF_ID = 12
_LEAST_WRAPPED = 12
"""A column that may take several lines keeps so many characters."""
_COUNT_EACH_S = 30.0
"""Where no terminal shows a bar, a line that counts comes this often."""

_REMARKS = ("note",)
_WORDS = ("item", "value", "note")
"""Columns of answers that hold words, and those that only remark."""

FORMATS = ("table", "json", "csv", "parquet")

format_option = click.option(
    "--format", "form", type=click.Choice(FORMATS), default="table", show_default=True, help="How rows are printed."
)


def emit(table: "Table", form: str) -> None:
    """Print rows to stdout in one of FORMATS."""
    from auditor.store.export import encode, rows_of  # noqa: PLC0415 - Arrow is heavy

    if form == "table":
        print_rows(rows_of(table), table.column_names, expendable=_REMARKS, wrapped=_WORDS)
        return
    write_bytes(encode(table, form))


def emit_columns(
    table: "Table",
    form: str,
    columns: Sequence[str],
    nothing: str,
    expendable: Sequence[str] = (),
    wrapped: Sequence[str] = (),
) -> None:
    """Print rows to stdout in one of FORMATS: as a table some columns; without rows `nothing` on stderr."""
    from auditor.store.export import rows_of  # noqa: PLC0415 - Arrow is heavy

    if form != "table":
        emit(table, form)
    elif rows := rows_of(table):
        print_rows(rows, columns, expendable=expendable, wrapped=wrapped)
    else:
        say(nothing)


def check_in_words(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row of a sensor check as it is printed: its sensors by their names."""
    return {**row, "sensor": f"S_{row['sensor']}", "others": " ".join(f"S_{other}" for other in row["others"])}


def write_bytes(data: bytes) -> None:
    """Write to stdout what is for programs."""
    sys.stdout.buffer.write(data)
    sys.stdout.buffer.flush()


def print_rows(
    rows: Sequence[Mapping[str, Any]],
    columns: Sequence[str],
    title: str = "",
    expendable: Sequence[str] = (),
    wrapped: Sequence[str] = (),
) -> None:
    """Print rows as a table.

    Where it would be wider than the terminal, ids are cut to their beginnings, what is the same in all rows stands
    once, above, `wrapped` columns take several lines, and `expendable` ones are left out, the first of them first.
    What is too wide even so becomes several tables, and rows one below the other where a column is.
    """
    from rich.console import Console  # noqa: PLC0415

    console = Console(file=sys.stdout, highlight=False, markup=False, emoji=False)
    room = console.width if console.is_terminal else WIDEST_TABLE
    console.width = 10_000  # so that a table is measured, not squeezed

    def fits(some: Sequence[str]) -> bool:
        return console.measure(_table(_widest(rows, some), some, title)).maximum <= room

    if not rows:
        if fits(columns):
            console.print(_table(rows, columns, title))
        console.print("(no rows)")
        return
    groups = [columns]
    if not fits(columns):
        rows = [{column: _brief(column, row[column]) for column in columns} for row in rows]
        same = [column for column in columns if len(rows) > 1 and all(row[column] == rows[0][column] for row in rows)]
        if same:
            alike = ", ".join(f"{column} {shown(rows[0][column])}" for column in same)
            console.print(f"the same in all {len(rows)} rows: {alike}", soft_wrap=True)
        columns = _without(columns, same) or columns
        for some in (_without(columns, expendable[:count]) for count in range(len(expendable) + 1)):
            if console.measure(_table(rows, some, title, wrapped)).minimum <= room:
                console.width = room
                console.print(_table(rows, some, title, wrapped))
                return
        groups = _groups(columns, fits)
    if groups and (len(groups) == 1 or len(rows) > 1):
        for number, group in enumerate(groups):
            console.print(_table(rows, group, "" if number else title))
    else:
        _print_below(console, rows, columns, title)


def _widest(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> list[Mapping[str, Any]]:
    """A row as wide as all of them: of each column the widest cell. Measuring all takes longer than asking for them."""
    from rich.cells import cell_len  # noqa: PLC0415

    def width(value: object) -> int:
        return cell_len(shown(value))

    return [{column: max((row[column] for row in rows), key=width) for column in columns}] if rows else []


def _without(columns: Sequence[str], some: Sequence[str]) -> list[str]:
    return [column for column in columns if column not in some]


def _print_below(console: "Console", rows: Sequence[Mapping[str, Any]], columns: Sequence[str], title: str) -> None:
    """Print rows one below the other, a line for each column."""
    label_width = max(len(column) for column in columns)
    if title:
        console.print(title)
    for row in rows:
        for column in columns:
            console.print(f"{column:>{label_width}}  {shown(row[column])}", soft_wrap=True)
        console.print()


def _groups(columns: Sequence[str], fits: Callable[[Sequence[str]], bool]) -> list[Sequence[str]]:
    """The columns in groups that fit, each led by the one that names the rows; none where a column cannot fit."""
    if fits(columns):
        return [columns]
    leading = "name" if "name" in columns else columns[0]
    groups = [[leading]]
    for column in columns:
        if column == leading:
            continue
        if fits([*groups[-1], column]):
            groups[-1].append(column)
        elif fits([leading, column]):
            groups.append([leading, column])
        else:
            return []
    return [*groups]


def _brief(column: str, value: object) -> object:
    """A value with its ids cut to beginnings that are still unique, and that queries take as parameters."""
    if isinstance(value, str):
        return value[:_BRIEF_ID] if column.endswith("_id") else value
    if isinstance(value, list | tuple):
        return [_brief(column, item) for item in value]
    if isinstance(value, dict):
        return {name: _brief(name, item) for name, item in value.items()}
    return value


def _table(
    rows: Sequence[Mapping[str, Any]], columns: Sequence[str], title: str, wrapped: Sequence[str] = ()
) -> "TableOnScreen":
    from rich import box  # noqa: PLC0415
    from rich.cells import cell_len  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    table = Table(
        box=box.SIMPLE_HEAD,
        title=Text(title) if title else None,
        title_justify="left",
        pad_edge=False,
        collapse_padding=True,
    )
    columns_of_cells: list[list[str]] = []
    for column in columns:
        numeric = all(isinstance(row[column], int | float | Decimal | None) for row in rows)
        justify: JustifyMethod = "right" if numeric and rows else "left"
        cells = [shown(row[column]) for row in rows]
        width = max(map(cell_len, [column, *cells]))  # given, it is not measured cell by cell
        if column in wrapped:
            least = min(_LEAST_WRAPPED, max(map(len, cells)))
            table.add_column(Text(column), justify=justify, min_width=least)
        else:
            table.add_column(Text(column), justify=justify, no_wrap=True, width=width)
        columns_of_cells.append(cells)
    for texts in zip(*columns_of_cells, strict=True):
        table.add_row(*map(Text, texts))
    return table


def shown(value: object) -> str:
    """A value as text for a terminal; a recording's own text cannot break its line or send control sequences."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float | Decimal):
        return f"{float(value):.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(shown(item) for item in value) if value else "-"
    if isinstance(value, dict):
        return ", ".join(f"{shown(name)} {shown(item)}" for name, item in value.items())
    return one_line(str(value))


def say(text: str) -> None:
    """One remark on stderr, on one line."""
    tell(text, Level.REMARK)


def answer(text: object) -> None:
    """One line of an answer on stdout."""
    click.echo(one_line(named(str(text))))


Advanced = Callable[[object, str, int], None]
"""Called with an item, what is done with it, and how many of its frames are; with none yet it is a remark."""
Finished = Callable[..., None]
"""Called when an item is finished, with remarks on it, each a line, and with the item as `of` where it has a size."""


class _Pace:
    """How far some items are, by their bytes where these are known, and how long the others will take.

    Of an item that is not finished the bytes are guessed from its frames, by those of the finished ones.
    """

    def __init__(self, total: int, sizes: Mapping[Any, int]) -> None:
        self.total, self.ended = total, 0
        self._sizes, self._began = sizes, monotonic()
        self._frames: dict[object, int] = {}
        self._left = set(sizes)

    @property
    def frames(self) -> int:
        """Frames of all items so far."""
        return sum(self._frames.values())

    def advance(self, item: object, frames: int) -> None:
        """So many frames of an item are done."""
        self._frames[item] = frames

    def finish(self, item: object) -> None:
        """An item is finished."""
        self.ended += 1
        self._left.discard(item)

    def fields(self) -> dict[str, object]:
        """What a line of JSON has: numbers of items and frames, and where it is known the share and the time left."""
        counted: dict[str, object] = {"done": self.ended, "of": self.total, "frames": self.frames}
        share, left_s = self._share_and_time()
        return counted if share is None else {**counted, "share": round(share, 4), "left_s": round(left_s)}

    def __str__(self) -> str:
        share, left_s = self._share_and_time()
        counted = f"{self.ended} of {self.total} done, {self.frames} frames"
        if share is None:
            return counted
        return f"{counted}, {100 * share:.0f} % of {_bytes(sum(self._sizes.values()))}, about {_time(left_s)} left"

    def _share_and_time(self) -> tuple[float | None, float]:
        every = sum(self._sizes.values())
        new = [item for item in self._sizes if item not in self._left and self._frames.get(item)]
        done: float = sum(self._sizes[item] for item in new)
        if not done:
            return None, 0.0
        a_frame = done / sum(self._frames[item] for item in new)
        done += sum(min(self._sizes[item], a_frame * self._frames.get(item, 0)) for item in self._left)
        total = sum(size for item, size in self._sizes.items() if item not in self._left and item not in new)
        return (total + done) / every, (monotonic() - self._began) * (every - total - done) / done


def _bytes(count: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def _time(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


@contextmanager
def progress(
    total: int, doing: str, sizes: Mapping[Any, int] = MappingProxyType({})
) -> Iterator[tuple[Advanced, Finished]]:
    """Show how far a number of recordings are; `sizes` are their bytes, where these say how long each takes.

    A terminal gets a bar; anything else the remarks only, and now and then a line that counts. As JSON each is a line.
    """
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn  # noqa: PLC0415

    console = Console(stderr=True, highlight=False, markup=False, emoji=False)
    columns = (TextColumn(doing), BarColumn(), TextColumn("{task.fields[pace]}"), TimeElapsedColumn())
    bars = console.is_terminal and not is_json()

    def remark(text: str, level: Level = Level.REMARK, **more: object) -> None:
        if is_json():
            tell(text, level, **more)
        else:
            console.print(shown(text), soft_wrap=True)

    pace, counted_at = _Pace(total, sizes), monotonic()
    with Progress(*columns, console=console, transient=True, disable=not bars) as bar:
        task = bar.add_task(doing, total=total, pace=pace)

        def advanced(item: object, message: str, done: int) -> None:
            nonlocal counted_at
            if done == 0:
                remark(f"{item}: {message}", item=str(item))
            pace.advance(item, done)
            bar.update(task)
            if not bars and monotonic() - counted_at >= _COUNT_EACH_S:
                counted_at = monotonic()
                remark(f"{doing}: {pace}", Level.PROGRESS, **pace.fields())

        def finished(*remarks: str, of: object = None) -> None:
            pace.finish(of)
            bar.advance(task)
            for text in remarks:
                remark(text)
            if is_json():
                tell(f"{doing}: {pace.ended} of {total} done", Level.PROGRESS, **pace.fields())

        yield advanced, finished
