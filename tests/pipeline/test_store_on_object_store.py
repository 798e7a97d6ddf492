"""A store on an object store: many machines write to it, and each reader sees it as it was at one moment."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import auditor
from auditor.cli import run
from auditor.errors import RecordingError, StoreError
from auditor.pipeline.remote import mirror as mirrors
from auditor.pipeline.remote.addresses import Address
from auditor.pipeline.remote.mirror import Mirror, mirrored
from auditor.pipeline.remote.snapshots import merged, read_snapshot
from auditor.store.log.runs import logged
from auditor.store.maintenance.verify import verify
from auditor.store.store import Store
from tests.making.object_stores import BUCKET, KEY, SECRET, Proxy, begin_with, object_store
from tests.making.small_drives import DAY_NS, START_NS, THREE_CAMERAS, write_drive
from tests.pipeline.test_object_stores import content_of, scan

FRAMES = 3


@pytest.fixture(scope="module")
def server() -> Iterator[Proxy]:
    with object_store() as proxy:
        yield proxy


@pytest.fixture(autouse=True)
def bucket(server: Proxy, monkeypatch: pytest.MonkeyPatch) -> Proxy:
    return begin_with(monkeypatch, server)


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("logs")
    return [
        write_drive(
            folder / f"{name}.mcap", FRAMES, positions_m=THREE_CAMERAS, seed=number, start_ns=START_NS + number * DAY_NS
        )
        for number, name in enumerate(("alder", "birch"))
    ]


@pytest.fixture
def address(request: pytest.FixtureRequest) -> Address:
    """Where a store of this test's own may be."""
    return Address(f"s3://{BUCKET}", f"stores/{abs(hash(request.node.name))}")


@pytest.fixture
def on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """Be on a machine of this name: its caches are its own."""

    def be(machine: str) -> None:
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / machine))

    return be


def problems(folder: Path) -> list[str]:
    return [str(one) for one in verify(Store.open(folder)).problems]


def test_a_store_there_equals_a_folder_and_another_machine_asks_it(
    logs: list[Path], bucket: Proxy, address: Address, on, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    on("one")
    local = tmp_path / "local"
    for store in (address, local):
        where = ["--store", str(store), "--jobs", "2"]
        assert run(["calibrate", *map(str, logs), *where]) in {0, 3}
        assert scan(*logs, "--store", store) in {0, 3}
        assert run(["judge", "-r", "0.02", *where]) in {0, 1, 3, 4}
        assert run(["report", "--store", str(store)]) in {0, 1, 3, 4}
    on("another")
    capfd.readouterr()
    told = []
    for store in (address, local):
        assert run(["query", "summary", "--store", str(store), "--format", "csv"]) == 0
        told.append(capfd.readouterr().out)
    assert told[0] == told[1]
    assert run(["verify", str(address)]) == 0
    said = "".join(capfd.readouterr())
    for secret in (KEY, SECRET, "mirrors"):
        assert secret not in said
    with mirrored(address) as folder:
        assert content_of(folder) == content_of(local)
        assert (folder / "reports" / "index.html").exists()


def test_nights_are_refreshed_there(logs: list[Path], address: Address, on, capfd: pytest.CaptureFixture[str]) -> None:
    on("one")
    words = ["refresh", *map(str, logs), "--clean", "--store", str(address), "--jobs", "2"]
    assert run([*words, "--dry-run"]) in {0, 1}
    assert read_snapshot(address).files == {}
    assert run(words) in {0, 1}
    assert f'"store": "{address}"' in capfd.readouterr().out
    assert "reports/refresh.html" in read_snapshot(address).files
    on("another")
    assert run(["calibration", "list", "--store", str(address)]) == 0


def test_the_library_takes_the_address_of_a_store(logs: list[Path], address: Address, on) -> None:
    on("one")
    assert auditor.calibrate(logs, store=str(address), jobs=2, pictures="none").errors == ()
    scanned = list(auditor.scan(logs, store=str(address), jobs=2, pictures="none"))
    assert [len(one.judged) for one in scanned] == [1, 1]
    on("another")
    assert len(list(auditor.judge(str(address), r="2%", jobs=1))) == 2
    assert auditor.query(str(address), "summary").num_rows == 2
    assert auditor.open_store(str(address)).query("summary")["r"].to_pylist() == [0.02] * 2


def test_a_store_that_is_not_there_is_named_by_its_address(
    address: Address, on, capfd: pytest.CaptureFixture[str]
) -> None:
    on("one")
    assert run(["query", "summary", "--store", str(address)]) == 2
    assert f"{address}: there is no store" in capfd.readouterr().err
    assert read_snapshot(address).files == {}


def test_two_writers_at_once_lose_nothing(logs: list[Path], address: Address, tmp_path: Path) -> None:
    one, other = Mirror(address), Mirror(address)
    assert one.folder != other.folder, "each has a mirror of its own, also on one machine"
    for mirror, log in ((one, logs[0]), (other, logs[1])):
        mirror.refresh()
        assert scan(log, "--store", mirror.folder) in {0, 3}
    one.put_back()
    other.put_back()
    other.put_back()
    for mirror in (one, other):
        mirror.close()
    assert scan(*logs, "--store", tmp_path / "local") in {0, 3}
    with mirrored(address) as folder:
        assert content_of(folder) == content_of(tmp_path / "local")
        assert problems(folder) == []


def test_of_two_that_measured_one_recording_the_first_stays_and_both_names_are_kept(
    logs: list[Path], address: Address, tmp_path: Path
) -> None:
    (tmp_path / "copies").mkdir()
    copy = tmp_path / "copies" / "copy.mcap"
    copy.write_bytes(logs[0].read_bytes())
    one, other = Mirror(address), Mirror(address)
    for mirror, log in ((one, logs[0]), (other, copy)):
        mirror.refresh()
        assert scan(log, "--store", mirror.folder) in {0, 3}
    measured = Store.open(one.folder).measurements()
    one.put_back()
    other.put_back()
    for mirror in (one, other):
        mirror.close()
    with mirrored(address) as folder:
        store = Store.open(folder)
        assert store.measurements() == measured
        assert {one.name for one in store.recordings()[0].sightings} == {"alder.mcap", "copy.mcap"}
        assert problems(folder) == []


def test_what_two_scans_measured_of_one_moment_is_related_when_they_are_put_together(
    logs: list[Path], address: Address, tmp_path: Path
) -> None:
    longer = write_drive(tmp_path / "longer.mcap", FRAMES + 2, positions_m=THREE_CAMERAS, seed=5)
    shorter = write_drive(tmp_path / "shorter.mcap", FRAMES, positions_m=THREE_CAMERAS, seed=6)
    folders = []
    for number, logs_of_one in enumerate(([longer], [shorter])):
        mirror = Mirror(address) if number == 0 else folders[0][1].__class__(address)
        mirror.refresh()
        assert scan(*logs_of_one, "--vehicle", "car", "--store", mirror.folder) in {0, 1, 3, 4}
        folders.append((logs_of_one, mirror))
    for _, mirror in folders:
        mirror.put_back()
        mirror.close()
    assert scan(longer, shorter, "--vehicle", "car", "--store", tmp_path / "local") in {0, 1, 3, 4}

    def related(folder: Path) -> list[tuple[object, ...]]:
        return sorted(
            (one.name, one.superseded_by, tuple(map(repr, one.conflicts or ())))
            for one in Store.open(folder).recordings()
        )

    with mirrored(address) as folder:
        assert related(folder) == related(tmp_path / "local")
        assert any(conflicts for _, _, conflicts in related(folder)), "the two contradict each other"


def test_a_reader_sees_all_of_a_command_or_nothing_and_what_was_not_put_back_is_put_back_next(
    logs: list[Path], address: Address, on, monkeypatch: pytest.MonkeyPatch
) -> None:
    on("one")
    assert scan(logs[0], "--store", address) in {0, 3}
    before = read_snapshot(address)
    with monkeypatch.context() as broken:
        broken.setattr(mirrors, "replace_snapshot", lambda *_: pytest.fail("the machine is lost"))
        other, mirror = Mirror(address), Mirror(address)
        mirror.refresh()
        mirror.mark_used()
        scan(logs[1], "--store", mirror.folder)
        with pytest.raises(pytest.fail.Exception):
            mirror.put_back()
        mirror.close()
        other.close()
    assert read_snapshot(address) == before
    on("another")
    with mirrored(address) as folder:
        assert len(Store.open(folder).ids("measurements")) == 1
        assert problems(folder) == []
    on("one")
    with mirrored(address) as folder:
        assert folder == other.folder, "what the lost mirror had came from the store"
        assert len(Store.open(folder).ids("measurements")) == 2
    on("another")
    with mirrored(address) as folder:
        assert len(Store.open(folder).ids("measurements")) == 2
        assert problems(folder) == []


def test_a_scan_puts_back_what_it_measured_before_it_ends(
    logs: list[Path], address: Address, on, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    on("one")
    monkeypatch.setattr(mirrors, "EACH_S", 0.0)
    put_back, replace_snapshot = [], mirrors.replace_snapshot

    def replaced(*given) -> bool:
        put_back.append(sum(place.startswith("measurements/") for place in given[2]))
        return replace_snapshot(*given)

    monkeypatch.setattr(mirrors, "replace_snapshot", replaced)
    assert run(["scan", *map(str, logs), "--store", str(address), "--jobs", "1", "--pictures", "none"]) in {0, 3}
    assert len(put_back) > 1
    assert 1 <= put_back[0] <= put_back[-1] == 2  # a busy machine may have measured both until it looks
    on("another")
    with mirrored(address) as folder:
        assert problems(folder) == []


def test_nothing_is_lost_where_requests_fail_and_answers_are_cut(
    logs: list[Path], bucket: Proxy, address: Address, on, tmp_path: Path
) -> None:
    assert scan(*logs, "--store", tmp_path / "local") in {0, 3}
    bucket.failing = 0.1
    on("one")
    assert scan(*logs, "--store", address) in {0, 3}
    on("another")
    with mirrored(address) as folder:
        assert content_of(folder) == content_of(tmp_path / "local")
        assert problems(folder) == []


def test_what_cannot_stand_beside_the_work_of_others_is_kept_apart_and_said(logs: list[Path], address: Address) -> None:
    one, other = Mirror(address), Mirror(address)
    for mirror, log in ((one, logs[0]), (other, logs[1])):
        mirror.refresh()
        assert run(["calibrate", str(log), "--store", str(mirror.folder), "--jobs", "2"]) in {0, 3}
    one.put_back()
    with pytest.raises(StoreError, match="both cannot stand") as told:
        other.put_back()
    kept = Path(told.value.remedy.removeprefix("run it again; what it wrote is kept in "))
    assert Store.open(kept).ids("measurements") != Store.open(one.folder).ids("measurements")
    for mirror in (one, other):
        mirror.close()
    with mirrored(address) as folder:
        assert Store.open(folder).ids("measurements") == Store.open(one.folder).ids("measurements")
        assert problems(folder) == []


def test_chains_that_grow_do_not_fill_the_bucket(bucket: Proxy, address: Address, on) -> None:
    on("one")
    mirror = Mirror(address)
    with logged(Store.open(mirror.folder, create=True).folder) as entry:
        for number in range(6):
            entry.used("recording", f"{number:064}", "a")
            mirror.put_back()
    mirror.put_back()
    mirror.close()
    objects_of_log = bucket.client().list_objects_v2(Bucket=BUCKET, Prefix=f"{address.key}/log/")["Contents"]
    assert len(objects_of_log) == 2, "the last one, and that of the snapshot before"


def test_no_run_of_another_machine_is_taken_for_a_dead_one(logs: list[Path], address: Address, on) -> None:
    on("one")
    one = Mirror(address)
    one.refresh()
    with logged(Store.open(one.folder, create=True).folder) as entry:
        entry.used("recording", "0" * 64, "a")
        one.put_back()
        on("another")
        with mirrored(address) as folder, logged(folder):
            Store.open(folder)
        on("one")
        one.put_back()
        entry.used("recording", "1" * 64, "b")
    one.put_back()
    one.close()
    with mirrored(address) as folder:
        assert problems(folder) == []
        assert verify(Store.open(folder)).open_runs == ()


def test_an_object_that_was_altered_is_refused(logs: list[Path], bucket: Proxy, address: Address, on) -> None:
    on("one")
    assert scan(logs[0], "--store", address) in {0, 3}
    keys = bucket.client().list_objects_v2(Bucket=BUCKET, Prefix=f"{address.key}/frames/")["Contents"]
    bucket.client().put_object(Bucket=BUCKET, Key=keys[0]["Key"], Body=b"x" * keys[0]["Size"])
    on("another")
    with pytest.raises(StoreError, match="not what the snapshot says"), mirrored(address):
        pass


def test_a_snapshot_that_names_a_place_outside_is_refused(bucket: Proxy, address: Address, on) -> None:
    on("one")
    content = b'{"format": "auditor store snapshot 1", "files": {"../x": [1, "00"]}}'
    bucket.client().put_object(Bucket=BUCKET, Key=f"{address.key}/snapshot.json", Body=content)
    with pytest.raises(StoreError, match="outside the store"), mirrored(address):
        pass


def test_a_bucket_that_is_not_there_is_said(logs: list[Path], on, capfd: pytest.CaptureFixture[str]) -> None:
    on("one")
    with pytest.raises(RecordingError, match="no such bucket"), mirrored(Address("s3://no-such-bucket", "a")) as folder:
        Store.open(folder, create=True)


@pytest.mark.parametrize(
    ("base", "mine", "theirs", "taken", "both", "refused"),
    [
        ("a1", "a1", "a2", {"a": "2"}, "", ""),
        ("a1", "a2", "a1", {}, "", ""),
        ("a1", "a2", "a2", {}, "", ""),
        ("a1", "a1", "", {"a": None}, "", ""),
        ("", "b1", "a1", {"a": "1"}, "", ""),
        ("a1", "a2", "a3", {}, "a", "a"),
        ("a1", "", "a3", {}, "a", "a"),
    ],
)
def test_changes_of_two_writers_are_put_together_by_place(base, mine, theirs, taken, both, refused) -> None:
    def files(text: str) -> dict[str, tuple[int, str]]:
        return {text[0]: (1, text[1])} if text else {}

    found = merged(files(base), files(mine), files(theirs))
    assert {place: file and file[1] for place, file in found.taken.items()} == taken
    assert found.both == tuple(both)
    assert found.refused == refused
