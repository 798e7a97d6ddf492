from contextlib import suppress

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings import schemas
from auditor.recordings.decoding import Decoders, DeepImageDecoder, ImageDecoder, RepairingDecoder
from auditor.recordings.decoding.pictures import encode_picture
from auditor.recordings.recording import Definition
from auditor.recordings.writers.messages import MessageMaker
from tests.making.message_forms import mosaic

MAKER = MessageMaker("cdr")
RANDOM = np.random.default_rng(7)
GREY = RANDOM.integers(0, 256, (48, 64), np.uint8)
BGR = cv2.resize(RANDOM.integers(0, 256, (6, 8, 3), np.uint8), (64, 48))
RGB = np.ascontiguousarray(BGR[:, :, ::-1])


def definition(schema: str) -> Definition:
    return Definition("ros2msg", MAKER.definition(schema).encode())


def decoder_of(schema: str) -> ImageDecoder:
    decoder = Decoders(definition).image(schema, "cdr")
    assert decoder is not None
    return decoder


def image_message(data: NDArray[np.uint8], encoding: str, **fields: object) -> Message:
    image = MAKER.store.types[schemas.IMAGE](
        **{
            "header": MAKER.header(5, "cam"),
            "height": 48,
            "width": 64,
            "encoding": encoding,
            "is_bigendian": 0,
            "step": data.size // 48,
            "data": np.ascontiguousarray(data).reshape(-1),
            **fields,
        }
    )
    return Message("/a", schemas.IMAGE, "cdr", 9, MAKER.serialise(schemas.IMAGE, image))


def picture_message(data: bytes, form: str = "jpeg") -> Message:
    return Message("/a", schemas.COMPRESSED_IMAGE, "cdr", 9, MAKER.compressed_image(data, form, 5, "cam"))


def pixels(message: Message, *, colour: bool = False, size_px: tuple[int, int] | None = (64, 48)) -> NDArray[np.uint8]:
    return decoder_of(message.schema).pixels(message, colour=colour, size_px=size_px)


def yuyv(bgr: NDArray[np.uint8]) -> NDArray[np.uint8]:
    yuv = cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV)
    out = np.empty((*bgr.shape[:2], 2), np.uint8)
    out[:, :, 0] = yuv[:, :, 0]
    out[:, ::2, 1] = yuv[:, ::2, 1]
    out[:, 1::2, 1] = yuv[:, ::2, 2]
    return out


def nv12(bgr: NDArray[np.uint8]) -> NDArray[np.uint8]:
    planes = cv2.cvtColor(bgr, cv2.COLOR_BGR2YUV_I420)
    chroma = planes[48:].reshape(2, 24 * 32)
    return np.vstack([planes[:48], chroma.T.reshape(24, 64)])


def test_grey_images_come_out_as_recorded() -> None:
    assert np.array_equal(pixels(image_message(GREY, "mono8")), GREY)
    assert np.array_equal(pixels(image_message(GREY, "8UC1"), colour=True), GREY)
    assert np.array_equal(pixels(image_message(GREY, "passthrough"), colour=True), GREY)


@pytest.mark.parametrize(
    ("data", "encoding"),
    [
        (BGR, "bgr8"),
        (BGR, "8UC3"),
        (RGB, "rgb8"),
        (np.dstack([BGR, GREY]), "bgra8"),
        (np.dstack([RGB, GREY]), "rgba8"),
        (BGR, "passthrough"),
        (np.dstack([BGR, GREY]), "passthrough"),
    ],
)
def test_colours_come_out_as_bgr_and_as_grey(data: NDArray[np.uint8], encoding: str) -> None:
    message = image_message(data, encoding)
    assert np.array_equal(pixels(message, colour=True), BGR)
    assert np.array_equal(pixels(message), cv2.cvtColor(BGR, cv2.COLOR_BGR2GRAY))


@pytest.mark.parametrize("encoding", ["yuv422_yuy2", "yuyv", "yuv422", "uyvy", "nv12", "nv21"])
def test_video_encodings_come_out_in_the_right_colours(encoding: str) -> None:
    data = nv12(BGR) if encoding.startswith("nv") else yuyv(BGR)
    if encoding in {"yuv422", "uyvy"}:
        data = np.ascontiguousarray(data[:, :, ::-1])
    if encoding == "nv21":
        data[48:] = data[48:].reshape(24, 32, 2)[:, :, ::-1].reshape(24, 64)
    message = image_message(data, encoding, step=data.shape[1] * (data.shape[2] if data.ndim == 3 else 1))
    error = np.abs(pixels(message, colour=True).astype(int) - BGR)
    assert np.median(error) < 20
    assert np.median(np.abs(pixels(message).astype(int) - cv2.cvtColor(BGR, cv2.COLOR_BGR2GRAY))) < 20


@pytest.mark.parametrize("order", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_patterns_are_distinguished(order: str) -> None:
    flat = np.empty((48, 64, 3), np.uint8)
    flat[:] = (200, 100, 20)
    eight = pixels(image_message(mosaic(flat, order), f"bayer_{order}8"), colour=True)
    assert np.array_equal(eight[10:-10, 10:-10], flat[10:-10, 10:-10])
    wide = np.zeros((48, 128), np.uint8)
    wide[:, 1::2] = mosaic(flat, order)
    sixteen = pixels(image_message(wide, f"bayer_{order}16"), colour=True)
    assert np.array_equal(sixteen[10:-10, 10:-10], flat[10:-10, 10:-10])


def test_sixteen_bits_keep_their_upper_eight_in_either_byte_order() -> None:
    values = RANDOM.integers(0, 65536, (48, 64), np.uint16)
    little = image_message(values.astype("<u2").view(np.uint8), "mono16")
    big = image_message(values.astype(">u2").view(np.uint8), "mono16", is_bigendian=1)
    assert np.array_equal(pixels(little), values >> 8)
    assert np.array_equal(pixels(big), values >> 8)


def test_padding_at_the_end_of_rows_is_left_out() -> None:
    padded = np.hstack([GREY, np.full((48, 10), 7, np.uint8)])
    assert np.array_equal(pixels(image_message(padded, "mono8")), GREY)


@pytest.mark.parametrize("given", [GREY, BGR])
def test_the_last_row_may_be_without_its_padding_as_of_a_cropped_picture(given: NDArray[np.uint8]) -> None:
    encoding, rows = ("mono8" if given.ndim == 2 else "bgr8"), given.reshape(48, -1)
    step = rows.shape[1] + 64
    padded = np.hstack([rows, np.full((48, 64), 7, np.uint8)]).ravel()[:-64]
    assert np.array_equal(pixels(image_message(padded, encoding, step=step), colour=given.ndim == 3), given)
    for wrong in (padded[:-1], padded[:-64]):
        with pytest.raises(DecodingError, match="holds"):
            pixels(image_message(wrong, encoding, step=step), size_px=None)


@pytest.mark.parametrize(
    "fields",
    [
        {"height": 47},
        {"height": 49},
        {"height": 40, "step": 0},
        {"step": 80, "data": np.zeros(48 * 72 + 5, np.uint8)},
        {"step": 64, "data": np.zeros(48 * 70, np.uint8)},
        {"step": 64, "data": np.zeros(48 * 128, np.uint8)},
        {"step": 64, "data": np.zeros(48 * 192, np.uint8)},
        {"width": 65},
        {"encoding": "bgr8"},
        {"encoding": "rgb9"},
        {"data": np.empty(0, np.uint8)},
        {"height": 2**31, "width": 2**31},
    ],
)
def test_an_image_that_does_not_hold_what_it_declares_is_damaged(fields: dict[str, object]) -> None:
    given_fields = {"encoding": "mono8", **fields}
    message = image_message(given_fields.pop("data", GREY), **given_fields)
    with pytest.raises(DecodingError):
        pixels(message, size_px=None)


PADDED = np.hstack([GREY, np.full((48, 10), 7, np.uint8)])


@pytest.mark.parametrize(
    ("data", "step", "repair"),
    [
        (GREY, 0, "step"),
        (GREY, 63, "step"),
        (GREY, 80, "step"),
        (GREY, 2**32 - 1, "step"),
        (PADDED, 0, "step"),
        (PADDED, 1, "step"),
        (np.append(GREY, np.full(99, 7, np.uint8)), 64, "more data"),
        (np.append(PADDED, np.full(4095, 7, np.uint8)), 74, "more data"),
    ],
)
def test_rows_are_put_right_where_the_data_leave_one_reading(data: NDArray[np.uint8], step: int, repair: str) -> None:
    decoder = decoder_of(schemas.IMAGE)
    assert np.array_equal(decoder.pixels(image_message(data, "mono8", step=step), colour=True), GREY)
    assert isinstance(decoder, RepairingDecoder)
    [said] = decoder.repairs
    assert said.startswith("/a: ")
    assert repair in said


def test_whole_rows_are_not_said_to_be_put_right() -> None:
    decoder = decoder_of(schemas.IMAGE)
    assert isinstance(decoder, RepairingDecoder)
    decoder.pixels(image_message(PADDED, "mono8"), colour=True)
    decoder.pixels(image_message(BGR, "bgr8", step=192), colour=True)
    assert not decoder.repairs


@pytest.mark.parametrize("raw", [True, False])
def test_an_image_of_another_size_than_its_camera_is_damaged(raw: bool) -> None:
    message = image_message(GREY, "mono8") if raw else picture_message(encode_picture(GREY, "png"))
    with pytest.raises(DecodingError, match="64 x 48 px instead of 65 x 48"):
        pixels(message, size_px=(65, 48))


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.data())
@pytest.mark.parametrize("schema", [schemas.IMAGE, schemas.COMPRESSED_IMAGE])
def test_a_message_cut_anywhere_is_damaged(schema: str, data: st.DataObject) -> None:
    message = image_message(GREY, "mono8") if schema == schemas.IMAGE else picture_message(encode_picture(GREY, "png"))
    at = data.draw(st.integers(0, len(message.data) - 4))
    decoder = decoder_of(schema)
    cut = Message("/a", schema, "cdr", 9, message.data[:at])
    with pytest.raises(DecodingError):
        decoder.pixels(cut, colour=False)
    with suppress(DecodingError):
        assert decoder.header(cut) == decoder.header(message)


def test_png_is_lossless_and_jpeg_nearly_so() -> None:
    assert np.array_equal(pixels(picture_message(encode_picture(GREY, "png"))), GREY)
    assert np.array_equal(pixels(picture_message(encode_picture(BGR, "png")), colour=True), BGR)
    assert pixels(picture_message(encode_picture(GREY, "png")), colour=True).ndim == 2
    jpeg = pixels(picture_message(encode_picture(BGR, "jpeg")), colour=True)
    assert np.abs(jpeg.astype(int) - BGR).mean() < 8


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.data())
def test_a_png_with_any_byte_changed_is_damaged_or_the_same_picture(data: st.DataObject) -> None:
    picture = bytearray(encode_picture(GREY, "png"))
    at = data.draw(st.integers(0, len(picture) - 1))
    picture[at] ^= data.draw(st.integers(1, 255))
    with suppress(DecodingError):
        assert np.array_equal(pixels(picture_message(bytes(picture))), GREY)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(st.floats(0, 1, exclude_max=True), st.booleans())
def test_a_jpeg_cut_anywhere_is_damaged(share: float, colour: bool) -> None:
    picture = encode_picture(BGR if colour else GREY, "jpeg")
    with pytest.raises(DecodingError):
        pixels(picture_message(picture[: int(share * (len(picture) - 1))]), colour=colour)


def test_bytes_behind_the_end_of_a_jpeg_do_no_harm() -> None:
    picture = encode_picture(GREY, "jpeg")
    assert np.array_equal(pixels(picture_message(picture + bytes(16))), pixels(picture_message(picture)))


def test_a_camera_that_marks_its_pictures_as_turned_is_not_obeyed() -> None:
    plain = encode_picture(GREY, "jpeg")
    turned = b"Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"
    marked = plain[:2] + b"\xff\xe1" + (len(turned) + 2).to_bytes(2, "big") + turned + plain[2:]
    assert np.array_equal(pixels(picture_message(marked)), pixels(picture_message(plain)))


def test_a_png_that_declares_a_huge_picture_is_refused_unread() -> None:
    picture = bytearray(encode_picture(GREY, "png"))
    picture[16:24] = (60_000).to_bytes(4, "big") * 2
    with pytest.raises(DecodingError, match="60000"):
        pixels(picture_message(bytes(picture)), size_px=None)


def test_a_broken_video_inside_a_compressed_image_is_refused() -> None:
    with pytest.raises(DecodingError, match="video"):
        pixels(picture_message(b"\0\0\0\1\x67" + bytes(100), "h264"))


def test_a_video_that_follows_a_picture_of_its_topic_is_refused() -> None:
    decoder = Decoders(lambda _: None).image(schemas.COMPRESSED_IMAGE, "cdr")
    assert decoder is not None
    decoder.pixels(picture_message(encode_picture(GREY, "png")), colour=False)
    with pytest.raises(DecodingError, match="neither PNG nor JPEG"):
        decoder.pixels(picture_message(b"\0\0\0\1\x67" + bytes(100), "h264"), colour=False)


def test_a_type_that_is_defined_otherwise_than_known_is_refused() -> None:
    message = image_message(GREY, "mono8")
    decoder = Decoders(lambda _: Definition("ros2msg", b"string header\nuint8[] data")).image(schemas.IMAGE, "cdr")
    assert decoder is not None
    with pytest.raises(DecodingError, match="otherwise"):
        decoder.pixels(message, colour=False)


@pytest.mark.parametrize("text", ["this is no definition", "uint8[", "nowhere/Type a"])
def test_an_ill_formed_definition_is_damage(text: str) -> None:
    decoder = Decoders(lambda _: Definition("ros2msg", text.encode())).image(schemas.IMAGE, "cdr")
    assert decoder is not None
    with pytest.raises(DecodingError):
        decoder.pixels(image_message(GREY, "mono8"), colour=False)


def test_a_definition_in_idl_is_understood() -> None:
    ruler = "=" * 80 + "\n"
    parts = {
        "sensor_msgs/msg/CompressedImage": "std_msgs::msg::Header header; string format; sequence<uint8> data;",
        "std_msgs/msg/Header": "builtin_interfaces::msg::Time stamp; string frame_id;",
        "builtin_interfaces/msg/Time": "int32 sec; uint32 nanosec;",
    }
    text = ""
    for name, fields in parts.items():
        package, _, kind = name.split("/")
        text += f"{ruler}IDL: {name}\nmodule {package} {{ module msg {{ struct {kind} {{ {fields} }}; }}; }};\n"
    decoder = Decoders(lambda _: Definition("ros2idl", text.encode())).image(schemas.COMPRESSED_IMAGE, "cdr")
    assert decoder is not None
    message = picture_message(encode_picture(GREY, "png"))
    assert np.array_equal(decoder.pixels(message, colour=False), GREY)


def test_the_header_is_read_without_the_rest() -> None:
    decoder = decoder_of(schemas.IMAGE)
    message = image_message(GREY, "mono8", header=MAKER.header(1_234_567_890_123_456_789, "/cam"))
    short = Message("/a", schemas.IMAGE, "cdr", 9, message.data[:40])
    assert decoder.header(short).stamp_ns == 1_234_567_890_123_456_789
    assert decoder.header(short).frame_id == "cam"


def test_ros_1_headers_have_a_counter() -> None:
    maker = MessageMaker("ros1")
    data = maker.raw_image(GREY, "mono8", maker.header(77_000_000_005, "cam"))
    decoders = Decoders(lambda schema: Definition("ros1msg", maker.definition(schema).encode()))
    decoder = decoders.image(schemas.IMAGE, "ros1")
    assert decoder is not None
    message = Message("/a", schemas.IMAGE, "ros1", 9, data)
    assert decoder.header(message).stamp_ns == 77_000_000_005
    assert np.array_equal(decoder.pixels(message, colour=False), GREY)


def test_a_field_spelt_in_other_letters_is_another_definition() -> None:
    definition = Definition("ros2msg", MAKER.definition(schemas.IMAGE).replace("uint32 width", "uint32 Width").encode())
    decoder = Decoders(lambda _: definition).image(schemas.IMAGE, "cdr")
    assert decoder is not None
    with pytest.raises(DecodingError, match="defined otherwise"):
        decoder.pixels(image_message(GREY, "mono8"), colour=False)


@pytest.mark.parametrize("tail", [bytes(8192), b"\xff" * 3000, RANDOM.bytes(5000)], ids=["zeros", "ones", "old data"])
@pytest.mark.parametrize("progressive", [False, True])
def test_a_jpeg_in_a_larger_buffer_is_read(tail: bytes, progressive: bool) -> None:
    options = [cv2.IMWRITE_JPEG_PROGRESSIVE, int(progressive), cv2.IMWRITE_JPEG_RST_INTERVAL, 3]
    plain = cv2.imencode(".jpg", BGR, options)[1].tobytes()
    decoder = decoder_of(schemas.COMPRESSED_IMAGE)
    pixels = decoder.pixels(picture_message(plain + tail, "jpeg"), colour=True)
    assert np.array_equal(pixels, cv2.imdecode(np.frombuffer(plain, np.uint8), cv2.IMREAD_COLOR))


@pytest.mark.parametrize("kept", [0.3, 0.9, 0.999])
@pytest.mark.parametrize("tail", [bytes(8192), b"\xff" * 3000], ids=["zeros", "ones"])
def test_a_jpeg_that_is_cut_and_filled_up_is_damaged(kept: float, tail: bytes) -> None:
    plain = encode_picture(BGR, "jpeg")
    with pytest.raises(DecodingError, match="cut"):
        decoder_of(schemas.COMPRESSED_IMAGE).pixels(
            picture_message(plain[: int(kept * len(plain))] + tail, "jpeg"), colour=True
        )


def test_a_jpeg_without_tables_is_read_as_cameras_of_usb_send_it() -> None:
    """Motion JPEG leaves out the Huffman tables: they are the standard's."""
    plain = encode_picture(BGR, "jpeg")
    kept, place = plain[:2], 2
    while plain[place + 1] != 0xDA:
        end = place + 2 + int.from_bytes(plain[place + 2 : place + 4], "big")
        kept += plain[place:end] if plain[place + 1] != 0xC4 else b""
        place = end
    pixels = decoder_of(schemas.COMPRESSED_IMAGE).pixels(picture_message(kept + plain[place:], "mjpeg"), colour=True)
    assert np.array_equal(pixels, cv2.imdecode(np.frombuffer(plain, np.uint8), cv2.IMREAD_COLOR))


_WIDE = GREY.astype("<u2") * 16
"""Values of 12 bits."""


@pytest.mark.parametrize(
    ("name", "like"),
    [
        ("bayerrg8", "bayer_rggb8"),
        ("BayerRG8", "bayer_rggb8"),
        ("BayerBG8", "bayer_bggr8"),
        ("BayerGB8", "bayer_gbrg8"),
        ("BayerGR8", "bayer_grbg8"),
        ("SRGGB8", "bayer_rggb8"),
        ("Mono8", "mono8"),
        ("CV_8UC1", "mono8"),
        ("GREY", "mono8"),
    ],
)
def test_other_names_of_an_encoding_are_known(name: str, like: str) -> None:
    decoder = decoder_of(schemas.IMAGE)
    named, known = (decoder.pixels(image_message(GREY, one), colour=True) for one in (name, like))
    assert np.array_equal(named, known)


@pytest.mark.parametrize(
    ("name", "like"),
    [("RGB8", "rgb8"), ("RGB8Packed", "rgb8"), ("BGR8", "bgr8"), ("CV_8UC3", "bgr8"), ("bgr24", "bgr8")],
)
def test_other_names_of_colours_are_known(name: str, like: str) -> None:
    decoder = decoder_of(schemas.IMAGE)
    named, known = (decoder.pixels(image_message(BGR, one), colour=True) for one in (name, like))
    assert np.array_equal(named, known)


@pytest.mark.parametrize("name", ["BayerRG12", "bayer_rggb12", "BayerRG10", "bayer_rggb16", "Mono12", "mono16"])
def test_values_of_more_than_8_bits_have_the_depth_that_they_fill(name: str) -> None:
    decoder = decoder_of(schemas.IMAGE)
    assert isinstance(decoder, DeepImageDecoder)
    wide, plain = image_message(_WIDE.view(np.uint8), name), "mono8" if "ono" in name else "bayer_rggb8"
    assert decoder.largest_value(wide) == 16 * int(GREY.max())
    decoder.use_depth("/a", 12)
    assert np.array_equal(decoder.pixels(wide, colour=True), decoder.pixels(image_message(GREY, plain), colour=True))


@pytest.mark.parametrize("name", ["BayerRG12p", "BayerRG12Packed", "Mono12p", "Mono10Packed", "bayer", "bayerxx8"])
def test_packed_and_unknown_encodings_are_refused_by_name(name: str) -> None:
    with pytest.raises(DecodingError, match=name):
        decoder_of(schemas.IMAGE).pixels(image_message(GREY, name), colour=True)


def test_an_image_without_an_encoding_is_said_to_have_none() -> None:
    """One byte a pixel may be grey or a mosaic."""
    with pytest.raises(DecodingError, match="does not say its encoding"):
        decoder_of(schemas.IMAGE).pixels(image_message(GREY, ""), colour=True)


@pytest.mark.parametrize(("size", "encoding"), [(0, ""), (64, "h264"), (64, "jpeg")])
@pytest.mark.parametrize(
    ("begins", "said"), [(b"\0\0\0\1", "a video"), (b"\0\0\1", "a video"), (b"\xff\xd8\xff", "a JPEG")]
)
def test_a_file_in_a_raw_image_is_said_by_its_first_bytes(size: int, encoding: str, begins: bytes, said: str) -> None:
    data = np.frombuffer(begins + bytes(48 * 64 - len(begins)), np.uint8).reshape(48, 64)
    decoder, message = decoder_of(schemas.IMAGE), image_message(data, encoding, width=size, height=size)
    for read in (decoder.size_px, lambda one: decoder.pixels(one, colour=True)):
        with pytest.raises(DecodingError, match=f"no pixels but {said}"):
            read(message)


def test_dark_pixels_are_no_video() -> None:
    dark = np.zeros((48, 64), np.uint8)
    dark[0, 3] = 1
    assert np.array_equal(pixels(image_message(dark, "passthrough")), dark)


SMOOTH = cv2.resize(RANDOM.integers(40, 216, (6, 8, 3), np.uint8), (64, 48), interpolation=cv2.INTER_CUBIC)
VALUES_12 = cv2.resize(RANDOM.integers(0, 4096, (6, 8), np.uint16), (64, 48), interpolation=cv2.INTER_LINEAR)


@pytest.mark.parametrize(
    ("data", "right", "wrong", "is_bigendian"),
    [
        (VALUES_12.astype(">u2").view(np.uint8), {"encoding": "mono16", "is_bigendian": 1}, "mono16", 0),
        (VALUES_12.astype("<u2").view(np.uint8), {"encoding": "mono16"}, "mono16", 1),
        (yuyv(SMOOTH), {"encoding": "yuyv"}, "yuv422", 0),
        (yuyv(SMOOTH)[..., ::-1], {"encoding": "uyvy"}, "yuv422_yuy2", 0),
    ],
)
@pytest.mark.parametrize("colour", [True, False])
def test_bytes_the_other_way_round_than_declared_are_put_right_and_said(
    data: NDArray[np.uint8], right: dict[str, object], wrong: str, is_bigendian: int, colour: bool
) -> None:
    decoder = decoder_of(schemas.IMAGE)
    declared = image_message(data, wrong, is_bigendian=is_bigendian)
    found = decoder.pixels(declared, colour=colour)
    assert np.array_equal(found, pixels(image_message(data, **right), colour=colour))  # type: ignore[arg-type]
    assert isinstance(decoder, RepairingDecoder)
    [repair] = decoder.repairs
    assert repair.startswith("/a: its bytes do not lie as declared")


@pytest.mark.parametrize("values", [VALUES_12, VALUES_12 << 4, RANDOM.integers(0, 4096, (48, 64)), VALUES_12 * 0 + 7])
def test_bytes_are_left_as_declared_where_the_other_way_is_not_far_smoother(values: NDArray[np.uint16]) -> None:
    decoder = decoder_of(schemas.IMAGE)
    decoder.pixels(image_message(values.astype("<u2").view(np.uint8), "mono16"), colour=False)
    decoder.pixels(image_message(yuyv(SMOOTH), "yuyv"), colour=False)
    decoder.pixels(image_message(yuyv(BGR // 255), "yuyv"), colour=False)
    assert isinstance(decoder, RepairingDecoder)
    assert not decoder.repairs
