"""What is in a recording is audited or named: the same exit code of inspect and scan, and one line that says why."""

import json
import struct
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from auditor.cli import run
from auditor.model.rig import Rig
from auditor.recordings import Topic, open_recording, schemas, survey, write_mcap
from auditor.recordings.decoding.sensor_types import UNREAD
from auditor.recordings.decoding.videos import tracks
from auditor.recordings.recording import Definition
from auditor.recordings.writers.messages import MessageMaker
from auditor.store.store import Store
from tests.making.audits import ask
from tests.making.restamped import Extra, Told, rewritten
from tests.making.scenes import plane_rig
from tests.making.small_drives import FOUR_CAMERAS, PERIOD_NS, START_NS, drive_frames, write_drive
from tests.making.videos import encoded

COUNT, HALF = 8, 4
CAMERAS = (0.6, 0.3, 0.0)
LIVOX = "livox_ros_driver2/msg/CustomMsg"


@pytest.fixture(scope="module")
def clean(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clean drive, and beside it a store with its thresholds."""
    folder = tmp_path_factory.mktemp("reading")
    drive = write_drive(folder / "clean.mcap", COUNT, seed=1, positions_m=CAMERAS)
    assert run(["calibrate", str(drive), "--store", str(folder / "audit")]) == 0
    return drive


def scan_of(path: Path, clean: Path) -> list[str]:
    """A scan by the thresholds of the clean drive into a store of its own: there it conflicts with no other drive."""
    [thresholds] = (clean.parent / "audit" / "calibrations").glob("*.parquet")
    store = str(path.parent / path.stem)
    return ["scan", str(path), "--pictures", "none", "--store", store, "--calibration", str(thresholds)]


@pytest.fixture
def both(clean: Path, capfd: pytest.CaptureFixture[str]) -> Callable[[Path], tuple[int, str]]:
    """The exit code of a scan and its remarks; inspect must end alike where the scan has no findings."""

    def audit(path: Path) -> tuple[int, str]:
        code = run(scan_of(path, clean))
        remarks = capfd.readouterr().err
        inspected = run(["inspect", str(path)])
        capfd.readouterr()
        assert inspected == {1: 0, 4: 3}.get(code, code), remarks
        return code, remarks

    return audit


def described(path: Path, capfd: pytest.CaptureFixture[str]) -> dict[str, dict[str, Any]]:
    run(["inspect", str(path), "--format", "json"])
    [one] = json.loads(capfd.readouterr().out)
    return {topic["topic"]: topic for topic in one["topics"]}


def same(told: Told) -> Iterator[Told]:
    yield told


def beside(name: str, schema: str, data: bytes, encoding: str = "cdr", definition: Definition | None = None) -> Extra:
    """A topic with a message of these bytes every period."""
    times = tuple((START_NS + n * PERIOD_NS, data) for n in range(COUNT))
    return Extra(Topic(name, schema, encoding), times, definition)


def image(encoding: str, name: str = "/other/image") -> Extra:
    maker = MessageMaker("cdr")
    data = maker.raw_image(np.zeros((4, 4), np.uint8), encoding, maker.header(START_NS, "other"))
    definition = Definition("ros2msg", maker.definition(schemas.IMAGE).encode())
    return beside(name, schemas.IMAGE, data, definition=definition)


def compressed(form: str, name: str = "/other/compressed") -> Extra:
    maker = MessageMaker("cdr")
    data = maker.compressed_image(b"\0\0\0\1\x40\1" + bytes(range(200)), form, START_NS, "other")
    definition = Definition("ros2msg", maker.definition(schemas.COMPRESSED_IMAGE).encode())
    return beside(name, schemas.COMPRESSED_IMAGE, data, definition=definition)


def test_10_of_16_attacked_frames_under_one_stamp_are_found_and_told(
    tmp_path: Path, clean: Path, both: Callable[[Path], tuple[int, str]]
) -> None:
    drive = write_drive(tmp_path / "drive.mcap", 16, seed=1, positions_m=CAMERAS, attacked={2: range(6, 16)})

    def hidden(told: Told) -> Iterator[Told]:
        yield told._replace(stamp_ns=min(told.stamp_ns, START_NS + 5 * PERIOD_NS))

    code, remarks = both(rewritten(drive, tmp_path / "hidden.mcap", hidden))
    assert code == 4
    [line] = [line for line in remarks.splitlines() if "coverage" in line]
    assert line == (
        "hidden.mcap: coverage 37.5 % of messages, 37.5 % of time: all sensors: 10 stamps repeated; ends 1.0 s early"
    )


def test_a_healthy_recording_ends_with_0_and_with_no_remark_but_those_that_are_true_of_it(
    clean: Path, both: Callable[[Path], tuple[int, str]]
) -> None:
    code, remarks = both(clean)
    lines = [line for line in remarks.splitlines() if "WARNING: the LiDAR points and stereo" not in line]
    lines = [line for line in lines if "WARNING: the points of the LiDAR points do not reach as near" not in line]
    said = [f"{clean}: {COUNT} frames measured", "clean.mcap: in sample: the calibration was made of it"]
    assert (code, lines) == (0, said)


@pytest.mark.parametrize(
    "change",
    [
        lambda told: [told._replace(stamp_ns=START_NS)],
        lambda told: [told] if told.topic != "/camera_2" or told.number < HALF else [],
        lambda told: [told._replace(data=told.data[:300])] if (told.topic, told.number) == ("/camera_2", 5) else [told],
        lambda told: [told._replace(stamp_ns=-5)] if told.number == 6 else [told],
    ],
    ids=["a frozen clock", "a camera that stops", "a damaged message", "negative stamps"],
)
def test_what_was_not_read_makes_a_recording_incomplete(
    change: Callable[[Told], Iterable[Told]], tmp_path: Path, clean: Path, both: Callable[[Path], tuple[int, str]]
) -> None:
    code, remarks = both(rewritten(clean, tmp_path / "drive.mcap", change))
    assert code == 3
    assert "coverage" in remarks


def test_the_least_coverage_is_an_option_of_scan(tmp_path: Path, clean: Path) -> None:
    def one_late(told: Told) -> Iterator[Told]:
        yield told._replace(stamp_ns=-5) if told.number == 6 else told

    scan = scan_of(rewritten(clean, tmp_path / "drive.mcap", one_late), clean)
    assert run(scan) == 3
    assert run([*scan, "--min-coverage", "0.8"]) == 0


def test_each_sensor_of_a_type_that_cannot_be_read_is_named_with_what_helps(
    tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """All types in one recording."""
    named = {f"/sensor_{number}/packets": schema for number, schema in enumerate(UNREAD)}
    extra = [beside(name, schema, b"\0\1\0\0" + bytes(4092)) for name, schema in named.items()]
    path = rewritten(clean, tmp_path / "drive.mcap", same, extra)
    assert run(["inspect", str(path)]) == 3
    assert next(iter(UNREAD.values())).remedy in capfd.readouterr().out
    topics = described(path, capfd)
    assert {name: topics[name]["remedy"] for name in named} == {name: UNREAD[named[name]].remedy for name in named}
    assert {(topics[name]["state"], topics[name]["messages"]) for name in named} == {("unreadable", COUNT)}


def test_the_reasons_that_were_found_while_reading_are_shown(
    tmp_path: Path, clean: Path, both: Callable[[Path], tuple[int, str]], capfd: pytest.CaptureFixture[str]
) -> None:
    reasons = {
        "/other/unknown": (image("xyz12", "/other/unknown"), "the image encoding 'xyz12' is not supported"),
        "/other/short": (image("bgr8", "/other/short"), "and holds 16 bytes"),
        "/other/video": (
            beside("/other/video", "foxglove.CompressedVideo", b"\0", "flatbuffer"),
            "in the encoding 'flatbuffer'",
        ),
        "/other/points": (
            beside("/other/points", "foxglove.PointCloud", b"\0", "flatbuffer"),
            "in the encoding 'flatbuffer'",
        ),
        "/other/nothing": (
            beside("/other/nothing", "foxglove.PointCloud", b"{}", "json"),
            "the cloud has no fields x, y and z",
        ),
    }
    path = rewritten(clean, tmp_path / "drive.mcap", same, [extra for extra, _ in reasons.values()])
    code, remarks = both(path)
    assert code == 3
    [line] = [line for line in remarks.splitlines() if "cannot be read" in line]
    assert line.startswith("drive.mcap: 5 sensors cannot be read: ")
    topics = described(path, capfd)
    for name, (_, reason) in reasons.items():
        assert reason in topics[name]["why"], name


def test_clouds_that_all_lie_about_their_width_are_an_unreadable_sensor(
    tmp_path: Path, clean: Path, both: Callable[[Path], tuple[int, str]], capfd: pytest.CaptureFixture[str]
) -> None:
    maker = MessageMaker("cdr")

    def lying(told: Told) -> Iterator[Told]:
        if told.topic == "/points":
            cloud = maker.store.deserialize_cdr(told.data, schemas.POINT_CLOUD)
            width = cloud.width + 1
            more = replace(cloud, width=width, row_step=width * cloud.point_step)
            told = told._replace(data=maker.serialise(schemas.POINT_CLOUD, more))
        yield told

    path = rewritten(clean, tmp_path / "drive.mcap", lying)
    code, remarks = both(path)
    assert code == 3
    assert "/points (LiDAR): the cloud declares 1 rows of" in remarks
    assert described(path, capfd)["/points"]["state"] == "unreadable"


def test_clouds_whose_width_alone_is_wrong_are_read_and_that_is_told(
    tmp_path: Path, clean: Path, both: Callable[[Path], tuple[int, str]]
) -> None:
    maker = MessageMaker("cdr")

    def stale(told: Told) -> Iterator[Told]:
        if told.topic == "/points":
            cloud = maker.store.deserialize_cdr(told.data, schemas.POINT_CLOUD)
            told = told._replace(data=maker.serialise(schemas.POINT_CLOUD, replace(cloud, width=cloud.width + 1)))
        yield told

    code, remarks = both(rewritten(clean, tmp_path / "drive.mcap", stale))
    assert code == 0
    assert "/points: its width does not fit the data" in remarks


def test_video_without_the_extra_says_what_to_install(
    tmp_path: Path, clean: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    maker = MessageMaker("cdr")
    packet = next(iter(encoded([np.zeros((64, 64, 3), np.uint8)])))
    data = maker.compressed_image(packet, "h264", START_NS, "other")
    definition = Definition("ros2msg", maker.definition(schemas.COMPRESSED_IMAGE).encode())
    extra = beside("/other/compressed", schemas.COMPRESSED_IMAGE, data, definition=definition)

    def absent() -> None:
        raise tracks.DecodingError("video needs the package av: install auditor[video]")

    monkeypatch.setattr(tracks, "_av", absent)
    with open_recording(rewritten(clean, tmp_path / "drive.mcap", same, [extra])) as recording:
        [unreadable] = survey(recording).unreadable
    assert (unreadable.topic.name, unreadable.kind) == ("/other/compressed", "camera")
    assert unreadable.reason == "video needs the package av: install auditor[video]"


def test_what_is_no_camera_or_lidar_leaves_a_recording_complete(
    tmp_path: Path, clean: Path, both: Callable[[Path], tuple[int, str]]
) -> None:
    others = [
        image("32FC1"),  # depth
        beside("/ouster/packets", "ouster_ros/msg/PacketMsg", bytes(48)),  # its IMU's
        compressed("16UC1; compressedDepth png"),
        beside("/map", "nav_msgs/msg/OccupancyGrid", b"\0"),
        beside("/scan", "sensor_msgs/msg/LaserScan", b"\0"),
        Extra(Topic("/front/livox", LIVOX, "cdr"), ()),  # no message
    ]
    code, remarks = both(rewritten(clean, tmp_path / "drive.mcap", same, others))
    assert (code, "cannot be read" in remarks) == (0, False), remarks


def test_a_camera_of_no_rig_is_told_with_its_reason(
    tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    topic = described(rewritten(clean, tmp_path / "drive.mcap", same, [image("mono8")]), capfd)["/other/image"]
    assert (topic["state"], topic["why"]) == ("not compared", "/other/image has no camera info")


@pytest.mark.parametrize(
    ("positions_m", "lidar", "says"),
    [((0.0,), False, "there is 1 camera (camera_1)"), ((0.6, 0.0), False, "add a third camera")],
)
def test_too_few_sensors_are_one_line_and_exit_3(
    positions_m: tuple[float, ...],
    lidar: bool,
    says: str,
    tmp_path: Path,
    both: Callable[[Path], tuple[int, str]],
) -> None:
    rig = plane_rig(positions_m, lidar)
    write_mcap(tmp_path / "few.mcap", rig, drive_frames(rig, 4))
    code, remarks = both(tmp_path / "few.mcap")
    assert (code, len(remarks.splitlines())) == (3, 1)
    assert "no triple possible" in remarks
    assert says in remarks


def test_a_lidar_alone_and_one_that_cannot_be_read_are_named(
    tmp_path: Path, both: Callable[[Path], tuple[int, str]]
) -> None:
    rig = plane_rig((0.6, 0.0), lidar=True)
    write_mcap(tmp_path / "two.mcap", rig, drive_frames(rig, 4))
    only_lidar = rewritten(
        tmp_path / "two.mcap", tmp_path / "lidar.mcap", lambda t: [t] if t.topic == "/points" else []
    )
    code, remarks = both(only_lidar)
    assert code == 3
    assert "is looked at for what appears, by its own past alone" in remarks
    no_lidar = rewritten(
        tmp_path / "two.mcap",
        tmp_path / "livox.mcap",
        lambda t: [t] if t.topic != "/points" else [],
        [beside("/livox/lidar", LIVOX, struct.pack("<4x"))],
    )
    code, remarks = both(no_lidar)
    assert (code, len(remarks.splitlines())) == (3, 1)
    assert "/livox/lidar (LiDAR)" in remarks
    assert "xfer_format 0" in remarks


def without(rig: Rig, path: Path, sensor: int, vehicle: str) -> Path:
    frames = (
        replace(frame, images={n: one for n, one in frame.images.items() if n != sensor})
        for frame in drive_frames(rig, COUNT, seed=2)
    )
    write_mcap(path, rig, frames, vehicle=vehicle)
    return path


def test_a_rig_smaller_than_the_vehicles_usual_one_is_told(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    rig, store = plane_rig(FOUR_CAMERAS, lidar=True), str(tmp_path / "audit")
    usual, smaller, other = tmp_path / "usual.mcap", tmp_path / "smaller.mcap", tmp_path / "other.mcap"
    write_mcap(usual, rig, drive_frames(rig, COUNT, seed=1), vehicle="alder")
    without(rig, smaller, 2, "alder")
    without(rig, other, 3, "birch")
    run(["scan", str(usual), str(smaller), str(other), "--measure-only", "--store", store])
    capfd.readouterr()
    run(["judge", store])
    [line] = [line for line in capfd.readouterr().err.splitlines() if "usual one of" in line]
    assert line == "smaller.mcap: its rig has 4 sensors, and the usual one of vehicle alder has 5: without /camera_2"


def test_coverage_is_kept_and_queried(tmp_path: Path, clean: Path, capfd: pytest.CaptureFixture[str]) -> None:
    def stopped(told: Told) -> Iterator[Told]:
        if told.topic != "/camera_2" or told.number < HALF:
            yield told

    path = rewritten(clean, tmp_path / "drive.mcap", stopped, [beside("/livox", LIVOX, b"\0"), image("mono8")])
    store = tmp_path / "audit"
    run(["scan", str(path), "--measure-only", "--store", str(store)])
    [known] = Store.open(store).measurements()
    assert known.coverage is not None
    states = {topic.topic: topic.state.value for topic in known.coverage}
    assert states["/livox"] == "unreadable"
    assert states["/other/image"] == "not compared"
    capfd.readouterr()
    assert run(["query", "coverage", "--store", str(store), "--format", "json"]) == 0
    rows = {row["topic"]: row for row in json.loads(capfd.readouterr().out)}
    assert rows["/camera_2"]["time_share"] == pytest.approx(0.5)
    assert rows["/camera_2"]["messages_share"] == 1
    assert rows["/livox"]["state"] == "unreadable"
    assert rows["/livox"]["frames"] is None
    assert "xfer_format" in rows["/livox"]["remedy"]
    assert rows["/other/image"]["reason"] == "/other/image has no camera info"
    sql = "SELECT topic, state, reason FROM balance WHERE state <> 'read' ORDER BY topic"
    unread, left_out = ask(store, sql)
    assert (unread["topic"], unread["state"]) == ("/livox", "unreadable")
    assert (left_out["topic"], left_out["reason"]) == ("/other/image", "/other/image has no camera info")
