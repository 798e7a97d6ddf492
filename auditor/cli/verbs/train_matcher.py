"""`auditor train-matcher`: a stereo network of one's own, from clean recordings and synthetic streets."""

import shlex
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from auditor.cli import options
from auditor.cli.exit_codes import Exit
from auditor.cli.options import PATH
from auditor.cli.output import answer, print_rows, progress, say
from auditor.errors import SettingError

if TYPE_CHECKING:
    from auditor.lab.training import CurvePoint, SampleSet, SampleSource, SampleTask
    from auditor.pipeline.workers import LimitsOf
    from auditor.recordings import Location

_FIRST_STREET = 5000  # far from those of an evaluation, which must not be trained on
_FIRST_LEFT_OUT = 9000
_LEFT_OUT_SHARE = 8
_STREET_SAMPLES = 8
_COLUMNS = ("step", "loss", "samples", "mean_px", "over_3px", "sgbm_over_3px")


@click.command("train-matcher", short_help="A stereo network from your own clean logs.")
@click.argument("recordings", nargs=-1, metavar="[RECORDING]...", type=PATH)
@click.option("--synthetic", type=click.IntRange(min=1), metavar="N", help="Make N streets and train on them too.")
@click.option(
    "--validate",
    multiple=True,
    type=PATH,
    help="A clean recording to validate the network on, not to train on; may be given again.",
)
@click.option(
    "--out",
    type=PATH,
    default=Path("network"),
    show_default=True,
    help="Folder of the training: samples, checkpoint, curve, weights.",
)
@click.option(
    "--frames",
    type=click.IntRange(min=1),
    default=500,
    show_default=True,
    help="Samples of each recording, at most, spread over it.",
)
@click.option(
    "--width", type=int, default=8, show_default=True, help="Channels of the network; 32 in the published one."
)
@click.option(
    "--max-disparity",
    type=int,
    default=128,
    show_default=True,
    help="Largest disparity that it finds, in pixels of the image.",
)
@click.option("--full-resolution", is_flag=True, help="Match every pixel, not every second one each way.")
@click.option(
    "--crop",
    type=(int, int),
    default=(96, 256),
    show_default=True,
    metavar="ROWS COLUMNS",
    help="Windows that it is trained on, in pixels that it sees.",
)
@click.option("--batch", type=int, default=4, show_default=True, help="Windows in one step.")
@click.option("--steps", type=int, default=2000, show_default=True, help="Steps in all.")
@click.option("--learning-rate", type=float, default=4e-3, show_default=True, help="The largest one of its schedule.")
@click.option(
    "--validate-every", type=int, default=100, show_default=True, help="Steps from one checkpoint to the next."
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the random draws.")
@click.option("--device", default="cpu", show_default=True, help="Where it is trained: cpu, cuda or cuda:1.")
@options.setting("rig")
@options.budget_options
@options.setting("jobs", "Processes that make samples, and threads that train on the CPU.")
def command(
    recordings: tuple[Path, ...],
    synthetic: int | None,
    validate: tuple[Path, ...],
    out: Path,
    frames: int,
    rig: Path | None,
    limits: "LimitsOf",
    jobs: int,
    *,
    full_resolution: bool,
    **settings: Any,  # noqa: ANN401 - handed on to TrainingSettings, which declares them
) -> int:
    """Train a PSMNet on the LiDAR of clean recordings and on synthetic streets, for `--matcher psmnet`.

    \b
    auditor train-matcher --synthetic 40 --out network
    auditor train-matcher clean_logs/*.mcap --validate other_day.mcap --synthetic 40
    auditor train-matcher clean_logs/*.mcap --synthetic 400 --full-resolution --width 32 --max-disparity 192
        --crop 256 512 --steps 20000 --device cuda

    It is trained on a pair of cameras a frame, in grey. After interruptions the same command goes on where it was. The
    curve shows the share of pixels over 3 px on validation streets and recordings, beside that of sgbm.
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.lab.training import CURVE, WEIGHTS, train_on, training_set  # noqa: PLC0415
    from auditor.measurement.disparity.matchers import psmnet_module  # noqa: PLC0415 - heavy

    _check_sources(recordings, validate, synthetic)
    training = psmnet_module("psmnet", "auditor.lab.training")
    chosen = training.TrainingSettings(
        **settings, step=1 if full_resolution else 2, precision=training.best_precision(settings["device"])
    )
    training.check_settings(chosen)  # before samples are made, which takes long
    located = [_located(paths) for paths in (recordings, validate)]
    left_out_streets = -(-synthetic // _LEFT_OUT_SHARE) if synthetic else 0
    for_training = _tasks(located[0], rig, range(_FIRST_STREET, _FIRST_STREET + (synthetic or 0)), out, frames)
    for_validation = _tasks(located[1], rig, range(_FIRST_LEFT_OUT, _FIRST_LEFT_OUT + left_out_streets), out, frames)
    samples = _make([*for_training, *for_validation], jobs, limits)
    training_samples = training_set(samples[: len(for_training)], samples[len(for_training) :])
    validated = ", ".join(f"{len(files)} of {kind}" for kind, files in training_samples.validation.items())
    say(f"{len(training_samples.training)} samples to train on; validated on {validated}")

    training.use_threads(jobs)
    points: list[CurvePoint] = []
    for some in train_on(training_samples, replace(chosen, samples=training_samples.known), out):
        points += some
        for point in some:
            say(_line(point))
    print_rows([_row(point) for point in points], _COLUMNS)
    say(f"the curve is in {out / CURVE}; use the network with")
    answer(f"auditor scan RECORDING... --matcher psmnet --weights {shlex.quote(str(out / WEIGHTS))}")
    return Exit.CLEAN


def _check_sources(recordings: Sequence[Path], validate: Sequence[Path], synthetic: int | None) -> None:
    """Raises SettingError where there is nothing to train on, or to validate on."""
    if synthetic is not None:
        return
    if not recordings:
        raise SettingError("nothing to train on", where="train-matcher", remedy="name recordings, or give --synthetic")
    if not validate:
        raise SettingError(
            "nothing to validate the network on", where="train-matcher", remedy="give --validate, or --synthetic"
        )


def _located(paths: Sequence[Path]) -> "tuple[Location, ...]":
    """The recordings at some paths. Raises RecordingError where one is none."""
    from auditor.recordings import find_recordings  # noqa: PLC0415 - keeps --help quick

    inputs = find_recordings(paths)
    for error in inputs.errors:
        raise error
    return inputs.recordings


def _tasks(
    recordings: "Sequence[Location]", rig: Path | None, streets: range, out: Path, frames: int
) -> "list[SampleTask]":
    """The samples to be made of some recordings, and of the streets of these numbers."""
    from auditor.lab.training import RecordingSamples, SampleTask, StreetSamples  # noqa: PLC0415 - heavy

    sources: list[SampleSource] = [RecordingSamples(path, rig) for path in recordings]
    sources += [StreetSamples(number, _STREET_SAMPLES) for number in streets]
    return [SampleTask(source, out / "samples", frames) for source in sources]


def _make(tasks: "list[SampleTask]", jobs: int, limits: "LimitsOf") -> "list[SampleSet]":
    """The samples of every source, in the order of the tasks; the first that cannot be made is an error."""
    from auditor.lab.training import make_samples  # noqa: PLC0415
    from auditor.pipeline.workers import run_all  # noqa: PLC0415 - keeps --help quick

    made = {}
    with progress(len(tasks), "making samples") as (advanced, finished):
        for outcome in run_all(make_samples, tasks, jobs, advanced, lambda task: limits(task.source.path)):
            if outcome.error is not None:
                raise outcome.error
            if outcome.result is not None:
                made[outcome.item] = outcome.result
                how = "made" if outcome.result.fresh else "made before"
                finished(f"{outcome.item}: {len(outcome.result.files)} samples {how}")
    return [made[task] for task in tasks]


def _row(point: "CurvePoint") -> dict[str, object]:
    return {
        "step": point.step,
        "loss": point.loss,
        "samples": point.kind,
        "mean_px": point.network.mean_px,
        "over_3px": point.network.over_3px_share,
        "sgbm_over_3px": point.sgbm.over_3px_share,
    }


def _line(point: "CurvePoint") -> str:
    network, sgbm = point.network.over_3px_share or 0.0, point.sgbm.over_3px_share or 0.0
    return f"step {point.step}: loss {point.loss:.3f}, {point.kind}: over 3 px {network:.1%} (sgbm {sgbm:.1%})"
