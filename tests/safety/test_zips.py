"""What zips of others may unpack to, and what their directories may hold."""

import io
import struct
from zipfile import ZIP_DEFLATED, ZipFile

import pytest

from auditor.safety.budget import Budget
from auditor.safety.zips import UnsafeZipError, check_file, opened

SMALL = Budget(10_000, total_bytes=20_000, free_bytes=1_000, most_ratio=10, most_parts=4)


def zipped(*sizes: int, method: int = ZIP_DEFLATED) -> io.BytesIO:
    file = io.BytesIO()
    with ZipFile(file, "w", method) as archive:
        for number, size in enumerate(sizes):
            archive.writestr(f"{number}", bytes(size))
    return file


@pytest.mark.parametrize(
    ("file", "says"),
    [
        (zipped(10_001, method=0), "declares 10001 unpacked bytes; at most 10000 are accepted"),
        (zipped(9_000, 9_000, 9_000, method=0), "the file has unpacked too much already"),
        (zipped(9_000), "the file has unpacked too much already"),
        (zipped(1, 1, 1, 1, 1), "is one of more than 4 parts"),
        (zipped(*[0] * 30), "its directory has"),
    ],
)
def test_what_a_zip_declares_is_compared_with_its_budget(file: io.BytesIO, says: str) -> None:
    with pytest.raises(UnsafeZipError, match=says):
        check_file(file, SMALL)


def test_within_the_budget_it_is_read() -> None:
    with opened(zipped(9_000, 9_000, method=0), SMALL) as archive:
        assert archive.read("1") == bytes(9_000)


def test_a_member_that_holds_more_than_it_declares_is_read_to_its_declared_size() -> None:
    """The directory and the member's own header say 10 bytes; 100 MB are packed."""
    content = bytearray(zipped(100_000_000).getvalue())
    directory = content.rindex(b"PK\1\2")
    for place in (directory + 24, 22):
        struct.pack_into("<L", content, place, 10)
    large = Budget(10, free_bytes=1 << 20)
    with pytest.raises(UnsafeZipError, match="Bad CRC"), opened(io.BytesIO(bytes(content)), large) as archive:
        archive.read("0")


@pytest.mark.parametrize("content", [b"", b"PK", b"PK\5\6" + bytes(17), b"no zip" * 100])
def test_what_is_no_zip_is_told_so(content: bytes) -> None:
    with pytest.raises(UnsafeZipError, match="it is no whole zip"):
        check_file(io.BytesIO(content), SMALL)


def test_a_member_without_a_name_is_told() -> None:
    file = io.BytesIO()
    with ZipFile(file, "w") as archive:
        archive.writestr("a", b"1")
    content = bytearray(file.getvalue())
    content[content.rindex(b"PK\1\2") + 46] = 0  # the name ends at a zero
    with pytest.raises(UnsafeZipError, match=r"its member .* (leads out of its folder|different ways)"):
        check_file(io.BytesIO(bytes(content)), SMALL)
