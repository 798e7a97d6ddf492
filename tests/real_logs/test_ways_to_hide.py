"""Recordings that were attacked, and then changed so that the attack would not be seen: none ends in exit code 0."""

from pathlib import Path

import pytest

from auditor.cli.exit_codes import Exit
from tests.making.audits import Audit
from tests.making.logs_of_strangers import NO_ATTACK, Attack, record, write
from tests.making.vehicles_of_strangers import WAGON
from tests.making.ways_to_hide import BETWEEN_SWEEPS, MOMENTS, SEED, SPOT, UNKNOWABLE, WALL, WAYS, Way

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


@pytest.mark.parametrize(("way", "topic"), UNKNOWABLE, ids=[way.name for way, _ in UNKNOWABLE])
def test_what_cannot_be_known_is_said(way: Way, topic: str, audit: Audit, tmp_path: Path) -> None:
    answer = audit.scan(write(tmp_path / "log.mcap", way.log()))
    assert topic in answer.err, "the topic that was not audited is named"


def test_messages_between_frames_are_counted(audit: Audit, tmp_path: Path) -> None:
    audit.scan(write(tmp_path / "log.mcap", BETWEEN_SWEEPS.log()))
    balance = """
        SELECT read, used FROM balance JOIN measurements USING (measurement_id)
        WHERE topic = '/right/image_rect/compressed' AND name = 'log.mcap'
    """
    assert audit.ask(balance) == [{"read": 2 * MOMENTS, "used": MOMENTS}]
