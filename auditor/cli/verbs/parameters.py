"""`auditor parameters`: every number that decides what is found."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from itertools import groupby

import click

from auditor.cli.output import emit, format_option, print_rows


@click.command("parameters", short_help="List the numbers that decide what is found.")
@format_option
def command(form: str) -> None:
    """List every number that decides what is found, with its unit and its source.

    Such a number can change which files form a recording, a rig, a frame, a count, a warning or a verdict, or what a
    refresh learns from and puts in force. What changes frames or counts is bound to the counting version, what changes
    verdicts to the judging version. A number that can change both is listed twice. Values are written as JSON.

    \b
    auditor parameters
    auditor parameters --format csv > parameters.csv
    """  # noqa: D301 - \b is click's mark for a paragraph that keeps its lines
    if form == "table":
        for (changes, group), rows in groupby(_rows(), key=lambda row: (row["changes"], row["group"])):
            print_rows(list(rows), ("name", "value", "unit", "source"), title=f"{group}: changes {changes}")
        return
    from auditor.store.export import table_of  # noqa: PLC0415 - Arrow is heavy

    emit(table_of(list(_rows())), form)


def _rows() -> Iterator[dict[str, object]]:
    """One row a parameter, those of a group one after the other."""
    from auditor.identification.parameters import JUDGING, PSMNET_PRIORS  # noqa: PLC0415 - NumPy is heavy
    from auditor.identification.refresh_parameters import DRIFTING, REFRESHING  # noqa: PLC0415
    from auditor.measurement.checks.found import MEASURING  # noqa: PLC0415 - OpenCV is heavy
    from auditor.measurement.warning_parameters import WARNING  # noqa: PLC0415
    from auditor.model.parameters import list_parameters  # noqa: PLC0415
    from auditor.recordings.parameters import ACCOUNTING, FINDING_FILES, RIG_FINDING, SYNCHRONISING  # noqa: PLC0415

    parts = (
        ("recordings", FINDING_FILES),
        ("rigs", RIG_FINDING),
        ("frames", SYNCHRONISING),
        ("topics", ACCOUNTING),
        ("counts", MEASURING),
        ("warnings", WARNING),
        ("verdicts", (*JUDGING, PSMNET_PRIORS)),
        ("refreshes", REFRESHING),
        ("drift", DRIFTING),
    )
    for changes, groups in parts:
        for parameter in list_parameters(*groups):
            yield {"changes": changes, **asdict(parameter), "value": json.dumps(parameter.value, default=str)}
