"""`auditor convert`: any recording that auditor reads becomes MCAP."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from auditor.cli import options
from auditor.cli.options import PATH

if TYPE_CHECKING:
    from auditor.pipeline.workers import LimitsOf


@click.command("convert", short_help="Any recording becomes MCAP.")
@click.argument("source", type=PATH)
@click.argument("target", type=PATH)
@options.budget_options
def command(source: Path, target: Path, limits: "LimitsOf") -> None:
    """Write a recording again as MCAP with ROS 2 messages; images and points stay what they are.

    \b
    auditor convert 2011_09_26_drive_0009_sync/ drive_0009.mcap
    auditor convert old_vehicle.bag old_vehicle.mcap
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.output import answer, say  # noqa: PLC0415 - keeps --help quick
    from auditor.pipeline.workers import run_within  # noqa: PLC0415
    from auditor.recordings.writers.mcap_file import no_remains  # noqa: PLC0415

    with no_remains(target):
        left_out = run_within(limits(source), _convert, source, target)
    for topic in left_out:
        say(topic)
    answer(target)


def _convert(source: Path, target: Path) -> Mapping[str, str]:
    """Write the copy; the topics that it leaves out, with reasons."""
    from auditor.recordings import convert, open_recording  # noqa: PLC0415 - keeps --help quick

    with open_recording(source) as recording:
        return convert(recording, target).left_out
