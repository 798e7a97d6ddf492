"""A user who may not read or write a place is told so in one line; what he may read is audited all the same."""

import errno
import json
import shutil

import pytest

from auditor.cli import run
from auditor.recordings import find_recordings
from auditor.store.folder import UPGRADED_FROM
from auditor.store.store import Store
from tests.making.audits import Audit
from tests.making.rights import without_rights
from tests.making.small_drives import THREE_CAMERAS, write_drive
from tests.store.kept import unpack


@pytest.fixture(scope="module")
def clean(tmp_path_factory):
    return write_drive(tmp_path_factory.mktemp("drives") / "clean.mcap", count=2, positions_m=THREE_CAMERAS)


@pytest.fixture
def locked(tmp_path):
    """A recording that its reader has no right to."""
    path = tmp_path / "locked.mcap"
    path.write_bytes(b"locked")
    path.chmod(0)
    return path


@pytest.fixture
def private(tmp_path):
    """A folder that nobody may enter."""
    folder = tmp_path / "private"
    folder.mkdir(0)
    yield folder
    folder.chmod(0o700)


@pytest.fixture
def audit(tmp_path, capfdbinary):
    return Audit(tmp_path / "audit", capfdbinary.readouterr)


def test_a_recording_that_cannot_be_read_is_an_error_of_its_own(clean, locked, audit):
    audit.scan(clean)
    with without_rights():
        scanned = audit.scan(clean, locked, how=("--format", "json"))
        planned = audit("refresh", clean, locked, "--dry-run")
    assert scanned.code == 3
    assert [one["name"] for one in scanned.rows["recordings"]] == ["clean.mcap"]
    assert [one["recording"] for one in scanned.rows["not_audited"]] == ["locked.mcap"]
    assert f"{locked}: it cannot be read (Permission denied)" in planned.err
    assert json.loads(planned.out)["exit"] != 2


def test_a_folder_within_that_cannot_be_read_is_an_error_of_its_own(clean, private):
    night = private.parent
    shutil.copy(clean, night)
    with without_rights():
        found = find_recordings([night])
    assert [one.path for one in found.recordings] == [night / "clean.mcap"]
    assert [(one.where, one.what) for one in found.errors] == [(str(private), "it cannot be read (Permission denied)")]


@pytest.mark.parametrize(
    "words",
    [
        ("query", "summary", "--store", "private/audit"),
        ("scan", "clean", "--store", "private/audit"),
        ("report", "--store", "private/audit"),
        ("calibrate", "clean", "--store", "private/audit"),
        ("refresh", "clean", "--store", "private/audit"),
        ("judge", "private/audit"),
        ("store", "upgrade", "private/audit"),
        ("convert", "clean", "private/other.mcap"),
        ("inspect", "clean", "--write-rig", "private/rig.toml"),
        ("show", "private/clean.mcap", "1"),
    ],
    ids=" ".join,
)
def test_a_folder_that_may_not_be_entered_is_named_with_what_to_do(words, clean, private, capfd):
    places = {"clean": str(clean)}
    given = [places.get(one, one.replace("private", str(private))) for one in words]
    with without_rights():
        assert run(given) == 2
    [line] = [one for one in capfd.readouterr().err.splitlines() if one.startswith("auditor: ")]
    assert line.startswith(f"auditor: {private}/")
    assert "(Permission denied); ask its owner for the right to it (chmod, chown), or name another place" in line


def test_a_store_that_needs_no_upgrade_is_not_written_to(clean, audit, monkeypatch):
    audit.scan(clean)
    monkeypatch.setattr("pathlib.Path.chmod", pytest.fail)
    assert "already" in audit("store", "upgrade").err


def test_an_upgrade_of_a_store_of_others_says_what_to_do(tmp_path, monkeypatch, capfd):
    folder, _ = unpack(UPGRADED_FROM[-1], tmp_path)

    def refuse(path, _):
        raise PermissionError(errno.EPERM, "Operation not permitted", str(path))

    monkeypatch.setattr("pathlib.Path.chmod", refuse)
    assert run(["store", "upgrade", str(folder)]) == 2
    [line] = capfd.readouterr().err.splitlines()
    assert line.startswith(f"auditor: {folder}: the upgraded files cannot be written (Operation not permitted); ask")
    assert line.endswith("the store is as it was")


def test_a_store_that_may_only_be_read_is_refreshed_by_nobody_and_says_what_to_do(tmp_path, capfd):
    store = Store.open(tmp_path / "audit", create=True).folder
    store.chmod(0o500)
    with without_rights():
        assert run(["refresh", "--store", str(store)]) == 2
    [line] = capfd.readouterr().err.splitlines()
    assert "cannot be made (Permission denied); ask its owner for the right to it" in line
    store.chmod(0o700)
