"""`auditor weights`: what is in a checkpoint of PSMNet, without running anything in it."""

from dataclasses import asdict
from pathlib import Path

import click

from auditor.cli.exit_codes import Exit
from auditor.cli.options import PATH
from auditor.cli.output import answer, shown


@click.group("weights", short_help="Inspect PSMNet checkpoints, convert them safely.")
def command() -> None:
    """Inspect checkpoints of PSMNet and convert them; nothing in a file is ever run.

    \b
    auditor weights inspect pretrained_model_KITTI2015.tar
    auditor weights convert pretrained_model_KITTI2015.tar kitti2015.safetensors --align-corners
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines


@command.command("inspect")
@click.argument("file", type=PATH)
def inspect(file: Path) -> int:
    """Show what a checkpoint holds, and whether it can be used."""
    from auditor.measurement.disparity.matchers import psmnet_module  # noqa: PLC0415 - keeps --help quick

    report = psmnet_module("weights").inspect_weights(file)
    for name, value in asdict(report).items():
        answer(f"{name:>14}  {shown(value)}")
    return Exit.FAILED if report.problems else Exit.CLEAN


@command.command("convert")
@click.argument("file", type=PATH)
@click.argument("target", type=PATH)
@click.option(
    "--align-corners/--no-align-corners",
    default=None,
    help="Upsampling convention that the weights were trained with; needed where the file does not say.",
)
@click.option("--max-disparity", type=click.IntRange(min=16), help="Largest disparity to write down with them.")
def convert(file: Path, target: Path, *, align_corners: bool | None, max_disparity: int | None) -> None:
    """Write weights as safetensors, a format that cannot hold code, with the settings they need."""
    from auditor.measurement.disparity.matchers import psmnet_module  # noqa: PLC0415 - keeps --help quick

    psmnet_module("weights").convert_weights(file, target, align_corners=align_corners, max_disparity=max_disparity)
    answer(target)
