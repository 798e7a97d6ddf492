"""Zips that somebody else made: their whole directory is checked before a byte of a member is read.

A zip can show one program other files than the next: by two members of one name, by a name that a file system takes for
another, by bytes that only one of them reads. None of that is needed, so all of it is refused.
"""

import stat
import struct
import unicodedata
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from io import SEEK_END
from pathlib import Path, PurePosixPath
from typing import IO
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile, ZipInfo

from auditor.safety.budget import Budget, OverBudgetError, Spending

_END, _END64, _PLACE64 = (struct.Struct(form) for form in ("<4s4H2LH", "<4sQ2H2L4Q", "<4sLQL"))
_LOCAL = struct.Struct("<26x2H")
_EXTRA = struct.Struct("<2H")
_ENTRY_BYTES = 46 + 256
"""Of a member in the directory, with a name and fields that are long ones."""
_ENCRYPTED = 0x1 | 0x40 | 0x2000
_MS_DOS_FOLDER = 0x10
_OTHER_NAME = 0x7075
"""An extra field by which a member has a second name, which some programs use."""


class UnsafeZipError(Exception):
    """Why a zip is not read, as a sentence."""


@contextmanager
def opened(file: Path | IO[bytes], budget: Budget) -> Iterator[ZipFile]:
    """A zip whose directory is as it should be and whose sizes are within a budget.

    Reading a member stops at its declared size. Raises UnsafeZipError where it is no such zip, and OSError.
    """
    try:
        source = file.open("rb") if isinstance(file, Path) else file
        with source:
            _check_directory_size(source, budget)
            with ZipFile(source) as archive:
                check(archive.infolist(), budget)
                if sum(member.compress_size for member in archive.infolist()) > source.seek(0, SEEK_END):
                    raise UnsafeZipError("its members share their bytes")
                yield archive
    except (BadZipFile, EOFError, NotImplementedError, zlib.error) as error:
        raise UnsafeZipError(f"it is no whole zip ({error})") from error


def check_file(file: Path | IO[bytes], budget: Budget) -> None:
    """Check a zip that another library will read. Raises UnsafeZipError as `opened` does, and OSError."""
    with opened(file, budget):
        pass


def check(members: Sequence[ZipInfo], budget: Budget) -> None:
    """Raise UnsafeZipError for the first member that is not as it should be, or is over the budget."""
    spending, by_name = Spending(budget), dict[str, ZipInfo]()
    for member in members:
        shown = ascii(member.orig_filename[:100])
        if reason := _odd(member):
            raise UnsafeZipError(f"its member {shown} {reason}")
        key = _as_a_file_system_might(member.filename)
        if key in by_name:
            raise UnsafeZipError(f"its member {shown} has the name of another, {by_name[key].filename[:100]!a}")
        by_name[key] = member
        try:
            spending.allow(member.compress_size, member.file_size)
        except OverBudgetError as error:
            raise UnsafeZipError(f"its member {shown} {error}") from error
    for folder in {str(above) for key in by_name for above in PurePosixPath(key).parents}:
        if folder in by_name and not by_name[folder].is_dir():
            raise UnsafeZipError(f"its member {by_name[folder].filename[:100]!a} is a file that has files in it")


def check_tiled(archive: ZipFile) -> None:
    """Raise UnsafeZipError unless the members follow one another, with nothing before, between or behind them.

    Programs that read from the front would find there what the directory does not name.
    """
    file = archive.fp
    assert file is not None
    place = 0
    for member in sorted(archive.infolist(), key=lambda one: one.header_offset):
        file.seek(member.header_offset)
        name_bytes, extra_bytes = _LOCAL.unpack(file.read(_LOCAL.size))
        if member.header_offset != place:
            raise UnsafeZipError(f"before its member {member.filename[:100]!a} are bytes that belong to none")
        place += _LOCAL.size + name_bytes + extra_bytes + member.compress_size
    if archive.start_dir != place:
        raise UnsafeZipError("behind its last member are bytes that belong to none")


def _odd(member: ZipInfo) -> str:
    """What is wrong with one member by itself; empty where nothing is."""
    name, kind = member.filename, stat.S_IFMT(member.external_attr >> 16)
    folder = kind == stat.S_IFDIR or bool(member.external_attr & _MS_DOS_FOLDER)
    parts = name.removesuffix("/").split("/")
    reasons = {
        "has a name that systems read in different ways": (
            member.orig_filename != name or "\\" in name or ":" in parts[0] or not name.isprintable()
        ),
        "leads out of its folder": any(part.rstrip(". ") == "" for part in parts),
        "is a link or a device": kind not in (0, stat.S_IFREG, stat.S_IFDIR),
        "is a folder and a file at once": (
            folder != name.endswith("/") or (folder and (member.file_size > 0 or kind == stat.S_IFREG))
        ),
        "is encrypted": bool(member.flag_bits & _ENCRYPTED),
        "is neither stored nor deflated": member.compress_type not in (ZIP_STORED, ZIP_DEFLATED),
        "is stored and has two sizes": (
            member.compress_type == ZIP_STORED and member.compress_size != member.file_size
        ),
        "has a second name": _OTHER_NAME in _extra_fields(member.extra),
    }
    return next((reason for reason, holds in reasons.items() if holds), "")


def _as_a_file_system_might(name: str) -> str:
    """A name without what some file systems overlook: case, forms of Unicode, and dots and blanks at an end."""
    plain = unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", name).casefold())
    return "/".join(part.rstrip(". ") for part in plain.removesuffix("/").split("/"))


def _extra_fields(extra: bytes) -> Iterator[int]:
    while len(extra) >= _EXTRA.size:
        kind, size = _EXTRA.unpack_from(extra)
        yield kind
        extra = extra[_EXTRA.size + size :]


def _check_directory_size(file: IO[bytes], budget: Budget) -> None:
    """The directory is read as a whole: it may be no larger than that of so many members."""
    at = file.seek(0, SEEK_END) - _END.size
    file.seek(max(at, 0))
    end = file.read()
    if at < 0 or end[:4] != b"PK\5\6":
        raise UnsafeZipError("it is no whole zip: it does not end with its directory")
    size = _END.unpack(end)[5]
    file.seek(max(at - _PLACE64.size - _END64.size, 0))
    before = file.read(min(at, _END64.size + _PLACE64.size))
    if before[-_PLACE64.size :][:4] == b"PK\6\7":
        if before[:4] != b"PK\6\6":
            raise UnsafeZipError("it is no whole zip: the end of its directory is not where it should be")
        size = _END64.unpack_from(before)[8]
    if budget.most_parts is not None and size > _ENTRY_BYTES * budget.most_parts:
        raise UnsafeZipError(f"its directory has {size} bytes, more than that of {budget.most_parts} members")
    file.seek(0)
