"""zstd data in several frames, as parallel and appending compressors write them."""

import bz2
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard

from auditor.recordings import open_recording
from auditor.recordings.formats.unpacking import BadChunkError, FrameWalk, unpack, unpack_file, unpack_message
from auditor.safety.budget import CHUNKS, Spending
from tests.making.forms import CONTAINERS
from tests.making.recorded_drives import make_frames, make_rig

PLAIN = np.random.default_rng(1).integers(0, 9, 400_000, np.uint8).tobytes()
SKIPPABLE = (0x184D2A53).to_bytes(4, "little") + (5).to_bytes(4, "little") + b"hello"

Pack = Callable[[bytes], bytes]


def streamed(data: bytes) -> bytes:
    """A frame that does not say its size, with a checksum behind it."""
    packer = zstandard.ZstdCompressor(write_content_size=False, write_checksum=True).compressobj()
    return packer.compress(data) + packer.flush()


def halves(data: bytes) -> bytes:
    middle = len(data) // 2
    return zstandard.compress(data[:middle]) + zstandard.compress(data[middle:])


FORMS: dict[str, Pack] = {
    "one": zstandard.compress,
    "two": halves,
    "first without size": lambda data: streamed(data[:9]) + zstandard.compress(data[9:]),
    "last without size": lambda data: zstandard.compress(data[:9]) + streamed(data[9:]),
    "skippable first": lambda data: SKIPPABLE + zstandard.compress(data),
    "skippable last": lambda data: zstandard.compress(data) + SKIPPABLE,
    "an empty one": lambda data: zstandard.compress(data) + zstandard.compress(b""),
    "many": lambda data: b"".join(zstandard.compress(data[at : at + 999]) for at in range(0, len(data), 999)),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_chunk_of_several_frames_is_unpacked(form: str) -> None:
    packed = FORMS[form](PLAIN)
    assert bytes(unpack(b"zstd", memoryview(packed), len(PLAIN))) == PLAIN


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("off", [-1, 1, 10**6])
def test_a_chunk_of_another_size_is_refused(form: str, off: int) -> None:
    packed = FORMS[form](PLAIN)
    with pytest.raises(BadChunkError):
        unpack(b"zstd", memoryview(packed), len(PLAIN) + off)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("tail", [b"\0" * 20, b"no frame at all", b"\x28\xb5\x2f\xfd"])
def test_other_data_behind_the_frames_are_damage(form: str, tail: bytes) -> None:
    with pytest.raises(BadChunkError):
        unpack_message(zstandard.compress(PLAIN) + FORMS[form](PLAIN) + tail, Spending(CHUNKS))


def test_a_message_of_two_frames_is_unpacked() -> None:
    assert unpack_message(halves(PLAIN), Spending(CHUNKS)) == PLAIN


@pytest.mark.parametrize("form", FORMS)
def test_a_file_of_several_frames_is_unpacked_whole(form: str) -> None:
    target = BytesIO()
    assert unpack_file(BytesIO(FORMS[form](PLAIN)), target, 10**7) == ""
    assert target.getvalue() == PLAIN


@pytest.mark.parametrize("form", [form for form in FORMS if form not in {"skippable last", "an empty one"}])
@pytest.mark.parametrize("lost", [1, 7, 2000])
def test_a_file_that_is_cut_in_any_of_its_frames_is_damaged(form: str, lost: int) -> None:
    target = BytesIO()
    assert "zstd data are" in unpack_file(BytesIO(FORMS[form](PLAIN)[:-lost]), target, 10**7)
    assert PLAIN.startswith(target.getvalue())


def test_a_file_that_is_cut_behind_a_whole_frame_is_taken_as_it_is() -> None:
    """Nothing in a frame says that another one follows: the recording inside is then cut, and says so."""
    packed = halves(PLAIN)
    first = zstandard.compress(PLAIN[: len(PLAIN) // 2])
    target = BytesIO()
    assert unpack_file(BytesIO(packed[: len(first)]), target, 10**7) == ""


def test_blocks_without_end_are_given_up() -> None:
    head = zstandard.compress(PLAIN)[:6]
    raw_blocks_of_no_bytes = head + bytes(3) * 10_000
    with pytest.raises(zstandard.ZstdError):
        FrameWalk(BytesIO(raw_blocks_of_no_bytes), len(raw_blocks_of_no_bytes), 100).frames()


def test_a_frame_that_unpacks_to_more_than_its_chunk_declares_costs_no_more_memory() -> None:
    bomb = streamed(bytes(10**8))
    with pytest.raises(BadChunkError, match="declares 1000 unpacked bytes and holds 1001"):
        unpack(b"zstd", memoryview(bomb), 1000)


@pytest.mark.parametrize("form", ["lz4", "bz2"])
@pytest.mark.parametrize("parts", [1, 2, 7])
def test_a_chunk_of_several_streams_is_unpacked(form: str, parts: int) -> None:
    pack = lz4.frame.compress if form == "lz4" else bz2.compress
    step = -(-len(PLAIN) // parts)
    packed = b"".join(pack(PLAIN[at : at + step]) for at in range(0, len(PLAIN), step))
    assert bytes(unpack(form.encode(), memoryview(packed), len(PLAIN))) == PLAIN
    for size, data in ((len(PLAIN) - 1, packed), (len(PLAIN) + 1, packed), (len(PLAIN), packed[:-9])):
        with pytest.raises(BadChunkError):
            unpack(form.encode(), memoryview(data), size)
    with pytest.raises(BadChunkError):
        unpack(form.encode(), memoryview(packed + b"other data"), len(PLAIN))


@pytest.mark.parametrize("ending", [".zstd", ".zst"])
def test_a_recording_that_was_packed_in_two_frames_is_read(ending: str, tmp_path: Path) -> None:
    write = next(one.write for one in CONTAINERS if one.name == "mcap ros2")
    plain = write(tmp_path, make_rig(3), make_frames(make_rig(3), 2), "raw")
    packed = tmp_path / f"packed.mcap{ending}"
    packed.write_bytes(halves(plain.read_bytes()))
    with open_recording(plain) as one, open_recording(packed) as other:
        assert [message.data for message in one.messages()] == [message.data for message in other.messages()]
        assert other.damage == ()
