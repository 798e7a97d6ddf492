"""Recordings as strangers' recorders write them: containers, sub-rigs, split drives and odd stamps are audited."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from auditor.cli.exit_codes import Exit
from tests.making.audits import Audit
from tests.making.logs_of_strangers import (
    DAY_NS,
    NO_ATTACK,
    START_NS,
    Attack,
    Calibration,
    Cloud,
    Log,
    Mounts,
    Sent,
    record,
    write,
)
from tests.making.vehicles_of_strangers import VAN, WAGON, Vehicle
from tests.making.ways_to_hide import MOMENTS, SEED, SPOT

FOUND = {Exit.FINDINGS, Exit.FINDINGS_INCOMPLETE}
NOTHING_FOUND = {Exit.CLEAN, Exit.INCOMPLETE}
VERDICTS = "SELECT stamp_ns, kind, attacked FROM verdicts ORDER BY stamp_ns"


Audits = Callable[[str], Audit]


def a_log(vehicle: Vehicle = WAGON, attack: Attack = NO_ATTACK, start_ns: int = START_NS) -> Log:
    return record(vehicle, range(MOMENTS), attack=attack, seed=SEED, start_ns=start_ns)


def summary(audit: Audit) -> dict[str, dict[str, Any]]:
    """The row of each recording; where it has several rigs that of the cameras together."""
    rows = sorted(
        audit("query", "summary", "--format", "json").rows, key=lambda row: row["rig_name"].endswith("cameras")
    )
    return {row["name"]: row for row in rows}


def clean_and_attacked(vehicle: Vehicle) -> tuple[Log, Log]:
    """Two logs, a day apart."""
    return a_log(vehicle), a_log(vehicle, SPOT, START_NS + DAY_NS)


# Sub-rigs

WITHOUT = {
    "the leftmost camera": (WAGON, ("left",)),
    "the LiDAR of the van": (VAN, ("lidar",)),
}


def reduced(log: Log, vehicle: Vehicle, missing: tuple[str, ...]) -> Log:
    """The log of a vehicle that lacks some sensors, and what calibrates them."""
    topics = {vehicle.lidar_topic if sensor == "lidar" else vehicle.topic(sensor) for sensor in missing}
    topics |= {vehicle.info(sensor) for sensor in missing if sensor != "lidar"}
    return [sent for sent in log if sent.topic not in topics]


@pytest.mark.parametrize("which", WITHOUT)
def test_who_unplugs_a_sensor_is_judged_by_those_that_remain(which: str, audit: Audit, tmp_path: Path):
    vehicle, missing = WITHOUT[which]
    clean, attacked = (
        write(tmp_path / f"log_{number}.mcap", reduced(log, vehicle, missing))
        for number, log in enumerate(clean_and_attacked(vehicle))
    )
    assert audit.scan(clean, attacked).code in FOUND
    rows = summary(audit)
    assert (rows[clean.name]["clean"], rows[attacked.name]["clean"]) == (MOMENTS, SPOT.moments.start)


# Split drives


def parts(log: Log, *begins: int) -> list[Log]:
    """A log split at some moments; what is latched is written into the first part only."""
    first, *others = [
        [sent for sent in log if begin <= sent.moment < end]
        for begin, end in zip((0, *begins), (*begins, MOMENTS), strict=True)
    ]
    latched = (Mounts, Calibration)
    return [first, *([sent for sent in part if not isinstance(sent.body, latched)] for part in others)]


def test_a_split_drive_is_audited_as_the_whole(audits: Audits, tmp_path: Path):
    of_whole, of_parts, log = audits("whole"), audits("parts"), a_log(attack=SPOT)
    assert of_whole.scan(write(tmp_path / "whole.bag", log)).code == Exit.FINDINGS
    split = [write(tmp_path / f"drive_{number}.bag", part) for number, part in enumerate(parts(log, 2, 4))]
    assert of_parts.scan(*split).code == Exit.FINDINGS
    assert of_parts.ask(VERDICTS) == of_whole.ask(VERDICTS)


# Odd stamps

LONGER = range(8)
"""Moments enough to tell a clock of its own from an attack."""


def without_stamps(sent: Sent) -> Sent:
    return sent.restamped(0)


def since_boot(sent: Sent) -> Sent:
    return sent.restamped(sent.stamp_ns - START_NS + 5 * 10**9)


def a_clock_of_its_own(sent: Sent) -> Sent:
    """The LiDAR's clock is a third of a second behind."""
    return sent.restamped(sent.stamp_ns - 333_333_333) if isinstance(sent.body, Cloud) else sent


@pytest.mark.parametrize("odd", [without_stamps, since_boot])
def test_odd_stamps_are_audited(odd, audit: Audit, tmp_path: Path):
    logs = [
        record(WAGON, LONGER, seed=SEED),
        record(WAGON, LONGER, attack=replace(SPOT, moments=LONGER[3:]), seed=SEED, start_ns=START_NS + DAY_NS),
    ]
    clean, attacked = (
        write(tmp_path / f"log_{number}.mcap", [odd(sent) for sent in log]) for number, log in enumerate(logs)
    )
    assert audit.scan(clean).code in NOTHING_FOUND
    assert audit.scan(attacked).code in FOUND


def test_points_of_other_moments_are_said_and_no_attack(audit: Audit, tmp_path: Path):
    longer = record(WAGON, LONGER, seed=SEED)
    log = write(tmp_path / "log.mcap", [a_clock_of_its_own(sent) for sent in longer])
    answer = audit.scan(log)
    assert answer.code is Exit.INCOMPLETE
    assert "its clock is set otherwise, or it is recorded late" in answer.err
    assert summary(audit)[log.name]["attacked_sensors"] == []
