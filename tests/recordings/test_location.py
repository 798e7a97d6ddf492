"""The identity of a recording changes with its files, and thousands of recordings of one folder list it once."""

import os
import time
from pathlib import Path

import pytest

from auditor.recordings.location import Location


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Twenty recordings, in a folder that has not changed for a day."""
    for number in range(20):
        (tmp_path / f"{number}.db3").write_bytes(b"content")
    settle(tmp_path)
    return tmp_path


def settle(folder: Path) -> None:
    a_day_ago = time.time() - 24 * 3600
    os.utime(folder, (a_day_ago, a_day_ago))


@pytest.mark.parametrize("settled", [True, False])
def test_a_journal_beside_a_recording_changes_its_identity_and_no_other(folder: Path, *, settled: bool) -> None:
    before = {one: Location(one).identity for one in folder.glob("*.db3")}
    (folder / "3.db3-wal").write_bytes(b"journal")
    (folder / "3.db3x").write_bytes(b"another file")
    if settled:
        os.utime(folder, (time.time() - 3600, time.time() - 3600))
    changed = [one.name for one, identity in before.items() if Location(one).identity != identity]
    assert changed == ["3.db3"]


def test_a_folder_that_stays_as_it_is_is_listed_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recordings, listed, scandir = sorted(folder.glob("*.db3")), list[object](), os.scandir

    def noted(place: Path) -> object:
        listed.append(place)
        return scandir(place)

    monkeypatch.setattr(os, "scandir", noted)
    identities = {Location(one).identity for one in recordings}
    assert len(identities) == len(recordings)
    assert listed == [folder]
