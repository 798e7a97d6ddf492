"""Recordings that rosbag2 compressed, and databases whose recorder crashed before it could close them."""

import shutil
import sqlite3
from pathlib import Path

import pytest
import zstandard

from auditor.errors import RecordingError
from auditor.recordings import open_recording, write_db3
from auditor.recordings.formats.unpacking import ZSTD_MAGIC
from auditor.safety.budget import MAX_BYTES, Budget
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
