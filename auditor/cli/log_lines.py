"""What a command says besides its answer, on stderr: as text for people, or as JSON, one object a line."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from enum import StrEnum

import click

from auditor.model.text import one_line

FORMATS = ("text", "json")


class Level(StrEnum):
    """What a line is: how far a command is, a remark on what it does, or why it ended."""

    PROGRESS = "progress"
    REMARK = "remark"
    ERROR = "error"


class _Form:
    """How lines are written, for this process."""

    as_json = False
    verb: str | None = None
    shown_as: tuple[tuple[str, str], ...] = ()


@contextmanager
def show_as(folder: str, name: str) -> Iterator[None]:
    """Show the paths in a folder under another name inside the block, and in the error that ends it."""
    _Form.shown_as = ((folder, name),)
    yield


def named(text: str) -> str:
    """A text with the names that folders are shown under."""
    for folder, name in _Form.shown_as:
        text = text.replace(folder, name)
    return text


def write_as(form: str) -> None:
    """Write lines in one of FORMATS from now on."""
    _Form.as_json = form == "json"
    _Form.verb = None
    _Form.shown_as = ()


def is_json() -> bool:
    """Whether lines are JSON."""
    return _Form.as_json


def tell(text: str, level: Level, **more: object) -> None:
    """Write one line; `more` stands in JSON only."""
    text = named(text)
    if not _Form.as_json:
        click.echo(one_line(text), err=True)
        return
    _Form.verb = _verb() or _Form.verb  # an error is written when its verb has ended
    line = {
        "at": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "level": level.value,
        "verb": _Form.verb,
        "message": one_line(text),
        **more,
    }
    click.echo(json.dumps(line, default=str), err=True)


def _verb() -> str:
    """The verb that runs, with the one below it: calibration list."""
    words: list[str] = []
    context = click.get_current_context(silent=True)
    while context is not None and context.parent is not None:
        words.insert(0, str(context.info_name))
        context = context.parent
    return " ".join(words)
