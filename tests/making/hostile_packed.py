"""Packed files and messages, and write-ahead logs, that are hostile or broken; and all hostile files together."""

import shutil
import struct
from collections.abc import Callable
from pathlib import Path

import zstandard

from auditor.recordings import write_db3
from auditor.recordings.formats.sqlite_pages import _sums
from tests.making.hostile_files import FRAMES, HOSTILE, MEGA, RIG, TOPIC, TOPICS, WHOLE, Hostile, db3_sql

_STATUS = Path("/proc/self/status")
_CLEAR_REFS = Path("/proc/self/clear_refs")


def memory_mb(name: str) -> float:
    """A figure of /proc/self/status, such as VmRSS, or VmHWM for the peak, in MB."""
    return int(_STATUS.read_text().split(f"{name}:")[1].split()[0]) / 1024


def forget_peak() -> None:
    """Start the peak anew at the present use."""
    _CLEAR_REFS.write_text("5")


TABLE = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"


def zeros(size: int) -> bytes:
    """So many zeros, packed."""
    packer = zstandard.ZstdCompressor().compressobj(size=size)
    return b"".join([*(packer.compress(bytes(16 * MEGA)) for _ in range(size // (16 * MEGA))), packer.flush()])


def packed(name: str, content: Callable[[], bytes]) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        (folder / name).write_bytes(content())
        return folder / name

    return make


def messages_of_zeros(folder: Path) -> Path:
    bomb = zeros(48 * MEGA).hex()
    inserts = [f"INSERT INTO messages VALUES({n}, 1, {n}, x'{bomb}')" for n in range(1, 60)]
    return db3_sql(TOPICS, TOPIC, TABLE, *inserts)(folder)


def log(*frames: tuple[int, int, bytes], page_bytes: int = 4096) -> bytes:
    """A write-ahead log with the right checksums of frames (page, pages after the commit, content)."""
    head = struct.pack(">IIIIII", 0x377F0683, 3007000, page_bytes, 0, 1, 2)
    sums = _sums(head, ">", (0, 0))
    out = [head, struct.pack(">II", *sums)]
    for page, commit, content in frames:
        start = struct.pack(">II", page, commit)
        sums = _sums(start + content, ">", sums)
        out += [start, struct.pack(">IIII", 1, 2, *sums), content]
    return b"".join(out)


def with_log(content: Callable[[bytes], bytes]) -> Callable[[Path], Path]:
    """A whole recording with a log beside it, which is made of its first page."""

    def make(folder: Path) -> Path:
        write_db3(folder / "drive", RIG, FRAMES)
        shutil.copy(folder / "drive" / "drive.db3", folder / "a.db3")
        (folder / "a.db3-wal").write_bytes(content((folder / "a.db3").read_bytes()[:4096]))
        return folder / "a.db3"

    return make


PACKED = (
    Hostile("db3.zstd: 3 GB of zeros", packed("a.db3.zstd", lambda: zeros(3 * 1024 * MEGA)), 0, "unpack to more than"),
    Hostile("mcap.zstd: no zstd", packed("a.mcap.zstd", lambda: b"text" * 99), 0, "zstd"),
    Hostile("mcap.zstd: empty inside", packed("a.mcap.zstd", lambda: zstandard.compress(b"")), 0, "not an MCAP"),
    Hostile(
        "db3.zstd: a window of 2 GiB", packed("a.db3.zstd", lambda: b"\x28\xb5\x2f\xfd\x00\xa8" + bytes(999)), 0, "zstd"
    ),
    Hostile("db3: messages that unpack to 3 GB", messages_of_zeros, 0, "unpacked too much"),
    Hostile("db3-wal: four billion pages", with_log(lambda page: log((1, 2**32 - 1, page))), WHOLE, "cut"),
    Hostile("db3-wal: a first page of noise", with_log(lambda _: log((1, 20, b"\xff" * 4096))), 0, "first page"),
    Hostile("db3-wal: pages that end before they begin", with_log(lambda page: log((9, 1, page))), 0, ""),
    Hostile("db3-wal: 512-byte pages", with_log(lambda page: log((1, 9, page[:512]), page_bytes=512)), WHOLE, "size"),
    Hostile(
        "db3-wal: one page 9,000 times",
        with_log(lambda page: log(*[(1, 0, page)] * 8_999, (1, 99, page))),
        WHOLE,
        "",
    ),
)

ALL = (*HOSTILE, *PACKED)
"""All hostile files."""
