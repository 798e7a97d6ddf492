"""Pages that a SQLite write-ahead log (`-wal`) holds newer than its database.

A recorder that crashed leaves its last writes there. Frames are used up to the last commit with correct
checksums, as by SQLite itself. Format: the SQLite database file format, section 4.

SQLite would recover the log by itself when it opens the database. It is not used because it writes for that: an index
file beside the recording, and the log's pages into the database as the last connection closes. A recording is evidence
and is opened for reading only.
"""

import struct
from collections.abc import Iterator, Mapping
from functools import cache
from itertools import islice
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

ENDING = "-wal"

_HEADER = struct.Struct(">IIIIIIII")
_FRAME = struct.Struct(">IIIIII")
_MAGIC = 0x377F0682
_SUMMED_HEADER_BYTES = 24
_SUMMED_FRAME_BYTES = 8
_PAGE_SIZES = {2**power for power in range(9, 17)}
_MAX_FRAMES = 500_000
_WORD = 2**32

Sums = tuple[int, int]


class Journal(NamedTuple):
    """The pages that a write-ahead log adds to its database.

    `pages` gives by page number the offset in the log of the newest content of a page; `page_count` is the number of
    pages that the database then has; `problem` says which part of the log was left out, empty for none.
    """

    page_bytes: int
    pages: Mapping[int, int]
    page_count: int
    problem: str


def read_journal(file: IO[bytes], size: int) -> Journal | None:
    """The committed pages of a log; None where there is none. Raises OSError."""
    file.seek(0)
    header = file.read(_HEADER.size)
    if len(header) < _HEADER.size:
        return None
    magic, _, page_bytes, _, salt0, salt1, sum0, sum1 = _HEADER.unpack(header)
    order = ">" if magic & 1 else "<"
    if magic & ~1 != _MAGIC or page_bytes not in _PAGE_SIZES:
        return None
    if _sums(header[:_SUMMED_HEADER_BYTES], order, (0, 0)) != (sum0, sum1):
        return None
    frames = _Frames(file, page_bytes, order, (salt0, salt1), (sum0, sum1))
    committed: dict[int, int] = {}
    pending: dict[int, int] = {}
    page_count = 0
    for number, commit, offset in islice(frames.whole(), _MAX_FRAMES):
        pending[number] = offset
        if commit:
            committed.update(pending)
            pending.clear()
            page_count = commit
    problems = [frames.problem] if frames.problem else []
    if pending:
        problems.append(f"{len(pending)} pages behind its last commit are left out")
    if frames.count >= _MAX_FRAMES and frames.offset < size:
        problems.append(f"it has more than {_MAX_FRAMES} pages: the rest is left out")
    return Journal(page_bytes, committed, page_count, "; ".join(problems))


class _Frames:
    """The frames of a log, each a page."""

    def __init__(self, file: IO[bytes], page_bytes: int, order: str, salts: Sums, sums: Sums) -> None:
        self._file = file
        self._page_bytes = page_bytes
        self._order = order
        self._salts = salts
        self._sums = sums
        self.offset = _HEADER.size
        self.count = 0
        self.problem = ""

    def whole(self) -> Iterator[tuple[int, int, int]]:
        """Page number, pages after its commit (0: none) and offset of its content, up to the first bad frame."""
        length = _FRAME.size + self._page_bytes
        while frame := self._file.read(length):
            if len(frame) < length:
                self.problem = f"it is cut at byte {self.offset}"
                return
            number, commit, *checked = _FRAME.unpack_from(frame)
            if tuple(checked[:2]) != self._salts:
                return  # left from an earlier use of the log
            self._sums = _sums(frame[:_SUMMED_FRAME_BYTES] + frame[_FRAME.size :], self._order, self._sums)
            if self._sums != tuple(checked[2:]):
                self.problem = f"its checksum is wrong at byte {self.offset}: the rest is left out"
                return
            start = self.offset + _FRAME.size
            self.offset += length
            self.count += 1
            yield number, commit, start


def _sums(data: bytes, order: str, before: Sums) -> Sums:
    """SQLite's checksum, continued from that of the bytes before.

    Each pair of words (a, b) makes s0 += a + s1, then s1 += b + s0: a linear step M s + (a, a + b), so that n of them
    are one sum over the powers of M, modulo 2^32.
    """
    a, b = np.frombuffer(data, f"{order}u4").astype(np.uint32).reshape(-1, 2).T
    top, off, low = _powers(len(a))
    s0 = int((top[1:] * a + off[1:] * (a + b)).sum(dtype=np.uint32)) + int(top[0]) * before[0] + int(off[0]) * before[1]
    s1 = int((off[1:] * a + low[1:] * (a + b)).sum(dtype=np.uint32)) + int(off[0]) * before[0] + int(low[0]) * before[1]
    return s0 % _WORD, s1 % _WORD


@cache
def _powers(n: int) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.uint32]]:
    """The elements (0, 0), (0, 1) = (1, 0) and (1, 1) of M^n, M^(n-1) .. M^0 for M = ((1, 1), (1, 2))."""
    powers = [(1, 0, 1)]
    for _ in range(n):
        top, off, low = powers[-1]
        powers.append(((top + off) % _WORD, (off + low) % _WORD, (off + 2 * low) % _WORD))
    top, off, low = np.array(powers[::-1], np.uint32).T
    return top, off, low
