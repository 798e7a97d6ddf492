from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from auditor.errors import RigError
from auditor.model.coverage import coverage_line
from auditor.model.frames import Frame, Message, PointCloud, SensorState, SkippedFrame
from auditor.model.rig import Rig
from auditor.recordings import find_rigs, open_recording, share_a_read, survey, synchronise, write_mcap
from auditor.recordings.formats.unpacking import ZSTD_MAGIC
from auditor.recordings.parameters import FRAME_WINDOW
from auditor.recordings.recording import Topic
from auditor.recordings.synchronisation import window as windows
from auditor.recordings.writers.mcap_file import McapFile
from tests.making.recorded_drives import (
    PERIOD_NS,
    START_NS,
    make_frame,
    make_frames,
    make_rig,
    same_frame,
    split,
    stream_of,
)
from tests.making.split_drives import messages_of, write_messages

RIG = make_rig(3)
OFFSETS = {0: -10_500_000, 1: 6_000_000, 2: -500_000}


def written(path: Path, frames: list[Frame], rig: Rig = RIG, **settings: object) -> Path:
    write_mcap(path / "a.mcap", rig, frames, **settings)
    return path / "a.mcap"


def read(path: Path) -> tuple[list[Frame], list[SkippedFrame], dict[str, object]]:
    with open_recording(path) as recording:
        stream = stream_of(recording, RIG)
        frames, skipped = split(stream)
        assert all(topic.adds_up for topic in stream.balance)
        assert {topic.topic for topic in stream.balance} == {topic.name for topic in recording.topics()}
        return frames, skipped, {topic.topic: topic for topic in stream.balance}


def test_constant_offsets_are_learnt_and_taken_off(tmp_path: Path) -> None:
    frames, skipped, _ = read(written(tmp_path, make_frames(RIG, 20, offsets=OFFSETS)))
    assert not skipped
    assert [frame.number for frame in frames] == list(range(20))
    assert [frame.stamp_ns for frame in frames] == [START_NS + n * PERIOD_NS for n in range(20)]
    assert all(presence.skew_ns == 0 for frame in frames for presence in frame.presence.values())
    # What a sensor wrote stays what it wrote.
    assert frames[3].images[1].stamp_ns == START_NS + 3 * PERIOD_NS + OFFSETS[1]


def test_jitter_within_the_tolerance_is_reported_as_skew(tmp_path: Path) -> None:
    frames = make_frames(RIG, 20)
    frames[7] = make_frame(RIG, 7, offsets={1: 20_000_000, 0: -15_000_000})
    read_frames, skipped, _ = read(written(tmp_path, frames))
    assert not skipped
    skews = {sensor: presence.skew_ns for sensor, presence in read_frames[7].presence.items()}
    assert skews == {0: -15_000_000, 1: 20_000_000, 2: 0, 3: 0}


@pytest.mark.parametrize("sensor", [0, 1, 3])
def test_a_missing_sensor_does_not_lose_the_frame(tmp_path: Path, sensor: int) -> None:
    frames = make_frames(RIG, 20)
    frames[5] = make_frame(RIG, 5, without={sensor})
    read_frames, skipped, balance = read(written(tmp_path, frames))
    assert not skipped
    assert len(read_frames) == 20
    assert read_frames[5].number == 5
    assert read_frames[5].presence[sensor].state is SensorState.MISSING
    assert all(same_frame(a, b) for a, b in zip(read_frames, frames, strict=True))
    assert balance[RIG.topic(sensor)].used == 19


def test_a_sensor_that_stops_for_good_leaves_frames_without_it(tmp_path: Path) -> None:
    frames = [make_frame(RIG, n, without={3} if n >= 10 else ()) for n in range(40)]
    read_frames, skipped, _ = read(written(tmp_path, frames))
    assert [frame.number for frame in read_frames] == list(range(39))
    assert all(frame.presence[3].state is SensorState.MISSING for frame in read_frames[10:])
    # Within one period of the end it is unknown whether it was lost.
    assert [(s.number, s.reason, s.sensor) for s in skipped] == [(39, "edge", 3)]


def test_incomplete_frames_at_both_edges_are_edge_and_not_lost(tmp_path: Path) -> None:
    frames = make_frames(RIG, 20)
    frames[0] = make_frame(RIG, 0, without={0, 1})
    frames[19] = make_frame(RIG, 19, without={2})
    read_frames, skipped, balance = read(written(tmp_path, frames))
    assert [(s.number, s.reason) for s in skipped] == [(0, "edge"), (19, "edge")]
    assert [frame.number for frame in read_frames] == list(range(1, 19))
    assert balance["/cam3/image_rect"].skipped == {"edge": 2}


def test_fewer_than_three_sensors_are_skipped_with_their_number(tmp_path: Path) -> None:
    frames = make_frames(RIG, 20)
    frames[9] = make_frame(RIG, 9, without={0, 1})
    read_frames, skipped, balance = read(written(tmp_path, frames))
    assert [(s.number, s.reason, s.sensor) for s in skipped] == [(9, "too few sensors", None)]
    assert len(read_frames) == 19
    assert balance["/cam2/image_rect"].skipped == {"too few sensors": 1}


def damaged(path: Path, target: Path, topic: str, number: int, keep: int) -> Path:
    """The same recording with one message of a topic cut to its first bytes."""
    with path.open("rb") as source, target.open("wb") as out:
        writer = Writer(out)
        writer.start("ros2")
        channels: dict[str, int] = {}
        seen = 0
        for schema, channel, message in make_reader(source).iter_messages(log_time_order=False):
            assert schema
            if channel.topic not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", known)
            data = message.data
            if channel.topic == topic:
                data = data[:keep] if seen == number else data
                seen += 1
            writer.add_message(channels[channel.topic], message.log_time, data, message.publish_time)
        writer.finish()
    return target


@pytest.mark.parametrize("keep", [0, 10, 500])
@pytest.mark.parametrize("sensor", [0, 2])
def test_a_cut_message_is_damaged_in_its_frame_and_not_missing(tmp_path: Path, sensor: int, keep: int) -> None:
    path = written(tmp_path, make_frames(RIG, 20, offsets=OFFSETS))
    frames, skipped, balance = read(damaged(path, tmp_path / "b.mcap", RIG.topic(sensor), 8, keep))
    assert not skipped
    assert len(frames) == 20
    assert frames[8].presence[sensor].state is SensorState.DAMAGED
    assert frames[8].presence[sensor].reason
    assert sensor not in frames[8].images
    assert balance[RIG.topic(sensor)].damaged == 1
    assert balance[RIG.topic(sensor)].used == 19


def test_damage_that_leaves_too_few_sensors_skips_the_frame(tmp_path: Path) -> None:
    frames = make_frames(RIG, 20)
    frames[8] = make_frame(RIG, 8, without={1})
    path = damaged(written(tmp_path, frames), tmp_path / "b.mcap", RIG.topic(2), 8, 500)
    _, skipped, balance = read(path)
    assert [(s.number, s.reason) for s in skipped] == [(8, "too few sensors")]
    assert balance["/cam2/image_rect"].damaged == 1
    assert balance["/cam3/image_rect"].skipped == {"too few sensors": 1}


def test_stamps_of_zero_fall_back_to_the_time_of_recording(tmp_path: Path) -> None:
    path = written(tmp_path, make_frames(RIG, 10))
    content = path.read_bytes()
    assert content
    with path.open("rb") as source, (tmp_path / "b.mcap").open("wb") as out:
        writer = Writer(out)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for schema, channel, message in make_reader(source).iter_messages(log_time_order=False):
            assert schema
            if channel.topic not in channels:
                known = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", known)
            data = bytearray(message.data)
            if channel.topic == "/cam2/image_rect":
                data[4:12] = bytes(8)
            writer.add_message(channels[channel.topic], message.log_time, bytes(data), message.log_time)
        writer.finish()
    frames, skipped, _ = read(tmp_path / "b.mcap")
    assert len(frames) == 10
    assert not skipped
    assert frames[4].images[2].stamp_ns == START_NS + 4 * PERIOD_NS
    with open_recording(tmp_path / "b.mcap") as recording:
        assert any("/cam2/image_rect" in problem and "0" in problem for problem in survey(recording).problems)


def test_a_faster_sensor_gives_the_nearest_message_and_the_others_lie_between_frames(tmp_path: Path) -> None:
    frames = []
    for tick in range(60):
        at = START_NS + tick * PERIOD_NS // 3
        without = {1, 2, 3} if tick % 3 else set()
        frame = make_frame(RIG, tick, without=without, stamp_ns=at)
        frames.append(frame)
    read_frames, skipped, balance = read(written(tmp_path, frames))
    assert not skipped
    assert len(read_frames) == 20
    assert all(frame.presence[0].skew_ns == 0 for frame in read_frames)
    assert balance["/top/points"].used == 20
    assert balance["/top/points"].skipped == {"between frames": 40}


def test_frames_go_on_at_their_pace_when_the_slow_sensor_stops(tmp_path: Path) -> None:
    frames = []
    for tick in range(120):
        without = {0} if tick % 3 or 30 <= tick < 90 else set()
        frames.append(make_frame(RIG, tick, without=without, stamp_ns=START_NS + tick * PERIOD_NS // 3))
    read_frames, skipped, _ = read(written(tmp_path, frames))
    without_lidar = [frame for frame in read_frames if frame.presence[0].state is SensorState.MISSING]
    assert len(read_frames) - len(without_lidar) == 20
    assert 14 <= len(without_lidar) <= 20
    assert not [s for s in skipped if s.reason != "edge"]


def test_a_repeated_message_is_not_a_frame_of_its_own(tmp_path: Path) -> None:
    frames = make_frames(RIG, 10)
    frames.insert(4, frames[3])
    read_frames, skipped, balance = read(written(tmp_path, frames))
    assert [frame.number for frame in read_frames] == list(range(10))
    assert not skipped
    assert sum(balance["/top/points"].skipped.values()) == 1


def test_messages_that_lie_topic_by_topic_are_still_paired(tmp_path: Path) -> None:
    path = written(tmp_path, make_frames(RIG, 50, offsets=OFFSETS))
    with open_recording(path) as recording:
        messages = sorted(recording.messages(), key=lambda message: message.topic)
        topics = {topic.name: topic for topic in recording.topics()}
        with (tmp_path / "b.mcap").open("wb") as out:
            file = McapFile(out, "ros2", "none")
            for message in messages:
                definition = recording.definition(message.schema)
                file.write(topics[message.topic], definition, message.log_time_ns, message.data)
            file.finish()
    frames, skipped, _ = read(tmp_path / "b.mcap")
    assert len(frames) == 50
    assert not skipped


def test_the_window_stays_small_whatever_a_silent_sensor_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = [make_frame(RIG, n, without={0} if 5 <= n < 45 else ()) for n in range(50)]
    path = written(tmp_path, frames)
    monkeypatch.setattr(windows, "MOST_WAITING_BYTES", 30_000)
    held: list[int] = []
    add = windows.MessageWindow.add

    def spied(window: windows.MessageWindow, sensor: int, waiting: windows.Waiting) -> None:
        add(window, sensor, waiting)
        held.append(window.held_bytes)

    monkeypatch.setattr(windows.MessageWindow, "add", spied)
    read_frames, _, _ = read(path)
    assert len(read_frames) == 50
    assert max(held) < 30_000 + 5_000


def test_a_stamp_from_another_century_costs_only_its_own_message(tmp_path: Path) -> None:
    frames = make_frames(RIG, 20)
    odd = make_frame(RIG, 10, stamp_ns=2_100_000_000 * 10**9)
    cloud = odd.cloud
    assert cloud
    frames[10] = Frame(
        10, frames[10].stamp_ns, frames[10].presence, PointCloud(cloud.stamp_ns, cloud.xyz_m), frames[10].images
    )
    read_frames, _, balance = read(written(tmp_path, frames))
    assert len(read_frames) == 20
    assert [frame.number for frame in read_frames if frame.presence[0].state is SensorState.MISSING] == [10]
    assert balance["/top/points"].used == 19


def test_colours_are_kept_only_where_requested(tmp_path: Path) -> None:
    path = written(tmp_path, make_frames(RIG, 3, colour=True))
    with open_recording(path) as recording:
        grey, _ = split(stream_of(recording, RIG))
        colour, _ = split(stream_of(recording, RIG, colour=True))
    assert grey[0].images[1].pixels.shape == (48, 64)
    assert np.array_equal(colour[0].images[1].pixels, make_frame(RIG, 0, colour=True).images[1].pixels)


def test_a_stream_can_be_read_twice(tmp_path: Path) -> None:
    with open_recording(written(tmp_path, make_frames(RIG, 5))) as recording:
        stream = stream_of(recording, RIG)
        first, second = list(stream), list(stream)
        assert len(first) == len(second) == 5
        assert all(topic.adds_up for topic in stream.balance)


def test_three_cameras_without_a_lidar_make_frames(tmp_path: Path) -> None:
    rig = make_rig(3, lidar=False)
    with open_recording(written(tmp_path, make_frames(rig, 5), rig)) as recording:
        (found,) = find_rigs(survey(recording))
        frames, skipped = split(stream_of(recording, found))
    assert len(frames) == 5
    assert frames[0].cloud is None
    assert not skipped


@pytest.mark.parametrize("count", [5, 12, 20, 30])
def test_topics_that_lie_one_after_the_other_cost_no_frame(count: int, tmp_path: Path) -> None:
    frames = make_frames(RIG, count, offsets=OFFSETS)
    by_topic = sorted(messages_of(".mcap", RIG, frames), key=lambda message: message.topic)
    path = write_messages(tmp_path / "by_topic.mcap", by_topic)
    found, skipped, _ = read(path)
    assert not skipped
    assert all(same_frame(a, b) for a, b in zip(found, frames, strict=True))


def test_of_messages_that_lie_out_of_order_it_is_said_by_how_much(tmp_path: Path) -> None:
    recorded = messages_of(".mcap", RIG, make_frames(RIG, 40))
    later = [message for number in range(20) for message in recorded[number::20]]
    for messages, says in ((recorded, []), (later, ["its messages lie out of order by up to"])):
        with open_recording(write_messages(tmp_path / "a.mcap", messages)) as recording:
            stream = stream_of(recording, RIG)
            split(stream)
            assert [remark[:38] for remark in stream.remarks] == says
            assert "begins" not in coverage_line(stream.coverage)


def test_a_rig_of_other_topics_is_refused_by_their_names(tmp_path: Path) -> None:
    with open_recording(written(tmp_path, make_frames(RIG, 3))) as recording:
        known = survey(recording)
        with pytest.raises(RigError, match="/cam4/image_rect"):
            synchronise(recording, make_rig(4), known)


def test_a_clock_that_jumps_back_costs_no_frame(tmp_path: Path) -> None:
    before = make_frames(RIG, 20)
    after = [make_frame(RIG, n, stamp_ns=START_NS + (n - 100) * PERIOD_NS) for n in range(20, 40)]
    with open_recording(written(tmp_path, [*before, *after])) as recording:
        known = survey(recording)
        stream = synchronise(recording, find_rigs(known)[0], known)
        frames, skipped = split(stream)
        assert any("jumps back by" in problem for problem in known.problems)
        assert all(topic.adds_up for topic in stream.balance)
    assert not skipped
    assert stream.clock_jumps == 1
    assert [frame.number for frame in frames] == list(range(40))
    assert all(same_frame(a, b) for a, b in zip(frames, [*before, *after], strict=True))


@pytest.mark.parametrize(("before", "behind"), [(3, 6), (8, 8), (12, 4), (70, 5)])
def test_a_simulation_that_starts_again_costs_no_frame(before: int, behind: int, tmp_path: Path) -> None:
    """Its stamps and log times repeat exactly, and its pictures do not."""
    again = [make_frame(RIG, 100 + n, stamp_ns=START_NS + n * PERIOD_NS, offsets=OFFSETS) for n in range(behind)]
    frames, skipped, counts = read(written(tmp_path, [*make_frames(RIG, before, offsets=OFFSETS), *again]))
    assert len(frames) == before + behind
    assert not skipped
    assert all(same_frame(a, b) for a, b in zip(frames[before:], again, strict=True))
    assert counts


def test_one_sensor_that_lags_far_behind_is_late_and_no_jump_of_the_clock(tmp_path: Path) -> None:
    frames = make_frames(RIG, 30)
    for number in (15, 18, 21):
        frames[number] = make_frame(RIG, number, offsets={2: -40 * PERIOD_NS})
    with open_recording(written(tmp_path, frames)) as recording:
        stream = stream_of(recording, RIG)
        found, skipped = split(stream)
    assert not skipped
    assert stream.clock_jumps == 0
    assert len(found) == 30
    assert {topic.topic: topic.skipped for topic in stream.balance}["/cam2/image_rect"] == {"late": 3}
    assert [f.number for f in found if f.presence[2].state is SensorState.MISSING] == [15, 18, 21]


def test_several_sensors_that_drop_out_and_come_back_lose_only_themselves(tmp_path: Path) -> None:
    rig = make_rig(4)
    frames = [
        make_frame(rig, n, without=({0} if n in range(10, 20) else set()) | ({1} if n in range(5, 25) else set()))
        for n in range(30)
    ]
    with open_recording(written(tmp_path, frames, rig)) as recording:
        found, skipped = split(stream_of(recording, rig))
    assert not skipped
    assert all(same_frame(a, b) for a, b in zip(found, frames, strict=True))


def test_offsets_that_are_given_stand_in_for_those_learnt(tmp_path: Path) -> None:
    with open_recording(written(tmp_path, make_frames(RIG, 20, offsets=OFFSETS))) as recording:
        known = survey(recording)
        cameras = (replace(RIG.cameras[0], offset_ns=1_000_000), *RIG.cameras[1:])
        stream = synchronise(recording, replace(RIG, cameras=cameras), known)
        frames, _ = split(stream)
        assert all(frame.presence[1].skew_ns == 5_000_000 for frame in frames)
        assert all(frame.presence[2].skew_ns == 0 for frame in frames)


def test_the_window_holds_few_messages_however_small_they_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    frames = [make_frame(RIG, n, without={0} if n > 1 else ()) for n in range(60)]
    patient = replace(FRAME_WINDOW, most_wait_periods=50)
    waiting: dict[int, int] = {}
    add = windows.MessageWindow.add

    def spied(window: windows.MessageWindow, sensor: int, message: windows.Waiting) -> None:
        add(window, sensor, message)
        waiting[limit] = max(waiting.get(limit, 0), sum(map(len, window._waiting.values())))

    monkeypatch.setattr(windows.MessageWindow, "add", spied)
    monkeypatch.setattr(windows, "FRAME_WINDOW", patient)
    for limit in (1000, 40):
        monkeypatch.setattr(windows, "_MOST_WAITING", limit)
        assert len(read(written(tmp_path, frames))[0]) >= 59
    assert waiting[1000] > 100
    assert waiting[40] <= 41


class Heard:
    """A listener of some topics."""

    def __init__(self, *topics: str) -> None:
        self.topics = topics
        self.messages: list[Message] = []

    def take(self, message: Message) -> None:
        self.messages.append(message)


def test_others_hear_the_messages_of_the_read_that_makes_frames(tmp_path: Path) -> None:
    with open_recording(written(tmp_path, make_frames(RIG, 5))) as recording:
        topic = RIG.camera(1).topic
        info, image = Heard(topic.rpartition("/")[0] + "/camera_info"), Heard(topic)
        plain, stream = stream_of(recording, RIG), stream_of(recording, RIG)
        share_a_read(recording, [stream], [info, image])
        assert all(map(same_frame, split(plain)[0], split(stream)[0]))
        assert stream.balance == plain.balance
        for heard in (info, image):
            assert heard.messages
            there = [message.data for message in recording.messages(heard.topics)]
            assert [message.data for message in heard.messages] == there


def test_what_is_damaged_of_messages_that_others_hear_is_no_damage_of_the_sensors(tmp_path: Path) -> None:
    source, target = written(tmp_path, make_frames(RIG, 5)), tmp_path / "b.mcap"
    topic = RIG.camera(1).topic.rpartition("/")[0] + "/camera_info"
    with open_recording(source) as recording, target.open("wb") as stream:
        file = McapFile(stream, "ros2", "zstd")
        for number, message in enumerate(recording.messages()):
            data = ZSTD_MAGIC if message.topic == topic and number > 20 else message.data
            definition = recording.definition(message.schema)
            file.write(Topic(message.topic, message.schema, message.encoding), definition, message.log_time_ns, data)
        file.finish()
    with open_recording(target) as recording:
        frames = stream_of(recording, RIG)
        heard = Heard(topic)
        share_a_read(recording, [frames], [heard])
        assert len(split(frames)[0]) == 5
        assert 0 < len(heard.messages) < 5
        assert not frames.damage
        list(recording.messages([topic]))
        assert recording.damage
