"""`auditor convert`: any recording that auditor reads becomes MCAP."""

from pathlib import Path

import click


@click.command("convert", short_help="Any recording becomes MCAP.")
@click.argument("source", type=click.Path(path_type=Path))
@click.argument("target", type=click.Path(path_type=Path))
def command(source: Path, target: Path) -> None:
    """Write a recording again as MCAP with ROS 2 messages; images and points stay what they are.

    \b
    auditor convert 2011_09_26_drive_0009_sync/ drive_0009.mcap
    auditor convert old_vehicle.bag old_vehicle.mcap
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    from auditor.cli.output import answer, say  # noqa: PLC0415 - keeps --help quick
    from auditor.recordings import convert, open_recording  # noqa: PLC0415

    with open_recording(source) as recording:
        report = convert(recording, target)
    for left_out in report.left_out:
        say(left_out)
    answer(target)
