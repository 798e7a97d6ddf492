"""Where the frames of zstd data end: writers that work in parallel or append put several one after the other.

Format: RFC 8878, section 3.1. The package `zstandard` tells the size of the first frame alone, and takes data that are
cut inside a later one for whole.
"""

from typing import IO, NamedTuple

import zstandard

_MAGIC = 0xFD2FB528
_SKIPPABLE = 0x184D2A50
_MOST_HEAD_BYTES = 18
_RLE_BLOCK = 1


class Frames(NamedTuple):
    """The unpacked size of all frames together, None where one does not declare its own; `whole` is False if cut."""

    size: int | None
    whole: bool


class FrameWalk:
    """Walks over the frames of zstd data, of which it reads the heads alone, and over at most `most_blocks` blocks."""

    def __init__(self, packed: IO[bytes], length: int, most_blocks: int) -> None:
        self._packed = packed
        self._length = length
        self._blocks_left = most_blocks

    def frames(self) -> Frames:
        """The frames from the start. Raises zstandard.ZstdError where anything else lies among them."""
        position, sizes = 0, list[int | None]()
        while position < self._length:
            head = self._read(position, _MOST_HEAD_BYTES)
            magic = int.from_bytes(head[:4], "little")
            if len(head) < 8:
                position = self._length + 1
            elif magic & 0xFFFFFFF0 == _SKIPPABLE:
                position += 8 + int.from_bytes(head[4:8], "little")
            elif magic == _MAGIC:
                found = zstandard.get_frame_parameters(head)
                sizes.append(found.content_size if found.content_size < zstandard.CONTENTSIZE_ERROR else None)
                position = self._end_of_blocks(position + zstandard.frame_header_size(head)) + 4 * found.has_checksum
            else:
                raise zstandard.ZstdError("its frames are followed by other data")
        known = [size for size in sizes if size is not None]
        return Frames(sum(known) if len(known) == len(sizes) else None, whole=position == self._length)

    def _end_of_blocks(self, position: int) -> int:
        """Where the blocks of a frame end; behind the end of the data where they are cut."""
        last = False
        while not last and position <= self._length:
            if not self._blocks_left:
                raise zstandard.ZstdError("it has too many blocks")
            self._blocks_left -= 1
            head = int.from_bytes(self._read(position, 3), "little")
            last, kind, size = bool(head & 1), head >> 1 & 3, head >> 3
            position += 3 + (1 if kind == _RLE_BLOCK else size)
        return position

    def _read(self, position: int, count: int) -> bytes:
        self._packed.seek(position)
        return self._packed.read(count)
