"""Options that several verbs share."""

import os
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any, TypeVar

import click

Decorated = TypeVar("Decorated", bound=Callable[..., Any])

DEFAULT_STORE = Path("audit")

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
matcher_option = click.option(
    "--matcher", default="sgbm", show_default=True, help="Stereo matcher: sgbm (half resolution) or sgbm-full."
)
rig_option = click.option(
    "--rig", type=click.Path(path_type=Path), help="A rig.toml in place of the recording's own calibration."
)
vehicle_option = click.option("--vehicle", help="Name of the vehicle that made these recordings.")
jobs_option = click.option(
    "--jobs",
    type=click.IntRange(min=1),
    default=lambda: len(os.sched_getaffinity(0)),
    show_default="the number of cores",
    help="Recordings measured at the same time.",
)


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


def judging_options(command: Decorated) -> Decorated:
    """The designated false-alarm rate, the statistic and the thresholds that verdicts are reached with."""
    for option in (
        click.option("--strict", is_flag=True, help="Refuse an r that the clean samples cannot resolve (r < 1/N)."),
        click.option(
            "--transfer", is_flag=True, help="Accept thresholds of another rig kind; the verdicts will say so."
        ),
        click.option(
            "--calibration",
            metavar="ID|FILE",
            help="Thresholds to judge by.  [default: the store's newest that fits]",
        ),
        click.option(
            "--statistic",
            type=click.Choice(["gated", "plain"]),
            default="gated",
            show_default=True,
            help="Count pixels with texture only, or all (the paper's E).",
        ),
        click.option(
            "-r",
            "r",
            type=RATE,
            default="0.01",
            show_default=True,
            help="Designated false-alarm rate: 0.01 or 1%.",
        ),
    ):
        command = option(command)
    return command
