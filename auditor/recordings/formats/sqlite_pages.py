"""The rows of a SQLite file, read page by page without running any of the SQL that the file carries.

A schema of a hostile file can hold generated columns and views that take any time and memory; a damaged page ends every
query. A recorder that crashed leaves its last writes in a write-ahead log (`-wal`), whose frames are used up to the
last commit with correct checksums, as by SQLite itself. Format: the SQLite database file format, sections 1.3 (header),
1.6 (b-tree pages), 2.1 (records), 4 (write-ahead log).

Python's `sqlite3` would give the same rows in one query. It is not used because it runs the SQL of the file's views and
generated columns, because one damaged page ends the query, and because it writes to recover the log: a recording is
evidence and is opened for reading only. This reader checks every size before it allocates, and goes on behind a damaged
page.
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
_PAGE_SIZES = tuple(2**power for power in range(9, 17))
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


MAGIC = b"SQLite format 3\0"
LEAF, INTERIOR = 0x0D, 0x05
_HEADER_BYTES = 100
_USUAL_PAGE_SIZE = 4096
_UINT16 = struct.Struct(">H")
_UINT32 = struct.Struct(">I")
_INTEGER_BYTES = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8, 7: 8, 8: 0, 9: 0, 0: 0}
_KINDS = "niiiiiifii"
_FLOAT = 7
_MAX_COLUMNS = 64
_MAX_DEPTH = 20
MAX_TEXT_BYTES = 2**20

Value = int | str | bytes | None


class BadPageError(Exception):
    """Why a page or row is left out; caught by the reading loop."""


class ValuePlace(NamedTuple):
    """Where a value lies in its row: serial type, first byte, length."""

    serial: int
    start: int
    length: int


class TableRow(NamedTuple):
    """A row of a table: its number, its columns, the part that lies in the page, and where the rest begins."""

    number: int
    columns: tuple[ValuePlace, ...]
    local: bytes
    overflow: int

    @property
    def kinds(self) -> str:
        """One letter a column: n NULL, i integer, f float, t text, b bytes."""
        return "".join(_KINDS[c.serial] if c.serial < 12 else "bt"[c.serial % 2] for c in self.columns)


class Pages:
    """The pages of one file, those in its write-ahead log before its own."""

    def __init__(
        self, file: IO[bytes], size: int, journal: Journal | None = None, journal_file: IO[bytes] | None = None
    ) -> None:
        self._file = file
        self._journal_file = journal_file
        self._newer = journal.pages if journal else {}
        self.size = size
        first = self._newer.get(1)
        if journal_file is not None and first is not None:
            header = _read(journal_file, first, _HEADER_BYTES)
        else:
            header = _read(file, 0, _HEADER_BYTES) if size >= _HEADER_BYTES else b""
        self.has_header = header.startswith(MAGIC)
        declared = _UINT16.unpack_from(header, 16)[0] if header else 0
        declared = 2**16 if declared == 1 else declared
        self.page_bytes = declared if self.has_header and declared in _PAGE_SIZES else _USUAL_PAGE_SIZE
        reserved = header[20] if self.has_header else 0
        self._usable = self.page_bytes - (reserved if reserved <= 32 else 0)
        self._own_count = size // self.page_bytes
        self.count = self._own_count
        self._declared_count = _UINT32.unpack_from(header, 28)[0] if self.has_header else 0
        if journal and journal.page_count:
            self._declared_count = journal.page_count
            self.count = min(journal.page_count, self._own_count + len(self._newer))
        self._most_row_bytes = self.count * self.page_bytes

    @property
    def is_cut(self) -> bool:
        """True where the header declares more pages than there are."""
        missing = self._declared_count > self.count
        return missing or any(page not in self._newer for page in range(self._own_count + 1, self._declared_count + 1))

    def offset(self, number: int) -> int:
        """The offset at which page `number` (from 1) begins."""
        return (number - 1) * self.page_bytes

    def kind(self, number: int) -> int:
        """The type of a page. Raises BadPageError where it does not exist."""
        return self._page(number)[_head_at(number)]

    def leaves(self, root: int, bad: list[int]) -> Iterator[int]:
        """The leaf pages of a table in the order of their rows; those that cannot be read are added to `bad`."""
        seen: set[int] = set()
        stack = [(root, 0)]
        while stack:
            number, depth = stack.pop()
            try:
                children = self._children(number)
            except BadPageError:
                bad.append(number)
                continue
            if number in seen or depth > _MAX_DEPTH:
                bad.append(number)
                continue
            seen.add(number)
            if children is None:
                yield number
            else:
                stack.extend((child, depth + 1) for child in reversed(children))

    def end_leaf(self, root: int, *, last: bool) -> int | None:
        """The first or last leaf page of a table; None where it cannot be reached."""
        number = root
        for _ in range(_MAX_DEPTH):
            try:
                children = self._children(number)
            except BadPageError:
                return None
            if children is None:
                return number
            number = children[-1 if last else 0]
        return None

    def _children(self, number: int) -> list[int] | None:
        """The pages below an interior page; None for a leaf. Raises BadPageError for any other."""
        page, head = self._page(number), _head_at(number)
        if page[head] == LEAF:
            return None
        if page[head] != INTERIOR:
            raise BadPageError("not a page of a table")
        pointers = self._pointers(page, head, 12)
        children = [_UINT32.unpack_from(page, pointer)[0] for pointer in pointers]
        return [*children, _UINT32.unpack_from(page, head + 8)[0]]

    def rows(self, number: int) -> Iterator[TableRow | None]:
        """The rows of a leaf page, None for one that is ill-formed. Raises BadPageError where it is not a leaf."""
        page, head = self._page(number), _head_at(number)
        if page[head] != LEAF:
            raise BadPageError("not a leaf of a table")
        for pointer in self._pointers(page, head, 8):
            try:
                yield self._row(page, pointer)
            except (BadPageError, IndexError):
                yield None

    def value(self, row: TableRow, column: int, most_bytes: int = MAX_TEXT_BYTES) -> Value:
        """One value of a row. Raises BadPageError where its bytes are not there, or are more than accepted."""
        serial, start, length = row.columns[column]
        if length > most_bytes:
            raise BadPageError("a value that is too large")
        end = start + length
        data = row.local[start:end]
        if end > len(row.local):
            data = self._overflowing(row, start, end)
        if serial >= 12:
            return data if serial % 2 == 0 else data.decode("utf-8", "replace")
        if serial in {8, 9}:
            return serial - 8
        return None if serial in {0, _FLOAT} else int.from_bytes(data, "big", signed=True)

    def _page(self, number: int) -> bytes:
        page = self._block(number, 1) if 1 <= number <= self.count else b""
        if len(page) < self.page_bytes:
            raise BadPageError("beyond the end of the file")
        return page

    def _block(self, number: int, count: int) -> bytes:
        """Consecutive pages, in one read where the log has none of them."""
        if not self._newer or self._journal_file is None:
            return _read(self._file, self.offset(number), count * self.page_bytes)
        return b"".join(
            _read(self._journal_file, newer, self.page_bytes)
            if (newer := self._newer.get(page)) is not None
            else _read(self._file, self.offset(page), self.page_bytes)
            for page in range(number, number + count)
        )

    def _pointers(self, page: bytes, head: int, header_bytes: int) -> list[int]:
        """The offsets at which the cells of a page begin."""
        (count,) = _UINT16.unpack_from(page, head + 3)
        start = head + header_bytes
        if start + 2 * count > len(page):
            raise BadPageError("more cells than fit")
        return [p for (p,) in _UINT16.iter_unpack(page[start : start + 2 * count]) if p <= len(page) - 4]

    def _row(self, page: bytes, pointer: int) -> TableRow:
        size, position = _varint(page, pointer)
        number, position = _varint(page, position)
        most = self._usable - 35
        local = size
        if size > most:
            least = (self._usable - 12) * 32 // 255 - 23
            local = least + (size - least) % (self._usable - 4)
            local = local if local <= most else least
        end = position + local
        if end + (4 if local < size else 0) > len(page) or size > self._most_row_bytes:
            raise BadPageError("a row beyond its page")
        overflow = _UINT32.unpack_from(page, end)[0] if local < size else 0
        inside = page[position:end]
        return TableRow(number, _columns(inside, size), inside, overflow)

    def _overflowing(self, row: TableRow, start: int, end: int) -> bytes:
        """The bytes of a row that do not fit into its page. Raises BadPageError where the chain of pages breaks off."""
        data = bytearray(row.local)
        following, inside = row.overflow, self._usable - 4
        jumps: set[int] = set()
        while len(data) < end:
            if not 1 <= following <= self.count or following in jumps:
                raise BadPageError("a row whose end is missing")
            # Recorders write these pages one behind the other: read them at once, and check the pointer of each.
            jumps.add(following)
            wanted = min(-(-(end - len(data)) // inside), self.count - following + 1)
            block = self._block(following, wanted)
            if len(block) < wanted * self.page_bytes:
                raise BadPageError("a row whose end is missing")
            for place in range(wanted):
                at = place * self.page_bytes
                data += block[at + 4 : at + self._usable]
                (pointer,) = _UINT32.unpack_from(block, at)
                if pointer != following + 1:
                    following = pointer
                    break
                following = pointer
        return bytes(data[start:end])


def _read(file: IO[bytes], offset: int, length: int) -> bytes:
    file.seek(offset)
    return file.read(length)


def _head_at(number: int) -> int:
    return _HEADER_BYTES if number == 1 else 0


def _columns(local: bytes, size: int) -> tuple[ValuePlace, ...]:
    header_bytes, position = _varint(local, 0)
    if header_bytes > len(local) or header_bytes > 9 * _MAX_COLUMNS:
        raise BadPageError("a row whose header is cut")
    columns = []
    start = header_bytes
    while position < header_bytes:
        serial, position = _varint(local, position)
        length = (serial - 12) // 2 if serial >= 12 else _INTEGER_BYTES.get(serial, -1)
        if length < 0 or start + length > size:
            raise BadPageError("a row that holds more than its size")
        columns.append(ValuePlace(serial, start, length))
        start += length
    return tuple(columns)


def _varint(data: bytes, position: int) -> tuple[int, int]:
    value = 0
    for place in range(9):
        byte = data[position + place]
        if place == 8:
            return value << 8 | byte, position + 9
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, position + place + 1
    raise AssertionError("unreachable")
