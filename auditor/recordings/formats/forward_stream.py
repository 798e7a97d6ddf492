"""A file that is read forward only, with an exact number of bytes at each read."""

import zlib
from typing import IO


class CutError(Exception):
    """The file ends inside a record; caught by the reading loop."""


class ForwardStream:
    """A file read forward only. With `checksum` it keeps the CRC of all bytes read or skipped."""

    def __init__(self, file: IO[bytes], size: int, *, checksum: bool = False) -> None:
        self._file = file
        self._checksum = checksum
        self.size = size
        self.offset = 0
        self.crc = 0

    def read(self, length: int) -> bytes:
        """Exactly `length` bytes. Raises CutError."""
        if self.offset + length > self.size:
            raise CutError
        data = self._file.read(length)
        self.offset += len(data)
        if len(data) < length:
            raise CutError
        if self._checksum:
            self.crc = zlib.crc32(data, self.crc)
        return data

    def skip_to(self, offset: int) -> None:
        """Move forward without keeping the bytes between. Raises CutError."""
        if not self._checksum:
            if offset > self.size:
                raise CutError
            self._file.seek(offset)
            self.offset = offset
            return
        while self.offset < offset:
            self.read(min(offset - self.offset, 1 << 20))
