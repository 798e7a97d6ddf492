"""Options that several verbs share."""

import os
import re
from collections.abc import Callable
from decimal import Decimal
from functools import wraps
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from auditor.model.pictures import Pictures

if TYPE_CHECKING:
    from auditor.measurement.disparity.matchers import MatcherOptions
    from auditor.pipeline.many import LimitsOf
    from auditor.recordings import Origin

Decorated = TypeVar("Decorated", bound=Callable[..., Any])

DEFAULT_STORE = Path("audit")


class FiniteRange(click.FloatRange):
    """A number within limits; "nan" and "inf", which Python reads as numbers, are refused."""

    def convert(self, value: float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """The number. Fails as click does."""
        number = super().convert(value, param, ctx)
        if not isfinite(number):
            self.fail(f"{value!r} is not a number: write one such as 0.5", param, ctx)
        return float(number)


store_option = click.option(
    "--store",
    type=click.Path(path_type=Path),
    default=DEFAULT_STORE,
    show_default=True,
    help="Folder of the store: measurements, thresholds, verdicts.",
)
recordings_argument = click.argument(
    "recordings", nargs=-1, required=True, metavar="RECORDING...", type=click.Path(path_type=Path)
)
rig_option = click.option(
    "--rig",
    type=click.Path(path_type=Path),
    help="A rig.toml, or Kalibr's camchain.yaml, in place of the recording's own calibration.",
)
jobs_option = click.option(
    "--jobs",
    type=click.IntRange(min=1),
    default=lambda: len(os.sched_getaffinity(0)),
    show_default="the number of cores",
    help="Recordings measured at the same time.",
)


again_option = click.option(
    "--measure-again",
    is_flag=True,
    help="Measure also what the store has; the earlier measurement goes, with its judgements.",
)


policy_option = click.option(
    "--policy",
    type=click.Path(path_type=Path),
    help="A policy.toml: which incidents fail, which are suppressed until when, and a baseline to compare with.",
)


content_option = click.option(
    "--verify-content",
    is_flag=True,
    help="Read also files whose path, size, times and inode are those of when the store read them.",
)


pictures_option = click.option(
    "--pictures",
    type=click.Choice([one.value for one in Pictures]),
    default=Pictures.ALL.value,
    show_default=True,
    help="Frames whose pictures the store keeps: none, those that may belong to an incident (a statistic is unusually "
    "large), or all; of these the strongest of each second, at most 60 a recording, small and grey. But for none, each "
    "incident gets those that show it besides: all cameras at full resolution, and the cloud.",
)


matcher_option = click.option(
    "--matcher",
    default="sgbm",
    show_default=True,
    help="Stereo matcher: sgbm (half resolution), sgbm-full, psmnet, onnx:FILE or torchscript:FILE.",
)


def origin_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Where recordings come from; the command gets `origin_of`, a function from a path to its Origin."""

    @wraps(command)
    def collected(
        *,
        vehicle: str | None,
        drive: str | None,
        weather: str | None,
        path_pattern: str | None,
        **others: Any,  # noqa: ANN401 - handed on
    ) -> Any:  # noqa: ANN401 - whatever the command returns
        from auditor.recordings import Origin  # noqa: PLC0415 - keeps --help quick

        def origin_of(path: Path) -> Origin:
            given = Origin(vehicle, drive=drive, weather=weather)
            return given.over(Origin.of_path(path, path_pattern)) if path_pattern else given

        return command(origin_of=origin_of, **others)

    for option in (
        click.option(
            "--path-pattern",
            metavar="PATTERN",
            help="What the paths say, such as '{vehicle}/{date}/{drive}_*.mcap'.",
        ),
        click.option(
            "--drive",
            help="Name of the drive that these recordings are parts of.  [default: those that follow each other]",
        ),
        click.option("--weather", help="Weather that they were made in, in your own words: rain, snow, fog."),
        click.option("--vehicle", help="Name of the vehicle that made these recordings."),
    ):
        collected = option(collected)
    return collected


def budget_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """What one recording may take; the command gets `limits`, a function from a path, or None, to its Limits."""

    @wraps(command)
    def collected(*, time_limit: float | None, memory_limit: float, **others: Any) -> Any:  # noqa: ANN401
        from auditor.pipeline.many import limits_by_size  # noqa: PLC0415 - keeps --help quick

        return command(limits=limits_by_size(time_limit, memory_limit), **others)

    for option in (
        click.option(
            "--memory-limit",
            type=FiniteRange(min=0, min_open=True),
            default=4096,
            show_default=True,
            metavar="MB",
            help="Memory that one recording may take before it is given up.",
        ),
        click.option(
            "--time-limit",
            type=FiniteRange(min=0, min_open=True),
            metavar="SECONDS",
            help="Time that one recording may take.  [default: any, while it makes progress: within ten minutes, and "
            "0.1 s a MB of it]",
        ),
    ):
        collected = option(collected)
    return collected


def matcher_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The stereo matcher and what networks need; the command gets `matcher` and `network`, a MatcherOptions."""

    @wraps(command)
    def collected(
        *,
        weights: Path | None,
        align_corners: bool | None,
        max_disparity: int | None,
        device: str,
        precision: str,
        compiled: bool,
        **others: Any,  # noqa: ANN401 - handed on
    ) -> Any:  # noqa: ANN401 - whatever the command returns
        from auditor.measurement.disparity.matchers import MatcherOptions  # noqa: PLC0415 - keeps --help quick

        network = MatcherOptions(weights, align_corners, max_disparity, device, precision, compiled)
        return command(network=network, **others)

    for option in (
        click.option(
            "--compile",
            "compiled",
            is_flag=True,
            help="Compile psmnet for the GPU first: about a minute, for long recordings.",
        ),
        click.option(
            "--precision",
            type=click.Choice(["fp32", "tf32", "fp16", "bf16"]),
            default="fp32",
            show_default=True,
            help="Arithmetic of psmnet on a GPU.",
        ),
        click.option("--device", default="cpu", show_default=True, help="Where a network runs: cpu, cuda or cuda:1."),
        click.option("--max-disparity", type=click.IntRange(min=16), help="Largest disparity that psmnet finds."),
        click.option(
            "--align-corners/--no-align-corners",
            default=None,
            help="Upsampling convention that psmnet's weights were trained with; needed where they do not say.",
        ),
        click.option("--weights", type=click.Path(path_type=Path), help="Checkpoint of psmnet."),
        matcher_option,
    ):
        collected = option(collected)
    return collected


def measuring_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """How recordings are measured, side by side; the command gets `measuring`, a MeasureSettings."""

    @wraps(command)
    def collected(
        *,
        matcher: str,
        network: "MatcherOptions",
        rig: Path | None,
        origin_of: "Callable[[Path], Origin]",
        limits: "LimitsOf",
        jobs: int,
        measure_again: bool,
        verify_content: bool,
        pictures: str,
        **others: Any,  # noqa: ANN401 - handed on
    ) -> Any:  # noqa: ANN401 - whatever the command returns
        from auditor.pipeline.many import MeasureSettings  # noqa: PLC0415 - keeps --help quick

        settings = MeasureSettings(
            matcher,
            network,
            rig,
            origin_of,
            limits,
            jobs,
            again=measure_again,
            pictures=Pictures(pictures),
            verify_content=verify_content,
        )
        return command(measuring=settings, **others)

    own = jobs_option(pictures_option(again_option(content_option(collected))))
    return matcher_options(rig_option(origin_options(budget_options(own))))


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
        found = re.fullmatch(r"(?:S_?)?(\d+)", str(value), re.IGNORECASE)
        if not found:
            self.fail(f"{value!r} is not a sensor: write S_0 for the LiDAR, S_1 for the rightmost camera", param, ctx)
        return int(found[1])


SENSOR = _Sensor()
"""A sensor by its number, as S_2 or 2."""


method_option = click.option(
    "--method",
    type=click.Choice(["robust", "paper"]),
    default="robust",
    show_default=True,
    help="Ten checks and joint identification, or disparity errors and Algorithm 2.",
)


strict_option = click.option(
    "--strict",
    is_flag=True,
    help="Refuse thresholds that are the prior alone and r < 0.0001; with --method paper r < 1/N, which N clean "
    "samples cannot resolve.",
)


recount_option = click.option(
    "--recount", is_flag=True, help="Compute statistics again from the stored cells, in today's windows."
)


def judging_options(command: Decorated) -> Decorated:
    """The method, the designated false-alarm rate and the thresholds that verdicts are reached with."""
    for option in (
        click.option(
            "--min-coverage",
            type=FiniteRange(0, 1),
            default=0.99,
            show_default=True,
            help="Share of frames, messages and time below which a recording counts as not fully audited.",
        ),
        strict_option,
        click.option(
            "--transfer", is_flag=True, help="Accept thresholds of another rig kind; the verdicts will say so."
        ),
        click.option(
            "--calibration",
            metavar="ID|FILE",
            help="Thresholds to judge by.  [default: the one in force that fits, or the prior]",
        ),
        click.option(
            "--statistic",
            type=click.Choice(["gated", "plain"]),
            default="gated",
            show_default=True,
            help="With --method paper: count pixels with texture only, or all (the paper's E).",
        ),
        click.option(
            "--incidents-per-hour",
            type=FiniteRange(min=0),
            metavar="NUMBER",
            help="With --method robust: false incidents an hour to aim at on clean drives.  [default: 2]",
        ),
        click.option(
            "-r",
            "r",
            type=RATE,
            default="0.01",
            show_default=True,
            help="Designated false-alarm rate, as 0.01 or 1%: of a frame, or with --method paper of each E.",
        ),
        method_option,
    ):
        command = option(command)
    return command
