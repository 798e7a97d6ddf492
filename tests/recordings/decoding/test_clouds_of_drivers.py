"""Points as drivers and transports write them: Livox's CustomMsg, and compressed clouds."""

import gzip
import struct
import sys
import tracemalloc
import zlib
from collections.abc import Callable
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

import lz4.block
import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.recordings import open_recording, schemas
from auditor.recordings.decoding import CloudDecoder, Decoders
from auditor.recordings.decoding.ros import known_types
from auditor.recordings.recording import Definition
from tests.making.velodyne import header, velodyne_scan

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
    ("data", "says"),
    [(b"CLOUDINI_V03", "damaged"), (b"CLOUDINI_V06\n\0", "version 6"), (b"", "'new'"), (b"?", "'new'")],
)
def test_other_compressed_points_are_said_by_name(data: bytes, says: str) -> None:
    with pytest.raises(DecodingError, match=says):
        decoder_of(schemas.COMPRESSED_CLOUD, "cdr").xyz_m(compressed("new", data))


draco = pytest.mark.skipif(find_spec("DracoPy") is None, reason="the extra `lidar` is not installed")
velodyne = pytest.mark.skipif(find_spec("velodyne_decoder") is None, reason="the extra `lidar` is not installed")


def by_draco(xyz: np.ndarray = XYZ, level: int = 5, bits: int = 18) -> bytes:
    import DracoPy  # noqa: PLC0415  # an extra

    made: bytes = DracoPy.encode(xyz, quantization_bits=bits, compression_level=level, preserve_order=level < 10)
    return made


@draco
@pytest.mark.parametrize("level", [0, 5, 10])
def test_clouds_of_draco_are_read(level: int) -> None:
    found = decoder_of(schemas.COMPRESSED_CLOUD, "cdr").xyz_m(compressed("draco", by_draco(level=level)))
    expected = XYZ if level < 10 else XYZ[np.lexsort(XYZ.T)]
    found = found if level < 10 else found[np.lexsort(found.T)]
    assert np.abs(found - expected).max() < 0.001


@draco
@pytest.mark.parametrize("count", [-1, 32, 10**6, 2**31 - 1])
def test_a_cloud_of_draco_with_more_points_than_its_message_says_is_refused(count: int) -> None:
    data = bytearray(by_draco())
    struct.pack_into("<i", data, 11, count)
    with pytest.raises(DecodingError, match="at most 31 points"):
        decoder_of(schemas.COMPRESSED_CLOUD, "cdr").xyz_m(compressed("draco", bytes(data)))


@draco
def test_a_cloud_of_draco_with_more_bytes_a_point_than_it_may_is_refused_before_it_is_decoded() -> None:
    data = bytearray(by_draco())
    assert data[19] == 3  # components of its only attribute
    data[18], data[19] = 10, 255
    struct.pack_into("<i", data, 11, 10**6)
    with pytest.raises(DecodingError, match="Draco data hold points that"):
        decoder_of(schemas.COMPRESSED_CLOUD, "cdr").xyz_m(compressed("draco", bytes(data), width=10**6))
    with pytest.raises(DecodingError, match="no cloud of at most"):
        decoder_of(schemas.COMPRESSED_CLOUD, "cdr").xyz_m(compressed("draco", b"DRACO\2\2" + bytes([1] * 30)))


@velodyne
@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_packets_of_a_velodyne_are_read(encoding: str) -> None:
    decoder = decoder_of(schemas.VELODYNE, encoding)
    xyz = decoder.xyz_m(velodyne_scan(encoding=encoding))
    assert decoder.header(velodyne_scan(encoding=encoding)).frame_id == "top"
    assert len(xyz) == 76 * 12 * 32
    assert np.linalg.norm(xyz, axis=1) == pytest.approx(10, abs=0.05)
    elevation = np.degrees(np.arcsin(xyz[:, 2] / 10))
    assert np.histogram(elevation, np.arange(-16, 17, 2))[0].tolist() == [len(xyz) // 16] * 16
    first = xyz[np.abs(elevation - 1) < 0.5][0]
    assert np.degrees(np.arctan2(first[1], first[0])) == pytest.approx(0, abs=0.2)  # azimuth 0 is straight ahead
    quarter = xyz[len(xyz) // 4 :][np.abs(elevation[len(xyz) // 4 :] - 1) < 0.5][0]
    assert np.degrees(np.arctan2(quarter[1], quarter[0])) == pytest.approx(-91, abs=1)  # clockwise from above


@velodyne
@pytest.mark.parametrize(
    ("message", "says"),
    [
        (velodyne_scan(0), "0 packets"),
        (velodyne_scan(2, data=bytes(1206)), "unsupported Velodyne model"),
        (velodyne_scan(2, model=0x41), "cannot be decoded"),
    ],
)
def test_packets_of_no_known_velodyne_are_said(message: Message, says: str) -> None:
    with pytest.raises(DecodingError, match=says):
        decoder_of(schemas.VELODYNE, "cdr").xyz_m(message)


@velodyne
def test_a_real_scan_of_a_vlp_16_is_read(real_data: Path) -> None:
    with open_recording(real_data / "real_bags_without_cameras" / "ros2_vlp16") as recording:
        decoder = Decoders(recording.definition).cloud(schemas.VELODYNE, "cdr")
        clouds = [decoder.xyz_m(message) for message in recording.messages()]
    assert len(clouds) == 4
    for xyz in clouds:
        ranges = np.linalg.norm(xyz, axis=1)
        assert len(xyz) > 5000
        assert 0.3 < np.median(ranges) < 100
        far = xyz[ranges > 5]
        elevation = np.degrees(np.arcsin(far[:, 2] / np.linalg.norm(far, axis=1)))
        assert np.mean(np.abs((elevation + 15) / 2 - np.round((elevation + 15) / 2)) < 0.1) > 0.9  # -15, -13, ... deg


@pytest.mark.parametrize(
    ("package", "schema"), [("DracoPy", schemas.COMPRESSED_CLOUD), ("velodyne_decoder", schemas.VELODYNE)]
)
def test_without_the_extra_its_name_is_said(package: str, schema: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    message = velodyne_scan(1) if schema == schemas.VELODYNE else compressed("draco", b"DRACO" + bytes(30))
    with pytest.raises(DecodingError, match=r"install auditor\[lidar\]"):
        decoder_of(schema, "cdr").xyz_m(message)


@draco
@velodyne
@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.booleans(), st.data())
def test_damaged_packets_and_draco_raise_one_kind_of_error(packets: bool, data: st.DataObject) -> None:
    schema = schemas.VELODYNE if packets else schemas.COMPRESSED_CLOUD
    whole = bytearray((velodyne_scan(2) if packets else compressed("draco", by_draco())).data)
    for _ in range(data.draw(st.integers(1, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    with suppress(DecodingError):
        decoder_of(schema, "cdr").xyz_m(Message("/a", schema, "cdr", 5, bytes(whole)))


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
