"""Packets of Ouster's LiDARs: their points against those of the maker's own library."""

import base64
import json
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

from auditor.errors import DecodingError
from auditor.model.coverage import TopicState
from auditor.model.frames import Frame
from auditor.recordings import open_recording, schemas, search_rigs, synchronise
from auditor.recordings.decoding import Decoders
from auditor.recordings.decoding.points.ouster import sensor_of
from auditor.recordings.decoding.ros import known_types
from auditor.recordings.synchronisation.coverage import outside_topics
from auditor.recordings.synchronisation.sectors import sweep_of
from auditor.recordings.synchronisation.survey import Survey, survey
from auditor.recordings.writers.convert import write_clip
from tests.making.ouster import METADATA_TOPIC, PACKETS, TOPIC, metadata, packet_message, packets

MADE_BY_THE_MAKER = json.loads(Path(__file__).with_name("ouster_packets.json").read_text())
"""A packet of each profile as ouster-sdk 1.0.1 writes it, and its points by the same library."""


def decoder(text: str | None = None, encoding: str = "cdr") -> object:
    known = Decoders(lambda _: None, metadata={TOPIC: metadata() if text is None else text})
    return known.cloud(schemas.OUSTER[0], encoding)


@pytest.mark.parametrize("made", MADE_BY_THE_MAKER, ids=[made["profile"] for made in MADE_BY_THE_MAKER])
def test_points_are_those_of_the_makers_library(made: dict[str, object]) -> None:
    packet = base64.b64decode(str(made["packet"]))
    reading = decoder(json.dumps(made["metadata"]))
    for data in (packet, packet + b"\0"):  # older drivers write a byte more
        xyz_m = reading.xyz_m(packet_message(data))
        assert xyz_m == pytest.approx(np.array(made["xyz_m"]), abs=1e-5)
    assert reading.header(packet_message(packet)).stamp_ns == 1_700_000_000_000_000_000 + 128 * 195312


def test_metadata_of_firmware_before_three_are_read() -> None:
    nested = json.loads(metadata())
    form = {key: nested["lidar_data_format"][key] for key in nested["lidar_data_format"] if "udp" not in key}
    flat = {**nested["beam_intrinsics"], **nested["lidar_intrinsics"], "data_format": form}
    del flat["beam_to_lidar_transform"]
    sensor = sensor_of(json.dumps(flat | {"lidar_origin_to_beam_origin_mm": 27.67}))
    assert (sensor.profile, sensor.beam_mm) == ("LEGACY", (27.67, 0.0))


def test_metadata_of_firmware_before_two_are_read_of_an_os_1() -> None:
    nested = json.loads(metadata())
    beams = {key: [1.0] * 64 for key in ("beam_azimuth_angles", "beam_altitude_angles")}
    old = {"lidar_data_format": "error: Command not recognized.", "config_params": {"lidar_mode": "1024x10"}}
    old |= {"beam_intrinsics": beams, "lidar_intrinsics": nested["lidar_intrinsics"]}
    sensor = sensor_of(json.dumps(old | {"sensor_info": {"prod_line": "OS-1-64"}}))
    assert (sensor.columns, sensor.packet_bytes, sensor.beam_mm) == (1024, 12_608, (15.806, 0.0))
    with pytest.raises(DecodingError):
        sensor_of(json.dumps(old | {"sensor_info": {"prod_line": "OS-2-64"}}))


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_a_packet_looks_no_further_than_its_columns_and_its_points_do(encoding: str) -> None:
    _, packet = next(packets(7))
    message = packet_message(packet, encoding=encoding)
    looks, points = (getattr(decoder(encoding=encoding), name)(message) for name in ("looks", "xyz_m"))
    spread = [np.ptp(np.degrees(np.arctan2(xyz[:, 1], xyz[:, 0]))) for xyz in (looks, points)]
    assert spread[0] == pytest.approx(15 * 360 / 512, abs=1e-3)
    assert spread[1] > spread[0] + 5


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "nothing",
        "{}",
        "[" * 10_000,
        metadata("RNG99"),
        metadata(pixels_per_column=7),
        metadata(columns_per_frame=10**9),
        metadata(columns_per_packet=0),
        metadata().replace("27.67", "1e300"),
        metadata().replace("4.2", "null"),
        " " * 2**18,
    ],
)
def test_other_texts_are_no_metadata(text: str) -> None:
    with pytest.raises(DecodingError, match="metadata"):
        decoder(text).xyz_m(packet_message(next(packets(7))[1]))


@pytest.mark.parametrize("length", [0, 48, 255, 256, 3000])
def test_a_packet_of_another_length_has_no_points(length: int) -> None:
    with pytest.raises(DecodingError, match="packet"):
        decoder().xyz_m(packet_message(next(packets(7))[1][:length]))


def write(folder: Path, *, text: str | None = None, attached: bool = False) -> Path:
    """Eight revolutions, packets of the LiDAR's IMU, and the metadata behind the first packets, or attached."""
    with (folder / "a.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2")
        topics = {TOPIC: schemas.OUSTER[2], "/ouster/imu_packets": schemas.OUSTER[2], METADATA_TOPIC: schemas.STRING}
        channels = {
            topic: writer.register_channel(topic, "cdr", writer.register_schema(schema, "ros2msg", b""))
            for topic, schema in topics.items()
        }
        for number in range(8):
            for time_ns, packet in packets(10**18 + number * 10**8):
                message = packet_message(packet, time_ns)
                writer.add_message(channels[TOPIC], time_ns, message.data, time_ns)
            imu = packet_message(time_ns.to_bytes(8, "little") + bytes(40)).data
            writer.add_message(channels["/ouster/imu_packets"], time_ns, imu, time_ns)
            if number == 0 and text is not None and not attached:
                store = known_types("cdr")
                data = bytes(store.serialize_cdr(store.types[schemas.STRING](data=text), schemas.STRING))
                writer.add_message(channels[METADATA_TOPIC], time_ns, data, time_ns)
        if attached and text is not None:
            writer.add_attachment(1, 1, "os.json", "application/json", text.encode())
        writer.finish()
    return folder / "a.mcap"


def surveyed(path: Path) -> tuple[Survey, dict[str, tuple[TopicState, str]]]:
    with open_recording(path) as recording:
        found = survey(recording)
        for _ in recording.messages():
            pass
        return found, {one.topic: (one.state, one.remedy) for one in outside_topics(recording, found)}


@pytest.mark.parametrize("attached", [False, True])
def test_packets_are_read_by_the_metadata_beside_them_and_make_sweeps(tmp_path: Path, *, attached: bool) -> None:
    found, states = surveyed(write(tmp_path, text=metadata(), attached=attached))
    [cloud] = found.clouds
    sweep = sweep_of(cloud.sectors, 0.0)
    assert sweep is not None
    assert (cloud.topic.name, cloud.frame_id, sweep.parts) == (TOPIC, "os_sensor", PACKETS)
    assert states["/ouster/imu_packets"][0] is TopicState.LEFT_OUT


def test_packets_without_metadata_are_said_with_what_to_do(tmp_path: Path) -> None:
    found, states = surveyed(write(tmp_path))
    assert not found.clouds
    assert states[TOPIC][0] is TopicState.UNREADABLE
    assert "metadata" in states[TOPIC][1]
    assert states["/ouster/imu_packets"][0] is TopicState.LEFT_OUT


def test_frames_hold_the_points_of_whole_revolutions(tmp_path: Path) -> None:
    with open_recording(write(tmp_path, text=metadata())) as recording:
        found = survey(recording)
        [rig] = search_rigs(found).rigs
        stream = synchronise(recording, rig, found)
        frames = [frame for frame in stream if isinstance(frame, Frame)]
    assert len(frames) >= 6
    whole = np.concatenate([decoder().xyz_m(packet_message(packet)) for _, packet in packets(7)])
    for frame in frames:
        assert frame.cloud is not None
        assert np.array_equal(np.unique(frame.cloud.xyz_m, axis=0), np.unique(whole, axis=0))
        assert len(frame.cloud.xyz_m) == len(whole)


def test_a_clip_has_the_metadata_from_before_its_seconds(tmp_path: Path) -> None:
    with open_recording(write(tmp_path, text=metadata())) as recording:
        clip = write_clip(recording, tmp_path / "clip.mcap", 10**18 + 5 * 10**8, 10**18 + 8 * 10**8)
    assert clip.before == 1
    with open_recording(tmp_path / "clip.mcap") as recording:
        assert [cloud.topic.name for cloud in survey(recording).clouds] == [TOPIC]
