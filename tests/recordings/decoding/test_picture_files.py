"""Picture files other than PNG and JPEG: what their headers say, and what is cut or hostile."""

import struct
import tracemalloc
from contextlib import suppress

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.errors import DecodingError
from auditor.recordings.decoding.picture_heads import inspect_picture
from auditor.recordings.decoding.pictures import decode_picture, largest_picture_value
from tests.making.message_forms import file_of

RANDOM = np.random.default_rng(7)
BGR = cv2.resize(RANDOM.integers(0, 256, (6, 8, 3), np.uint8), (66, 47))
GREY = np.ascontiguousarray(BGR[..., 1])
DEEP = GREY.astype(np.uint16) * 16 + 3
FORMS = ["webp", "bmp", "tiff", "jp2", "avif"]


@pytest.mark.parametrize("form", FORMS)
def test_colours_and_sizes_are_read(form: str) -> None:
    data = memoryview(file_of(BGR, form))
    picture = inspect_picture(data)
    assert (picture.form, picture.size_px, picture.grey, picture.deep) == (form, (66, 47), False, False)
    assert np.array_equal(decode_picture(data, colour=True, size_px=(66, 47)), BGR)
    grey = decode_picture(data, colour=False, size_px=None)
    assert np.array_equal(grey, cv2.cvtColor(BGR, cv2.COLOR_BGR2GRAY)), "as of every other lossless form"
    with pytest.raises(DecodingError, match="instead of 64 x 47"):
        decode_picture(data, colour=True, size_px=(64, 47))


@pytest.mark.parametrize("form", ["bmp", "tiff", "jp2", "avif"])
def test_grey_pictures_stay_grey(form: str) -> None:
    data = memoryview(file_of(GREY, form))
    assert inspect_picture(data).grey
    assert np.array_equal(decode_picture(data, colour=True, size_px=None), GREY)


@pytest.mark.parametrize("form", ["tiff", "jp2", "avif"])
def test_values_of_16_bits_keep_their_upper_ones(form: str) -> None:
    data = memoryview(file_of(DEEP, form))
    assert largest_picture_value(data) == DEEP.max()
    assert np.array_equal(decode_picture(data, colour=False, size_px=None, bits=12), GREY)


def test_a_lossy_webp_is_read() -> None:
    data = cv2.imencode(".webp", BGR, [cv2.IMWRITE_WEBP_QUALITY, 95])[1].tobytes()
    assert data[12:16] in {b"VP8 ", b"VP8X"}
    assert inspect_picture(memoryview(data)).size_px == (66, 47)
    assert abs(decode_picture(memoryview(data), colour=True, size_px=None).astype(int) - BGR).mean() < 6


def test_a_codestream_without_its_boxes_is_read() -> None:
    data = file_of(BGR, "jp2")
    bare = data[data.index(b"\xff\x4f\xff\x51") :]
    assert inspect_picture(memoryview(bare)).size_px == (66, 47)
    assert np.array_equal(decode_picture(memoryview(bare), colour=True, size_px=None), BGR)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kept", [0.01, 0.1, 0.5, 0.9])
def test_a_cut_file_is_damaged(form: str, kept: float) -> None:
    data = file_of(BGR, form)
    with pytest.raises(DecodingError):
        decode_picture(memoryview(data[: int(kept * len(data))]), colour=True, size_px=None)


@pytest.mark.parametrize("form", FORMS)
def test_a_size_that_is_absurd_is_refused_before_anything_is_decoded(form: str) -> None:
    data = bytearray(file_of(BGR, form))
    wide = {
        "bmp": lambda: struct.pack_into("<ii", data, 18, 60_000, 60_000),
        "webp": lambda: struct.pack_into("<I", data, 21, 0x0FFFFFFF),
        "jp2": lambda: struct.pack_into(">II", data, data.index(b"\xff\x4f\xff\x51") + 8, 60_000, 60_000),
        "avif": lambda: struct.pack_into(">II", data, data.index(b"ispe") + 8, 60_000, 60_000),
        "tiff": lambda: _set_tiff_size(data, 60_000),
    }
    wide[form]()
    tracemalloc.start()
    with pytest.raises(DecodingError, match="is not accepted"):
        decode_picture(memoryview(bytes(data)), colour=True, size_px=None)
    assert tracemalloc.get_traced_memory()[1] < 10**6
    tracemalloc.stop()


def test_an_avif_whose_data_declare_more_pixels_than_the_file_is_refused_before_it_is_decoded() -> None:
    small, wide = file_of(BGR, "avif"), file_of(np.zeros((4096, 4096, 3), np.uint8), "avif")
    place = small.index(b"mdat") + 4
    item = wide[wide.index(b"mdat") + 4 :]
    sequence = item[: 4 + item[3]] if item[:2] == b"\x12\0" else item[: 2 + item[1]]
    item = sequence + b"\x78" + bytes(len(small) - place - len(sequence) - 1)  # the rest is padding
    with pytest.raises(DecodingError, match="more pixels than it declares"):
        decode_picture(memoryview(small[:place] + item), colour=True, size_px=None)


def _set_tiff_size(data: bytearray, side: int) -> None:
    (start,) = struct.unpack_from("<I", data, 4)
    (entries,) = struct.unpack_from("<H", data, start)
    for place in range(start + 2, start + 2 + 12 * entries, 12):
        tag, kind = struct.unpack_from("<HH", data, place)
        if tag in {256, 257}:
            struct.pack_into("<H" if kind == 3 else "<I", data, place + 8, side)


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (cv2.imencode(".gif", BGR)[1].tobytes(), "GIF"),
        (b"\0\0\0\x20ftypavis" + bytes(40), "several pictures"),
        (b"\0\0\0\x20ftypavif" + bytes(40), "does not say its size"),
        (b"\xff\x0a" + bytes(40), "JPEG XL"),
        (b"", "neither PNG nor JPEG"),
        (b"BM" + bytes(60), "8, 24 or 32"),
        (b"II*\0" + bytes(60), "cut in its header"),
    ],
)
def test_other_files_are_told_by_name(data: bytes, says: str) -> None:
    with pytest.raises(DecodingError, match=says):
        inspect_picture(memoryview(data))


@settings(max_examples=400, deadline=None, derandomize=True)
@given(st.sampled_from(FORMS), st.data())
def test_damaged_files_raise_one_kind_of_error(form: str, data: st.DataObject) -> None:
    deep = form in {"tiff", "jp2", "avif"} and data.draw(st.booleans())
    whole = bytearray(file_of(DEEP if deep else BGR, form))
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, min(len(whole) - 1, 200)))] = data.draw(st.integers(0, 255))
    with suppress(DecodingError):
        decode_picture(memoryview(bytes(whole)), colour=True, size_px=None)
