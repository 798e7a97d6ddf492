"""Options of the verbs that read recordings or a store."""

import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from auditor.cli.values import PATH, FiniteRange
from auditor.model.pictures import Pictures

if TYPE_CHECKING:
    from auditor.measurement.disparity.matchers import MatcherOptions
    from auditor.pipeline.many import LimitsOf
    from auditor.recordings import Origin

DEFAULT_STORE = Path("audit")


def _own_store(context: click.Context, parameter: click.Parameter, store: Path) -> Path:
    """A store that nobody named must have been made here: one in a folder of logs may have been planted there."""
    named = context.params.get("place") is not None  # of judge: what is given comes before what is not
    if not named and context.get_parameter_source(str(parameter.name)) is ParameterSource.DEFAULT and store.exists():
        from auditor.store.made_here import refuse_foreign  # noqa: PLC0415 - keeps --help quick
        from auditor.store.marker import MARKER  # noqa: PLC0415

        if (store / MARKER).exists():
            refuse_foreign(store)
    return store


store_option = click.option(
    "--store",
    type=PATH,
    default=DEFAULT_STORE,
    callback=_own_store,
    show_default=True,
    help="Folder of the store: measurements, thresholds, verdicts.",
)
recordings_argument = click.argument("recordings", nargs=-1, required=True, metavar="RECORDING...", type=PATH)
rig_option = click.option(
    "--rig",
    type=PATH,
    help="A rig.toml, or Kalibr's camchain.yaml, in place of the recording's own calibration.",
)
jobs_option = click.option(
    "--jobs",
    type=click.IntRange(min=1),
    default=lambda: len(os.sched_getaffinity(0)),
    show_default="the number of cores",
    help="Recordings that are worked on at the same time.",
)


again_option = click.option(
    "--measure-again",
    is_flag=True,
    help="Measure also what the store has; the earlier measurement goes, with its judgements.",
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
        click.option("--weights", type=PATH, help="Checkpoint of psmnet."),
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
