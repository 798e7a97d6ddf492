"""Recordings that rosbag2 compressed, and databases whose recorder crashed before it could close them."""

import bz2
import shutil
import sqlite3
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard

from auditor.errors import RecordingError
from auditor.recordings import open_recording, write_db3
from auditor.recordings.formats.unpacking import (
    ZSTD_MAGIC,
    BadChunkError,
    FrameWalk,
    unpack,
    unpack_file,
    unpack_message,
)
from auditor.safety.budget import CHUNKS, MAX_BYTES, Budget, Spending
from tests.making.forms import CONTAINERS
from tests.making.recorded_drives import make_frames, make_rig

RIG = make_rig(3)
FRAMES = make_frames(RIG, 12)


@pytest.fixture
def db3(tmp_path: Path) -> Path:
    write_db3(tmp_path / "drive", RIG, FRAMES)
    return tmp_path / "drive" / "drive.db3"


def read(path: Path) -> tuple[list[bytes], tuple[str, ...]]:
    with open_recording(path) as recording:
        data = [bytes(message.data) for message in recording.messages()]
        return data, tuple(str(damage) for damage in recording.damage)


@pytest.fixture
def crashed(tmp_path: Path) -> Path:
    """A .db3 whose write-ahead log holds the later half of its messages, each in a transaction of its own."""
    return next(c for c in CONTAINERS if c.name == "db3 with a write-ahead log").write(tmp_path, RIG, FRAMES, "raw")


def test_a_write_ahead_log_is_read_up_to_its_last_whole_commit(crashed: Path) -> None:
    whole, damage = read(crashed)
    log = crashed.with_name(f"{crashed.name}-wal")
    content = log.read_bytes()
    assert damage == ()
    for share in (0.99, 0.5, 0.1):
        log.write_bytes(content[: int(share * len(content))])
        some, damage = read(crashed)
        assert some == whole[: len(some)]
        assert len(some) < len(whole)
        assert any(log.name in piece for piece in damage)
    flipped = bytearray(content)
    flipped[len(flipped) // 2] ^= 1
    log.write_bytes(bytes(flipped))
    some, damage = read(crashed)
    assert some == whole[: len(some)]
    assert any("checksum is wrong" in piece for piece in damage)
    log.write_bytes(content[:-20])
    assert any("cut" in piece for piece in read(crashed)[1])


def test_a_log_belongs_to_the_content_that_the_id_is_of(crashed: Path) -> None:
    log = crashed.with_name(f"{crashed.name}-wal")
    with open_recording(crashed) as recording:
        before = recording.recording_id
        assert recording.files == (crashed, log)
    log.write_bytes(log.read_bytes() + b"more")
    with open_recording(crashed) as recording:
        assert recording.recording_id != before


def test_an_ill_formed_log_or_one_of_another_page_size_is_reported(db3: Path, crashed: Path, tmp_path: Path) -> None:
    shutil.copy(db3, tmp_path / "a.db3")
    whole = read(tmp_path / "a.db3")[0]
    (tmp_path / "a.db3-wal").write_bytes(b"something")
    messages, damage = read(tmp_path / "a.db3")
    assert messages == whole
    assert any("a.db3-wal" in piece for piece in damage)
    other = sqlite3.connect(tmp_path / "other.db3")
    other.execute("PRAGMA page_size=1024")
    other.execute("PRAGMA journal_mode=WAL")
    other.execute("CREATE TABLE t(a)")
    other.commit()
    shutil.copy(tmp_path / "other.db3-wal", tmp_path / "a.db3-wal")
    other.close()
    messages, damage = read(tmp_path / "a.db3")
    assert messages == whole
    assert any("another size" in piece for piece in damage)


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_a_packed_file_that_is_cut_gives_what_it_still_holds(kind: str, tmp_path: Path) -> None:
    name = f"rosbag2 folder, {kind}, zstd files"
    folder = next(c for c in CONTAINERS if c.name == name).write(tmp_path, RIG, make_frames(RIG, 60), "raw")
    (packed,) = folder.glob("*.zstd")
    whole, damage = read(folder)
    assert damage == ()
    content = packed.read_bytes()
    packed.write_bytes(content[: len(content) // 2])
    some, damage = read(folder)
    assert 0 < len(some) < len(whole)
    assert damage
    packed.write_bytes(b"no zstd at all")
    with pytest.raises(RecordingError, match="zstd"):
        open_recording(folder)


def test_a_packed_file_that_unpacks_without_end_is_left_at_its_bound(
    db3: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("auditor.recordings.formats.unpacking.CHUNKS", Budget(MAX_BYTES, free_bytes=0, most_ratio=2))
    (tmp_path / "a.db3.zstd").write_bytes(zstandard.compress(db3.read_bytes() + bytes(50_000_000)))
    messages, damage = read(tmp_path / "a.db3.zstd")
    assert any("unpack to more than" in piece for piece in damage)
    assert messages == read(db3)[0][: len(messages)]


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_a_packed_message_that_is_damaged_is_left_out(kind: str, tmp_path: Path) -> None:
    name = f"rosbag2 folder, {kind}, zstd messages"
    folder = next(c for c in CONTAINERS if c.name == name).write(tmp_path, RIG, FRAMES, "raw")
    (file,) = folder.glob(f"*.{kind}")
    whole = read(folder)[0]
    content = file.read_bytes()
    at = content.rindex(ZSTD_MAGIC)
    file.write_bytes(content[: at + 4] + b"\xff\xff" + content[at + 6 :])
    some, damage = read(folder)
    assert len(some) == len(whole) - 1
    assert any("left out" in piece for piece in damage)


PLAIN = np.random.default_rng(1).integers(0, 9, 400_000, np.uint8).tobytes()
SKIPPABLE = (0x184D2A53).to_bytes(4, "little") + (5).to_bytes(4, "little") + b"hello"

Pack = Callable[[bytes], bytes]


def streamed(data: bytes) -> bytes:
    """A frame that does not say its size, with a checksum behind it."""
    packer = zstandard.ZstdCompressor(write_content_size=False, write_checksum=True).compressobj()
    return packer.compress(data) + packer.flush()


def halves(data: bytes) -> bytes:
    middle = len(data) // 2
    return zstandard.compress(data[:middle]) + zstandard.compress(data[middle:])


FORMS: dict[str, Pack] = {
    "one": zstandard.compress,
    "two": halves,
    "first without size": lambda data: streamed(data[:9]) + zstandard.compress(data[9:]),
    "last without size": lambda data: zstandard.compress(data[:9]) + streamed(data[9:]),
    "skippable first": lambda data: SKIPPABLE + zstandard.compress(data),
    "skippable last": lambda data: zstandard.compress(data) + SKIPPABLE,
    "an empty one": lambda data: zstandard.compress(data) + zstandard.compress(b""),
    "many": lambda data: b"".join(zstandard.compress(data[at : at + 999]) for at in range(0, len(data), 999)),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_chunk_of_several_frames_is_unpacked(form: str) -> None:
    packed = FORMS[form](PLAIN)
    assert bytes(unpack(b"zstd", memoryview(packed), len(PLAIN))) == PLAIN


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("off", [-1, 1, 10**6])
def test_a_chunk_of_another_size_is_refused(form: str, off: int) -> None:
    packed = FORMS[form](PLAIN)
    with pytest.raises(BadChunkError):
        unpack(b"zstd", memoryview(packed), len(PLAIN) + off)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("tail", [b"\0" * 20, b"no frame at all", b"\x28\xb5\x2f\xfd"])
def test_other_data_behind_the_frames_are_damage(form: str, tail: bytes) -> None:
    with pytest.raises(BadChunkError):
        unpack_message(zstandard.compress(PLAIN) + FORMS[form](PLAIN) + tail, Spending(CHUNKS))


def test_a_message_of_two_frames_is_unpacked() -> None:
    assert unpack_message(halves(PLAIN), Spending(CHUNKS)) == PLAIN


@pytest.mark.parametrize("form", FORMS)
def test_a_file_of_several_frames_is_unpacked_whole(form: str) -> None:
    target = BytesIO()
    assert unpack_file(BytesIO(FORMS[form](PLAIN)), target, 10**7) == ""
    assert target.getvalue() == PLAIN


@pytest.mark.parametrize("form", [form for form in FORMS if form not in {"skippable last", "an empty one"}])
@pytest.mark.parametrize("lost", [1, 7, 2000])
def test_a_file_that_is_cut_in_any_of_its_frames_is_damaged(form: str, lost: int) -> None:
    target = BytesIO()
    assert "zstd data are" in unpack_file(BytesIO(FORMS[form](PLAIN)[:-lost]), target, 10**7)
    assert PLAIN.startswith(target.getvalue())


def test_a_file_that_is_cut_behind_a_whole_frame_is_taken_as_it_is() -> None:
    """Nothing in a frame says that another one follows: the recording inside is then cut, and says so."""
    packed = halves(PLAIN)
    first = zstandard.compress(PLAIN[: len(PLAIN) // 2])
    target = BytesIO()
    assert unpack_file(BytesIO(packed[: len(first)]), target, 10**7) == ""


def test_blocks_without_end_are_given_up() -> None:
    head = zstandard.compress(PLAIN)[:6]
    raw_blocks_of_no_bytes = head + bytes(3) * 10_000
    with pytest.raises(zstandard.ZstdError):
        FrameWalk(BytesIO(raw_blocks_of_no_bytes), len(raw_blocks_of_no_bytes), 100).frames()


def test_a_frame_that_unpacks_to_more_than_its_chunk_declares_costs_no_more_memory() -> None:
    bomb = streamed(bytes(10**8))
    with pytest.raises(BadChunkError, match="declares 1000 unpacked bytes and holds 1001"):
        unpack(b"zstd", memoryview(bomb), 1000)


@pytest.mark.parametrize("form", ["lz4", "bz2"])
@pytest.mark.parametrize("parts", [1, 2, 7])
def test_a_chunk_of_several_streams_is_unpacked(form: str, parts: int) -> None:
    pack = lz4.frame.compress if form == "lz4" else bz2.compress
    step = -(-len(PLAIN) // parts)
    packed = b"".join(pack(PLAIN[at : at + step]) for at in range(0, len(PLAIN), step))
    assert bytes(unpack(form.encode(), memoryview(packed), len(PLAIN))) == PLAIN
    for size, data in ((len(PLAIN) - 1, packed), (len(PLAIN) + 1, packed), (len(PLAIN), packed[:-9])):
        with pytest.raises(BadChunkError):
            unpack(form.encode(), memoryview(data), size)
    with pytest.raises(BadChunkError):
        unpack(form.encode(), memoryview(packed + b"other data"), len(PLAIN))


@pytest.mark.parametrize("ending", [".zstd", ".zst"])
def test_a_recording_that_was_packed_in_two_frames_is_read(ending: str, tmp_path: Path) -> None:
    write = next(one.write for one in CONTAINERS if one.name == "mcap ros2")
    plain = write(tmp_path, make_rig(3), make_frames(make_rig(3), 2), "raw")
    packed = tmp_path / f"packed.mcap{ending}"
    packed.write_bytes(halves(plain.read_bytes()))
    with open_recording(plain) as one, open_recording(packed) as other:
        assert [message.data for message in one.messages()] == [message.data for message in other.messages()]
        assert other.damage == ()
