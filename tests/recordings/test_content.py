"""What is read of a recording is what its id is the hash of, or it is refused."""

import hashlib
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from auditor.errors import RecordingError
from auditor.recordings import content, open_recording
from auditor.recordings.content import ChangedError, FileContent
from tests.making.forms import CONTAINERS
from tests.making.reading_all import count_reads
from tests.making.recorded_drives import make_frames, make_rig

RIG = make_rig(3)
FRAMES = make_frames(RIG, 6)
WRITERS = {
    container.name: container
    for container in CONTAINERS
    if container.name
    in {
        "mcap ros2 zstd",
        "mcap ros2 unchunked",
        "mcap ros2, several files",
        "bag lz4",
        "rosbag2 folder, db3",
        "db3 with a write-ahead log",
        "rosbag2 folder, mcap",
    }
}


def write_kitti(folder: Path) -> Path:
    """A raw drive of two cameras, one LiDAR and three frames."""
    drive = folder / "2011_09_26_drive_0042_sync"
    rng = np.random.default_rng(0)
    for name, ending in (("image_00", "png"), ("image_01", "png"), ("velodyne_points", "bin")):
        (drive / name / "data").mkdir(parents=True)
        (drive / name / "timestamps.txt").write_text(
            "".join(f"2011-09-26 13:00:00.{number}00000000\n" for number in range(3))
        )
        for number in range(3):
            file = drive / name / "data" / f"{number:010}.{ending}"
            if ending == "png":
                cv2.imwrite(str(file), rng.integers(0, 256, (16, 24), np.uint8))
            else:
                rng.random((50, 4), np.float32).tofile(file)
    lines = [f"S_rect_0{n}: 24 16\nP_rect_0{n}: 20 0 12 {-10 * n} 0 20 8 0 0 0 1 0\n" for n in range(2)]
    (drive / "calib_cam_to_cam.txt").write_text("".join(lines))
    return drive


@pytest.fixture(scope="module", params=[*WRITERS, "kitti"])
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of each format, in a folder of its own."""
    folder = tmp_path_factory.mktemp("written")
    if request.param == "kitti":
        return write_kitti(folder)
    return WRITERS[request.param].write(folder, RIG, FRAMES, "raw")


@pytest.fixture
def path(written: Path, tmp_path: Path) -> Path:
    """A copy of it that a test may change."""
    folder = next(parent for parent in written.parents if parent.name.startswith("written"))
    return shutil.copytree(folder, tmp_path / "copy") / written.relative_to(folder)


def rename_over(file: Path) -> None:
    other = file.with_name(f"other-{file.name}")
    other.write_bytes(bytes(file.stat().st_size))
    shutil.copystat(file, other)
    other.replace(file)


def overwrite_in_place(file: Path) -> None:
    status = file.stat()
    with file.open("r+b") as out:
        out.seek(status.st_size // 2)
        old = out.read(1)
        out.seek(status.st_size // 2)
        out.write(bytes([old[0] ^ 1]))
    os.utime(file, ns=(status.st_atime_ns, status.st_mtime_ns))


def truncate(file: Path) -> None:
    os.truncate(file, file.stat().st_size - 1)


def grow(file: Path) -> None:
    with file.open("ab") as out:
        out.write(b"more")


CHANGES = pytest.mark.parametrize("change", [rename_over, overwrite_in_place, truncate, grow])


@CHANGES
def test_a_file_that_changes_after_it_was_hashed_is_refused_in_every_format(
    path: Path, change: Callable[[Path], None]
) -> None:
    with open_recording(path) as recording:
        for file in recording.files:
            change(file)
        with pytest.raises(RecordingError, match=r"changed while it was read.*scan it again when it is finished"):
            list(recording.messages())
        with pytest.raises(RecordingError, match="changed while it was read"):
            recording.check_unchanged()


@CHANGES
def test_a_file_that_changes_behind_what_was_read_is_found_at_the_end(
    path: Path, change: Callable[[Path], None]
) -> None:
    with open_recording(path) as recording:
        messages = list(recording.messages())
        assert messages
        recording.check_unchanged()
        change(recording.files[-1])
        with pytest.raises(RecordingError, match="changed while it was read"):
            recording.check_unchanged()


def test_a_packed_recording_is_refused_when_its_file_changed(tmp_path: Path) -> None:
    packed = next(c for c in CONTAINERS if c.name == "rosbag2 bare db3.zstd").write(tmp_path, RIG, FRAMES, "raw")
    with open_recording(packed) as recording:
        overwrite_in_place(packed)
        assert list(recording.messages())  # of its own unpacked copy, which is what was hashed
        with pytest.raises(RecordingError, match="changed while it was read"):
            recording.check_unchanged()


def test_the_journal_that_is_read_is_the_one_that_was_hashed(tmp_path: Path) -> None:
    path = next(c for c in CONTAINERS if c.name == "db3 with a write-ahead log").write(tmp_path, RIG, FRAMES, "raw")
    with open_recording(path) as recording:
        before = len(list(recording.messages()))
        journal = recording.files[1]
        rename_over(journal)
        with pytest.raises(RecordingError, match=f"{journal.name}.*changed"):
            list(recording.messages())
    with open_recording(path) as recording:
        assert len(list(recording.messages())) < before


def test_every_byte_is_compared_even_while_size_and_times_stay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(content, "_identity", lambda status: (status.st_size,))
    file = tmp_path / "a"
    data = np.random.default_rng(0).bytes(3 * content._BLOCK_BYTES + 17)
    file.write_bytes(data)
    known = FileContent(file)
    assert known.sha256 == hashlib.sha256(data).hexdigest()
    assert known.read() == data
    for position in (0, content._BLOCK_BYTES, len(data) - 1):
        changed = bytearray(data)
        changed[position] ^= 1
        file.write_bytes(changed)
        with known.open() as stream:
            stream.seek(position)
            with pytest.raises(ChangedError):
                stream.read(1)
    file.write_bytes(data)
    assert known.read() == data


def test_a_proven_file_reads_and_seeks_as_a_file_does(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    file = tmp_path / "a"
    file.write_bytes(rng.bytes(2 * content._BLOCK_BYTES + 5))
    with FileContent(file).open() as ours, file.open("rb") as theirs:
        for _ in range(200):
            offset, length = int(rng.integers(0, 2**21 + 40)), int(rng.integers(0, 2**18))
            assert ours.seek(offset) == theirs.seek(offset)
            assert ours.read(length) == theirs.read(length)
            assert ours.tell() == theirs.tell()


def test_empty_files_and_files_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "empty").touch()
    known = FileContent(tmp_path / "empty")
    assert known.sha256 == hashlib.sha256().hexdigest()
    assert known.read() == b""
    with pytest.raises(RecordingError, match="cannot be read"):
        FileContent(tmp_path / "missing")


def test_the_blocks_of_a_file_are_bounded_in_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(content, "_BLOCK_BYTES", 16)
    monkeypatch.setattr(content, "_MAX_BLOCKS", 10)
    data = bytes(range(256)) * 4
    (tmp_path / "a").write_bytes(data)
    known = FileContent(tmp_path / "a")
    assert len(known._states) <= 10
    assert known.read() == data


def test_a_file_is_hashed_while_it_is_read_and_only_the_rest_of_it_when_its_hash_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = count_reads(monkeypatch)
    file = tmp_path / "a"
    file.write_bytes(data := np.random.default_rng(2).bytes(12 * content._BLOCK_BYTES + 9))
    known = FileContent(file)
    assert sum(read) == 0
    with known.open() as stream:
        stream.seek(-4, os.SEEK_END)  # as a footer is read before all else
        assert stream.read() == data[-4:]
        stream.seek(0)
        assert stream.read(3 * content._BLOCK_BYTES) == data[: 3 * content._BLOCK_BYTES]
    assert known.sha256 == hashlib.sha256(data).hexdigest()
    assert len(data) < sum(read) <= len(data) + content._BLOCK_BYTES
    read.clear()
    assert known.sha256 == hashlib.sha256(data).hexdigest()
    assert sum(read) == 0


@pytest.mark.parametrize("hashed", [False, True])
def test_a_block_that_is_read_far_ahead_is_what_is_read_and_hashed_later(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, hashed: bool
) -> None:
    monkeypatch.setattr(content, "_identity", lambda status: (status.st_size,))
    file = tmp_path / "a"
    data = np.random.default_rng(3).bytes(12 * content._BLOCK_BYTES)
    file.write_bytes(data)
    known = FileContent(file)

    def ending() -> bytes:
        with known.open() as stream:
            stream.seek(-4, os.SEEK_END)
            return stream.read()

    assert ending() == data[-4:]
    file.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    with pytest.raises(ChangedError):
        _ = known.sha256 if hashed else ending()
