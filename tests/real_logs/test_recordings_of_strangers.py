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
from tests.making.ways_to_hide import MOMENTS, SEED, SPOT, WALL

FOUND = {Exit.FINDINGS, Exit.FINDINGS_INCOMPLETE}
NOTHING_FOUND = {Exit.CLEAN, Exit.INCOMPLETE}
VERDICTS = "SELECT stamp_ns, kind, attacked FROM verdicts ORDER BY stamp_ns"


Audits = Callable[[str], Audit]


def a_log(vehicle: Vehicle = WAGON, attack: Attack = NO_ATTACK, start_ns: int = START_NS) -> Log:
    return record(vehicle, range(MOMENTS), attack=attack, seed=SEED, start_ns=start_ns)


def summary(audit: Audit) -> dict[str, dict[str, Any]]:
    return {row["name"]: row for row in audit("query", "summary", "--format", "json").rows}


def clean_and_attacked(vehicle: Vehicle) -> tuple[Log, Log]:
    """Two logs, a day apart."""
    return a_log(vehicle), a_log(vehicle, SPOT, START_NS + DAY_NS)


@pytest.mark.parametrize(
    ("container", "vehicle"), [(".mcap", WAGON), (".bag", VAN), (".db3", WAGON)], ids=["mcap", "bag", "db3"]
)
def test_what_was_recorded_in_each_container_is_clean_or_attacked(
    container: str, vehicle: Vehicle, audit: Audit, tmp_path: Path
):
    clean, attacked = (
        write(tmp_path / f"log_{number}{container}", log) for number, log in enumerate(clean_and_attacked(vehicle))
    )
    assert audit.scan(clean).code == Exit.CLEAN
    assert audit.scan(attacked).code == Exit.FINDINGS
    rows = summary(audit)
    assert (rows[clean.name]["clean"], rows[attacked.name]["clean"]) == (MOMENTS, SPOT.moments.start)
    assert rows[attacked.name]["attacked_sensors"] == [1]


# Sub-rigs

WITHOUT = {
    "the leftmost camera": (WAGON, ("left",)),
    "a camera and the LiDAR": (WAGON, ("inner_left", "lidar")),
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


def test_a_sub_rig_is_judged_as_if_it_had_been_calibrated_alone(audit: Audit, new_audit: Audit, tmp_path: Path):
    vehicle, missing = WITHOUT["a camera and the LiDAR"]
    clean = [
        write(
            tmp_path / f"clean_{seed}.mcap",
            reduced(record(vehicle, range(MOMENTS), seed=seed, start_ns=START_NS - day * DAY_NS), vehicle, missing),
        )
        for day, seed in ((1, 11), (2, 14))
    ]
    assert new_audit("calibrate", *clean).code == Exit.CLEAN
    log = write(tmp_path / "log.mcap", reduced(a_log(vehicle, SPOT), vehicle, missing))
    assert new_audit.scan(log).code in FOUND
    assert audit.scan(log).code in FOUND
    assert audit.ask(VERDICTS) == new_audit.ask(VERDICTS)


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
    split = [write(tmp_path / f"drive_{number}.bag", part) for number, part in enumerate(parts(log, 2, 5))]
    assert of_parts.scan(*split).code == Exit.FINDINGS
    assert of_parts.ask(VERDICTS) == of_whole.ask(VERDICTS)


def test_a_split_drive_equals_its_folder(audits: Audits, tmp_path: Path):
    of_folder, of_files, of_both = audits("folder's"), audits("files'"), audits("both's")
    folder = tmp_path / "drive"
    folder.mkdir()
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    split = [write(folder / f"drive_{number}.mcap", part) for number, part in enumerate(parts(a_log(attack=SPOT), 4))]
    assert of_folder.scan(folder).code == Exit.FINDINGS
    assert of_files.scan(*split).code == Exit.FINDINGS
    assert len(of_files.ask(VERDICTS)) == MOMENTS
    assert of_files.ask(VERDICTS) == of_folder.ask(VERDICTS)
    assert of_both.scan(folder).code == Exit.FINDINGS
    assert of_both.scan(*split).code in FOUND
    assert len(of_both("query", "incidents", "--format", "json").rows) == 1, "what came twice is counted once"


def test_cameras_and_lidar_in_two_files_of_one_drive(audit: Audit, tmp_path: Path):
    log = a_log(attack=WALL)
    clouds = [sent for sent in log if isinstance(sent.body, Cloud)]
    cameras = write(tmp_path / "drive_cameras.mcap", [sent for sent in log if sent not in clouds])
    lidar = write(tmp_path / "drive_lidar.mcap", clouds)
    assert audit.scan(cameras, lidar, how=("--drive", "one")).code in FOUND


# Odd stamps


def without_stamps(sent: Sent) -> Sent:
    return sent.restamped(0)


def since_boot(sent: Sent) -> Sent:
    return sent.restamped(sent.stamp_ns - START_NS + 5 * 10**9)


def a_clock_of_its_own(sent: Sent) -> Sent:
    """The LiDAR's clock is a third of a second behind."""
    return sent.restamped(sent.stamp_ns - 333_333_333) if isinstance(sent.body, Cloud) else sent


@pytest.mark.parametrize("odd", [without_stamps, since_boot])
def test_odd_stamps_are_audited(odd, audit: Audit, tmp_path: Path):
    longer = range(MOMENTS + 2)
    logs = [
        record(WAGON, longer, seed=SEED),
        record(WAGON, longer, attack=replace(SPOT, moments=longer[3:]), seed=SEED, start_ns=START_NS + DAY_NS),
    ]
    clean, attacked = (
        write(tmp_path / f"log_{number}.mcap", [odd(sent) for sent in log]) for number, log in enumerate(logs)
    )
    assert audit.scan(clean).code in NOTHING_FOUND
    assert audit.scan(attacked).code in FOUND


def test_points_of_other_moments_are_said_and_no_attack(audit: Audit, tmp_path: Path):
    longer = record(WAGON, range(MOMENTS + 2), seed=SEED)
    log = write(tmp_path / "log.mcap", [a_clock_of_its_own(sent) for sent in longer])
    answer = audit.scan(log)
    assert answer.code is Exit.INCOMPLETE
    assert "its stamps are a period early" in answer.err
    assert summary(audit)[log.name]["attacked_sensors"] == []
