"""A store in a folder of logs may have been planted there: nobody takes it unasked."""

import shutil
from pathlib import Path

import pytest

from auditor.cli import run
from tests.making.small_drives import THREE_CAMERAS, write_drive

SCAN = ["scan", "log.mcap", "--jobs", "1", "--pictures", "none"]
FOREIGN = "this store was not made by you on this machine"


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an attacked log and a store in which somebody has called its incidents known."""
    folder = tmp_path_factory.mktemp("planted")
    log = write_drive(folder / "log.mcap", 8, seed=1, positions_m=THREE_CAMERAS, attacked={2: range(2, 6)})
    assert run(["scan", str(log), "--store", str(folder / "made"), "--jobs", "1", "--pictures", "none"]) == 1
    shutil.copytree(folder / "made", folder / "audit")
    return folder


@pytest.mark.parametrize("verb", [SCAN, ["query", "incidents"], ["report"], ["judge"], ["refresh"]])
def test_a_store_that_was_planted_beside_the_logs_is_refused_until_it_is_named(
    verb: list[str], logs: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(logs)
    assert run(verb) == 2
    assert FOREIGN in capfd.readouterr().err
    assert run([*verb, "--store", "audit"]) in (0, 1)
    assert FOREIGN not in capfd.readouterr().err


def test_a_store_that_is_named_by_itself_is_judged_beside_a_planted_one(
    logs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(logs)
    assert run(["judge", "made"]) == 1


def test_a_store_that_was_made_here_is_taken_unasked(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(logs / "log.mcap", tmp_path)
    monkeypatch.chdir(tmp_path)
    assert run(SCAN) == 1
    assert run(SCAN) == 1
    (tmp_path / "audit").rename(tmp_path / "old")
    shutil.copytree(tmp_path / "old", tmp_path / "audit")
    assert run(SCAN) == 2, "what took its place is another"


def test_where_nothing_can_be_remembered_a_store_has_to_be_named(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    monkeypatch.chdir(tmp_path)
    log = str(logs / "log.mcap")
    assert [run([*SCAN[:1], log, *SCAN[2:], *words]) for words in ([], [], ["--store", "audit"])] == [1, 2, 1]
