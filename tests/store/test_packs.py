"""Packed stores answer as before, whatever is done to them and whenever a packing is killed."""

import random
import shutil
from dataclasses import replace
from pathlib import Path

import duckdb
import pyarrow.parquet as pq
import pytest

from auditor.cli import run
from auditor.store import tables
from auditor.store.connection import connected
from auditor.store.log.chains import entries
from auditor.store.log.entry import EntryKind
from auditor.store.log.runs import logged
from auditor.store.maintenance import upgrade
from auditor.store.maintenance.removal import remove_measurement, remove_recordings
from auditor.store.maintenance.verify import verify, verify_changes
from auditor.store.packs import packing
from auditor.store.packs.index import INDEX, PACKED
from auditor.store.packs.packing import pack, small_files
from auditor.store.queries import run_query, run_sql
from auditor.store.schema import SCHEMA_VERSION
from auditor.store.store import Store
from auditor.store.tables import read_rows
from auditor.store.views import views_script
from tests.store.kept import unpack

VIEWS = ("summary", "incidents", *(f"stored_{table}" for table in PACKED))


class KilledError(BaseException):
    """Stands for a killed process: nothing catches it."""


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A store that nothing was packed of, and what it answers."""
    folder, _ = unpack(SCHEMA_VERSION, tmp_path_factory.mktemp("kept"))
    return folder, told(folder)


@pytest.fixture
def folder(kept, tmp_path):
    """A copy of it."""
    return shutil.copytree(kept[0], tmp_path / "audit")


def told(folder):
    """All that a store answers: every row of its tables and of queries, and what is read of an id."""
    store = Store.open(folder)
    with connected(store, " ".join(VIEWS)) as connection:
        rows = {view: sorted(map(repr, connection.execute(f"FROM {view}").fetchall())) for view in VIEWS}
    by_id = [
        (repr((store.measurement(one), store.load_statistics(one).statistics.tolist())), grids(store, one))
        for one in store.ids("measurements")
    ]
    judged = [store.recordings(), store.judgements(), store.measurements(), *map(store.labels, store.ids("recordings"))]
    return {**rows, "by id": by_id, "judged": judged}


def grids(store, measurement_id):
    """All counts of a measurement by cell."""
    return [
        (frame, counted, cells.valid.shape, cells.valid.tobytes(), cells.total.tobytes())
        for frame, grids_of_frame in store.load_cells(measurement_id)
        for counted, cells in grids_of_frame.items()
    ]


def parquet_files(folder):
    return [path for path in folder.rglob("*.parquet") if path.parent.name in PACKED]


def whole(folder):
    """Nothing is wrong with a store."""
    store = Store.open(folder)
    assert [str(problem) for problem in verify(store).grave] == []
    return store


def test_a_packed_store_has_few_files_and_answers_as_before(kept, folder):
    before = len(parquet_files(folder))
    done = pack(Store.open(folder))
    assert (done.files, done.packs, done.left) == (before, len(PACKED), 0)
    assert len(parquet_files(folder)) == done.packs
    assert told(folder) == kept[1]
    assert verify(whole(folder)).problems == ()
    assert [entry.kind for entry in entries(folder)].count(EntryKind.PACKED) == done.packs
    assert pack(Store.open(folder)) == packing.PackingResult()
    assert small_files(Store.open(folder)) == 0


def test_ids_that_are_read_in_order_read_each_row_group_of_a_pack_once(folder, monkeypatch):
    store = Store.open(folder)
    known = store.ids("measurements")
    alone = {one: store.load_statistics(one).statistics.tobytes() for one in known}
    pack(store)
    tables._group.cache_clear()
    read, read_row_group = [], pq.ParquetFile.read_row_group

    def counted(file, group, **options):
        read.append((file.metadata.num_rows, group, tuple(options["columns"])))
        return read_row_group(file, group, **options)

    monkeypatch.setattr(pq.ParquetFile, "read_row_group", counted)
    again = Store.open(folder)
    assert {one: again.load_statistics(one).statistics.tobytes() for one in known} == alone
    groups = {again.packs.part("frames", one).group for one in known}
    assert len(groups) < len(known)
    frames = [one for one in read if "fingerprints" in one[2] or "stamp_ns" in one[2]]
    assert len(frames) == len(set(frames)) == len(groups)
    for one in known * tables.KEPT_GROUPS:
        assert again.load_statistics(one).statistics.tobytes() == alone[one]
    assert tables._group.cache_info().currsize <= tables.KEPT_GROUPS


def test_verdicts_which_only_questions_read_have_larger_row_groups(kept, folder, monkeypatch):
    monkeypatch.setattr(packing, "GROUP_ROWS", 1)
    monkeypatch.setattr(packing, "TOGETHER", {"verdicts": 11})
    pack(Store.open(folder))
    packs = Store.open(folder).packs
    rows = {}
    for table in ("frames", "verdicts"):
        [path] = packs.paths(table)
        groups = pq.ParquetFile(path).metadata
        rows[table] = [groups.row_group(place).num_rows for place in range(groups.num_row_groups)]
    ids = sum(member.group is not None for member in packs.members(packs.paths("frames")[0]).values())
    assert len(rows["frames"]) == ids
    assert all(count > 10 for count in rows["verdicts"][:-1])
    assert told(folder) == kept[1]


def test_what_is_written_after_a_packing_goes_before_it_and_is_packed_next(folder):
    pack(Store.open(folder))
    store = Store.open(folder)
    one, other = store.recordings()
    for number, record in enumerate((one, other)):
        store.write_recording(type(record)(**{**vars(record), "vehicle": f"car{number}"}))
    assert [record.vehicle for record in store.recordings()] == ["car0", "car1"]
    assert run_sql(store, "SELECT vehicle FROM recordings ORDER BY ALL").to_pylist() == [
        {"vehicle": "car0"},
        {"vehicle": "car1"},
    ]
    assert pack(store).files == 2
    assert [record.vehicle for record in whole(folder).recordings()] == ["car0", "car1"]
    assert len(list((folder / "packs" / "recordings").iterdir())) == 1


@pytest.mark.parametrize("again", [False, True])
def test_what_is_removed_of_a_pack_is_gone_at_once_and_for_good(kept, folder, again):
    store = Store.open(folder)
    pack(store)
    gone, stays = store.measurements()
    assert remove_measurement(store, gone.measurement_id) == 2
    for _ in range(2):
        left = whole(folder)
        assert verify(left).problems == ()
        assert left.ids("measurements") == left.ids("frames") == [stays.measurement_id]
        assert not left.has_measurement(gone.measurement_id)
        for view in ("frames", "cells", "verdicts"):
            found = run_sql(left, f"SELECT DISTINCT measurement_id FROM stored_{view}").to_pylist()
            assert found == [{"measurement_id": stays.measurement_id}]
        if again:  # nothing of it comes back
            store.write_recording(store.recordings()[0])
            store.write_labels(stays.recording_id, store.labels(stays.recording_id))
            pack(store, least=1)


def test_a_recording_is_removed_of_a_packed_store_as_of_any_other(kept, folder, tmp_path):
    plain = shutil.copytree(kept[0], tmp_path / "plain")
    pack(Store.open(folder))
    for place in (plain, folder):
        store = Store.open(place)
        remove_recordings(store, [store.ids("recordings")[0]])
    assert told(folder) == told(plain)
    whole(folder)


def test_recordings_are_judged_again_and_measured_again_in_a_packed_store(folder):
    pack(Store.open(folder))
    assert run(["judge", str(folder), "-r", "0.02"]) in {0, 1, 3, 4}
    store = whole(folder)
    assert len(store.ids("judgements")) == 6
    assert {str(one.r) for one in store.current_judgements().values()} == {"0.02"}
    pack(store)
    assert run_query(whole(folder), "summary").num_rows == 2
    assert run(["judge", str(folder), "-r", "0.02"]) in {0, 1, 3, 4}
    again = list((folder / "verdicts").glob("*.parquet"))
    assert again, "they were packed, and are files of their own again"
    whole(folder)
    again[0].write_bytes(again[0].read_bytes() + b" ")
    assert [one.place for one in verify(store).grave] == [f"verdicts/{again[0].name}"]


def test_a_file_that_was_packed_and_written_again_is_not_told_as_added_where_others_come(folder):
    pack(Store.open(folder))
    assert run(["judge", str(folder), "-r", "0.02"]) in {0, 1, 3, 4}
    pack(Store.open(folder))
    assert run(["judge", str(folder), "-r", "0.02"]) in {0, 1, 3, 4}
    store = whole(folder)
    store.write_recording(replace(store.recordings()[0], recording_id="e" * 64))
    assert [str(problem) for problem in verify_changes(Store.open(folder)).grave] == []


def test_what_ties_rows_to_others_is_looked_at_in_packs_as_in_files(folder):
    store = Store.open(folder)
    one, other = store.ids("measurements")[:2]
    for known, change in ((one, {"frames": 99}), (other, {"recording_id": "f" * 64})):
        [row] = read_rows("measurements", store.path("measurements", known))
        store.write("measurements", known, [{**row, **change}])
    before = [str(problem) for problem in verify(Store.open(folder)).problems]
    assert pack(Store.open(folder)).left == 0
    assert [str(problem) for problem in verify(Store.open(folder)).problems] == before
    assert len(before) == 2
    assert "it counts 99 rows of frames" in before[0] + before[1]
    assert f"there is no recording_id {'f' * 64} in recordings" in before[0] + before[1]


@pytest.mark.parametrize(("function", "seed"), [("replace", 0), ("unlink", 1)])
def test_a_packing_that_is_killed_leaves_every_answer_and_the_next_one_completes_it(
    kept, folder, monkeypatch, function, seed
):
    moment, original, done = random.Random(seed).randrange(24), getattr(Path, function), []

    def killed(path, *given, **named):
        if path.is_relative_to(folder):
            if len(done) == moment:
                raise KilledError
            done.append(path)
        return original(path, *given, **named)

    monkeypatch.setattr(Path, function, killed)
    with pytest.raises(KilledError):
        pack(Store.open(folder))
    monkeypatch.undo()
    assert told(folder) == kept[1]
    with logged(folder):
        pass  # the next run closes the killed one
    pack(whole(folder), least=1)
    assert told(folder) == kept[1]
    assert not any(path.parent.parent == folder for path in parquet_files(folder))
    assert verify(whole(folder)).problems == ()


def test_files_stay_while_a_connection_reads_them(kept, folder):
    with connected(Store.open(folder)) as reader:
        assert pack(Store.open(folder)).left == 24
        assert reader.sql("FROM stored_verdicts").fetchall()
        assert told(folder) == kept[1]
    del reader
    assert pack(Store.open(folder)).left == 0
    assert told(folder) == kept[1]
    assert not any(path.parent.parent == folder for path in parquet_files(folder))


@pytest.mark.parametrize("removed", [0, 1])
def test_verify_knows_every_file_after_a_kill_while_packed_files_go(folder, tmp_path, monkeypatch, removed):
    """Also those that rows finished, which the log names nowhere before: the store as it was when the process ended."""
    frames = [path for path in parquet_files(folder) if path.parent.name == "frames"]
    assert len(frames) > 1
    remove, gone = Path.unlink, []

    def unlink(path, **options):
        if path.parent.name == "frames" and len(gone) == removed and not (tmp_path / "killed").exists():
            shutil.copytree(folder, tmp_path / "killed")
        gone.extend([path] * (path.parent.name == "frames"))
        remove(path, **options)

    monkeypatch.setattr(Path, "unlink", unlink)
    pack(Store.open(folder))
    monkeypatch.undo()
    found = verify(Store.open(tmp_path / "killed"))
    assert len(found.open_runs) == 1
    assert not found.grave


def test_a_reader_that_found_a_file_reads_the_pack_where_it_went_meanwhile(folder, monkeypatch):
    known = Store.open(folder).ids("measurements")[0]
    before, found = Store.open(folder).load_statistics(known), []
    store = Store.open(folder)
    store.rig(store.measurement(known).rig_id)
    source = store.source("frames", known)
    path = source.find()
    pack(Store.open(folder))
    late = type(source)(source.path, lambda: found.append(1) or (path if len(found) == 1 else source.find()))
    monkeypatch.setattr(store, "source", lambda *_: late)
    assert repr(store.load_statistics(known)) == repr(before)
    assert len(found) == 2


@pytest.mark.parametrize("table", ["recordings", "frames"])
def test_a_file_that_was_altered_is_not_packed(folder, table):
    path = sorted((folder / table).glob("*.parquet"))[0]
    pq.write_table(pq.read_table(path), path)
    place = path.relative_to(folder).as_posix()
    for _ in range(2):
        assert [problem.place for problem in verify(Store.open(folder)).grave] == [place]
        pack(Store.open(folder))
        assert path.is_file()


@pytest.mark.parametrize("table", ["recordings", "measurements", "frames", INDEX])
def test_a_pack_or_an_index_that_was_altered_is_named_alone(folder, table):
    pack(Store.open(folder))
    path = folder / INDEX if table == INDEX else next((folder / "packs" / table).iterdir())
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    found = {problem.place for problem in verify(Store.open(folder)).grave}
    assert path.relative_to(folder).as_posix() in found
    assert {place.partition("/")[0] for place in found} <= {"packs", "packs.csv", "pictures"}, found


def test_a_pack_that_is_gone_is_missed(folder):
    pack(Store.open(folder))
    next((folder / "packs" / "cells").iterdir()).unlink()
    assert any(problem.place.startswith("packs/cells/") for problem in verify(Store.open(folder)).grave)


def test_the_command_says_what_it_did(folder, capsys):
    assert run(["store", "compact", str(folder)]) == 0
    assert "24 files are 10 now" in capsys.readouterr().err
    assert run(["store", "compact", str(folder)]) == 0
    assert "no small files" in capsys.readouterr().err


def test_the_views_for_others_read_packs_and_what_was_written_since(folder):
    store = Store.open(folder)
    pack(store)
    remove_measurement(store, store.ids("measurements")[0])
    record = store.recordings()[0]
    store.write_recording(type(record)(**{**vars(record), "vehicle": "car9"}))
    tables = [f"stored_{table}" for table in PACKED]
    with duckdb.connect() as plain, connected(store, " ".join(tables)) as own:
        plain.execute(views_script(folder))
        for table in tables:
            rows = [sorted(map(repr, one.sql(f"FROM {table}").fetchall())) for one in (plain, own)]
            assert rows[0] == rows[1], table


def test_a_scan_packs_where_many_files_have_gathered(folder, monkeypatch):
    store = Store.open(folder)
    assert packing.pack_where_many(store) == packing.PackingResult()
    monkeypatch.setattr(packing, "MANY_FILES", 24)
    assert packing.pack_where_many(store).files == 24


def test_a_packed_store_is_upgraded_with_all_that_packs_have(kept, folder, monkeypatch):
    pack(Store.open(folder))
    monkeypatch.setattr(upgrade, "SCHEMA_VERSION", SCHEMA_VERSION + 1)  # what the next version will do
    monkeypatch.setattr(upgrade, "UPGRADED_FROM", (SCHEMA_VERSION,))
    assert upgrade.upgrade(folder) == upgrade.UpgradeResult(measurements=2, judgements=4, parts=6)
    monkeypatch.undo()
    found, before = told(folder), kept[1]
    assert found.keys() == before.keys()
    assert found["by id"] == before["by id"]
    assert found["summary"] == before["summary"]
    assert not (folder / "packs").exists()
    assert [str(one) for one in verify(Store.open(folder)).grave] == []
