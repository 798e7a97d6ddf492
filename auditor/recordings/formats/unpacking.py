"""Unpacking compressed chunks and files without trusting what they declare."""

import bz2
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from io import SEEK_END, BytesIO
from pathlib import Path
from shutil import disk_usage
from typing import IO, NamedTuple

import lz4.frame
import zstandard

from auditor.errors import RecordingError
from auditor.recordings.content import ChangedError, FileContent, UnprovenFile
from auditor.safety.budget import CHUNKS, MAX_BYTES, OverBudgetError, Spending

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
_STEP_BYTES = 1 << 20
_BUFFER_BYTES = 1 << 18
_MOST_STREAMS = 64
"""Streams of lz4 or bz2 data one after the other, behind the first: what follows each is copied."""

_MOST_BLOCKS_A_MESSAGE = 1 << 12
_MOST_BLOCKS_A_FILE = 1 << 22
"""Blocks of zstd data, which have up to 128 kB unpacked: those of half a terabyte."""

PACKED = frozenset({".zstd", ".zst"})
"""The endings that rosbag2 (compression mode `file`) and zstd itself add to the names of files that they compressed."""


class BadChunkError(Exception):
    """Why a chunk is left out; caught by the reading loop, which notes it with its offset and goes on."""


def allow(spending: Spending, packed: int, size: int) -> None:
    """Count a chunk or message. Raises BadChunkError where it is over the budget of its file."""
    try:
        spending.allow(packed, size)
    except OverBudgetError as error:
        raise BadChunkError(f"it {error}") from error


def unpack(compression: bytes, packed: memoryview, size: int) -> memoryview:
    """Unpack exactly `size` bytes. Raises BadChunkError where they are damaged, more or fewer."""
    if compression in {b"", b"none"}:
        records = packed
    elif compression == b"zstd":
        records = memoryview(_unpack_zstd(packed, size))
    elif compression in {b"lz4", b"bz2"}:
        records = memoryview(_unpack_stream(compression, packed, size))
    else:
        raise BadChunkError(f"its compression {compression[:20]!r} is unknown")
    if len(records) != size:
        raise BadChunkError(f"it declares {size} unpacked bytes and holds {len(records)}")
    return records


def unpack_beginning(compression: bytes, packed: memoryview, size: int) -> memoryview:
    """The content that a cut chunk still holds, at most `size` bytes: up to the cut, or up to the first damage."""
    if compression in {b"", b"none"}:
        return packed[:size]
    unpacked = bytearray()
    try:
        if compression == b"zstd":
            with _zstd_reader(packed) as reader:
                while piece := reader.read(min(_STEP_BYTES, size - len(unpacked))):
                    unpacked += piece
        elif compression in {b"lz4", b"bz2"}:
            unpacker = _stream_unpacker(compression)
            data: bytes | memoryview = packed
            while len(unpacked) < size and not unpacker.eof:
                piece = unpacker.decompress(data, min(_STEP_BYTES, size - len(unpacked)))
                if not piece and unpacker.needs_input:
                    break
                unpacked += piece
                data = b""
    except (zstandard.ZstdError, RuntimeError, OSError, EOFError):
        pass  # the bytes before the damage are kept
    return memoryview(unpacked)


def unpack_message(data: bytes, spending: Spending) -> bytes:
    """A message that rosbag2 compressed by itself (compression mode `message`), or any other as it is.

    CDR begins with a zero: it is never taken for zstd. Raises BadChunkError where it is damaged or unpacks to too much.
    """
    if data[: len(ZSTD_MAGIC)] != ZSTD_MAGIC:
        return data
    try:
        frames = FrameWalk(BytesIO(data), len(data), _MOST_BLOCKS_A_MESSAGE).frames()
    except zstandard.ZstdError as error:
        raise BadChunkError(f"its zstd data are damaged ({error})") from error
    if not frames.whole:
        raise BadChunkError("its zstd data are cut")
    if frames.size is None:
        raise BadChunkError("its zstd frame does not declare its size")
    allow(spending, len(data), frames.size)
    return _unpack_zstd(memoryview(data), frames.size)


def unpack_file(source: IO[bytes], target: IO[bytes], most_bytes: int) -> str:
    """Unpack a zstd file as far as it is whole and within bounds; returns what was wrong, empty for nothing.

    The bounds are `most_bytes` and those of CHUNKS. Raises OSError.
    """
    packed_bytes = source.seek(0, SEEK_END)
    source.seek(0)
    most = min(most_bytes, CHUNKS.bound(packed_bytes))
    unpacked = 0
    try:
        frames = FrameWalk(source, packed_bytes, _MOST_BLOCKS_A_FILE).frames()
        source.seek(0)
        with _zstd_reader(source) as reader:
            while piece := reader.read(min(_STEP_BYTES, most - unpacked)):
                unpacked += len(piece)
                target.write(piece)
                if unpacked == most:
                    return f"it would unpack to more than {most} bytes: the rest is left out"
    except zstandard.ZstdError as error:
        return f"its zstd data are damaged ({error}) behind {unpacked} unpacked bytes"
    if not frames.whole or frames.size not in {None, unpacked}:
        of_all = f" of {frames.size}" if frames.size is not None and frames.size > unpacked else ""
        return f"its zstd data are cut behind {unpacked}{of_all} unpacked bytes"
    return ""


def _zstd_reader(packed: memoryview | IO[bytes]) -> zstandard.ZstdDecompressionReader:
    """The content of all frames, one after the other."""
    unpacker = zstandard.ZstdDecompressor(max_window_size=MAX_BYTES)
    return unpacker.stream_reader(packed, read_across_frames=True, closefd=False)


def _unpack_zstd(packed: memoryview, size: int) -> bytes:
    try:
        declared = zstandard.frame_content_size(packed)
        if declared > size:
            raise BadChunkError("its zstd frame declares another size than the chunk")
        if declared == size:
            with suppress(zstandard.ZstdError):
                unpacker = zstandard.ZstdDecompressor(max_window_size=MAX_BYTES)
                return unpacker.decompress(packed, max_output_size=size, allow_extra_data=False)
        # Of several frames, or of one that does not declare its size, no more than the chunk declares is unpacked.
        unpacked = bytearray()
        with _zstd_reader(packed) as reader:
            while piece := reader.read(min(_STEP_BYTES, size + 1 - len(unpacked))):
                unpacked += piece
        return bytes(unpacked)
    except zstandard.ZstdError as error:
        raise BadChunkError(f"its zstd data are damaged ({error})") from error


def _unpack_stream(compression: bytes, packed: memoryview, size: int) -> bytes:
    unpacker, records = _stream_unpacker(compression), b""
    try:
        # One byte more than declared, so that a stream that holds more is seen.
        records = unpacker.decompress(packed, size + 1)
        for _ in range(_MOST_STREAMS):
            if not (unpacker.eof and unpacker.unused_data) or len(records) > size:
                break
            rest, unpacker = unpacker.unused_data, _stream_unpacker(compression)
            records += unpacker.decompress(rest, size + 1 - len(records))
    except (RuntimeError, OSError, EOFError) as error:
        raise BadChunkError(f"its {compression.decode()} data are damaged ({error})") from error
    if not unpacker.eof:
        raise BadChunkError(f"its {compression.decode()} data are cut or longer than declared")
    return records


def _stream_unpacker(compression: bytes) -> bz2.BZ2Decompressor:
    # lz4 ships no types; its class has the same methods.
    return lz4.frame.LZ4FrameDecompressor() if compression == b"lz4" else bz2.BZ2Decompressor()


Content = FileContent | UnprovenFile


@dataclass(frozen=True, eq=False)
class Source:
    """One file of a recording, unpacked: its name, its path and size, and why a part could not be unpacked.

    `content` has the bytes of the file, `_unpacked` those of a file that was packed, which nobody else can write to.
    `journal` is the write-ahead log beside it.
    """

    path: Path
    name: str
    size: int
    content: Content
    problem: str = ""
    journal: Content | None = None
    _unpacked: IO[bytes] | None = None

    def open(self) -> IO[bytes]:
        """The unpacked file for reading. Raises ChangedError where it changed since it was opened, and OSError."""
        if self._unpacked is None:
            return self.content.open()
        return Path(f"/proc/self/fd/{self._unpacked.fileno()}").open("rb", buffering=_BUFFER_BYTES)

    def close(self) -> None:
        """Free the space of the unpacked content."""
        if self._unpacked is not None:
            self._unpacked.close()


def source_of(content: Content, journal: Content | None = None) -> Source:
    """A file, unpacked where it is packed. Raises RecordingError where there is too little space for it."""
    file = content.path
    if file.suffix.lower() not in PACKED:
        return Source(file, file.name, content.size, content, journal=journal)
    # The file has no name in any folder: nothing of it stays if this process is killed.
    unpacked = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the recording
    try:
        with content.open() as packed:
            problem = unpack_file(packed, unpacked, disk_usage(tempfile.gettempdir()).free // 2)
        unpacked.flush()
        size = unpacked.tell()
    except ChangedError:
        unpacked.close()
        raise
    except OSError as error:
        unpacked.close()
        raise RecordingError(
            f"it cannot be unpacked ({error.strerror or error})",
            where=file,
            remedy="free disk space, or unpack it",
        ) from error
    return Source(file, file.stem, size, content, problem, _unpacked=unpacked)


def kind_of(path: Path) -> str:
    """The extension of a file in lower case; of a packed file the extension of its content."""
    return Path(path.stem).suffix.lower() if path.suffix.lower() in PACKED else path.suffix.lower()


_MAGIC = 0xFD2FB528
_SKIPPABLE = 0x184D2A50
_MOST_HEAD_BYTES = 18
_RLE_BLOCK = 1


class Frames(NamedTuple):
    """The unpacked size of all frames together, None where one does not declare its own; `whole` is False if cut."""

    size: int | None
    whole: bool


class FrameWalk:
    """Walks over the frames of zstd data, of which it reads the heads alone, and over at most `most_blocks` blocks.

    Writers that work in parallel or append put several frames one after the other. Format: RFC 8878, section 3.1. The
    package `zstandard` tells the size of the first frame alone, and takes data cut inside a later one for whole.
    """

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
                header = zstandard.get_frame_parameters(head)
                sizes.append(header.content_size if header.content_size < zstandard.CONTENTSIZE_ERROR else None)
                position = self._end_of_blocks(position + zstandard.frame_header_size(head)) + 4 * header.has_checksum
            else:
                raise zstandard.ZstdError("its frames are followed by other data")
        lengths = [size for size in sizes if size is not None]
        return Frames(sum(lengths) if len(lengths) == len(sizes) else None, whole=position == self._length)

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
