import errno
import fcntl
import os
import stat
import time

import pytest

from auditor.errors import StoreError
from auditor.store import files
from auditor.store.files import checked_id, finished, part_file, remove_abandoned, write_whole
from auditor.store.maintenance.upgrade import upgrade
from auditor.store.store import Store
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store

OLD = "." + "a" * 8 + ".parquet." + "0" * 16 + ".part"


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def abandon(folder, age_s):
    part = folder / OLD
    part.write_bytes(b"half a")
    moment = time.time() - age_s
    os.utime(part, (moment, moment))
    return part


def test_a_file_appears_whole_and_replaces_the_old_one(tmp_path):
    target = tmp_path / "table" / "x.parquet"
    write_whole(target, b"old")
    with part_file(target) as part:
        part.file.write(b"new and longer")
        assert target.read_bytes() == b"old"
        part.commit()
    assert target.read_bytes() == b"new and longer"
    assert names(target.parent) == ["x.parquet"]


def test_without_a_commit_nothing_stays(tmp_path):
    with part_file(tmp_path / "x.parquet") as part:
        part.file.write(b"half")
    assert names(tmp_path) == []


def test_an_error_inside_the_block_leaves_the_old_file(tmp_path):
    write_whole(tmp_path / "x.parquet", b"old")
    with pytest.raises(StoreError), part_file(tmp_path / "x.parquet") as part:
        write_whole(tmp_path / "x.parquet" / "y.parquet", b"half")
    assert part.file.closed
    assert (tmp_path / "x.parquet").read_bytes() == b"old"
    assert names(tmp_path) == ["x.parquet"]


def test_a_full_disk_is_told_as_one_and_leaves_the_old_file(tmp_path, monkeypatch):
    write_whole(tmp_path / "x.parquet", b"old")
    monkeypatch.setattr(files, "open_part", lambda path: open("/dev/full", "wb"))  # noqa: PTH123, SIM115
    with pytest.raises(StoreError, match=os.strerror(errno.ENOSPC)) as caught:
        write_whole(tmp_path / "x.parquet", b"new")
    assert "make room" in caught.value.remedy
    assert (tmp_path / "x.parquet").read_bytes() == b"old"


def test_a_folder_that_cannot_be_made_is_told(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(StoreError, match="cannot be written"):
        write_whole(tmp_path / "file" / "x.parquet", b"new")


def test_what_a_killed_writer_left_is_removed(tmp_path):
    abandon(tmp_path, age_s=120)
    remove_abandoned(tmp_path)
    assert names(tmp_path) == []


def test_what_is_still_being_written_stays(tmp_path):
    with abandon(tmp_path, age_s=120).open("rb") as writer:
        fcntl.flock(writer, fcntl.LOCK_EX)
        remove_abandoned(tmp_path)
        assert names(tmp_path) == [OLD]


def test_what_was_begun_just_now_stays(tmp_path):
    abandon(tmp_path, age_s=1)
    remove_abandoned(tmp_path)
    assert names(tmp_path) == [OLD]


def test_files_of_others_stay(tmp_path):
    (tmp_path / ".notes.part").write_bytes(b"")
    os.utime(tmp_path / ".notes.part", (0, 0))
    remove_abandoned(tmp_path)
    assert names(tmp_path) == [".notes.part"]


def test_only_finished_files_named_by_ids_are_listed(tmp_path):
    for name in ("b" * 32 + ".parquet", "a" * 64 + ".parquet", "notes.parquet", "a" * 32 + ".txt"):
        (tmp_path / name).write_bytes(b"")
    abandon(tmp_path, age_s=0)
    assert finished(tmp_path) == ["a" * 64, "b" * 32]
    assert finished(tmp_path / "nowhere") == []


@pytest.mark.parametrize("text", ["", "../../etc/passwd", "A" * 32, "a" * 7, "a" * 65, "a" * 31 + "/", "a" * 32 + "\n"])
def test_what_is_no_id_never_becomes_a_path(text):
    with pytest.raises(StoreError, match="no id"):
        checked_id(text)


@pytest.fixture(params=[0o000, 0o022])
def umask(request):
    before = os.umask(request.param)
    yield
    os.umask(before)


def modes(folder):
    paths = [folder, *folder.rglob("*")]
    return {(path.is_dir(), oct(stat.S_IMODE(path.stat().st_mode))) for path in paths}


OWNERS = {(True, "0o700"), (False, "0o600")}


def fill(folder):
    store, rig = new_store(folder), make_rig(3)
    add_judgement(store, rig, add_measurement(store, rig, [make_measurement(rig, 0)]), "c")
    return store


@pytest.mark.usefixtures("umask")
def test_all_that_a_store_holds_is_its_owners(tmp_path):
    assert modes(fill(tmp_path / "new").folder) == OWNERS


@pytest.mark.usefixtures("umask")
def test_a_page_outside_of_the_store_is_its_owners_too(tmp_path):
    write_whole(tmp_path / "pages" / "page.html", b"page")
    assert modes(tmp_path / "pages") == OWNERS


def test_an_upgrade_closes_a_store_that_was_open_to_others(tmp_path):
    store = fill(tmp_path)
    for path in (store.folder, *store.folder.rglob("*")):
        path.chmod(0o755 if path.is_dir() else 0o644)
    upgrade(store.folder)
    assert modes(Store.open(store.folder).folder) == OWNERS
