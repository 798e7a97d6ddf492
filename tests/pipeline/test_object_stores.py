"""Recordings on object stores: found by their addresses, read once, and measured as those on disk are."""

import json
import threading
from collections.abc import Iterator
from pathlib import Path

import duckdb
import pytest

from auditor.cli import run
from auditor.errors import RecordingError, SettingError
from auditor.pipeline.remote import object_store as objects
from auditor.pipeline.remote.addresses import Address, address_of
from auditor.pipeline.remote.finding import find_remote
from auditor.pipeline.remote.spool import Spool
from auditor.store.store import Store
from tests.making.object_stores import BUCKET, KEY, SECRET, Proxy, begin_with, object_store
from tests.making.small_drives import DAY_NS, PERIOD_NS, START_NS, THREE_CAMERAS, write_drive

FRAMES = 3


@pytest.fixture(scope="module")
def server() -> Iterator[Proxy]:
    with object_store() as proxy:
        yield proxy


@pytest.fixture(autouse=True)
def bucket(server: Proxy, monkeypatch: pytest.MonkeyPatch) -> Proxy:
    return begin_with(monkeypatch, server)


@pytest.fixture(scope="module")
def fleet(server: Proxy, tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Three recordings, on disk and on the object store."""
    folder = tmp_path_factory.mktemp("logs") / "fleet"
    files = []
    for number, (vehicle, suffix) in enumerate([("alder", ".mcap"), ("birch", ".mcap"), ("cedar", ".bag")]):
        (folder / vehicle).mkdir(parents=True)
        drive = write_drive(
            folder / vehicle / f"{vehicle}{suffix}",
            FRAMES,
            positions_m=THREE_CAMERAS,
            seed=number,
            start_ns=START_NS + number * DAY_NS,
        )
        server.put(f"fleet/{vehicle}/{drive.name}", drive)
        files.append(drive)
    return files


def content_of(store: Path) -> dict[str, list[tuple[object, ...]]]:
    """What a store has, but for paths and times."""
    left_out = {
        "measurements": "measured_at, seconds, outputs",
        "recordings": "path, sightings",
        "judgements": "judged_at, outputs, seconds",
    }
    found = {}
    for table in ("recordings", "measurements", "frames", "cells", "statistics", "rigs", "judgements", "verdicts"):
        if list((store / table).glob("*.parquet")):
            but = [name for name in left_out.get(table, "").split(", ") if name]
            rows = duckdb.sql(f"SELECT * FROM read_parquet('{store}/{table}/*.parquet')")
            kept = ", ".join(f'"{name}"' for name in rows.columns if name not in but)
            found[table] = sorted(map(repr, rows.project(kept).fetchall()))
    return found


def scan(*words: object) -> int:
    return run(["scan", *map(str, words), "--jobs", "2", "--pictures", "none"])


def test_recordings_of_an_object_store_are_measured_as_those_on_disk_and_read_once(
    fleet: list[Path], bucket: Proxy, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    spool = tmp_path / "spool"
    assert scan(f"s3://{BUCKET}/fleet/**/*.*", "--store", tmp_path / "remote", "--spool", spool) == scan(
        *fleet, "--store", tmp_path / "local"
    )
    assert content_of(tmp_path / "remote") == content_of(tmp_path / "local")
    assert bucket.given_bytes <= 1.05 * sum(file.stat().st_size for file in fleet)
    assert list(spool.iterdir()) == []
    said = capfd.readouterr()
    assert f"s3://{BUCKET}/fleet/alder/alder.mcap: {FRAMES} frames measured" in said.err
    kept = b"".join(file.read_bytes() for file in (tmp_path / "remote").rglob("*") if file.is_file())
    for secret in (KEY, SECRET):
        assert secret not in said.err + said.out
        assert secret.encode() not in kept
    bucket.forget()
    assert scan(f"s3://{BUCKET}/fleet", "--store", tmp_path / "remote", "--spool", spool) in {0, 3}
    assert bucket.given_bytes == 0, "what is known is not read again"


def test_drives_that_are_named_as_parts_are_known_each_and_what_is_new_is_read_with_what_lies_beside_it(
    bucket: Proxy, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    sizes = []

    def driven(number: int, start_ns: int) -> None:
        drive = write_drive(
            tmp_path / f"night_{number}.mcap", FRAMES, positions_m=THREE_CAMERAS, seed=number, start_ns=start_ns
        )
        bucket.put(f"nights/{drive.name}", drive)
        sizes.append(drive.stat().st_size)

    def read() -> float:
        bucket.forget()
        assert scan(f"s3://{BUCKET}/nights", "--store", tmp_path / "audit", "--spool", tmp_path) in {0, 3}
        return bucket.given_bytes

    for number in range(3):
        driven(number, START_NS + number * DAY_NS)
    assert read() >= sum(sizes)
    assert read() == 0
    driven(3, START_NS + 2 * DAY_NS + FRAMES * PERIOD_NS)
    capfd.readouterr()
    assert sizes[2] + sizes[3] <= read() <= 1.05 * (sizes[2] + sizes[3])
    assert f"s3://{BUCKET}/nights/night_2: {2 * FRAMES} frames measured" in capfd.readouterr().err
    assert read() == 0
    assert f"night_2: {2 * FRAMES} frames measured before" in capfd.readouterr().err


def test_a_path_pattern_reads_the_address_of_each_drive_that_is_named_as_a_part(bucket: Proxy, tmp_path: Path) -> None:
    for vehicle in ("alder", "birch"):
        for number in range(2):
            drive = write_drive(
                tmp_path / f"{number}.mcap",
                FRAMES,
                positions_m=THREE_CAMERAS,
                seed=10 * ord(vehicle[0]) + number,
                start_ns=START_NS + number * DAY_NS,
            )
            bucket.put(f"days/{vehicle}/log_{number}.mcap", drive)
    pattern = ("--path-pattern", "{vehicle}/{drive}.mcap")
    assert scan(f"s3://{BUCKET}/days", "--store", tmp_path / "audit", "--spool", tmp_path, *pattern) == 0
    told = {(one.vehicle, one.drive) for one in Store.open(tmp_path / "audit").recordings()}
    assert told == {(vehicle, f"log_{number}") for vehicle in ("alder", "birch") for number in range(2)}


def test_of_drives_that_were_copied_together_one_is_not_copied_again(bucket: Proxy, tmp_path: Path) -> None:
    for number in range(2):
        drive = write_drive(
            tmp_path / f"day_{number}.mcap", 1, positions_m=THREE_CAMERAS, start_ns=START_NS + number * DAY_NS
        )
        bucket.put(f"again/{drive.name}", drive)
    [both] = find_remote([Address(f"s3://{BUCKET}", "again")]).recordings
    spool = Spool(tmp_path)
    with spool.copied(both) as copies:
        assert [one.name for one in copies] == ["day_0.mcap", "day_1.mcap"]
    bucket.forget()
    with spool.copied(copies[1]) as [again]:
        assert again == copies[1]
    with spool.copied(both) as once_more:
        assert once_more == copies
    assert bucket.given_bytes == 0
    spool.close()


def test_nothing_is_lost_where_requests_fail_and_answers_are_cut(
    fleet: list[Path], bucket: Proxy, tmp_path: Path
) -> None:
    bucket.failing = 0.1
    for number, file in enumerate(fleet * 8):
        found = find_remote([Address(f"s3://{BUCKET}", f"fleet/{file.stem}")])
        assert found.errors == ()
        [one] = found.recordings
        assert one.remote is not None
        copy = tmp_path / str(number)
        objects.copy_object(f"s3://{BUCKET}", one.remote.objects[0], copy, threading.Event())
        assert copy.read_bytes() == file.read_bytes()
    sent = 8 * sum(file.stat().st_size for file in fleet)
    assert len(bucket.requests) > 2 * 8 * len(fleet), "some had to be asked again"
    assert bucket.given_bytes <= 1.05 * sent


@pytest.mark.parametrize("key", ["odd/a b#1+%20 & ä'.mcap", "odd/deep/[x]{y}~.mcap"])
def test_a_key_may_have_any_name_that_a_file_may_have(
    key: str, fleet: list[Path], bucket: Proxy, tmp_path: Path
) -> None:
    address = bucket.put(key, fleet[0])
    found = [one for one in find_remote([Address(f"s3://{BUCKET}", "odd")]).recordings if str(one) == address]
    with Spool(tmp_path).copied(found[0]) as [copy]:
        assert copy.path.name == Path(key).name
        assert copy.path.read_bytes() == fleet[0].read_bytes()


def test_a_file_of_a_web_server_is_an_object(fleet: list[Path], bucket: Proxy, tmp_path: Path) -> None:
    address = address_of(f"{bucket.url}/{BUCKET}/fleet/alder/alder.mcap")
    assert address is not None
    assert "files of a web server have to be public" in str(find_remote([address]).errors[0])
    bucket.client().put_object_acl(Bucket=BUCKET, Key="fleet/alder/alder.mcap", ACL="public-read")
    [one] = find_remote([address]).recordings
    with Spool(tmp_path).copied(one) as [copy]:
        assert copy.path.read_bytes() == fleet[0].read_bytes()
    folder = address_of(f"{bucket.url}/{BUCKET}/fleet/alder/")
    assert folder is not None
    assert "name one file an address" in str(find_remote([folder]).errors[0])


def test_an_object_that_is_replaced_while_it_is_read_is_refused(
    fleet: list[Path], bucket: Proxy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(objects, "_PIECE_BYTES", 1 << 16)
    address = Address(f"s3://{BUCKET}", "changing/alder.mcap")
    bucket.put(address.key, fleet[0])
    known = objects.find_object(address)
    assert known is not None
    bucket.put(address.key, fleet[1])
    with pytest.raises(RecordingError, match="replaced while it was read"):
        objects.copy_object(address.root, known, tmp_path / "copy", threading.Event())


def test_each_bad_address_has_its_error_and_the_others_go_on(
    fleet: list[Path], bucket: Proxy, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    good = f"s3://{BUCKET}/fleet/alder/alder.mcap"
    bad = [f"s3://{BUCKET}/fleet/nothing.mcap", "s3://no-such-bucket/x/*.mcap", f"s3://{BUCKET}/nowhere/**"]
    code = scan(*bad, good, "--store", tmp_path / "store")
    said = " ".join(capfd.readouterr().err.split())
    assert code in {3, 4}
    assert f"{good}: {FRAMES} frames measured" in said
    assert f"{bad[0]}: there is no recording at this address" in said
    assert f"{bad[1]}: there is no such bucket" in said
    assert f"{bad[2]}: there is no recording at this address" in said


def test_refused_credentials_are_told_without_them(
    fleet: list[Path], bucket: Proxy, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    bucket.refusing = True
    assert scan(f"s3://{BUCKET}/fleet/alder/alder.mcap", "--store", tmp_path / "store") == 2
    said = "".join(capfd.readouterr())
    assert "access was refused (403)" in " ".join(said.split())
    assert KEY not in said
    assert SECRET not in said


@pytest.mark.parametrize("address", ["s3://user:word@bucket/x.mcap", "https://host/x.mcap?X-Amz-Signature=abc"])
def test_an_address_with_credentials_is_refused_and_not_shown(
    address: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SettingError, match="holds no credentials"):
        address_of(address)
    assert scan(address, "--store", tmp_path / "store") == 2
    said = "".join(capfd.readouterr())
    assert "word" not in said
    assert "abc" not in said


@pytest.mark.parametrize(
    ("pattern", "key", "matches"),
    [
        ("fleet/**/*.mcap", "fleet/a/b/x.mcap", True),
        ("fleet/**/*.mcap", "fleet/x.mcap", True),
        ("fleet/*/x.mcap", "fleet/a/b/x.mcap", False),
        ("fleet/[ab]*/x.mcap", "fleet/birch/x.mcap", True),
        ("fleet/[!ab]*/x.mcap", "fleet/birch/x.mcap", False),
        ("fleet/drive?.mcap", "fleet/drive1.mcap", True),
        ("fleet/a.c", "fleet/abc", False),
    ],
)
def test_a_pattern_stands_for_the_keys_that_match_it(pattern: str, key: str, *, matches: bool) -> None:
    address = address_of(f"s3://bucket/{pattern}")
    assert address is not None
    assert address.matches(key) is matches


def test_a_copy_that_has_no_room_is_told_before_anything_is_read(
    fleet: list[Path], bucket: Proxy, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    words = ["--store", tmp_path / "store", "--spool", tmp_path / "spool", "--spool-limit", "0.01"]
    assert scan(f"s3://{BUCKET}/fleet/alder/alder.mcap", *words) == 2
    said = " ".join(capfd.readouterr().err.split())
    assert "and copies in" in said
    assert "--spool-limit" in said
    assert bucket.given_bytes == 0


def test_copies_share_the_room_that_there_is(fleet: list[Path], bucket: Proxy, tmp_path: Path) -> None:
    found = find_remote([Address(f"s3://{BUCKET}", "fleet")]).recordings
    most = max(one.size_bytes for one in found) * 1.2
    spool = Spool(tmp_path / "spool", most)
    for one in found:
        with spool.copied(one) as [copy]:
            kept = sum(file.stat().st_size for file in (tmp_path / "spool").rglob("*") if file.is_file())
            assert copy.path.stat().st_size == one.size_bytes
            assert kept <= most
    spool.close()


def test_what_a_killed_process_left_of_its_copies_goes_with_the_next(
    fleet: list[Path], bucket: Proxy, tmp_path: Path
) -> None:
    (left := tmp_path / "auditor-spool-killed").mkdir()
    (left / "x.mcap").write_bytes(b"half")
    [one] = find_remote([Address(f"s3://{BUCKET}", "fleet/alder/alder.mcap")]).recordings
    spool = Spool(tmp_path)
    other = Spool(tmp_path)
    with spool.copied(one) as [copy], other.copied(one) as [another]:
        assert not left.exists()
        assert copy.path.exists()
        assert another.path.exists()
        assert copy.path != another.path
    spool.close()
    other.close()


def test_parts_of_a_drive_are_put_together_and_drives_of_one_series_are_not(
    bucket: Proxy, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    period_ns = FRAMES * 10**8
    for number, start_ns in enumerate([START_NS, START_NS + period_ns, START_NS + 5 * DAY_NS]):
        file = tmp_path / "logs" / f"drive_{number}.mcap"
        file.parent.mkdir(exist_ok=True)
        write_drive(file, FRAMES, positions_m=THREE_CAMERAS, start_ns=start_ns, seed=number)
        bucket.put(f"split/{file.name}", file)
    scan(f"s3://{BUCKET}/split", "--store", tmp_path / "remote")
    said = capfd.readouterr().err
    scan(tmp_path / "logs", "--store", tmp_path / "local")
    assert content_of(tmp_path / "remote") == content_of(tmp_path / "local")
    assert f"s3://{BUCKET}/split/drive: {2 * FRAMES} frames measured" in said
    assert f"s3://{BUCKET}/split/drive_2.mcap: {FRAMES} frames measured" in said


def test_what_lies_in_a_rosbag2_folder_of_another_kind_is_a_recording_by_itself(bucket: Proxy, tmp_path: Path) -> None:
    (tmp_path / "any").write_bytes(b"0")
    for name in ("metadata.yaml", "night_0.db3", "night_0.db3-wal", "night_1.db3", "other.bag", "other.mcap"):
        bucket.put(f"beside/night/{name}", tmp_path / "any")
    found = [one.remote for one in find_remote([Address(f"s3://{BUCKET}", "beside")]).recordings]
    names = {one.address.rpartition("beside/")[2]: len(one.objects) for one in found if one is not None}
    assert names == {"night": 4, "night/other.bag": 1, "night/other.mcap": 1}


def test_shards_without_a_coordinator_and_one_scan_behind_them_equal_one_scan(
    fleet: list[Path], bucket: Proxy, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    address, shards = f"s3://{BUCKET}/fleet", [f"{number}/3" for number in range(3)]
    measured = []
    for shard in shards:
        assert scan(address, "--store", tmp_path / "shards", "--shard", shard) == 0
        measured.append(capfd.readouterr().err.count("frames measured"))
    assert sum(measured) == len(fleet)
    assert max(measured) < len(fleet)
    bucket.forget()
    assert scan(address, "--store", tmp_path / "shards") == scan(address, "--store", tmp_path / "one")
    assert content_of(tmp_path / "shards") == content_of(tmp_path / "one")


@pytest.mark.parametrize("shard", ["3/3", "1", "-1/3", "0/0", "a/b"])
def test_what_is_no_shard_is_refused(shard: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["scan", str(tmp_path), "--shard", shard, "--store", str(tmp_path / "store")]) == 2
    assert "is no shard" in capfd.readouterr().err


def test_every_verb_that_reads_recordings_takes_addresses(
    fleet: list[Path], bucket: Proxy, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    address, store = f"s3://{BUCKET}/fleet/**/*.mcap", str(tmp_path / "store")
    assert run(["inspect", address]) in {0, 3}
    assert f"s3://{BUCKET}/fleet/birch/birch.mcap" in capfd.readouterr().out
    assert run(["calibrate", address, "--store", store, "--jobs", "2"]) in {0, 3}
    assert run(["refresh", address, "--clean", "--store", store, "--dry-run"]) in {0, 1}
    assert f"s3://{BUCKET}/fleet/alder/alder.mcap" in capfd.readouterr().err
    assert run(["refresh", address, "--clean", "--store", store, "--jobs", "2"]) in {0, 1}


def test_incidents_are_pictured_from_the_copy_that_was_measured_and_a_case_has_its_clip(
    bucket: Proxy, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    drive = write_drive(tmp_path / "night.mcap", 8, positions_m=THREE_CAMERAS, attacked={1: range(2, 8)})
    address, store = bucket.put("nights/night.mcap", drive), tmp_path / "store"
    bucket.forget()
    assert run(["scan", address, "--store", str(store)]) in {1, 4}
    assert bucket.given_bytes <= 1.05 * drive.stat().st_size
    assert len(list((store / "pictures").rglob("*"))) > 1
    capfd.readouterr()
    assert run(["query", "incidents", "--store", str(store), "--format", "json"]) == 0
    incident = json.loads(capfd.readouterr().out)[0]["incident_id"]
    assert run(["case", incident, "--store", str(store), "--into", str(tmp_path / "case")]) == 0
    assert (tmp_path / "case" / "clip.mcap").stat().st_size > 0
    assert address in (tmp_path / "case" / "ticket.json").read_text() + (tmp_path / "case" / "page.html").read_text()
