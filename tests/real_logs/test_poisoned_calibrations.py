"""Attacked recordings offered as clean ones: the attack is found all the same, or whoever calibrates is warned."""

from pathlib import Path

import pytest

from auditor.cli.exit_codes import Exit
from tests.making.audits import Audit
from tests.making.logs_of_strangers import DAY_NS, START_NS, Attack, record, write
from tests.making.vehicles_of_strangers import WAGON
from tests.making.ways_to_hide import MOMENTS, SEED, SPOT, WALL


@pytest.mark.parametrize(("attack", "clean"), [(WALL, 0), (SPOT, 1)], ids=["wall alone", "spot beside a clean one"])
def test_an_attack_is_found_by_a_calibration_on_its_like_or_calibrate_warned(
    attack: Attack, clean: int, new_audit: Audit, tmp_path: Path
):
    offered = [
        write(tmp_path / f"clean_{day}.mcap", record(WAGON, range(MOMENTS), seed=11, start_ns=START_NS - day * DAY_NS))
        for day in range(1, 1 + clean)
    ]
    poisoned = record(WAGON, range(MOMENTS), attack=attack, seed=14, start_ns=START_NS - 3 * DAY_NS)
    answer = new_audit("calibrate", *offered, write(tmp_path / "poisoned.mcap", poisoned))
    warned = any("WARNING" in line and "poisoned.mcap" in line for line in answer.err.splitlines())
    log = record(WAGON, range(MOMENTS), attack=attack, seed=SEED)
    assert warned or new_audit.scan(write(tmp_path / "log.mcap", log)).code != Exit.CLEAN
