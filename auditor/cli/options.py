"""Options of the verbs that read recordings or a store, and the types of their values.

Those that are settings are made from the fields of these.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import Field
from decimal import Decimal
from enum import StrEnum
from functools import wraps
from math import isfinite
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from auditor.model.settings import Criteria, MeasureSettings, about, choices, default, made, settings_of, value_type


class FiniteRange(click.FloatRange):
    """A number within limits; "nan" and "inf", which Python reads as numbers, are refused."""

    def convert(self, value: float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number. Fails as click does."""
        number = super().convert(value, param, ctx)
        if not isfinite(number):
            self.fail(f"{value!r} is not a number: write one such as 0.5", param, ctx)
        return float(number)


class LocalPath(click.Path):
    """A path on this computer; an address such as s3://bucket is refused, which would make a folder of that name."""

    def __init__(self, *, exists: bool = False, dir_okay: bool = True) -> None:
        # one that cannot be read is an error of its own where it is opened: the other recordings of a verb go on
        super().__init__(exists=exists, dir_okay=dir_okay, readable=exists, path_type=Path)

    def convert(
        self, value: str | PathLike[str], param: click.Parameter | None, ctx: click.Context | None
    ) -> str | bytes | PathLike[str]:
        """The path. Fails as click does."""
        from auditor.errors import SettingError  # noqa: PLC0415 - keeps --help quick
        from auditor.resources import local_path  # noqa: PLC0415

        try:
            local_path(str(value))
        except SettingError as error:
            self.fail(f"{value}: {error.what}; {error.remedy}", param, ctx)
        return super().convert(value, param, ctx)


PATH = LocalPath()
"""A file or folder of this computer, as a Path."""


class RecordingPlace(LocalPath):
    """A path on this computer, or the address of objects, such as s3://bucket/fleet/**/*.mcap."""

    def convert(
        self,
        value: Any,  # noqa: ANN401 - click's signature
        param: click.Parameter | None,
        ctx: click.Context | None,
    ) -> Any:  # noqa: ANN401 - a Path or an Address
        """The path or address. Fails as click does."""
        from auditor.errors import SettingError  # noqa: PLC0415 - keeps --help quick
        from auditor.pipeline.remote.addresses import Address, address_of  # noqa: PLC0415

        if isinstance(value, Address):
            return value
        try:
            return address_of(value) or super().convert(value, param, ctx)
        except SettingError as error:
            self.fail(f"{error.where}: {error.what}; {error.remedy}", param, ctx)


PLACE = RecordingPlace()
"""Where recordings lie, as a Path or an Address."""


class _Rate(click.ParamType[Decimal]):
    name = "rate"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> Decimal:
        from auditor.errors import SettingError  # noqa: PLC0415 - keeps --help quick
        from auditor.identification.thresholds import parse_r  # noqa: PLC0415

        try:
            return value if isinstance(value, Decimal) else parse_r(str(value))
        except SettingError as error:
            self.fail(f"{error.what}; {error.remedy}", param, ctx)


RATE = _Rate()
"""A designated false-alarm rate r, as a Decimal in [0, 1]."""


class _Sensor(click.ParamType[int]):
    name = "S_k"

    def convert(self, value: object, param: click.Parameter | None, ctx: click.Context | None) -> int:
        match = re.fullmatch(r"(?:S_?)?(\d+)", str(value), re.IGNORECASE)
        if not match:
            self.fail(f"{value!r} is not a sensor: write S_0 for the LiDAR, S_1 for the rightmost camera", param, ctx)
        return int(match[1])


SENSOR = _Sensor()
"""A sensor by its number, as S_2 or 2."""


if TYPE_CHECKING:
    from auditor.pipeline.remote.addresses import Address
    from auditor.pipeline.workers import LimitsOf

Command = Callable[..., Any]

DEFAULT_STORE = Path("audit")

_SETTINGS = settings_of(Criteria, MeasureSettings)

JUDGING = (
    *("method", "r", "incidents_per_hour", "statistic", "calibration", "transfer", "strict"),
    *("min_coverage", "min_view", "no_sensors"),
)
"""What scans and judges are told of judging, in the order of their help."""

BUDGET = ("time_limit", "memory_limit")
MATCHER = ("matcher", "weights", "align_corners", "max_disparity", "device", "precision", "compiled")
MEASURING = (
    *(*MATCHER, "rig", "vehicle", "weather", "drive", "path_pattern", *BUDGET),
    *("jobs", "pictures", "cells", "measure_again", "verify_content", "spool", "spool_limit"),
)


# The store and the recordings


def own_store(context: click.Context, store: "Path | Address") -> "Path | Address":
    """A store that nobody named must have been made here: one in a folder of logs may have been planted there."""
    if not isinstance(store, Path):
        return store
    if context.get_parameter_source("store") is ParameterSource.DEFAULT and store.exists():
        from auditor.store.folder import MARKER, refuse_foreign  # noqa: PLC0415 - keeps --help quick

        if (store / MARKER).exists():
            refuse_foreign(store)
    return store


@contextmanager
def as_folder(store: "Path | Address") -> Iterator[Path]:
    """A store as a folder inside the block: one on an object store is mirrored, and what is written is put back."""
    if isinstance(store, Path):
        yield store
        return
    from auditor.cli.log_lines import show_as  # noqa: PLC0415 - keeps --help quick
    from auditor.pipeline.remote.mirror import mirrored  # noqa: PLC0415

    with mirrored(store) as folder, show_as(str(folder), str(store)):
        yield folder


def _store(
    callback: "Callable[[click.Context, click.Parameter, Any], Any] | None", kind: "click.ParamType[Any]" = PLACE
) -> Callable[[Command], Command]:
    where = "A folder, or an address such as s3://bucket/audit." if kind is PLACE else "A folder."
    return click.option(
        "--store",
        type=kind,
        default=DEFAULT_STORE,
        callback=callback,
        show_default=True,
        help=f"The store: measurements, thresholds, verdicts. {where}",
    )


def store_option(command: Command) -> Command:
    """The store as --store; the command gets `store`, a folder."""

    @wraps(command)
    def run(*, store: "Path | Address", **others: Any) -> Any:  # noqa: ANN401 - handed on
        with as_folder(store) as folder:
            return command(store=folder, **others)

    return _store(lambda context, _, store: own_store(context, store))(run)


recordings_argument = click.argument("recordings", nargs=-1, required=True, metavar="RECORDING...", type=PLACE)
"""Recordings on this computer or on object stores."""


def store_argument_or_option(kind: "click.ParamType[Any]" = PLACE, *, own: bool = True) -> Callable[[Command], Command]:
    """The store as an argument, or as --store; the command gets `store`, a folder.

    Where nobody named it, it must be our `own`, but for what only looks whether it is whole.
    """

    def decorated(command: Command) -> Command:
        @wraps(command)
        def run(*, place: "Path | Address | None", store: "Path | Address", **others: Any) -> Any:  # noqa: ANN401
            context = click.get_current_context()
            if place is not None and context.get_parameter_source("store") is ParameterSource.COMMANDLINE:
                raise click.UsageError("name the store once, with --store")
            taken = place if place is not None else own_store(context, store) if own else store
            with as_folder(taken) as folder:
                return command(store=folder, **others)

        return click.argument("place", metavar="[STORE]", required=False, type=kind)(_store(None, kind)(run))

    return decorated


# Settings


def setting(name: str, text: str | None = None) -> Callable[[Command], Command]:
    """The option of a setting; `text` takes the place of its help."""
    field = _SETTINGS[name]
    shown = about(field)
    flag = shown.flag or name.replace("_", "-")
    dashed = f"-{flag}" if len(flag) == 1 else f"--{flag}"
    return click.option(
        f"{dashed}/--no-{flag}" if _may_be_off(field) else dashed, name, help=text or shown.help, **_kind(field)
    )


def _kind(field: Field[Any]) -> dict[str, Any]:
    """What click is told of the values of a setting, and of its default."""
    kind, shown = value_type(field), about(field)
    if kind is bool:
        return {"default": None} if _may_be_off(field) else {"is_flag": True}
    if kind is tuple:
        return {"multiple": True, "metavar": shown.metavar}
    taken = {"type": _type(field), "metavar": shown.metavar}
    if shown.default_in_words is not None:
        return {**taken, "default": lambda: default(field), "show_default": shown.default_in_words}
    if field.default is None:
        return taken
    in_text = field.default.value if isinstance(field.default, StrEnum) else field.default
    return {**taken, "default": in_text, "show_default": True}


def _type(field: Field[Any]) -> click.ParamType[Any]:
    """The type of an option that has a value."""
    kind, shown = value_type(field), about(field)
    if kind is float:
        return FiniteRange(shown.least, shown.most, min_open=shown.above_least)
    if kind is int:
        return click.IntRange(min=None if shown.least is None else int(shown.least))
    if texts := choices(field):
        return click.Choice([str(text) for text in texts])
    return {Decimal: RATE, Path: PATH}.get(kind, click.STRING)


def _may_be_off(field: Field[Any]) -> bool:
    """Whether a setting is yes, no, or not given."""
    return value_type(field) is bool and field.default is None


def _gathered(
    names: Sequence[str], into: str, make: Callable[[Mapping[str, Any]], object]
) -> Callable[[Command], Command]:
    """The options of some settings; the command gets what is made of them."""

    def decorated(command: Command) -> Command:
        @wraps(command)
        def run(**values: Any) -> Any:  # noqa: ANN401 - whatever the command returns
            own = {name: values.pop(name) for name in names}
            return command(**{into: make(own)}, **values)

        optioned: Command = run
        for name in reversed(names):
            optioned = setting(name)(optioned)
        return optioned

    return decorated


def judging_options(*names: str) -> Callable[[Command], Command]:
    """How verdicts are reached; the command gets `judging`, Criteria."""
    return _gathered(names, "judging", lambda given: made(Criteria, given))


def measuring_options(*names: str) -> Callable[[Command], Command]:
    """How recordings are measured; the command gets `measuring`, MeasureSettings."""
    return _gathered(names, "measuring", lambda given: made(MeasureSettings, given))


budget_options = _gathered(BUDGET, "limits", lambda given: _limits(**given))
"""What one recording may take; the command gets `limits`, a function from a path, or None, to its Limits."""


def _limits(time_limit: float | None, memory_limit: float) -> "LimitsOf":
    from auditor.pipeline.many import limits_by_size  # noqa: PLC0415 - keeps --help quick

    return limits_by_size(time_limit, memory_limit)
