"""The settings that functions of `import auditor` take as keywords: for type checkers, signatures and docstrings."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, Field
from decimal import Decimal
from inspect import Parameter, Signature, cleandoc, signature
from pathlib import Path
from textwrap import fill
from typing import Any, TypedDict, TypeVar

from auditor.identification.thresholds import parse_r
from auditor.measurement.disparity.matchers import MatcherOptions
from auditor.model.pictures import CellRetention, Pictures
from auditor.model.settings import Criteria, Engine, MeasureSettings, about, made, settings_of
from auditor.model.verdict import Method, Statistic

Function = TypeVar("Function", bound=Callable[..., object])


class JudgingKeywords(TypedDict, total=False):
    """The fields of `Criteria` as keywords, for type checkers."""

    r: Decimal | float | str
    method: Method | str
    statistic: Statistic | str
    incidents_per_hour: float | None
    transfer: bool
    strict: bool
    recount: bool
    calibration: str | None
    min_coverage: float
    min_view: float
    no_sensors: Iterable[str]


class MeasuringKeywords(TypedDict, total=False):
    """The fields of `MeasureSettings` as keywords, for type checkers."""

    matcher: str
    weights: str | Path | None
    align_corners: bool | None
    max_disparity: int | None
    device: str
    precision: str
    compiled: bool
    rig: str | Path | None
    vehicle: str | None
    weather: str | None
    drive: str | None
    path_pattern: str | None
    time_limit: float | None
    memory_limit: float
    jobs: int | None
    pictures: Pictures | str
    cells: CellRetention | str
    shard: str | None
    engine: Engine | str
    address: str | None
    spool: str | Path | None
    spool_limit: float | None
    measure_again: bool
    verify_content: bool


class ScanKeywords(JudgingKeywords, MeasuringKeywords, total=False):
    """The settings of a scan as keywords, for type checkers."""


def explained(*kinds: type) -> Callable[[Function], Function]:
    """A decorator: the settings that a function takes as keywords stand in its signature and in its docstring."""

    def explain(function: Function) -> Function:
        own = [one for one in signature(function).parameters.values() if one.kind is not Parameter.VAR_KEYWORD]
        named = settings_of(*kinds).values()
        keywords = [
            Parameter(one.name, Parameter.KEYWORD_ONLY, default=_shown_default(one), annotation=one.type)
            for one in named
        ]
        answers = signature(function).return_annotation
        function.__signature__ = Signature([*own, *keywords], return_annotation=answers)  # type: ignore[attr-defined]
        texts = [f"{one.name}\n    {fill(about(one).help, 110, subsequent_indent='    ')}" for one in named]
        function.__doc__ = "\n".join(
            [cleandoc(function.__doc__ or ""), "", "Other Parameters", "----------------", *texts]
        )
        return function

    return explain


def _shown_default(setting: Field[Any]) -> object:
    """The default of a setting in a signature: None stands for one that depends on the machine."""
    return None if setting.default is MISSING else setting.default


def criteria(given: Mapping[str, object]) -> Criteria:
    """The criteria that have these values; r may be text, as 1%. Raises SettingError."""
    r = given.get("r")
    return made(Criteria, {**given, "r": None if r is None else parse_r(str(r))})


def measuring_of(network: MatcherOptions, given: Mapping[str, object]) -> MeasureSettings:
    """The settings that have these values; those of a network may come as one. Raises SettingError."""
    of_network = {name: value for name, value in vars(network).items() if name in settings_of(MeasureSettings)}
    return made(MeasureSettings, {**of_network, **given})
