"""Recordings and a store on Google Cloud Storage, whose objects are replaced by their generation."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.pipeline.remote import object_store as objects
from auditor.pipeline.remote.addresses import Address
from auditor.pipeline.remote.snapshots import read_snapshot, replace_snapshot
from tests.making.google_store import google_store
from tests.making.small_drives import THREE_CAMERAS, write_drive

Held = dict[str, tuple[int, bytes]]


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Held]:
    with google_store() as (url, content):
        monkeypatch.setenv("GOOGLE_BASE_URL", url)
        monkeypatch.setenv("GOOGLE_BEARER_TOKEN", "not-a-token")
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
        objects._store.cache_clear()
        yield content
        objects._store.cache_clear()


def test_of_two_writers_at_once_the_second_one_is_told(held: Held) -> None:
    address = Address("gs://bucket", "audit")
    nothing = read_snapshot(address)
    assert replace_snapshot(address, nothing, {"a": (1, "x")})
    assert not replace_snapshot(address, nothing, {"b": (1, "y")}), "somebody else made the first one"
    first = read_snapshot(address)
    assert replace_snapshot(address, first, {"a": (1, "x"), "c": (1, "z")})
    assert not replace_snapshot(address, first, {"d": (1, "y")}), "somebody else replaced it"
    assert read_snapshot(address).files == {"a": (1, "x"), "c": (1, "z")}


def test_recordings_there_are_scanned_into_a_store_there_that_is_asked_and_verified(
    held: Held, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    drive = write_drive(tmp_path / "alder.mcap", 3, positions_m=THREE_CAMERAS)
    held["fleet/alder/alder.mcap"] = (1, drive.read_bytes())
    store, found = ["--store", "gs://bucket/audit"], "gs://bucket/fleet/**/*.mcap"
    assert run(["scan", found, *store, "--shard", "0/1", "--jobs", "1"]) == 0
    assert run(["scan", found, *store, "--jobs", "1", "--pictures", "none"]) in {0, 3}
    assert "3 frames measured" in capfd.readouterr().err
    assert run(["query", "summary", *store]) == 0
    assert "alder.mcap" in capfd.readouterr().out
    assert run(["verify", "gs://bucket/audit"]) == 0
