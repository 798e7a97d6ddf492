"""Bags and .db3 files that were not closed, are cut, or lie about their sizes."""

import bz2
import shutil
import sqlite3
import struct
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.rosbag1 import Reader as BagReader

from auditor.errors import RecordingError
from auditor.recordings import open_recording, write_bag, write_db3
from auditor.safety.budget import MAX_BYTES
from tests.making.forms import copy_bag
from tests.making.recorded_drives import make_frames, make_rig, same_frame, split, stream_of

RIG = make_rig(3)
FRAMES = make_frames(RIG, 12)
MESSAGES = 1 + 12 * 7 + 1


def write_small_chunks(path: Path, compression: str = "none") -> None:
    """A bag of several chunks."""
    write_bag(path.with_suffix(".big.bag"), RIG, FRAMES)
    copy_bag(path.with_suffix(".big.bag"), path, compression)
    path.with_suffix(".big.bag").unlink()


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bag") / "a.bag"
    write_small_chunks(path)
    return path


@pytest.fixture(scope="module")
def db3(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("db3") / "drive"
    write_db3(folder, RIG, FRAMES)
    return folder / "drive.db3"


def records(path: Path) -> list[tuple[int, int, int]]:
    """Kind, start and end of every record of a bag."""
    content, position, found = path.read_bytes(), 13, []
    while position < len(content):
        (length,) = struct.unpack_from("<I", content, position)
        header = content[position + 4 : position + 4 + length]
        (data_length,) = struct.unpack_from("<I", content, position + 4 + length)
        end = position + 8 + length + data_length
        found.append((header[header.index(b"op=") + 3], position, end))
        position = end
    return found


def chunks(path: Path) -> list[tuple[int, int]]:
    return [(start, end) for kind, start, end in records(path) if kind == 5]


def read(path: Path) -> tuple[list[bytes], tuple[str, ...]]:
    with open_recording(path) as recording:
        data = [bytes(message.data) for message in recording.messages()]
        assert sum(recording.counts.values()) >= len(data)
        return data, tuple(str(damage) for damage in recording.damage)


def without_index(path: Path) -> bytes:
    """What a recorder leaves that was killed between two chunks: no index, and a header that knows of none."""
    content = bytearray(path.read_bytes()[: chunks(path)[-1][1]])
    at = content.index(b"index_pos=") + len(b"index_pos=")
    content[at : at + 8] = bytes(8)
    return bytes(content)


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_bags_of_every_compression_give_what_rosbags_gives(tmp_path: Path, compression: str) -> None:
    write_small_chunks(tmp_path / "a.bag", compression)
    assert len(chunks(tmp_path / "a.bag")) > 4
    with BagReader(tmp_path / "a.bag") as reader:
        expected = [data for _, _, data in reader.messages()]
    data, damage = read(tmp_path / "a.bag")
    assert sorted(data) == sorted(expected)
    assert damage == ()


@pytest.mark.parametrize("name", ["a.bag", "a.bag.active"])
def test_a_bag_without_an_index_gives_all_messages_and_reports_the_damage(bag: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(without_index(bag))
    data, damage = read(tmp_path / name)
    assert data == read(bag)[0]
    assert damage == ("the recording was not closed: it has no index",)
    with open_recording(tmp_path / name) as recording:
        frames, _ = split(stream_of(recording))
    assert all(same_frame(a, b) for a, b in zip(frames, FRAMES, strict=True))


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_an_active_bag_whose_last_chunk_is_open_gives_its_messages(tmp_path: Path, compression: str) -> None:
    write_small_chunks(tmp_path / "a.bag", compression)
    content = bytearray(without_index(tmp_path / "a.bag"))
    start, _ = chunks(tmp_path / "a.bag")[-1]
    (length,) = struct.unpack_from("<I", content, start)
    at = content.index(b"size=", start) + 5
    content[at : at + 4] = content[start + 4 + length : start + 8 + length] = bytes(4)
    (tmp_path / "a.bag.active").write_bytes(content)
    data, damage = read(tmp_path / "a.bag.active")
    expected = read(tmp_path / "a.bag")[0]
    assert data == expected[: len(data)]
    assert len(data) == MESSAGES if compression == "none" else len(data) > MESSAGES - 12
    assert damage


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.data())
@pytest.mark.parametrize("indexed", [True, False])
def test_messages_before_a_cut_of_a_bag_are_read_and_the_cut_is_reported(
    bag: Path, tmp_path_factory: pytest.TempPathFactory, indexed: bool, data: st.DataObject
) -> None:
    content = bag.read_bytes() if indexed else without_index(bag)
    at = data.draw(st.integers(0, len(content) - 1))
    path = tmp_path_factory.mktemp("cut") / "cut.bag"
    path.write_bytes(content[:at])
    expected = read(bag)[0]
    if at < 13:
        with pytest.raises(RecordingError):
            open_recording(path)
        return
    found, damage = read(path)
    assert found == expected[: len(found)]
    complete = sum(end <= at for _, end in chunks(bag))
    assert len(found) >= complete
    assert damage
    if complete == len(chunks(bag)):
        assert found == expected


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.data())
def test_bytes_overwritten_in_a_bag_cost_no_more_than_their_chunk(
    bag: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content = bytearray(bag.read_bytes())
    start, end = data.draw(st.sampled_from(chunks(bag)))
    at = data.draw(st.integers(start, end - 8))
    content[at : at + 8] = data.draw(st.binary(min_size=8, max_size=8))
    path = tmp_path_factory.mktemp("flip") / "flip.bag"
    path.write_bytes(content)
    expected, found = read(bag)[0], read(path)[0]
    # What stands in other chunks is there, byte for byte.
    missing = [message for message in expected if message not in found]
    chunk = bag.read_bytes()[start:end]
    assert all(message in chunk for message in missing)


def patched(bag: Path, place: str, number: int) -> bytes:
    content = bytearray(bag.read_bytes())
    start, _ = chunks(bag)[2]
    (length,) = struct.unpack_from("<I", content, start)
    at = {"header": start, "data": start + 4 + length, "size": content.index(b"size=", start) + 5}[place]
    struct.pack_into("<I", content, at, number)
    return bytes(content)


@pytest.mark.parametrize("place", ["header", "data", "size"])
@pytest.mark.parametrize("number", [0, 1, MAX_BYTES + 1, 2**31, 2**32 - 1])
def test_a_size_that_lies_costs_one_chunk_of_a_bag(bag: Path, tmp_path: Path, place: str, number: int) -> None:
    (tmp_path / "a.bag").write_bytes(patched(bag, place, number))
    data, damage = read(tmp_path / "a.bag")
    assert damage
    assert len(data) > MESSAGES * 0.7


def test_a_bz2_chunk_that_unpacks_to_more_than_it_declares_is_left_out(tmp_path: Path) -> None:
    write_small_chunks(tmp_path / "a.bag", "bz2")
    content = (tmp_path / "a.bag").read_bytes()
    start, end = chunks(tmp_path / "a.bag")[2]
    (length,) = struct.unpack_from("<I", content, start)
    bomb = bz2.compress(bytes(20 * 2**20))
    header = content[start : start + 4 + length]
    (tmp_path / "b.bag").write_bytes(content[:start] + header + struct.pack("<I", len(bomb)) + bomb + content[end:])
    data, damage = read(tmp_path / "b.bag")
    assert "longer than declared" in damage[0]
    # The index points elsewhere now; the walk does not need it.
    assert MESSAGES > len(data) > MESSAGES - 14


def test_an_encrypted_bag_is_refused(bag: Path, tmp_path: Path) -> None:
    content = bag.read_bytes()
    header = b"".join(
        struct.pack("<I", len(field)) + field
        for field in (b"op=\x03", b"index_pos=" + bytes(8), b"encryptor=rosbag/AesCbcEncryptor")
    )
    (tmp_path / "a.bag").write_bytes(content[:13] + struct.pack("<I", len(header)) + header + bytes(4))
    with pytest.raises(RecordingError, match="encrypted"):
        open_recording(tmp_path / "a.bag")


def sqlite_rows(path: Path) -> list[bytes]:
    with sqlite3.connect(path) as connection:
        rows = [bytes(data) for (data,) in connection.execute("SELECT data FROM messages ORDER BY id")]
    connection.close()
    return rows


def test_a_db3_without_metadata_gives_what_sqlite_gives(db3: Path, tmp_path: Path) -> None:
    shutil.copy(db3, tmp_path / "bare.db3")
    assert read(tmp_path / "bare.db3") == (sqlite_rows(db3), ())


@pytest.mark.parametrize("page_bytes", [512, 1024, 65536])
def test_pages_of_other_sizes_are_read(db3: Path, tmp_path: Path, page_bytes: int) -> None:
    shutil.copy(db3, tmp_path / "a.db3")
    connection = sqlite3.connect(tmp_path / "a.db3", isolation_level=None)
    connection.execute(f"PRAGMA page_size = {page_bytes}")
    connection.execute("VACUUM")
    connection.close()
    assert read(tmp_path / "a.db3") == (sqlite_rows(db3), ())


def test_a_db3_with_a_damaged_first_page_gives_all_messages_and_reports_the_damage(db3: Path, tmp_path: Path) -> None:
    content = bytearray(db3.read_bytes())
    content[:4096] = bytes(4096)
    (tmp_path / "a.db3").write_bytes(content)
    data, damage = read(tmp_path / "a.db3")
    assert data == sqlite_rows(db3)
    assert any("first page" in piece for piece in damage)
    with open_recording(tmp_path / "a.db3") as recording:
        frames, _ = split(stream_of(recording))
    assert all(same_frame(a, b) for a, b in zip(frames, FRAMES, strict=True))


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.data())
def test_messages_before_a_cut_of_a_db3_are_read_and_the_cut_is_reported(
    db3: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content = db3.read_bytes()
    at = data.draw(st.integers(8 * 4096, len(content) - 1))
    path = tmp_path_factory.mktemp("cut") / "cut.db3"
    path.write_bytes(content[:at])
    found, damage = read(path)
    expected = sqlite_rows(db3)
    assert damage
    assert set(found) <= set(expected)
    # Every message that lies before the cut as a whole is there, but for the page or two that the cut goes through.
    before = [message for message in expected if len(message) < 400 and 0 <= content.find(message) < at - 8192]
    assert set(before) <= set(found)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.data())
def test_noise_in_a_db3_raises_only_our_own_error(
    db3: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content = bytearray(db3.read_bytes())
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.one_of(st.integers(0, 6 * 4096), st.integers(0, len(content) - 9)))
        content[at : at + 8] = data.draw(st.binary(min_size=8, max_size=8))
    path = tmp_path_factory.mktemp("noise") / "noise.db3"
    path.write_bytes(content)
    with suppress(RecordingError):
        read(path)


def test_sql_of_a_recording_is_never_run(tmp_path: Path) -> None:
    connection = sqlite3.connect(tmp_path / "a.db3", isolation_level=None)
    endless = "WITH RECURSIVE n(x) AS (VALUES(1) UNION ALL SELECT x + 1 FROM n) SELECT count(*), 1, 1, x'00' FROM n"
    connection.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)")
    connection.execute("INSERT INTO topics VALUES(1, '/a', 'std_msgs/msg/String', 'cdr')")
    connection.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB,"
        " bomb AS (zeroblob(1000000000)))"
    )
    connection.execute("INSERT INTO messages VALUES(1, 1, 5, x'0102')")
    connection.execute(f"CREATE VIEW schema AS {endless}")
    connection.close()
    assert read(tmp_path / "a.db3") == ([b"\x01\x02"], ())


def test_another_sqlite_file_is_refused(tmp_path: Path) -> None:
    connection = sqlite3.connect(tmp_path / "a.db3")
    connection.execute("CREATE TABLE other(id INTEGER PRIMARY KEY)")
    connection.close()
    with pytest.raises(RecordingError, match="not a ROS 2 recording"):
        open_recording(tmp_path / "a.db3")
