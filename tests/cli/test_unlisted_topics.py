"""Every topic with data is accounted for: read, shown to be no sensor, or said, whatever its type and its name are."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest

from auditor.cli import run
from auditor.recordings import Topic, open_recording, schemas
from auditor.recordings.recording import Definition
from auditor.recordings.writers.messages import MessageMaker
from tests.making.restamped import Extra, Told, rewritten
from tests.making.small_drives import PERIOD_NS, START_NS, write_drive

COUNT = 8
CAMERAS = (0.6, 0.3, 0.0)
BLOB = Definition("ros2msg", b"float64 timestamp\nuint8[] data\n")
RGBD = Definition(
    "ros2msg",
    b"sensor_msgs/Image rgb\nsensor_msgs/Image depth\n" + b"=" * 80 + b"\nMSG: sensor_msgs/Image\nuint8[] data\n",
)
OF_IDL = Definition("ros2idl", b"module a { struct B { sequence<octet> data; }; };")
OF_JSON = Definition("jsonschema", b'{"properties": {"data": {"type": "string", "contentEncoding": "base64"}}}')
TRACKS = Definition("ros2msg", b"std_msgs/Header header\nRadarTrack[] tracks\n")
STATES = Definition("ros2msg", b"float64[] values\nuint8[8] frame\n")


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clean drive, and beside it a store with its thresholds."""
    folder = tmp_path_factory.mktemp("unlisted")
    drive = write_drive(folder / "clean.mcap", COUNT, seed=1, positions_m=CAMERAS)
    assert run(["calibrate", str(drive), "--store", str(folder / "audit")]) == 0
    return drive


def same(told: Told) -> Iterator[Told]:
    yield told


def beside(
    name: str,
    schema: str,
    size_bytes: int,
    definition: Definition | None = None,
    encoding: str = "cdr",
    count: int = COUNT,
) -> Extra:
    """A topic with a message of so many bytes every period."""
    data = b"\0\1\0\0" + bytes(size_bytes - 4)
    times = tuple((START_NS + n * PERIOD_NS, data) for n in range(count))
    return Extra(Topic(name, schema, encoding), times, definition)


def scan(path: Path, clean: Path, *options: str) -> int:
    [thresholds] = (clean.parent / "audit" / "calibrations").glob("*.parquet")
    store = str(path.parent / path.stem)
    given = ["--pictures", "none", "--store", store, "--calibration", str(thresholds)]
    return run(["scan", str(path), *given, *options])


def codes(path: Path, clean: Path, capfd: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """The exit code of a scan and what it said; inspect ends alike."""
    capfd.readouterr()
    code, said = scan(path, clean), capfd.readouterr().err
    assert run(["inspect", str(path)]) == code
    capfd.readouterr()
    return code, said


def topics_of(path: Path, capfd: pytest.CaptureFixture[str]) -> dict[tuple[str, str], dict[str, object]]:
    capfd.readouterr()
    run(["inspect", str(path), "--format", "json"])
    [one] = json.loads(capfd.readouterr().out)
    return {(topic["topic"], topic["schema"]): topic for topic in one["topics"]}


BY_THEIR_DATA = [
    (beside("/iv_packets", "acme_lidar/msg/Scan", 2000, BLOB), "whose definition holds raw bytes"),
    (beside("/rgbd", "rtabmap_msgs/msg/RGBDImage", 60_000, RGBD), "whose definition holds sensor_msgs/Image"),
    (beside("/scan_blob", "a/msg/B", 2000, OF_IDL), "whose definition holds raw bytes"),
    (beside("/json_cam", "acme.Frame", 5000, OF_JSON, "json"), "whose definition holds raw bytes"),
    (beside("/events", "event_camera_msgs/msg/EventPacket", 60_000), "event_camera_msgs/msg/EventPacket is not"),
    (beside("/bytes", "std_msgs/msg/UInt8MultiArray", 60_000), "std_msgs/msg/UInt8MultiArray is not known"),
    (beside("/text", "std_msgs/msg/String", 60_000), "std_msgs/msg/String is not known"),
    (beside("/nameless", "", 60_000, None, "json"), "the type without a name is not known"),
    (beside("/imu", "acme/msg/Imu", 60_000, STATES), "8 messages of 60,000 bytes, 8 a second, 480.0 kB/s"),
]
"""Topics that may be sensors, each for a reason of its own, and what is said of it."""


@pytest.mark.parametrize("of_them", [slice(0, 5), slice(5, 9)], ids=["the first", "the others"])
def test_topics_that_may_be_sensors_by_their_data_are_named_with_their_rates_and_what_to_do(
    of_them: slice, tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    some = BY_THEIR_DATA[of_them]
    code, said = codes(rewritten(clean, tmp_path / "drive.mcap", same, [extra for extra, _ in some]), clean, capfd)
    assert code == 3
    [line] = [line for line in said.splitlines() if "cannot be read" in line]
    assert f"{len(some)} sensors cannot be read: " in line
    told = line.split("cannot be read: ", 1)[1].split("; ")
    for extra, says in some:
        of_it = " ".join(one for one in told if extra.topic.name in one)
        assert f"{extra.topic.name} (camera or LiDAR)" in line
        assert says in line
        assert f"--no-sensor {extra.topic.name}" in of_it
    assert line.count("kB/s") == len(some)
    assert line.count("holds raw bytes") == sum("holds raw bytes" in says for _, says in some)


HIDING = ("/radar_points", "/debug/overlay", "/semantic_mask", "/depth/imu")


@pytest.mark.parametrize("kind", ["camera", "LiDAR"])
def test_no_name_hides_a_sensor_that_cannot_be_read(
    kind: str, tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    maker = MessageMaker("cdr")
    if kind == "camera":
        data = maker.raw_image(np.zeros((4, 4), np.uint8), "bayerrg8x", maker.header(START_NS, "other"))
        definition = Definition("ros2msg", maker.definition(schemas.IMAGE).encode())
        extras = [Extra(Topic(name, schemas.IMAGE, "cdr"), ((START_NS, data),), definition) for name in HIDING]
    else:
        extras = [beside(name, "nebula_msgs/msg/NebulaPackets", 4096) for name in HIDING]
    code, said = codes(rewritten(clean, tmp_path / "drive.mcap", same, extras), clean, capfd)
    assert code == 3
    assert f"{len(HIDING)} sensors cannot be read: " in said
    assert all(f"{name} ({kind})" in said for name in HIDING)


def test_a_recording_with_many_topics_of_other_kinds_stays_complete_and_nothing_is_said_of_them(
    tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    many = [
        beside("/imu", "sensor_msgs/msg/Imu", 350, count=80),
        beside("/imu_json", "IMU", 300, None, "json"),
        beside("/gps", "foxglove.LocationFix", 200, None, "protobuf"),
        beside("/odom", "nav_msgs/msg/Odometry", 720),
        beside("/pose", "foxglove.PoseInFrame", 200, None, "json"),
        beside("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", 60_000),
        beside("/map", "nav_msgs/msg/OccupancyGrid", 100_000),
        beside("/markers", "visualization_msgs/msg/MarkerArray", 100_000),
        beside("/semantic_map", "foxglove.SceneUpdate", 100_000, None, "protobuf"),
        beside("/annotations", "foxglove.ImageAnnotations", 50_000, None, "protobuf"),
        beside("/objects", "autoware_auto_perception_msgs/msg/PredictedObjects", 100_000),
        beside("/radar_front", "nuscenes_msgs/msg/RadarTracks", 6_000, TRACKS),
        beside("/can", "can_msgs/msg/Frame", 40_000, STATES),
        beside("/state", "acme_msgs/msg/State", 2_000, STATES),
        beside("/vector_map", "acme_msgs/msg/Map", 1_000_000, BLOB, count=1),
        beside("/serial", "acme_msgs/msg/Serial", 1_000, BLOB),
        beside("/rosout", "rcl_interfaces/msg/Log", 400),
    ]
    path = rewritten(clean, tmp_path / "drive.mcap", same, many)
    code, said = codes(path, clean, capfd)
    assert code == 0, said
    assert not [line for line in said.splitlines() if "no rig" in line or "cannot be read" in line]
    states = topics_of(path, capfd)
    assert {states[one.topic.name, one.topic.schema]["state"] for one in many} == {"no sensor"}
    assert states["/imu", "sensor_msgs/msg/Imu"]["why"] == "sensor_msgs/msg/Imu carries no pictures and no points"
    assert "too little for a camera or LiDAR" in str(states["/state", "acme_msgs/msg/State"]["why"])


def test_inspect_says_what_became_of_each_topic(tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]) -> None:
    extra = [beside("/packets", "acme/msg/Packets", 60_000), Extra(Topic("/none", "acme/msg/None", "cdr"), ())]
    states = topics_of(rewritten(clean, tmp_path / "drive.mcap", same, extra), capfd)
    assert {topic["state"] for topic in states.values()} == {"read", "unreadable"}
    assert states["/tf_static", "tf2_msgs/msg/TFMessage"]["state"] == "read"
    assert states["/packets", "acme/msg/Packets"]["state"] == "unreadable"


def test_a_topic_declared_no_sensor_counts_for_nothing_and_is_told(
    tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = rewritten(clean, tmp_path / "drive.mcap", same, [beside("/lidar_like", "acme/msg/Log", 60_000)])
    declared = ["--no-sensor", "/lidar_like", "--no-sensor", "/not_there"]
    assert scan(path, clean) == 3
    capfd.readouterr()
    assert scan(path, clean, *declared) == 0
    said = "drive.mcap: 1 topic is in no rig: /lidar_like: declared by --no-sensor to be neither camera nor LiDAR"
    assert said in capfd.readouterr().err
    assert run(["inspect", str(path)]) == 3
    assert run(["inspect", str(path), *declared]) == 0
    assert run(["judge", str(tmp_path / "drive"), *declared]) == 0
    assert run(["judge", str(tmp_path / "drive")]) == 3


def test_no_sensor_of_the_rig_can_be_declared_none(
    tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    def stopped(told: Told) -> Iterable[Told]:
        return [told] if told.topic != "/camera_2" or told.number < COUNT // 2 else []

    path = rewritten(clean, tmp_path / "drive.mcap", stopped)
    assert scan(path, clean, "--no-sensor", "/camera_2") == 3


def test_messages_of_a_second_type_under_one_name_are_told(
    tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    text = beside("/front", "std_msgs/msg/Bool", 8, count=1)
    hidden = beside("/front", "acme/msg/Cloud", 60_000)
    path = rewritten(clean, tmp_path / "drive.mcap", same, [text, hidden])
    code, said = codes(path, clean, capfd)
    assert code == 3
    assert "/front (camera or LiDAR): the type acme/msg/Cloud" in said
    states = topics_of(path, capfd)
    assert states["/front", "acme/msg/Cloud"]["state"] == "unreadable"
    assert states["/front", "std_msgs/msg/Bool"]["state"] == "no sensor"


def test_a_second_type_of_a_sensor_under_one_name_is_told_however_little_it_is(
    tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    text = beside("/front", "std_msgs/msg/Bool", 8, count=1)
    hidden = beside("/front", schemas.POINT_CLOUD, 40)
    code, said = codes(rewritten(clean, tmp_path / "drive.mcap", same, [text, hidden]), clean, capfd)
    assert code == 3
    assert "/front (LiDAR): it begins behind the beginning" in said


def test_a_lidar_of_the_old_point_cloud_type_is_part_of_the_rig(
    tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    maker = MessageMaker("cdr")
    point, old = maker.store.types["geometry_msgs/msg/Point32"], maker.store.types[schemas.POINT_CLOUD_OLD]
    with open_recording(clean) as recording:
        messages = []
        for message in recording.messages({"/points"}):
            cloud = maker.store.deserialize_cdr(message.data, schemas.POINT_CLOUD)
            xyz_m = np.frombuffer(cloud.data, np.float32).reshape(-1, cloud.point_step // 4)[:, :3].tolist()
            points = [point(*map(float, one)) for one in xyz_m]
            data = maker.serialise(schemas.POINT_CLOUD_OLD, old(header=cloud.header, points=points, channels=[]))
            messages.append((message.log_time_ns, data))
    definition = Definition("ros2msg", maker.definition(schemas.POINT_CLOUD_OLD).encode())
    extra = Extra(Topic("/old", schemas.POINT_CLOUD_OLD, "cdr"), tuple(messages), definition)
    path = rewritten(clean, tmp_path / "drive.mcap", lambda told: [told] if told.topic != "/points" else [], [extra])
    code, said = codes(path, clean, capfd)
    assert code == 0, said
    assert topics_of(path, capfd)["/old", schemas.POINT_CLOUD_OLD]["sensor"] == "S_0"


def test_a_video_that_is_not_decoded_is_named(tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]) -> None:
    maker = MessageMaker("cdr")
    data = maker.compressed_image(bytes(range(200)), "theora", START_NS, "other")
    definition = Definition("ros2msg", maker.definition(schemas.COMPRESSED_IMAGE).encode())
    extra = Extra(Topic("/other", schemas.COMPRESSED_IMAGE, "cdr"), ((START_NS, data),), definition)
    path = rewritten(clean, tmp_path / "drive.mcap", same, [extra])
    code, said = codes(path, clean, capfd)
    assert code == 3
    assert "/other (camera): the video 'theora' is Theora, which is not decoded" in said
    of_topic = topics_of(path, capfd)["/other", schemas.COMPRESSED_IMAGE]
    assert of_topic["state"] == "unreadable"
    assert "Theora" in str(of_topic["why"])
    assert str(of_topic["remedy"]).startswith("record JPEG")
