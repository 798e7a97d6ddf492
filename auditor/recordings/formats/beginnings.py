"""What files are by their bytes, whatever they are called: recordings under other names, and archives that hold some.

A few blocks of each file are read, and nothing is unpacked.
"""

import re
from codecs import getincrementaldecoder
from collections.abc import Iterator
from io import SEEK_END
from pathlib import Path, PurePosixPath
from typing import IO

from auditor.recordings.formats.mcap_records import MAGIC as MAGIC_OF_MCAP
from auditor.recordings.formats.part_names import BAG, DB3, MCAP, file_kind
from auditor.recordings.formats.rosbag1 import MAGIC as MAGIC_OF_BAGS

_MAGIC_OF_SQLITE = b"SQLite format 3\0"
_TABLES = re.compile(
    rb"CREATE TABLE topics\b.*CREATE TABLE messages\b|CREATE TABLE messages\b.*CREATE TABLE topics\b", re.S
)
_FIRST_PAGE_BYTES = 65536  # the largest page of SQLite; its first one has the tables

_MAGIC_OF_ZIP = b"PK\3\4"
_ENTRY_OF_ZIP = b"PK\1\2"
_NAME_IN_ENTRY = slice(28, 30)
_ENTRY_BYTES = 46
_DIRECTORY_BYTES = 2**20  # of the end of a zip, where its directory lies: it bounds the work

_TAR_BLOCK = 512
_MOST_MEMBERS = 1000  # of a tar, whose headers lie between its files: it bounds the work

_TEXT_BYTES = 4096  # so much of a file's beginning says whether it is text


def kind_by_bytes(opened: IO[bytes]) -> str:
    """.mcap, .bag or .db3 where an open file begins as one of them does; empty otherwise. Raises OSError."""
    opened.seek(0)
    beginning = opened.read(_TAR_BLOCK)
    if beginning.startswith(MAGIC_OF_MCAP):
        return MCAP
    if beginning.startswith(MAGIC_OF_BAGS):
        return BAG
    is_database = beginning.startswith(_MAGIC_OF_SQLITE)
    return DB3 if is_database and _TABLES.search(beginning + opened.read(_FIRST_PAGE_BYTES)) else ""


def recordings_in_archive(opened: IO[bytes]) -> tuple[str, ...]:
    """The names of the recordings that an open zip or tar holds, as far as it is looked at. Raises OSError."""
    opened.seek(0)
    listed = _names_in_zip if opened.read(_TAR_BLOCK).startswith(_MAGIC_OF_ZIP) else _names_in_tar
    return tuple(name for name in map(_last_part, listed(opened)) if file_kind(Path(name)))


def is_text(opened: IO[bytes]) -> bool:
    """Whether an open file begins with text, as no recording does, whole or in part, packed or not. Raises OSError."""
    opened.seek(0)
    beginning = opened.read(_TEXT_BYTES)
    decoder = getincrementaldecoder("utf-8")()
    try:
        return "\0" not in decoder.decode(beginning) and bool(beginning)
    except UnicodeDecodeError:
        return False


def _last_part(name: bytes) -> str:
    return PurePosixPath(name.decode("utf-8", "replace")).name


def _names_in_zip(opened: IO[bytes]) -> Iterator[bytes]:
    opened.seek(max(0, opened.seek(0, SEEK_END) - _DIRECTORY_BYTES))
    _, *entries = opened.read(_DIRECTORY_BYTES).split(_ENTRY_OF_ZIP)
    for entry in (_ENTRY_OF_ZIP + one for one in entries):
        length = int.from_bytes(entry[_NAME_IN_ENTRY], "little")
        yield entry[_ENTRY_BYTES : _ENTRY_BYTES + length]


def _names_in_tar(opened: IO[bytes]) -> Iterator[bytes]:
    place = 0
    for _ in range(_MOST_MEMBERS):
        opened.seek(place)
        head = opened.read(_TAR_BLOCK)
        size = re.match(rb"[0-7]+", head[124:136])
        if head[257:262] != b"ustar" or size is None:
            return
        yield head[:100].partition(b"\0")[0]
        place += _TAR_BLOCK + -(-int(size[0], 8) // _TAR_BLOCK) * _TAR_BLOCK
