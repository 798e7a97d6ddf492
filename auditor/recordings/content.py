"""The content of a recording's files: hashed as it is first read, and compared at every later read.

What is measured is filed under the hash of the recording. A file may be replaced, overwritten or cut while it is read,
so a later read takes nothing on trust: each block is hashed again before any of its bytes is used. The hash of the
whole is finished when it is asked for, with the blocks that nobody has read.
"""

import errno
import hashlib
import os
import stat
from collections.abc import Iterable
from io import SEEK_CUR, SEEK_END, SEEK_SET, BufferedReader, FileIO, RawIOBase
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from auditor.errors import RecordingError

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

_BLOCK_BYTES = 1 << 20
_MAX_BLOCKS = 1 << 16
"""Larger files have larger blocks: what is kept of a block takes 0.3 kB, so that no file takes more than 20 MB."""

_MOST_SKIPPED = 8
"""So many blocks that a reader passes over are hashed at once; of one that jumps farther its block alone."""

_KEPT_BLOCKS = 4
_BUFFER_BYTES = 1 << 18
_SMALL_BUFFER_BYTES = 1 << 16


def open_regular(path: Path) -> FileIO:
    """A file for reading. Raises OSError, also for pipes, sockets and devices: to open or read one may wait forever."""
    file = FileIO(path, opener=lambda name, flags: os.open(name, flags | os.O_NONBLOCK))
    if not stat.S_ISREG(os.fstat(file.fileno()).st_mode):
        file.close()
        raise OSError(errno.EINVAL, "it is no regular file")
    return file


class ChangedError(RecordingError):
    """A file that is no longer what it was when it was opened."""

    def __init__(self, path: Path) -> None:
        problem = "the file changed while it was read: nothing of this is kept"
        super().__init__(problem, where=path, remedy="scan it again when it is finished")


class FileContent:
    """One file as it was when it was first read: its size, its sha256, and what proves each block of it.

    Of each block are kept the state of the hash before it and the digest behind it. So one sha256 over the file serves
    all of them, and a block with that digest after that state is the block that was hashed. A block far ahead of those
    that were hashed, as a file's ending is, has a digest of its own until it is its turn, and must be the same then.
    """

    __slots__ = ("_ahead", "_block_bytes", "_blocks", "_digests", "_identity", "_states", "_whole", "path", "size")

    def __init__(self, path: Path) -> None:
        """Note a file as it is. Raises RecordingError where it cannot be read."""
        self.path = path
        self._digests = bytearray()
        self._states: list[hashlib._Hash] = []
        self._ahead: dict[int, bytes] = {}
        self._whole = hashlib.sha256()
        try:
            with open_regular(path) as file:
                status = os.fstat(file.fileno())
        except OSError as error:
            raise unreadable(path, error) from error
        self._identity = _identity(status)
        self.size = status.st_size
        self._block_bytes = max(_BLOCK_BYTES, -(-self.size // _MAX_BLOCKS))
        self._blocks = max(-(-self.size // self._block_bytes), 1)

    @property
    def sha256(self) -> str:
        """The sha256 (hex) of the file. Raises ChangedError, and RecordingError where it cannot be read."""
        if len(self._states) < self._blocks:
            try:
                with self._opened() as file:
                    self._hash_up_to(file.fileno(), self._blocks)
            except OSError as error:
                raise unreadable(self.path, error) from error
            self.check_unchanged()
        return self._digests[-self._whole.digest_size :].hex()

    def open(self) -> BinaryIO:
        """The file for reading. A read raises ChangedError where the file is not what was hashed, and OSError."""
        return BufferedReader(_ProvenReader(self, self._opened()), _BUFFER_BYTES)

    def read(self) -> bytes:
        """All of a small file. Raises ChangedError and OSError."""
        with self._opened() as file:
            return b"".join(self.block(file.fileno(), number) for number in range(self._blocks))

    def _opened(self) -> FileIO:
        file = open_regular(self.path)
        if _identity(os.fstat(file.fileno())) != self._identity:
            file.close()
            raise ChangedError(self.path)
        return file

    def block(self, descriptor: int, number: int) -> bytes:
        """One block, read anew. Raises ChangedError where it is not what was hashed, and OSError."""
        if len(self._states) < number <= len(self._states) + _MOST_SKIPPED:
            self._hash_up_to(descriptor, number)
        data = self._read(descriptor, number)
        if number == len(self._states):
            self._hash(data)
        elif number > len(self._states):
            digest = hashlib.sha256(data).digest()
            if self._ahead.setdefault(number, digest) != digest:
                raise ChangedError(self.path)
        else:
            after = self._states[number].copy()
            after.update(data)
            length = after.digest_size
            if after.digest() != self._digests[number * length : (number + 1) * length]:
                raise ChangedError(self.path)
        return data

    def _read(self, descriptor: int, number: int) -> bytes:
        start = number * self._block_bytes
        length = min(self._block_bytes, self.size - start)
        data = _pread(descriptor, start, length)
        if len(data) != length:
            raise ChangedError(self.path)
        return data

    def _hash_up_to(self, descriptor: int, number: int) -> None:
        """Hash the blocks before one that are not hashed yet."""
        for block in range(len(self._states), number):
            self._hash(self._read(descriptor, block))

    def _hash(self, data: bytes) -> None:
        """Hash the next block, which must be what was read of it before."""
        before = self._ahead.pop(len(self._states), None)
        if before is not None and hashlib.sha256(data).digest() != before:
            raise ChangedError(self.path)
        self._states.append(self._whole.copy())
        self._whole.update(data)
        self._digests += self._whole.digest()

    def place(self, offset: int) -> tuple[int, int]:
        """The number of the block that has an offset, and how far the offset lies behind the block's start."""
        return divmod(offset, self._block_bytes)

    def check_unchanged(self) -> None:
        """Raise ChangedError where the path leads to another file by now, or to one that was written to."""
        try:
            now = _identity(self.path.stat())
        except OSError as error:
            raise ChangedError(self.path) from error
        if now != self._identity:
            raise ChangedError(self.path)


class UnprovenFile:
    """A file as it is now. What is learnt of it decides which files are opened together, and is never stored."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.size = path.stat().st_size

    def open(self) -> BinaryIO:
        """The file for reading. Raises OSError."""
        return BufferedReader(open_regular(self.path), _SMALL_BUFFER_BYTES)


class Contents:
    """The files of one recording, each as it was when it was first asked for."""

    def __init__(self) -> None:
        self._files: dict[Path, FileContent] = {}

    def of(self, path: Path) -> FileContent:
        """A file. Raises RecordingError where it cannot be read."""
        if path not in self._files:
            self._files[path] = FileContent(path)
        return self._files[path]

    def recording_id(self, path: Path, files: Iterable[Path]) -> str:
        """sha256 (hex) of a file; of a folder, or a file and its journal, of sorted relative paths and files' hashes.

        Raises RecordingError where a file cannot be read.
        """
        files = tuple(files)
        if files == (path,):
            return self.of(path).sha256
        folder = path if path.is_dir() else path.parent
        whole = hashlib.sha256()
        for name, file in sorted((file.relative_to(folder).as_posix(), file) for file in files):
            whole.update(f"{self.of(file).sha256}  {name}\n".encode("utf-8", "surrogateescape"))
        return whole.hexdigest()

    def check_unchanged(self) -> None:
        """Raise ChangedError where a file is not what it was when it was hashed."""
        for content in self._files.values():
            content.check_unchanged()


class _ProvenReader(RawIOBase):
    """A file of which no byte is given that was not hashed before."""

    def __init__(self, content: FileContent, file: FileIO) -> None:
        self._content = content
        self._file = file
        self._position = 0
        self._blocks: dict[int, bytes] = {}

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = SEEK_SET, /) -> int:
        self._position = offset + {SEEK_SET: 0, SEEK_CUR: self._position, SEEK_END: self._content.size}[whence]
        return self._position

    def readinto(self, buffer: "WriteableBuffer", /) -> int:
        if self._position >= self._content.size:
            return 0
        target = memoryview(buffer).cast("B")
        number, start = self._content.place(self._position)
        piece = memoryview(self._block(number))[start : start + len(target)]
        target[: len(piece)] = piece
        self._position += len(piece)
        return len(piece)

    def close(self) -> None:
        self._file.close()
        self._blocks.clear()
        super().close()

    def _block(self, number: int) -> bytes:
        block = self._blocks.pop(number, None)
        if block is None:
            block = self._content.block(self._file.fileno(), number)
        self._blocks[number] = block  # the last one used stands last
        if len(self._blocks) > _KEPT_BLOCKS:
            del self._blocks[next(iter(self._blocks))]
        return block


def unreadable(path: Path, error: OSError) -> RecordingError:
    """The error for a file or folder that cannot be read."""
    return RecordingError(f"it cannot be read ({error.strerror or error})", where=path)


def _identity(status: os.stat_result) -> tuple[int, ...]:
    """What changes when a file is replaced or written to, also where its time of modification was set back."""
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns


def _pread(descriptor: int, offset: int, length: int) -> bytes:
    """The bytes at an offset, fewer at the end of the file."""
    pieces = [os.pread(descriptor, length, offset)]
    while pieces[-1] and (missing := length - sum(map(len, pieces))) > 0:
        pieces.append(os.pread(descriptor, missing, offset + length - missing))
    return b"".join(pieces)
