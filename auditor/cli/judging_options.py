"""Options of the verbs that reach verdicts."""

from collections.abc import Callable
from typing import Any, TypeVar

import click

from auditor.cli.values import RATE, FiniteRange

Decorated = TypeVar("Decorated", bound=Callable[..., Any])


method_option = click.option(
    "--method",
    type=click.Choice(["robust", "paper"]),
    default="robust",
    show_default=True,
    help="Nine checks and joint identification, or disparity errors and Algorithm 2.",
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


no_sensor_option = click.option(
    "--no-sensor",
    "no_sensors",
    metavar="TOPIC",
    multiple=True,
    help="A topic that is neither camera nor LiDAR, though it cannot be read: a recording counts as fully audited "
    "without it, and says so. May be repeated.",
)


def judging_options(command: Decorated) -> Decorated:
    """The method, the designated false-alarm rate and the thresholds that verdicts are reached with."""
    for option in (
        no_sensor_option,
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
            help="With --method robust: false incidents an hour to aim at on clean drives.  [default: 1]",
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
