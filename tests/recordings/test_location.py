"""The identity of a recording changes with its files; thousands of one folder list it once; its origin is read."""

import os
import time
from pathlib import Path

import pytest

from auditor.errors import SettingError
from auditor.recordings import Origin, read_path
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


@pytest.mark.parametrize(
    ("path", "pattern", "expected"),
    [
        (
            "/fleet/V7/2026-03-01/night.mcap",
            "{vehicle}/{date}/{drive}.mcap",
            {"vehicle": "V7", "date": "2026-03-01", "drive": "night"},
        ),
        ("fleet/V7_2026-03-01_0003.bag", "{vehicle}_{date}_*.bag", {"vehicle": "V7", "date": "2026-03-01"}),
        ("V7/a.mcap", "{vehicle}/*", {"vehicle": "V7"}),
        ("V7/heavy rain/a.mcap", "{vehicle}/{weather}/*", {"vehicle": "V7", "weather": "heavy rain"}),
        ("/fleet/V7/a.mcap", "{vehicle}/{date}/*.bag", {}),
        ("/fleet/V(7)+/a.b.mcap", "V({vehicle})+/a.b.mcap", {"vehicle": "7"}),
        ("/fleet/V(7)+/aXb.mcap", "V({vehicle})+/a.b.mcap", {}),
    ],
)
def test_the_end_of_a_path_gives_the_words_of_the_pattern(path: str, pattern: str, expected: dict[str, str]) -> None:
    assert read_path(Path(path), pattern) == expected


@pytest.mark.parametrize("pattern", ["", "*/*.mcap", "{car}/*", "{}/*", "{vehicle}/{vehicle}"])
def test_a_pattern_without_a_known_word_is_refused(pattern: str) -> None:
    with pytest.raises(SettingError, match="vehicle"):
        read_path(Path("a/b"), pattern)


def test_what_was_given_goes_before_what_the_metadata_say() -> None:
    declared = Origin.of_metadata({"vehicle": "V7", "weather": "snow", "date": "2026-01-31"})
    found = Origin(weather="rain").over(declared)
    assert (found.vehicle, found.weather, found.date) == ("V7", "rain", declared.date)
    assert declared.weather == "snow"
