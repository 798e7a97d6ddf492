"""Recordings that were attacked, and then changed so that it would not be seen: none counts as audited clean."""

import shutil
from pathlib import Path

import pytest

import auditor
from auditor.cli.exit_codes import Exit
from auditor.model.pictures import Pictures
from auditor.pipeline.library import Scanned
from tests.making.audits import Audit, ask
from tests.making.logs_of_strangers import NO_ATTACK, Attack, record, write
from tests.making.vehicles_of_strangers import WAGON
from tests.making.ways_to_hide import BETWEEN_SWEEPS, MOMENTS, SEED, SPOT, UNKNOWABLE, WALL, WAYS

PATTERN = "{vehicle}/log.mcap"
"""Each recording is of a vehicle of its own: of one vehicle they would be in conflict, as all have the same stamps."""


@pytest.fixture(scope="module")
def store(calibrated: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A calibrated store."""
    return Path(shutil.copytree(calibrated, tmp_path_factory.mktemp("ways") / "audit"))


@pytest.fixture(scope="module")
def scanned(store: Path) -> dict[str, Scanned]:
    """What one scan of all recordings says of each, by the name of its way."""
    folders = {}
    for number, way in enumerate((*WAYS, *(way for way, _ in UNKNOWABLE), BETWEEN_SWEEPS)):
        folder = store.parent / f"way{number}"
        folder.mkdir()
        write(folder / "log.mcap", way.log())
        folders[folder.name] = way.name
    found = auditor.scan(
        [store.parent / folder for folder in folders], store=store, pictures=Pictures.NONE, path_pattern=PATTERN
    )
    return {folders[Path(one.recording).parent.name]: one for one in found}


def test_no_way_to_hide_is_audited_clean(scanned: dict[str, Scanned]) -> None:
    """One test, so that no two processes scan them all."""
    assert {name: one.error for name, one in scanned.items() if one.error is not None} == {}
    of_ways = {way.name: scanned[way.name] for way in WAYS}
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


def test_what_cannot_be_known_is_said(scanned: dict[str, Scanned]) -> None:
    for way, topic in UNKNOWABLE:
        assert any(topic in one for one in scanned[way.name].warnings), "the topic that was not audited is named"


def test_messages_between_frames_are_counted(scanned: dict[str, Scanned], store: Path) -> None:
    [known] = scanned[BETWEEN_SWEEPS.name].judged
    balance = f"""
        SELECT read, used FROM balance
        WHERE topic = '/right/image_rect/compressed' AND measurement_id = '{known.measurement_id}'
    """
    assert ask(store, balance) == [{"read": 2 * MOMENTS, "used": MOMENTS}]
