from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import Writer
from mcap_protobuf.schema import build_file_descriptor_set

from auditor.errors import DecodingError
from auditor.model.frames import Message
from auditor.model.optics.geometry import motion, rotation_from_quaternion
from auditor.recordings import convert, find_rigs, open_recording, survey
from auditor.recordings.decoding import Decoders
from auditor.recordings.decoding.foxglove_layouts import LAYOUTS, LOCATION_FIX, TIMESTAMP
from auditor.recordings.decoding.protobuf import MAX_FIELDS, check_schema, decode_protobuf
from auditor.recordings.recording import Definition
from tests.making.foxglove_messages import (
    cloud_fields,
    json_text,
    messages_of,
    nuscenes,
    protobuf_message,
    stamp,
    transform,
    write_json,
    write_protobuf,
)
from tests.making.recorded_drives import make_frames, make_rig, same_frame, split, stream_of

RIG = make_rig(3)
FRAMES = make_frames(RIG, 6)
XYZ = np.arange(90, dtype=np.float32).reshape(30, 3)
CLOUD = "foxglove.PointCloud"
ENCODINGS = ["protobuf", "json"]


def message(schema: str, fields: dict[str, Any], encoding: str) -> Message:
    data = json_text(fields) if encoding == "json" else protobuf_message(schema, fields).SerializeToString()
    return Message("/a", schema, encoding, 9, data)


def decoder(of: Message, definition: Definition | None = None) -> Any:
    found = Decoders(lambda _: definition).of(of.schema, of.encoding)
    assert found is not None
    return found


def descriptor_set(schema: str) -> bytes:
    made: bytes = build_file_descriptor_set(type(protobuf_message(schema, {}))).SerializeToString()
    return made


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_negative_timestamp_is_read_as_it_is(encoding: str) -> None:
    cloud = message(CLOUD, cloud_fields(XYZ, -3 * 10**9, "lidar"), encoding)
    assert decoder(cloud).header(cloud).stamp_ns == -3 * 10**9
    assert len(decoder(cloud).xyz_m(cloud)) == len(XYZ)


@pytest.mark.parametrize("one_transform_a_message", [False, True])
@pytest.mark.parametrize("form", ["raw", "png"])
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_frames_come_out_as_they_went_in(
    tmp_path: Path, encoding: str, form: str, one_transform_a_message: bool
) -> None:
    write = write_json if encoding == "json" else write_protobuf
    write(tmp_path / "a.mcap", messages_of(RIG, FRAMES, form, one_transform_a_message=one_transform_a_message))
    with open_recording(tmp_path / "a.mcap") as recording:
        frames, skipped = split(stream_of(recording))
        assert recording.damage == ()
    assert not skipped
    assert len(frames) == len(FRAMES)
    assert all(same_frame(a, b) for a, b in zip(frames, FRAMES, strict=True))


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_conversion_keeps_the_messages_as_they_are(tmp_path: Path, encoding: str) -> None:
    write = write_json if encoding == "json" else write_protobuf
    write(tmp_path / "a.mcap", messages_of(RIG, FRAMES))
    with open_recording(tmp_path / "a.mcap") as recording:
        convert(recording, tmp_path / "b.mcap")
        before = [m.data for m in recording.messages()]
    with open_recording(tmp_path / "b.mcap") as recording:
        assert [m.data for m in recording.messages()] == before
        frames, _ = split(stream_of(recording))
    assert all(same_frame(a, b) for a, b in zip(frames, FRAMES, strict=True))


NOT_READ = {
    LOCATION_FIX: {
        4: "position_covariance",
        5: "position_covariance_type",
        8: "color",
        9: "metadata",
        10: "heading",
        11: "velocity",
    }
}
"""Fields that foxglove publishes and no layout has: nothing is made of them."""


@pytest.mark.parametrize("schema", sorted(set(LAYOUTS) - {TIMESTAMP}))
def test_our_layouts_are_those_that_foxglove_publishes(schema: str) -> None:
    check_schema(schema, descriptor_set(schema))
    published = {field.number: field.name for field in protobuf_message(schema, {}).DESCRIPTOR.fields}
    known = {number: field.name for number, field in LAYOUTS[schema].items()}
    assert {**known, **NOT_READ.get(schema, {})} == published


@pytest.mark.parametrize(
    ("known", "other"), [(b"point_stride", b"point_strude"), (b"frame_id\x18\x02", b"frame_id\x18\x07")]
)
def test_a_schema_that_defines_a_known_name_otherwise_is_refused(known: bytes, other: bytes) -> None:
    schema = descriptor_set(CLOUD)
    assert known in schema
    cloud = message(CLOUD, cloud_fields(XYZ, 5, "top"), "protobuf")
    assert len(decoder(cloud, Definition("protobuf", schema)).xyz_m(cloud)) == 30
    with pytest.raises(DecodingError, match="defined otherwise"):
        decoder(cloud, Definition("protobuf", schema.replace(known, other))).xyz_m(cloud)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_points_are_taken_into_their_frame_by_the_pose(encoding: str) -> None:
    pose = {"position": {"x": 1.0, "y": 2.0, "z": 3.0}, "orientation": {"x": 0.0, "y": 0.0, "z": 0.6, "w": 0.8}}
    cloud = message(CLOUD, cloud_fields(XYZ, 5, "top", pose=pose), encoding)
    turned = motion(rotation_from_quaternion(0, 0, 0.6, 0.8), np.array([1.0, 2, 3]))
    assert np.allclose(decoder(cloud).xyz_m(cloud), XYZ @ turned[:3, :3].T + turned[:3, 3], atol=1e-4)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_points_of_64_bits_between_other_fields_are_read(encoding: str) -> None:
    points = np.zeros((30, 5))
    points[:, 1:4] = XYZ
    fields = [{"name": "i", "offset": 0, "type": 8}]
    fields += [{"name": name, "offset": 8 * n, "type": 8} for n, name in enumerate("xyz", 1)]
    changed = cloud_fields(XYZ, 5, "top", data=points.tobytes(), fields=fields, point_stride=40)
    cloud = message(CLOUD, changed, encoding)
    assert np.array_equal(decoder(cloud).xyz_m(cloud), XYZ)


@pytest.mark.parametrize(
    "wrong",
    [
        {"point_stride": 0},
        {"point_stride": 7},
        {"point_stride": 2**32 - 1},
        {"fields": []},
        {"fields": [{"name": n, "offset": 0, "type": 99} for n in "xyz"]},
        {"data": XYZ.tobytes()[:-1]},
        {"pose": {"orientation": {"x": float("nan"), "y": 0.0, "z": 0.0, "w": 0.0}}},
        {"pose": {"orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}}},
        {"pose": {"position": {"x": 1e300, "y": 0.0, "z": 0.0}}},
    ],
)
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_cloud_that_does_not_hold_what_it_declares_is_damaged(encoding: str, wrong: dict[str, Any]) -> None:
    cloud = message(CLOUD, cloud_fields(XYZ, 5, "top", **wrong), encoding)
    with pytest.raises(DecodingError):
        decoder(cloud).xyz_m(cloud)


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_calibration_without_r_and_p_is_that_of_a_camera_alone(encoding: str) -> None:
    K = [50.0, 0, 32, 0, 50, 24, 0, 0, 1]
    fields = {"timestamp": stamp(7), "frame_id": "/cam", "width": 64, "height": 48, "K": K}
    calibration = message("foxglove.CameraCalibration", fields, encoding)
    info = decoder(calibration).camera_info(calibration)
    assert (info.header.stamp_ns, info.header.frame_id, info.width_px, info.height_px) == (7, "cam", 64, 48)
    assert np.array_equal(info.rotation, np.eye(3))
    assert np.array_equal(info.projection, np.hstack([np.array(K).reshape(3, 3), np.zeros((3, 1))]))


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_a_transform_without_a_rotation_worth_the_name_is_refused(encoding: str) -> None:
    fields = transform("a", "b", np.eye(4), 5)
    fields["rotation"] = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}
    one = message("foxglove.FrameTransform", fields, encoding)
    with pytest.raises(DecodingError, match="no rotation"):
        decoder(one).transforms(one)


def test_a_message_of_endless_fields_is_refused() -> None:
    with pytest.raises(DecodingError, match="fields"):
        decode_protobuf(CLOUD, memoryview(b"\x78\x00" * (MAX_FIELDS + 1)))


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"[]",
        b"null",
        b"{",
        b"[" * 50_000,
        b"[" * 200_000,
        b'{"timestamp": 5}',
        b'{"timestamp": {"sec": 1e400}}',
        b'{"timestamp": {"sec": 99999999999999999999999}}',
        b'{"data": "***"}',
        b'{"data": "abc"}',
        b'{"data": 7}',
        b'{"width": "7"}',
        b'{"width": -1}',
        b'{"width": 1.5}',
        b'{"frame_id": {}}',
        b"[" + b"1," * 200_000 + b"1]",
        b'{"sec": ' + b"9" * 5000 + b"}",
        b"\xff\xfe",
    ],
)
def test_json_that_is_not_a_raw_image_raises_only_our_own_error(data: bytes) -> None:
    image = Message("/a", "foxglove.RawImage", "json", 9, data)
    with pytest.raises(DecodingError):
        decoder(image).pixels(image, colour=False)


@settings(max_examples=50, deadline=None, derandomize=True)
@given(st.data())
@pytest.mark.parametrize("encoding", ENCODINGS)
def test_noise_raises_only_our_own_error(encoding: str, data: st.DataObject) -> None:
    whole = message(CLOUD, cloud_fields(XYZ, 5, "top"), encoding)
    content = bytearray(whole.data)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at : at + 4] = data.draw(st.binary(min_size=0, max_size=6))
    noisy = Message("/a", CLOUD, encoding, 9, bytes(content))
    try:
        decoder(noisy).header(noisy)
        assert np.isfinite(decoder(noisy).xyz_m(noisy)).all()
    except DecodingError:
        pass


def test_a_topic_in_an_encoding_without_a_decoder_is_named(tmp_path: Path) -> None:
    with (tmp_path / "a.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start("")
        schema = writer.register_schema("foxglove.RawImage", "flatbuffer", b"")
        writer.add_message(writer.register_channel("/cam", "flatbuffer", schema), 1, b"abc", 1)
        writer.finish()
    with open_recording(tmp_path / "a.mcap") as recording:
        known = survey(recording)
    assert known.problems == ("/cam: foxglove.RawImage in the encoding 'flatbuffer' cannot be decoded",)


def test_the_cameras_of_the_real_nuscenes_frame_are_a_rig_each(real_data: Path, tmp_path: Path) -> None:
    write_protobuf(tmp_path / "a.mcap", nuscenes(real_data / "nuscenes_one_frame"))
    with open_recording(tmp_path / "a.mcap") as recording:
        known = survey(recording)
    assert [cloud.points for cloud in known.clouds] == [34_688]
    assert {image.size_px for image in known.images} == {(1600, 900)}
    assert len(known.images) == 6
    rigs = find_rigs(known)
    assert len({rig.topic(1) for rig in rigs}) == len(rigs) == 6
    assert all(rig.by_time for rig in rigs)
