"""Recordings that were attacked, and then changed so that it would not be seen: none counts as audited clean."""

from collections.abc import Iterable
from pathlib import Path

import pytest

import auditor
from auditor.cli.exit_codes import Exit
from auditor.model.pictures import Pictures
from auditor.pipeline.library import ScanResult
from tests.making.audits import Audit, ask
from tests.making.logs_of_strangers import NO_ATTACK, Attack, record, write
from tests.making.vehicles_of_strangers import WAGON
from tests.making.ways_to_hide import BETWEEN_SWEEPS, MOMENTS, SEED, SPOT, UNKNOWABLE, WALL, WAYS, Way

PATTERN = "{vehicle}/log.mcap"
"""Each recording is of a vehicle of its own: of one vehicle they would be in conflict, as all have the same stamps."""


def scanned(store: Path, ways: Iterable[Way]) -> dict[str, ScanResult]:
    """What one scan of their recordings says of each, by the name of its way.

    Each test scans its own: what they shared, each process of the suite would scan once.
    """
    folders = {}
    for number, way in enumerate(ways):
        folder = store.parent / f"way{number}"
        folder.mkdir()
        write(folder / "log.mcap", way.log())
        folders[folder.name] = way.name
    found = auditor.scan(
        [store.parent / folder for folder in folders], store=store, pictures=Pictures.NONE, path_pattern=PATTERN
    )
    return {folders[Path(one.recording).parent.name]: one for one in found}


def test_no_way_to_hide_is_audited_clean(audit: Audit) -> None:
    of_ways = scanned(audit.store, WAYS)
    assert of_ways.keys() == {way.name for way in WAYS}
    assert {name: one.error for name, one in of_ways.items() if one.error is not None} == {}
    assert [name for name, one in of_ways.items() if one.complete and not one.found] == []
    assert [name for name, one in of_ways.items() if not (one.found or one.warnings)] == []


@pytest.mark.parametrize(
    ("attack", "code"), [(NO_ATTACK, Exit.CLEAN), (SPOT, Exit.FINDINGS), (WALL, Exit.FINDINGS)], ids=str
)
def test_the_same_recordings_that_hide_nothing_are_clean_or_attacked(
    attack: Attack, code: Exit, audit: Audit, tmp_path: Path
) -> None:
    log = record(WAGON, range(MOMENTS), attack=attack, seed=SEED)
    assert audit.scan(write(tmp_path / "log.mcap", log)).code == code


def test_what_cannot_be_known_is_said(audit: Audit) -> None:
    found = scanned(audit.store, [way for way, _ in UNKNOWABLE])
    for way, topic in UNKNOWABLE:
        assert found[way.name].error is None
        assert any(topic in one for one in found[way.name].warnings), "the topic that was not audited is named"


def test_messages_between_frames_are_counted(audit: Audit) -> None:
    [known] = scanned(audit.store, [BETWEEN_SWEEPS])[BETWEEN_SWEEPS.name].judged
    balance = f"""
        SELECT read, used FROM balance
        WHERE topic = '/right/image_rect/compressed' AND measurement_id = '{known.measurement_id}'
    """
    assert ask(audit.store, balance) == [{"read": 2 * MOMENTS, "used": MOMENTS}]
