"""The clip has the messages as they were recorded; the findings stand beside them on the same timeline."""

import json
from pathlib import Path
from typing import Any

import fastjsonschema
import foxglove_schemas_protobuf
import numpy as np
import pytest
from google.protobuf import json_format  # type: ignore[import-untyped]
from mcap.reader import make_reader

from auditor.errors import RecordingError
from auditor.recordings import Topic, open_recording, survey
from auditor.recordings.rigs.discovery import find_rigs
from auditor.recordings.writers.convert import write_clip
from auditor.recordings.writers.mcap_file import mcap_file
from tests.making.case_stores import AttackedStore
from tests.making.small_drives import PERIOD_NS, START_NS, write_drive

READ = "foxglove_schemas_protobuf"


def messages(path: Path) -> list[tuple[str, str, int, bytes]]:
    """Topic, encoding, log time and bytes of all messages, read whole by the mcap library with CRCs checked."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        read = [
            (channel.topic, channel.message_encoding, message.log_time, bytes(message.data))
            for _, channel, message in reader.iter_messages(log_time_order=False)
        ]
        summary = reader.get_summary()
    assert summary is not None
    assert summary.statistics is not None
    assert len(read) == summary.statistics.message_count
    return read


def test_the_clip_has_all_messages_of_its_seconds_to_the_last_bit(attacked: AttackedStore, lidar_case: Path) -> None:
    clip, source = messages(lidar_case / "clip.mcap"), messages(attacked.recordings[0])
    times = [log_time for topic, _, log_time, _ in clip if topic != "/tf_static"]
    row = attacked.row(0)
    margin = 2 * PERIOD_NS
    assert (min(times), max(times)) == (row["from_ns"] - margin, row["to_ns"] + margin)
    within = [one for one in source if min(times) <= one[2] <= max(times)]
    assert [one for one in clip if one[2] >= min(times)] == within
    before = [one for one in clip if one[2] < min(times)]
    assert [one[0] for one in before] == ["/tf_static"]
    assert before[0] in source


def test_the_clip_is_a_recording_with_the_same_rig(attacked: AttackedStore, lidar_case: Path) -> None:
    rigs = []
    for path in (attacked.recordings[0], lidar_case / "clip.mcap"):
        with open_recording(path) as recording:
            rigs.append(find_rigs(survey(recording))[0].rig_id)
    assert rigs[0] == rigs[1]


def test_a_clip_of_a_ros_1_bag_keeps_its_messages(tmp_path: Path) -> None:
    bag = write_drive(tmp_path / "drive.bag", 6)
    with open_recording(bag) as recording:
        source = [(m.topic, m.encoding, m.log_time_ns, bytes(m.data)) for m in recording.messages()]
        clip = write_clip(recording, tmp_path / "clip.mcap", START_NS + 2 * PERIOD_NS, START_NS + 3 * PERIOD_NS)
    read = messages(tmp_path / "clip.mcap")
    assert all(one in source for one in read)
    assert clip.messages == len([one for one in source if 2 <= (one[2] - START_NS) / PERIOD_NS <= 3])
    assert (clip.before, {one[1] for one in read}) == (1, {"ros1"})


def test_what_mcap_does_not_carry_or_was_not_recorded_gives_no_clip(tmp_path: Path) -> None:
    with mcap_file(tmp_path / "files.mcap", profile="", compression="none") as file:
        file.write(Topic("/camera", "kitti/Picture", "png"), None, 1, b"1")
    with open_recording(tmp_path / "files.mcap") as recording, pytest.raises(RecordingError, match="does not carry"):
        write_clip(recording, tmp_path / "clip.mcap", 0, 2)
    drive = write_drive(tmp_path / "drive.mcap", 2)
    with open_recording(drive) as recording, pytest.raises(RecordingError, match="no message was recorded"):
        write_clip(recording, tmp_path / "clip.mcap", 0, 2)
    assert not (tmp_path / "clip.mcap").exists()


def for_protobuf(value: Any) -> Any:
    """JSON as protobuf's own parser takes it: times are text there."""
    if isinstance(value, dict):
        if value.keys() == {"sec", "nsec"}:
            return f"{value['sec'] + value['nsec'] / 1e9:.9f}s" if value["sec"] < 10**6 else "2020-01-01T00:00:00Z"
        return {key: for_protobuf(item) for key, item in value.items()}
    return [for_protobuf(item) for item in value] if isinstance(value, list) else value


def test_the_findings_are_foxgloves_messages_on_the_clips_timeline(attacked: AttackedStore, lidar_case: Path) -> None:
    found, clip = messages(lidar_case / "findings.mcap"), messages(lidar_case / "clip.mcap")
    assert {topic for topic, *_ in found} == {
        "/auditor/event",
        "/auditor/log",
        "/auditor/S_4/annotations",
        "/auditor/S_0/box",
        "/auditor/S_4/overlay",
        "/auditor/S_0/damaged",
    }
    assert {one[2] for one in found} <= {one[2] for one in clip}
    row = attacked.row(0)
    logs = [json.loads(data) for topic, _, _, data in found if topic == "/auditor/log"]
    assert len(logs) == 1 + row["frames"]
    [event] = [json.loads(data) for topic, _, _, data in found if topic == "/auditor/event"]
    assert event["start_time"]["sec"] * 10**9 + event["start_time"]["nsec"] == row["from_ns"]
    with (lidar_case / "findings.mcap").open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            if channel.message_encoding == "json":
                content = json.loads(message.data)
                fastjsonschema.validate(json.loads(schema.data), content)
                name = schema.name.removeprefix("foxglove.")
                module = __import__(f"{READ}.{name}_pb2", fromlist=[name])
                json_format.ParseDict(for_protobuf(content), getattr(module, name)())
            else:
                assert (channel.message_encoding, schema.encoding) == ("protobuf", "protobuf")
                assert schema.name in ("foxglove.CompressedImage", "foxglove.PointCloud")


def test_auditor_reads_the_overlays_and_the_damaged_points_itself(attacked: AttackedStore, lidar_case: Path) -> None:
    assert foxglove_schemas_protobuf  # the messages above are checked against it
    with open_recording(lidar_case / "findings.mcap") as recording:
        known = survey(recording)
    assert [(one.topic.name, one.size_px) for one in known.images] == [("/auditor/S_4/overlay", (320, 120))]
    [cloud] = known.clouds
    strongest = attacked.row(0)["strongest_frame"]
    region = attacked.region(strongest)
    assert np.isclose(cloud.points, region["points"], rtol=0.05)
