"""Recordings that were attacked, and then changed so that the attack would not be seen: none ends in exit code 0."""

from pathlib import Path

import pytest

from auditor.cli.exit_codes import Exit
from tests.making.audits import Audit
from tests.making.logs_of_strangers import NO_ATTACK, Attack, record, write
from tests.making.vehicles_of_strangers import WAGON
from tests.making.ways_to_hide import MOMENTS, SEED, SPOT, WALL, WAYS, Way

NOT_SILENCED = {Exit.FINDINGS, Exit.INCOMPLETE, Exit.FINDINGS_INCOMPLETE}


@pytest.mark.parametrize("way", WAYS, ids=lambda way: way.name)
def test_no_way_to_hide_ends_in_exit_code_0(way: Way, audit: Audit, tmp_path: Path) -> None:
    answer = audit.scan(write(tmp_path / "log.mcap", way.log()))
    assert answer.code in NOT_SILENCED, answer
    assert answer.err.strip() or answer.code != Exit.INCOMPLETE, "what was not audited is said"


@pytest.mark.parametrize(
    ("attack", "code"), [(NO_ATTACK, Exit.CLEAN), (SPOT, Exit.FINDINGS), (WALL, Exit.FINDINGS)], ids=str
)
def test_the_same_recordings_that_hide_nothing_are_clean_or_attacked(
    attack: Attack, code: Exit, audit: Audit, tmp_path: Path
) -> None:
    log = record(WAGON, range(MOMENTS), attack=attack, seed=SEED)
    assert audit.scan(write(tmp_path / "log.mcap", log)).code == code
