"""Points as drivers and transports write them: Livox's CustomMsg, and compressed clouds."""

import gzip
import tracemalloc
import zlib
from collections.abc import Callable
from contextlib import suppress

import lz4.block
import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings import schemas
from auditor.recordings.decoding import CloudDecoder, Decoders
from auditor.recordings.decoding.standard_types import known_types
from auditor.recordings.recording import Definition

XYZ = np.random.default_rng(3).normal(0, 10, (31, 3)).astype(np.float32)
PACK: dict[str, Callable[[bytes], bytes]] = {
    "zlib": zlib.compress,
    "zlib as gzip": gzip.compress,
    "zstd": zstandard.compress,
    "lz4": lz4.frame.compress,
    "lz4 block": lambda data: lz4.block.compress(data, store_size=False),
}


def decoder_of(schema: str, encoding: str, text: bytes | None = None) -> CloudDecoder:
    definition = None if text is None else Definition("ros1msg" if encoding == "ros1" else "ros2msg", text)
    found = Decoders(lambda _: definition).cloud(schema, encoding)
    assert found is not None
    return found


def header(store: object, frame_id: str, *, ros1: bool) -> object:
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=7, nanosec=9)
    return types["std_msgs/msg/Header"](**({"seq": 0} if ros1 else {}), stamp=stamp, frame_id=frame_id)


def livox(schema: str, encoding: str, xyz: np.ndarray = XYZ, frame_id: str = "livox", **given: object) -> Message:
    """As rosbags writes it from the driver's own definition."""
    store = known_types(encoding)
    Point, Custom = store.types[schema.replace("CustomMsg", "CustomPoint")], store.types[schema]
    points = [
        Point(offset_time=n, x=float(x), y=float(y), z=float(z), reflectivity=200, tag=16, line=n % 6)
        for n, (x, y, z) in enumerate(xyz)
    ]
    head = header(store, frame_id, ros1=encoding == "ros1")
    message = Custom(header=head, timebase=9, point_num=len(xyz), lidar_id=1, rsvd=np.zeros(3, np.uint8), points=points)
    data = store.serialize_ros1(message, schema) if encoding == "ros1" else store.serialize_cdr(message, schema)
    return Message("/livox/lidar", schema, encoding, 5, bytes(data))


def compressed(form: str, packed: bytes, **given: object) -> Message:
    store, schema = known_types(), schemas.COMPRESSED_CLOUD
    Field = store.types["sensor_msgs/msg/PointField"]
    fields = [Field(name=name, offset=4 * place, datatype=7, count=1) for place, name in enumerate("xyz")]
    values = {"height": 1, "width": len(XYZ), "point_step": 12, "row_step": 12 * len(XYZ), **given}
    message = store.types[schema](
        header=header(store, "top", ros1=False),
        fields=fields,
        is_bigendian=False,
        is_dense=True,
        format=form,
        compressed_data=np.frombuffer(packed, np.uint8),
        **values,
    )
    return Message("/points", schema, "cdr", 5, bytes(store.serialize_cdr(message, schema)))


@pytest.mark.parametrize("schema", schemas.LIVOX)
@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
@pytest.mark.parametrize("frame_id", ["", "l", "liv", "livox_frame"])
def test_points_of_livox_are_read(schema: str, encoding: str, frame_id: str) -> None:
    decoder, message = decoder_of(schema, encoding), livox(schema, encoding, frame_id=frame_id)
    assert np.array_equal(decoder.xyz_m(message), XYZ)
    assert (decoder.header(message).stamp_ns, decoder.header(message).frame_id) == (7 * 10**9 + 9, frame_id)


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_missing_returns_of_livox_are_left_out(encoding: str) -> None:
    xyz = XYZ.copy()
    xyz[3], xyz[7, 1] = np.nan, np.inf
    assert len(decoder_of(schemas.LIVOX[1], encoding).xyz_m(livox(schemas.LIVOX[1], encoding, xyz))) == len(XYZ) - 2
    assert len(decoder_of(schemas.LIVOX[1], encoding).xyz_m(livox(schemas.LIVOX[1], encoding, XYZ[:0]))) == 0


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_a_cut_message_of_livox_is_damaged(encoding: str) -> None:
    schema = schemas.LIVOX[0]
    decoder, whole = decoder_of(schema, encoding), livox(schema, encoding).data
    for length in range(len(whole)):
        with pytest.raises(DecodingError):
            decoder.xyz_m(Message("/a", schema, encoding, 5, whole[:length]))


def test_a_message_of_livox_that_is_defined_otherwise_is_refused() -> None:
    text = b"std_msgs/Header header\nuint64 timebase\nuint32 point_num\nCustomPoint[] points\n"
    with pytest.raises(DecodingError, match="otherwise"):
        decoder_of(schemas.LIVOX[1], "cdr", text).xyz_m(livox(schemas.LIVOX[1], "cdr"))


@pytest.mark.parametrize("form", PACK)
def test_compressed_clouds_are_read_whatever_their_transport_is_called(form: str) -> None:
    message = compressed("lz4" if "block" in form else "cloud", PACK[form](XYZ.tobytes()))
    assert np.array_equal(decoder_of(schemas.COMPRESSED_CLOUD, "cdr").xyz_m(message), XYZ)


@pytest.mark.parametrize("form", PACK)
@pytest.mark.parametrize("size", [-12, -1, 1, 12, 10**6])
def test_a_compressed_cloud_of_another_size_is_damaged(form: str, size: int) -> None:
    data = XYZ.tobytes()
    data = data[:size] if size < 0 else data + bytes(size)
    with pytest.raises(DecodingError):
        decoder_of(schemas.COMPRESSED_CLOUD, "cdr").xyz_m(compressed("lz4", PACK[form](data)))


@pytest.mark.parametrize("form", PACK)
@pytest.mark.parametrize("declared", [1, 31, 10**6, 2**32 - 1])
def test_a_compressed_cloud_takes_no_more_memory_than_it_may(form: str, declared: int) -> None:
    bomb = compressed("lz4", PACK[form](bytes(50_000_000)), width=declared, row_step=min(12 * declared, 2**32 - 1))
    decoder = decoder_of(schemas.COMPRESSED_CLOUD, "cdr")
    with suppress(DecodingError):
        decoder.xyz_m(compressed("zlib", zlib.compress(XYZ.tobytes())))  # its definition is parsed once
    tracemalloc.start()
    with suppress(DecodingError):
        decoder.xyz_m(bomb)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 130e6 if declared == 10**6 else most < 20e6


@pytest.mark.parametrize(
    ("data", "says"), [(b"DRACO\2\2", "Draco"), (b"CLOUDINI_V03", "cloudini"), (b"", "'new'"), (b"?", "'new'")]
)
def test_other_compressed_points_are_said_by_name(data: bytes, says: str) -> None:
    with pytest.raises(DecodingError, match=says):
        decoder_of(schemas.COMPRESSED_CLOUD, "cdr").xyz_m(compressed("new", data))


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.sampled_from(sorted(PACK)), st.data())
def test_damaged_clouds_raise_one_kind_of_error(form: str, data: st.DataObject) -> None:
    schema = data.draw(st.sampled_from([schemas.COMPRESSED_CLOUD, schemas.LIVOX[1]]))
    whole = bytearray(
        (compressed(form, PACK[form](XYZ.tobytes())) if "point_cloud" in schema else livox(schema, "cdr")).data
    )
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    with suppress(DecodingError):
        decoder_of(schema, "cdr").xyz_m(
            Message("/a", schema, "cdr", 5, bytes(whole[: data.draw(st.integers(0, len(whole)))]))
        )
