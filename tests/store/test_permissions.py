"""Files are readable by their owner only, whatever the umask."""

import os
import stat

import pytest

from auditor.store.files import write_whole
from auditor.store.maintenance.upgrade import upgrade
from auditor.store.store import Store
from tests.making.stores import add_judgement, add_measurement, make_measurement, make_rig, new_store


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
