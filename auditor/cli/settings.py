"""Settings that take the place of options: from the environment, and from a file that the user names or keeps.

An option is taken from the command line, else from the environment, else from the file, else it has its default. The
folder that a command runs in is not searched for a file: it may hold logs of strangers, and a file among them would
choose thresholds and stores (docs/settings.md).
"""

import os
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from auditor.cli.output import say
from auditor.errors import SettingError

FILE = "auditor.toml"
PREFIX = "AUDITOR"
EVERY_VERB = "defaults"
"""The table of the file whose settings hold for every verb that has such an option."""

_OF_THIS_RUN = frozenset({"clean", "yes", "sql", "file"})
"""Options that speak of one command line, and are no settings: that what it names is clean or may be removed; SQL."""

_STORE = "store"
_LONGEST = 1 << 16
_REMEDY = "docs/settings.md lists what may stand there"


def default_file() -> Path:
    """The file of the user that is read where none is named."""
    return Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "auditor" / FILE


def from_environment(command: click.Command, verbs: Sequence[str]) -> None:
    """Let the environment give the options of a verb: AUDITOR_VERB_OPTION goes before AUDITOR_OPTION."""
    for option in _options(command):
        own = [option.envvar] if isinstance(option.envvar, str) else [*(option.envvar or ())]
        option.envvar = [*dict.fromkeys([_variable(*verbs, option), _variable(option), *own])]
    for name, below in _below(command):
        from_environment(below, (*verbs, name))


def read_file(path: Path, group: click.Group, context: click.Context) -> dict[str, Any]:
    """The settings of a file, as click's default map. Raises SettingError for a file, key or value that is wrong."""
    tables = _parsed(path)
    shared = tables.pop(EVERY_VERB, {})
    if not isinstance(shared, dict):
        raise SettingError(f"{EVERY_VERB} is no table", where=path, remedy=f"write [{EVERY_VERB}]")
    commands = {name: group.get_command(context, name) for name in group.list_commands(context)}
    for name in tables:
        if name not in commands:
            raise SettingError(f"there is no verb {name!r}", where=path, remedy=_REMEDY)
    used = set[str]()
    values = {
        name: _of_command(path, name, command, tables.get(name, {}), shared, used)
        for name, command in commands.items()
        if command is not None
    }
    for key in shared:
        if key not in used:
            raise SettingError(f"no verb has an option {key!r}", where=f"{path} [{EVERY_VERB}]", remedy=_REMEDY)
    return values


def announced(command: click.Command) -> None:
    """Let a verb say which of its options are settings, on stderr and in the log of the store, before it runs.

    So nothing that a file or a variable says is done silently.
    """
    for _, below in _below(command):
        announced(below)
    run = command.callback
    if run is None or isinstance(command, click.Group) or hasattr(run, "__wrapped_by_settings__"):
        return

    @wraps(run)
    def said_first(*values: Any, **named: Any) -> Any:  # noqa: ANN401 - handed on
        context = click.get_current_context()
        sources = [*_taken(context)]
        if sources:
            say(f"settings: {', '.join(f'{words} ({where})' for words, where in sources)}")
            root = context.find_root()
            root.obj = [*(root.obj or ()), *(words for words, _ in sources)]
        return run(*values, **named)

    said_first.__wrapped_by_settings__ = True  # type: ignore[attr-defined]
    command.callback = said_first


def _taken(context: click.Context) -> Iterator[tuple[str, str]]:
    """The options of a verb that are settings, as they would be written on its command line, and where each is from."""
    for option in _options(context.command):
        source = context.get_parameter_source(str(option.name))
        if source is ParameterSource.ENVIRONMENT:
            where = next(name for name in option.envvar or () if os.environ.get(name))
            given: object = os.environ[where]
        elif source is ParameterSource.DEFAULT_MAP:
            where = str(context.find_root().params["config"] or default_file())
            given = context.lookup_default(str(option.name))
        else:
            continue
        yield f"{max(option.opts, key=len)}={given}", where


def _parsed(path: Path) -> dict[str, Any]:
    try:
        with path.open("rb") as file:
            content = file.read(_LONGEST + 1) if path.is_file() else None
    except OSError as error:
        raise SettingError(
            f"it cannot be read ({error.strerror})", where=path, remedy="name a file of settings"
        ) from error
    if content is None:
        raise SettingError("it is no file", where=path, remedy="name a file of settings")
    if len(content) > _LONGEST:
        raise SettingError(f"it is longer than {_LONGEST} bytes, which no settings are", where=path, remedy=_REMEDY)
    try:
        return tomllib.loads(content.decode())
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise SettingError(f"it is no TOML ({error})", where=path, remedy=_REMEDY) from error


def _of_command(
    path: Path, name: str, command: click.Command, given: object, shared: Mapping[str, Any], used: set[str]
) -> dict[str, Any]:
    """The settings of one verb, and of those below it, by the names of its parameters; `used` gets the shared keys."""
    if not isinstance(given, dict):
        raise SettingError(f"{name} is no table", where=path, remedy=f"write [{name}]")
    options = {_key(option): option for option in _options(command)}
    below = dict(_below(command))
    values: dict[str, Any] = {}
    for key, value in {**{key: shared[key] for key in options.keys() & shared.keys()}, **given}.items():
        if key in below:
            continue
        where = f"{path} [{name if key in given else EVERY_VERB}]"
        if key not in options:
            names = f"its options are {', '.join([*options, *below])}" if options or below else "it has no options"
            raise SettingError(f"{name} has no option {key!r}", where=where, remedy=names)
        values[str(options[key].name)] = _checked(options[key], value, where)
    used |= options.keys() & shared.keys()
    for key, inner in below.items():
        values[key] = _of_command(path, f"{name}.{key}", inner, given.get(key, {}), shared, used)
    return values


def _checked(option: click.Parameter, value: object, where: str) -> object:
    """A value as the option takes it. Raises SettingError where it is of another type or out of range."""
    listed = option.multiple or option.nargs != 1
    fits = isinstance(value, bool) if _is_flag(option) else _is_plain(value) or (listed and isinstance(value, list))
    if not fits:
        wanted = "true or false" if _is_flag(option) else "a list" if listed else "a text or a number"
        raise SettingError(f"{_key(option)} is {value!r}, not {wanted}", where=where, remedy=_REMEDY)
    try:
        option.type_cast_value(click.Context(click.Command("")), value if _is_flag(option) else _text(value))
    except click.BadParameter as error:
        raise SettingError(f"{_key(option)}: {error.message}", where=where) from error
    return value if _is_flag(option) else _text(value)


def _is_flag(option: click.Parameter) -> bool:
    return isinstance(option, click.Option) and option.is_flag


def _is_plain(value: object) -> bool:
    return isinstance(value, str | int | float) and not isinstance(value, bool)


def _text(value: object) -> object:
    """A value as it would be written on the command line."""
    return [str(one) for one in value] if isinstance(value, list) else str(value)


def _options(command: click.Command) -> Iterator[click.Parameter]:
    """The options of a verb that are settings: not those of one run, nor those that only print something and end.

    The store is one also where it is an argument that may be left out.
    """
    for parameter in command.params:
        if isinstance(parameter, click.Option):
            if not parameter.is_eager and _key(parameter) not in _OF_THIS_RUN:
                yield parameter
        elif parameter.name == _STORE and not parameter.required:
            yield parameter


def _below(command: click.Command) -> Iterator[tuple[str, click.Command]]:
    return iter(command.commands.items()) if isinstance(command, click.Group) else iter(())


def _key(option: click.Parameter) -> str:
    """The longest name of an option, as it is written in a file: time-limit, r."""
    return max((name.lstrip("-") for name in option.opts), key=len)


def _variable(*names: str | click.Parameter) -> str:
    words = [PREFIX, *(name if isinstance(name, str) else _key(name) for name in names)]
    return "_".join(words).replace("-", "_").upper()
