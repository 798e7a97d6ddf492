"""`auditor parameters` lists every number that decides what is found."""

import csv
import io
import json

import pytest

from auditor.cli import run
from auditor.identification.parameters import JUDGING, PSMNET_PRIORS
from auditor.identification.refresh_parameters import DRIFTING, REFRESHING
from auditor.measurement.checks.found import MEASURING
from auditor.measurement.warning_parameters import WARNING
from auditor.model.parameters import list_parameters
from auditor.recordings.parameters import ACCOUNTING, FINDING_FILES, RIG_FINDING, SYNCHRONISING

GROUPS = (
    FINDING_FILES,
    RIG_FINDING,
    SYNCHRONISING,
    ACCOUNTING,
    MEASURING,
    WARNING,
    JUDGING,
    (PSMNET_PRIORS,),
    REFRESHING,
    DRIFTING,
)
EVERY = list_parameters(*(one for group in GROUPS for one in group))


def printed(capfd: pytest.CaptureFixture[str], *options: str) -> str:
    assert run(["parameters", *options]) == 0
    return capfd.readouterr().out


def test_json_has_every_parameter_once_for_what_it_changes(capfd: pytest.CaptureFixture[str]) -> None:
    rows = json.loads(printed(capfd, "--format", "json"))
    assert len(rows) == len(EVERY)
    by_name = {(row["changes"], row["group"], row["name"]): row for row in rows}
    assert len(by_name) == len(rows)
    error = by_name["counts", "disparity_error", "absolute_px"]
    assert (json.loads(error["value"]), error["unit"]) == (3.0, "px of disparity")
    assert "paper, Eq. 2" in error["source"]
    assert by_name["verdicts", "naming", "least_probability"]["value"] == "0.7"
    changed = {"recordings", "rigs", "frames", "topics"}
    changed |= {"counts", "warnings", "verdicts", "refreshes", "drift"}
    assert changed == {row["changes"] for row in rows}


def test_csv_has_the_same_rows(capfd: pytest.CaptureFixture[str]) -> None:
    rows = list(csv.DictReader(io.StringIO(printed(capfd, "--format", "csv"))))
    assert list(rows[0]) == ["changes", "group", "name", "value", "unit", "source"]
    assert [(row["group"], row["name"]) for row in rows] == [(one.group, one.name) for one in EVERY]


def test_the_table_has_a_part_for_each_group_that_says_what_it_changes(capfd: pytest.CaptureFixture[str]) -> None:
    lines = [line.strip() for line in printed(capfd).splitlines()]
    for title in ("sgbm: changes counts", "naming: changes verdicts", "frame_window: changes frames"):
        assert title in lines
    [block] = [line for line in lines if line.startswith("block_px")]
    assert block.split()[1] == "5"
