"""The settings of judging and of measuring. Each is declared once: a field with its type, unit, default and help text.

The options of the command line, the variables of the environment, the keys of the settings file, the keywords of
`import auditor` and the table in docs/settings.md are made from these fields.
"""

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from decimal import Decimal
from difflib import get_close_matches
from enum import StrEnum
from pathlib import Path
from types import NoneType
from typing import Any, TypeVar, get_args, get_origin

from auditor.errors import SettingError
from auditor.model.pictures import CellRetention, Pictures
from auditor.model.verdict import Method, Statistic

Settings = TypeVar("Settings", "Criteria", "MeasureSettings")

_SETTING = "setting"


@dataclass(frozen=True)
class Setting:
    """What a field of settings has beside its name, type and default.

    `flag` is the name of its option, where that is not the field's. `metavar` stands for its value in help texts.
    Numbers have a `unit`, and lie between `least` and `most`; `above_least` leaves `least` itself out. Texts are one
    of `choices`, where there are any. `default_in_words` stands in help texts for a default that is computed.
    """

    help: str
    flag: str | None = None
    metavar: str | None = None
    unit: str | None = None
    least: float | None = None
    most: float | None = None
    above_least: bool = False
    choices: tuple[str, ...] = ()
    default_in_words: str | None = None


def _about(text: str, **more: Any) -> dict[str, Setting]:  # noqa: ANN401 - parts of a Setting
    """The metadata of a field with this help text."""
    return {_SETTING: Setting(text, **more)}


def _cores() -> int:
    return len(os.sched_getaffinity(0))


# Judging


@dataclass(frozen=True)
class Criteria:
    """How verdicts are to be reached, and from when on a recording counts as fully audited.

    Raises SettingError for what the paper's method does not have.
    """

    r: Decimal = field(
        default=Decimal("0.01"),
        metadata=_about(
            "Designated false-alarm rate, as 0.01 or 1%: of a frame, or with --method paper of each E.",
            unit="share",
            least=0,
            most=1,
        ),
    )
    method: Method = field(
        default=Method.ROBUST,
        metadata=_about("Checks of each sensor and joint identification, or disparity errors and Algorithm 2."),
    )
    statistic: Statistic = field(
        default=Statistic.GATED,
        metadata=_about(
            "With --method paper: count pixels with texture only, or all (the paper's E).",
            choices=(Statistic.GATED, Statistic.PLAIN),
        ),
    )
    incidents_per_hour: float | None = field(
        default=None,
        metadata=_about(
            "With --method robust: false incidents an hour to aim at on clean drives.  [default: 1]",
            metavar="NUMBER",
            unit="1/h",
            least=0,
        ),
    )
    transfer: bool = field(
        default=False, metadata=_about("Accept thresholds of another rig kind; the verdicts will say so.")
    )
    strict: bool = field(
        default=False,
        metadata=_about(
            "Refuse thresholds that are the prior alone and r < 0.0001; with --method paper r < 1/N, which N clean "
            "samples cannot resolve."
        ),
    )
    recount: bool = field(
        default=False, metadata=_about("Compute statistics again from the stored cells, in today's windows.")
    )
    calibration: str | None = field(
        default=None,
        metadata=_about(
            "Thresholds to judge by.  [default: the one in force that fits, or the prior]", metavar="ID|FILE"
        ),
    )
    min_coverage: float = field(
        default=0.99,
        metadata=_about(
            "Share of frames, messages and time below which a recording counts as not fully audited.",
            unit="share",
            least=0,
            most=1,
        ),
    )
    min_view: float = field(
        default=0.5,
        metadata=_about(
            "Share of a camera's picture that other cameras are compared with, below which it was not looked at: a "
            "recording then counts as not fully audited.",
            unit="share",
            least=0,
            most=1,
        ),
    )
    no_sensors: tuple[str, ...] = field(
        default=(),
        metadata=_about(
            "A topic that is neither camera nor LiDAR, though it cannot be read: a recording counts as fully audited "
            "without it, and says so. May be repeated.",
            flag="no-sensor",
            metavar="TOPIC",
        ),
    )

    def __post_init__(self) -> None:
        if self.method is Method.ROBUST:
            return
        remedy = "leave it away, or judge with --method robust"
        if self.incidents_per_hour is not None:
            reason = "the paper's method has no limit that incidents per hour could set"
            raise SettingError(reason, where="--incidents-per-hour", remedy=remedy)
        if self.recount:
            reason = "the paper's method has no statistics that come from cells"
            raise SettingError(reason, where="--recount", remedy=remedy)


# Measuring


class Engine(StrEnum):
    """What measures many recordings."""

    PROCESSES = "processes"
    RAY = "ray"


@dataclass(frozen=True)
class MeasureSettings:
    """How recordings are measured: `jobs` at a time, each in a process of its own within its limits."""

    matcher: str = field(
        default="sgbm",
        metadata=_about("Stereo matcher: sgbm (half resolution), sgbm-full, psmnet, or onnx:FILE."),
    )
    weights: Path | None = field(
        default=None, metadata=_about("Checkpoint of psmnet; without it the weights that come with auditor.")
    )
    align_corners: bool | None = field(
        default=None,
        metadata=_about("Upsampling convention that psmnet's weights were trained with; needed where they do not say."),
    )
    max_disparity: int | None = field(
        default=None, metadata=_about("Largest disparity that psmnet finds.", unit="px", least=16)
    )
    device: str = field(default="cpu", metadata=_about("Where a network runs: cpu, cuda or cuda:1."))
    precision: str = field(
        default="fp32", metadata=_about("Arithmetic of psmnet on a GPU.", choices=("fp32", "tf32", "fp16", "bf16"))
    )
    compiled: bool = field(
        default=False,
        metadata=_about("Compile psmnet for the GPU first: about a minute, for long recordings.", flag="compile"),
    )
    rig: Path | None = field(
        default=None,
        metadata=_about("A rig.toml, or a calibration by Kalibr, ROS or Autoware, in place of the recording's own."),
    )
    vehicle: str | None = field(default=None, metadata=_about("Name of the vehicle that made these recordings."))
    weather: str | None = field(
        default=None, metadata=_about("Weather that they were made in, in your own words: rain, snow, fog.")
    )
    drive: str | None = field(
        default=None,
        metadata=_about(
            "Name of the drive that these recordings are parts of.  [default: those that follow each other]"
        ),
    )
    path_pattern: str | None = field(
        default=None,
        metadata=_about("What the paths say, such as '{vehicle}/{date}/{drive}_*.mcap'.", metavar="PATTERN"),
    )
    time_limit: float | None = field(
        default=None,
        metadata=_about(
            "Time that one recording may take.  [default: any, while it makes progress: within ten minutes, and 0.1 s "
            "a MB of it]",
            metavar="SECONDS",
            unit="s",
            least=0,
            above_least=True,
        ),
    )
    memory_limit: float = field(
        default=4096,
        metadata=_about(
            "Memory that one recording may take before it is given up.",
            metavar="MB",
            unit="MB",
            least=0,
            above_least=True,
        ),
    )
    jobs: int = field(
        default_factory=_cores,
        metadata=_about(
            "Recordings that are worked on at the same time.", least=1, default_in_words="the number of cores"
        ),
    )
    pictures: Pictures = field(
        default=Pictures.ALL,
        metadata=_about(
            "Frames whose pictures the store keeps: none, those that may belong to an incident (a statistic is "
            "unusually large), or all; of these the strongest of each second, one in five seconds where nothing is "
            "unusual, at most 60 a recording, small and grey. "
            "But for none, each incident gets those that show it besides: all cameras at full resolution, and the "
            "cloud."
        ),
    )
    cells: CellRetention = field(
        default=CellRetention.INCIDENTS,
        metadata=_about(
            "Frames whose cells the store keeps: those that may belong to an incident (a statistic is unusually large) "
            "and one in five seconds, or all, which then are most of what it holds. Verdicts are the same; what lacks "
            "cells cannot be judged with --recount."
        ),
    )
    shard: str | None = field(
        default=None,
        metadata=_about(
            "Only the recordings of this shard of several, 0/8 to 7/8: so many processes, on any machines, share the "
            "work without knowing of each other. They measure only: the same command without it judges, once.",
            metavar="I/N",
        ),
    )
    engine: Engine = field(
        default=Engine.PROCESSES,
        metadata=_about(
            "What measures: processes of this machine, as many as --jobs, or tasks of a cluster of Ray, whose machines "
            "see the same recordings and the same store.",
        ),
    )
    address: str | None = field(
        default=None,
        metadata=_about(
            "With --engine ray: the cluster's address, or auto for the one that runs here.  [default: RAY_ADDRESS, or "
            "one is started for this command]",
            metavar="HOST:PORT",
        ),
    )
    spool: Path | None = field(
        default=None,
        metadata=_about(
            "Folder for copies of recordings on object stores, each for as long as it is read.  [default: where "
            "temporary files are]"
        ),
    )
    spool_limit: float | None = field(
        default=None,
        metadata=_about(
            "Room that these copies may take together.  [default: half of what is free]",
            metavar="MB",
            unit="MB",
            least=0,
            above_least=True,
        ),
    )
    measure_again: bool = field(
        default=False,
        metadata=_about("Measure also what the store has; the earlier measurement goes, with its judgements."),
    )
    verify_content: bool = field(
        default=False,
        metadata=_about("Read also files whose path, size, times and inode are those of when the store read them."),
    )


# What is made from them


def settings_of(*kinds: type) -> dict[str, Field[Any]]:
    """The fields of some settings by their names."""
    return {one.name: one for kind in kinds for one in fields(kind)}


def about(setting: Field[Any]) -> Setting:
    """What a field of settings has beside its name, type and default."""
    declared: Setting = setting.metadata[_SETTING]
    return declared


def value_type(setting: Field[Any]) -> type:
    """The type of a field's values: of `Path | None` it is Path, of `tuple[str, ...]` tuple."""
    if get_origin(setting.type) is tuple:
        return tuple
    [kind] = [one for one in get_args(setting.type) or (setting.type,) if one is not NoneType]
    assert isinstance(kind, type), "settings are annotated with classes"
    return kind


def choices(setting: Field[Any]) -> tuple[str, ...]:
    """The texts that a field takes; none where it takes any."""
    kind = value_type(setting)
    return about(setting).choices or (tuple(kind) if issubclass(kind, StrEnum) else ())


def default(setting: Field[Any]) -> Any:  # noqa: ANN401 - of any type
    """The default of a field, computed where it depends on the machine."""
    return setting.default_factory() if setting.default_factory is not MISSING else setting.default


def made(kind: type[Settings], given: Mapping[str, object]) -> Settings:
    """The settings that have these values; None stands for a default.

    Raises SettingError for a name that is no setting, and for a value that a setting does not take.
    """
    by_name = settings_of(kind)
    for name in given.keys() - by_name.keys():
        raise unknown_setting(name, by_name)
    values: dict[str, Any] = {
        name: _converted(by_name[name], value) for name, value in given.items() if value is not None
    }
    return kind(**values)


def unknown_setting(name: str, names: Iterable[str]) -> SettingError:
    """The error for a name that is no setting, with the nearest one."""
    nearest = get_close_matches(name, names, 1)
    remedy = f"did you mean {nearest[0]!r}?" if nearest else f"use some of: {', '.join(names)}"
    return SettingError(f"there is no setting {name!r}", where="settings", remedy=remedy)


def _converted(setting: Field[Any], value: object) -> object:
    """A value as the type of its field."""
    kind, taken = value_type(setting), choices(setting)
    if taken and value not in taken:
        raise SettingError(
            f"there is no {setting.name} {value!r}", where="settings", remedy=f"use one of: {', '.join(taken)}"
        )
    if kind in (int, float, Decimal):
        _refuse_out_of_range(setting, value)
    converts = kind in (float, Path, tuple) or issubclass(kind, StrEnum)
    converted: object = kind(value) if converts else value
    return converted


def _refuse_out_of_range(setting: Field[Any], number: Any) -> None:  # noqa: ANN401 - of any type of number
    """Raises SettingError for a number that is none, or out of the range of its setting."""
    limits = about(setting)
    least = -math.inf if limits.least is None else limits.least
    most = math.inf if limits.most is None else limits.most
    if not (math.isfinite(number) and least <= number <= most) or (limits.above_least and number == least):
        raise SettingError(
            f"{setting.name} cannot be {number!r}", where="settings", remedy="auditor scan --help says what it may be"
        )
