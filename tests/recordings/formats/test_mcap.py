import struct
import zlib
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from auditor.errors import RecordingError
from auditor.model.verdict import AttackLabel
from auditor.recordings import open_recording, write_mcap
from auditor.recordings.formats import mcap
from auditor.recordings.formats.mcap_records import unpack_chunk
from auditor.recordings.formats.unpacking import BadChunkError
from auditor.safety.budget import CHUNKS, MAX_BYTES, Spending
from tests.making.recorded_drives import (
    chunk_ends,
    make_frames,
    make_rig,
    mcap_file,
    rechunk,
    same_frame,
    split,
    stream_of,
)

RIG = make_rig(3)
FRAMES = make_frames(RIG, 6)
LABEL = AttackLabel("/cam1/image_rect", "facula", 5, 9, {"R": 187.5, "seed": 3})


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("mcap")
    write_mcap(folder / "big.mcap", RIG, FRAMES)
    rechunk(folder / "big.mcap", folder / "whole.mcap")
    return folder / "whole.mcap"


@pytest.fixture(scope="module")
def ends(whole: Path) -> list[tuple[int, int, int]]:
    found = chunk_ends(whole)
    assert len(found) > 5
    return found


def count(path: Path) -> int:
    with open_recording(path) as recording:
        return sum(1 for _ in recording.messages())


KILO = bytes(1000)
ZSTD = zstandard.compress(KILO)
LZ4 = lz4.frame.compress(KILO)


def chunk_body(data: bytes, *, size: int | None = None, compression: str = "", packed: bytes | None = None) -> bytes:
    packed = data if packed is None else packed
    head = struct.pack("<QQQI", 0, 0, len(data) if size is None else size, zlib.crc32(data))
    return head + struct.pack("<I", len(compression)) + compression.encode() + struct.pack("<Q", len(packed)) + packed


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
@pytest.mark.parametrize("chunked", [True, False])
def test_frames_come_out_as_they_went_in(whole: Path, tmp_path: Path, compression: str, chunked: bool) -> None:
    rechunk(whole, tmp_path / "a.mcap", compression=compression, use_chunking=chunked, enable_data_crcs=True)
    with open_recording(tmp_path / "a.mcap") as recording:
        frames, skipped = split(stream_of(recording))
        assert recording.damage == ()
    assert not skipped
    assert len(frames) == len(FRAMES)
    assert all(same_frame(a, b) for a, b in zip(frames, FRAMES, strict=True))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.data())
def test_messages_before_a_cut_are_read_and_the_cut_is_reported(
    whole: Path, ends: list[tuple[int, int, int]], tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content = whole.read_bytes()
    at = data.draw(st.integers(0, len(content) - 1))
    path = tmp_path_factory.mktemp("cut") / "cut.mcap"
    path.write_bytes(content[:at])
    if at < 8:
        with pytest.raises(RecordingError):
            open_recording(path)
        return
    with open_recording(path) as recording:
        messages = list(recording.messages())
        assert recording.damage
    whole_chunks = sum(number for _, end, number in ends if end <= at)
    with open_recording(whole) as recording:
        expected = list(recording.messages())
    assert [message.data for message in messages] == [message.data for message in expected[: len(messages)]]
    most = max(number for _, _, number in ends)
    assert whole_chunks <= len(messages) <= whole_chunks + most


@pytest.mark.parametrize("compression", ["NONE", "LZ4", "ZSTD"])
def test_whole_messages_of_a_cut_chunk_are_kept_and_reported(tmp_path: Path, compression: str) -> None:
    random = np.random.default_rng(5)
    texts = [random.integers(1, 256, 50_000, np.uint8).tobytes() for _ in range(20)]
    messages = [("/a", number, text) for number, text in enumerate(texts)]
    mcap_file(tmp_path / "a.mcap", messages, chunk_size=2**24, compression=CompressionType[compression])
    content = (tmp_path / "a.mcap").read_bytes()
    (tmp_path / "a.mcap").write_bytes(content[:600_000])
    with open_recording(tmp_path / "a.mcap") as recording:
        kept = [message.data for message in recording.messages()]
        assert recording.counts == {"/a": len(kept)}
        assert f"{len(kept)} messages before the cut are kept" in str(recording.damage[0])
    assert kept == texts[: len(kept)]
    assert 8 <= len(kept) < 12


def test_a_message_of_a_cut_chunk_with_a_hole_of_zeros_is_not_kept(tmp_path: Path) -> None:
    texts = [b"x" * 50_000, b"y" * 20_000 + bytes(5000) + b"y" * 20_000, b"z" * 50_000]
    messages = [("/a", number, text) for number, text in enumerate(texts)]
    mcap_file(tmp_path / "a.mcap", messages, chunk_size=2**24, compression=CompressionType.NONE)
    (tmp_path / "a.mcap").write_bytes((tmp_path / "a.mcap").read_bytes()[:140_000])
    with open_recording(tmp_path / "a.mcap") as recording:
        assert [message.data for message in recording.messages()] == texts[:1]


def test_frames_before_a_cut_come_out(whole: Path, ends: list[tuple[int, int, int]], tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole.read_bytes()[: ends[len(ends) // 2][1] + 100])
    with open_recording(path) as recording:
        frames, _ = split(stream_of(recording))
    assert len(frames) >= 2
    assert all(same_frame(a, b) for a, b in zip(frames, FRAMES, strict=False))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.data())
def test_a_flipped_byte_costs_at_most_its_chunk_and_is_reported(
    whole: Path, ends: list[tuple[int, int, int]], tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content = bytearray(whole.read_bytes())
    start, end, number = data.draw(st.sampled_from(ends))
    at = data.draw(st.integers(start + 9 + 16, end - 1))
    content[at] ^= data.draw(st.integers(1, 255))
    path = tmp_path_factory.mktemp("flip") / "flip.mcap"
    path.write_bytes(content)
    with open_recording(path) as recording:
        messages = list(recording.messages())
        places = [damage.offset for damage in recording.damage]
    # The chunk's checksum itself may be flipped to 0, which means none: then nothing is lost.
    assert len(messages) in {sum(n for _, _, n in ends) - number, sum(n for _, _, n in ends)}
    assert places[:1] == [start] or len(messages) == sum(n for _, _, n in ends)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.data())
def test_random_changes_raise_only_our_own_errors(
    whole: Path, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content = bytearray(whole.read_bytes())
    for _ in range(data.draw(st.integers(1, 5))):
        at = data.draw(st.integers(0, len(content) - 9))
        content[at : at + 8] = data.draw(st.binary(min_size=8, max_size=8))
    path = tmp_path_factory.mktemp("noise") / "noise.mcap"
    path.write_bytes(content)
    try:
        with open_recording(path) as recording:
            list(recording.messages())
            recording.labels()
            recording.metadata()
            recording.topics()
    except RecordingError:
        pass


def test_topics_that_are_not_requested_are_counted(whole: Path) -> None:
    with open_recording(whole) as recording:
        messages = list(recording.messages({"/cam1/image_rect"}))
        assert len(messages) == 6
        assert recording.counts["/top/points"] == 6
        assert recording.counts["/cam2/camera_info"] == 6
        assert recording.counts["/tf_static"] == 1


def test_a_recording_is_read_again_from_its_start(whole: Path) -> None:
    with open_recording(whole) as recording:
        half = recording.messages()
        first = [next(half) for _ in range(5)]
        again = list(recording.messages())
        assert [message.data for message in again[:5]] == [message.data for message in first]
        assert sum(recording.counts.values()) == len(again)


def test_topics_are_known_without_a_summary(whole: Path, tmp_path: Path) -> None:
    rechunk(whole, tmp_path / "a.mcap", repeat_channels=False, repeat_schemas=False)
    with open_recording(tmp_path / "a.mcap") as recording, open_recording(whole) as other:
        assert recording.topics() == other.topics()


def test_a_tail_of_zeros_is_reported_once_and_not_walked(
    whole: Path, ends: list[tuple[int, int, int]], tmp_path: Path
) -> None:
    path = tmp_path / "zeros.mcap"
    path.write_bytes(whole.read_bytes()[: ends[3][1]] + bytes(10_000))
    with open_recording(path) as recording:
        messages = list(recording.messages())
        assert [damage.offset for damage in recording.damage] == [ends[3][1]]
    assert len(messages) == sum(n for _, _, n in ends[:4])


def test_behind_a_chunk_with_an_absurd_length_reading_goes_on_at_the_next_one_of_the_summary(
    whole: Path, ends: list[tuple[int, int, int]], tmp_path: Path
) -> None:
    content = bytearray(whole.read_bytes())
    struct.pack_into("<Q", content, ends[2][0] + 1, 2**60)
    (tmp_path / "a.mcap").write_bytes(content)
    with open_recording(tmp_path / "a.mcap") as recording:
        assert len(list(recording.messages())) == sum(n for _, _, n in ends) - ends[2][2]
        assert [damage.offset for damage in recording.damage] == [ends[2][0]]
    (tmp_path / "a.mcap").write_bytes(content[: ends[-1][1]])
    with open_recording(tmp_path / "a.mcap") as recording:
        assert sum(n for _, _, n in ends[:2]) <= len(list(recording.messages())) <= sum(n for _, _, n in ends[:3])
        assert recording.damage[0].offset == ends[2][0]


def zstd_declaring(size: int) -> bytes:
    """A small zstd frame whose header declares another size (RFC 8878, 3.1.1: one segment, 8 bytes of size)."""
    block = ZSTD
    assert block[:4] == b"\x28\xb5\x2f\xfd"
    body = block[5 + 2 :]  # magic, descriptor with a 2-byte size field in one segment
    return block[:4] + bytes([0xE0]) + struct.pack("<Q", size) + body


@pytest.mark.parametrize(
    "body",
    [
        pytest.param(chunk_body(KILO, size=2**40, compression="zstd", packed=b""), id="oversized"),
        pytest.param(
            chunk_body(KILO, compression="zstd", packed=zstd_declaring(2**32)), id="zstd frame declares 4 GiB"
        ),
        pytest.param(
            chunk_body(KILO, size=10, compression="zstd", packed=ZSTD),
            id="zstd longer",
        ),
        pytest.param(chunk_body(KILO, size=10, compression="lz4", packed=LZ4), id="lz4 longer"),
        pytest.param(chunk_body(KILO, compression="lz4", packed=LZ4[:-6]), id="lz4 cut"),
        pytest.param(chunk_body(KILO, compression="lz4", packed=b"nonsense"), id="lz4 nonsense"),
        pytest.param(chunk_body(KILO, compression="zstd", packed=b"nonsense"), id="zstd nonsense"),
        pytest.param(
            chunk_body(KILO, compression="zstd", packed=ZSTD + b"more"),
            id="zstd tail",
        ),
        pytest.param(chunk_body(bytes(10), compression="brotli"), id="unknown compression"),
        pytest.param(chunk_body(bytes(10))[:-1], id="cut"),
        pytest.param(chunk_body(bytes(10))[:30], id="cut header"),
        pytest.param(chunk_body(bytes(10)) + b"more", id="longer than declared"),
        pytest.param(chunk_body(bytes(10))[:-1] + b"x", id="checksum"),
        pytest.param(b"", id="empty"),
    ],
)
def test_a_hostile_chunk_is_refused(body: bytes) -> None:
    with pytest.raises(BadChunkError):
        unpack_chunk(body, Spending(CHUNKS))


def test_a_zstd_frame_without_a_declared_size_is_read() -> None:
    packer = zstandard.ZstdCompressor(write_content_size=False)
    body = chunk_body(KILO, compression="zstd", packed=packer.compress(KILO))
    assert bytes(unpack_chunk(body, Spending(CHUNKS))) == KILO
    with pytest.raises(BadChunkError):
        unpack_chunk(chunk_body(KILO, size=999, compression="zstd", packed=packer.compress(KILO)), Spending(CHUNKS))


def test_an_oversized_chunk_is_left_out_and_the_next_one_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    mcap_file(path, [("/a", 1, b"one"), ("/a", 2, b"two")], chunk_size=1, compression=CompressionType.NONE)
    content = bytearray(path.read_bytes())
    first = chunk_ends(path)[0]
    struct.pack_into("<Q", content, first[0] + 9 + 16, MAX_BYTES + 1)
    path.write_bytes(content)
    with open_recording(path) as recording:
        # Schema and channel went with the first chunk: the summary still knows them.
        assert [message.data for message in recording.messages()] == [b"two"]
        assert [damage.offset for damage in recording.damage] == [first[0]]


def test_a_message_on_an_unknown_channel_is_damage(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start("")
        channel = writer.register_channel("/a", "json", 0)
        writer.add_message(channel, 1, b"{}", 1)
        writer.add_message(77, 2, b"{}", 2)
        writer.finish()
    with open_recording(tmp_path / "a.mcap") as recording:
        assert len(list(recording.messages())) == 1
        assert "77" in str(recording.damage[0])


def test_a_log_time_out_of_range_is_reported(tmp_path: Path) -> None:
    mcap_file(tmp_path / "a.mcap", [("/a", 2**64 - 1, b"{}")])
    with open_recording(tmp_path / "a.mcap") as recording:
        assert [message.log_time_ns for message in recording.messages()] == [0]
        assert recording.damage


def test_a_wrong_checksum_over_all_data_is_reported(whole: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    rechunk(whole, path, use_chunking=False, enable_data_crcs=True)
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with open_recording(path) as recording:
        list(recording.messages())
        assert "checksum" in str(recording.damage[-1])


def test_ground_truth_and_metadata_are_read_back_wherever_the_file_was_cut_behind_them(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_mcap(path, RIG, FRAMES, [LABEL], vehicle="V7")
    with open_recording(path) as recording:
        assert recording.labels() == (LABEL,)
        assert recording.metadata() == {"vehicle": "V7"}
    path.write_bytes(path.read_bytes()[:-50])
    with open_recording(path) as recording:
        assert recording.labels() == (LABEL,)


@pytest.mark.parametrize("text", [b"[1]", b"{", b'[{"topic": "/a"}]', b"[" * 100_000])
def test_ill_formed_ground_truth_is_a_clear_error(tmp_path: Path, text: bytes) -> None:
    with (tmp_path / "a.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start("")
        writer.add_attachment(0, 0, "auditor-labels.json", "application/json", text)
        writer.finish()
    with open_recording(tmp_path / "a.mcap") as recording, pytest.raises(RecordingError, match="ground truth"):
        recording.labels()


def test_an_attachment_with_a_wrong_checksum_is_not_used(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_mcap(path, RIG, FRAMES[:1], [LABEL])
    content = path.read_bytes()
    assert content.count(b'"facula"') == 1
    path.write_bytes(content.replace(b'"facula"', b'"FACULA"'))
    with open_recording(path) as recording:
        assert recording.labels() == ()


def test_the_identity_is_that_of_the_content(whole: Path, tmp_path: Path) -> None:
    (tmp_path / "other.mcap").write_bytes(whole.read_bytes())
    (tmp_path / "changed.mcap").write_bytes(whole.read_bytes()[:-1])
    with (
        open_recording(whole) as a,
        open_recording(tmp_path / "other.mcap") as b,
        open_recording(tmp_path / "changed.mcap") as c,
    ):
        assert a.recording_id == b.recording_id != c.recording_id
        assert len(a.recording_id) == 64


def test_the_clock_follows_from_the_first_log_time(tmp_path: Path) -> None:
    mcap_file(tmp_path / "a.mcap", [("/a", 5 * 10**9, b"{}")])
    mcap_file(tmp_path / "b.mcap", [("/a", 1_700_000_000 * 10**9, b"{}")])
    mcap_file(tmp_path / "c.mcap", [])
    clocks = []
    for name in "abc":
        with open_recording(tmp_path / f"{name}.mcap") as recording:
            clocks.append(recording.clock)
    assert clocks == ["relative", "utc", "unknown"]


def test_another_file_named_mcap_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"this is text, not a recording")
    with pytest.raises(RecordingError, match="not an MCAP file"):
        open_recording(tmp_path / "a.mcap")


def test_labels_and_metadata_are_those_that_a_whole_read_has_passed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_mcap(tmp_path / "a.mcap", RIG, FRAMES, [LABEL], vehicle="V7")
    with open_recording(tmp_path / "a.mcap") as recording:
        list(recording.messages())
        monkeypatch.setattr(mcap, "records", None)  # nothing is looked for again
        assert recording.labels() == (LABEL,)
        assert recording.metadata() == {"vehicle": "V7"}
