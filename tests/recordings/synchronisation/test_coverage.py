"""What counts against the coverage of a recording, what does not, and what is audited all the same."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auditor.model.coverage import TopicCoverage, TopicState, coverage_line, least_covered
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.recordings import find_rigs, open_recording, survey, write_mcap
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
from tests.making.restamped import Extra, Told, rewritten

RIG = make_rig(3)
CAMERA = "/cam2/image_rect"
COUNT = 20

Change = Callable[[Told], Iterable[Told]]


def written(folder: Path, frames: list[Frame], change: Change | None = None, rig: Rig = RIG) -> Path:
    write_mcap(folder / "whole.mcap", rig, frames)
    return rewritten(folder / "whole.mcap", folder / "a.mcap", change) if change else folder / "whole.mcap"


def read(path: Path, rig: Rig = RIG) -> tuple[list[Frame], dict[str, TopicCoverage]]:
    with open_recording(path) as recording:
        stream = stream_of(recording, rig)
        frames, _ = split(stream)
        assert all(topic.adds_up for topic in stream.balance)
        return frames, {topic.topic: topic for topic in stream.coverage}


def against(coverage: dict[str, TopicCoverage]) -> dict[str, dict[str, int]]:
    return {topic: dict(one.against) for topic, one in coverage.items() if one.against}


def restamped(stamp_of: Callable[[Told], int], topics: Iterable[str] = ()) -> Change:
    """Only the stamps of some topics change, or of all."""
    chosen = set(topics)

    def change(told: Told) -> Iterator[Told]:
        yield told._replace(stamp_ns=stamp_of(told)) if not chosen or told.topic in chosen else told

    return change


def held(told: Told) -> int:
    """One stamp for the frames from 5 to 16."""
    return START_NS + 4 * PERIOD_NS if 5 <= told.number <= 16 else told.stamp_ns


@pytest.mark.parametrize("topics", [(), (CAMERA,), ("/top/points",)])
def test_messages_under_one_repeated_stamp_are_audited_and_count_against(tmp_path: Path, topics: tuple[str]) -> None:
    frames = make_frames(RIG, COUNT)
    found, coverage = read(written(tmp_path, frames, restamped(held, topics)))
    assert all(same_frame(a, b) for a, b in zip(found, frames, strict=True))
    assert [frame.stamp_ns for frame in found] == [frame.stamp_ns for frame in frames]
    changed = set(topics) or set(coverage)
    assert against(coverage) == {topic: {"stamp repeated": 12} for topic in changed}
    messages, time = least_covered(coverage.values())
    assert messages == pytest.approx(8 / 20)
    assert time == pytest.approx(8 / 20)
    assert "12 stamps repeated; a gap of 1.2 s" in coverage_line([*coverage.values()])


@pytest.mark.parametrize(
    ("stamp_of", "reason"),
    [
        (lambda told: -told.stamp_ns, "stamp zero or negative"),
        (lambda told: 0, "stamp zero or negative"),
        (lambda told: told.stamp_ns - 3_050_000_000, "stamp goes back"),
        (lambda told: told.stamp_ns + 10**17, "stamp disagrees with its log time"),
        (lambda told: 5 + told.number, "stamp goes back"),
    ],
)
def test_an_impossible_stamp_is_replaced_by_the_log_time(
    tmp_path: Path, stamp_of: Callable[[Told], int], reason: str
) -> None:
    frames = make_frames(RIG, 60)

    def some(told: Told) -> int:
        return stamp_of(told) if told.number in (40, 50) else told.stamp_ns

    found, coverage = read(written(tmp_path, frames, restamped(some, [CAMERA])))
    assert all(same_frame(a, b) for a, b in zip(found, frames, strict=True))
    assert against(coverage) == {CAMERA: {reason: 2}}


@pytest.mark.parametrize("topics", [(), (CAMERA,)])
def test_a_clock_that_stands_still_from_the_beginning_is_paired_by_log_time(tmp_path: Path, topics: tuple[str]) -> None:
    frames = make_frames(RIG, COUNT)
    found, coverage = read(written(tmp_path, frames, restamped(lambda told: START_NS - 10**15, topics)))
    assert all(same_frame(a, b) for a, b in zip(found, frames, strict=True))
    assert list(np.diff([frame.stamp_ns for frame in found])) == [PERIOD_NS] * (COUNT - 1)
    changed = set(topics) or set(coverage)
    assert against(coverage) == {topic: {"clock stands still": COUNT} for topic in changed}
    assert least_covered(coverage.values()) == (0, 0)


def test_negative_stamps_throughout_are_paired_by_log_time(tmp_path: Path) -> None:
    frames = make_frames(RIG, COUNT)
    found, coverage = read(written(tmp_path, frames, restamped(lambda told: told.stamp_ns - 2 * START_NS)))
    assert all(same_frame(a, b) for a, b in zip(found, frames, strict=True))
    assert set(map(str, against(coverage)[CAMERA])) == {"stamp zero or negative"}


def test_stamps_and_log_times_that_repeat_together_leave_their_messages_unaudited_and_told(tmp_path: Path) -> None:
    def change(told: Told) -> Iterator[Told]:
        time_ns = held(told)
        yield told._replace(stamp_ns=time_ns, log_time_ns=time_ns)

    _, coverage = read(written(tmp_path, make_frames(RIG, COUNT), change))
    assert least_covered(coverage.values())[0] == pytest.approx(8 / 20)


def test_a_clock_set_back_counts_against(tmp_path: Path) -> None:
    later = [make_frame(RIG, n, stamp_ns=START_NS + (n - 30) * PERIOD_NS + 3_000_000) for n in range(COUNT, 2 * COUNT)]
    found, coverage = read(written(tmp_path, [*make_frames(RIG, COUNT), *later]))
    assert len(found) == 2 * COUNT
    assert [*against(coverage).values()] == [{"stamp goes back": COUNT}] * 4


@pytest.mark.parametrize(
    ("without", "told"),
    [
        (lambda n: n < 8, "cam2 begins 0.8 s late"),
        (lambda n: n >= 30, "cam2 ends 1.0 s early"),
        (lambda n: 10 <= n < 20, "cam2 a gap of 1.0 s"),
        (lambda n: n in range(8, 14) or n in range(20, 25), "cam2 2 gaps, the longest of 0.6 s"),
    ],
)
def test_a_sensor_that_is_not_there_all_the_time_counts_against_it_by_time(
    tmp_path: Path, without: Callable[[int], bool], told: str
) -> None:
    frames = [make_frame(RIG, n, without={2} if without(n) else ()) for n in range(40)]
    _, coverage = read(written(tmp_path, frames))
    messages, time = least_covered(coverage.values())
    assert (messages, time < 0.99) == (1, True)
    assert told in coverage_line([*coverage.values()])


def test_messages_of_a_sensor_beside_all_frames_are_unpaired(tmp_path: Path) -> None:
    def beside(told: Told) -> Iterator[Told]:
        half = PERIOD_NS // 2 if told.number % 2 and told.topic == CAMERA else 0
        yield told._replace(stamp_ns=told.stamp_ns + half, log_time_ns=told.log_time_ns + half)

    _, coverage = read(written(tmp_path, make_frames(RIG, COUNT), beside))
    assert against(coverage)[CAMERA]["unpaired"] >= 9


def test_a_sensor_that_was_thinned_out_does_not_hide_the_messages_of_the_others(tmp_path: Path) -> None:
    thinned = [make_frame(RIG, n, without={0} if n % 10 else ()) for n in range(60)]
    _, coverage = read(written(tmp_path, thinned))
    assert coverage[CAMERA].against["unpaired"] >= 40
    assert least_covered(coverage.values())[0] < 0.2


def test_a_damaged_message_counts_against(tmp_path: Path) -> None:
    def cut(told: Told) -> Iterator[Told]:
        yield told._replace(data=told.data[:400]) if (told.topic, told.number) == (CAMERA, 7) else told

    _, coverage = read(written(tmp_path, make_frames(RIG, COUNT), cut))
    assert against(coverage) == {CAMERA: {"damaged": 1}}


# Healthy recordings


def at(stamps: dict[int, Iterable[int]]) -> list[Frame]:
    """Messages of sensors at stamps of their own, in order of time."""
    events = sorted((START_NS + stamp, sensor) for sensor, own in stamps.items() for stamp in own)
    return [
        make_frame(RIG, number, without=set(RIG.sensors) - {sensor}, stamp_ns=stamp_ns)
        for number, (stamp_ns, sensor) in enumerate(events)
    ]


def every(period_ms: float, seconds: float, shift_ms: float = 0, jitter_ms: float = 0, seed: int = 0) -> list[int]:
    random = np.random.default_rng(seed)
    count = int(seconds * 1000 / period_ms)
    return [int((n * period_ms + shift_ms + random.uniform(-jitter_ms, jitter_ms)) * 10**6) for n in range(count)]


def cameras(period_ms: float, seconds: float, **how: float) -> dict[int, list[int]]:
    return {sensor: every(period_ms, seconds, seed=sensor, **how) for sensor in (1, 2, 3)}


HEALTHY = {
    "LiDAR 20 Hz, cameras 10 Hz": {0: every(50, 8, 7), **cameras(100, 8)},
    "cameras 30 Hz, LiDAR 10 Hz": {0: every(100, 8, 11), **cameras(33.333, 8)},
    "cameras 20 Hz, LiDAR 10 Hz, jitter": {0: every(100, 8, 5, 3), **cameras(50, 8, jitter_ms=3)},
    "all 10 Hz, jitter": {0: every(100, 8, -12, 4, 9), **cameras(100, 8, jitter_ms=4)},
    "all 30 Hz, jitter": {0: every(33.333, 5, 2, 1, 9), **cameras(33.333, 5, jitter_ms=1)},
    "single dropped messages": {
        sensor: [stamp for n, stamp in enumerate(own) if n != 31 + 9 * sensor]
        for sensor, own in {0: every(100, 10), **cameras(100, 10)}.items()
    },
    "LiDAR begins and ends within a period": {0: every(100, 8, 95)[:-1], **cameras(100, 8)},
    "three frames": {0: every(100, 0.3, 4), **cameras(100, 0.3)},
    "two frames": {0: every(100, 0.2, 4), **cameras(100, 0.2)},
}


@pytest.mark.parametrize("name", HEALTHY)
def test_a_healthy_recording_is_complete(name: str, tmp_path: Path) -> None:
    found, coverage = read(written(tmp_path, at(HEALTHY[name])))
    assert found
    assert min(least_covered(coverage.values())) == 1, coverage_line([*coverage.values()])
    assert coverage_line([*coverage.values()]) == ""


def delayed(delay_ns: Callable[[Told], int]) -> Change:
    def change(told: Told) -> Iterator[Told]:
        yield told._replace(log_time_ns=told.log_time_ns + delay_ns(told))

    return change


def doubled(told: Told) -> Iterator[Told]:
    """As two recorders of each topic write it."""
    yield told
    yield told._replace(log_time_ns=told.log_time_ns + 3_000_000)


RECORDERS: dict[str, Change] = {
    "two recorders": doubled,
    "half a second late": delayed(lambda told: 5 * 10**8),
    "a delay that jitters by a period": delayed(lambda told: 10**8 + told.number * 37 % 100 * 10**6),
    "clocks drift by a millisecond a frame": delayed(lambda told: told.number * 10**6),
    "a clock that counts from the start": lambda told: [
        told._replace(stamp_ns=told.stamp_ns - START_NS, log_time_ns=told.log_time_ns - START_NS)
    ],
    "no stamps at all": restamped(lambda told: 0),
    "log times of another year": delayed(lambda told: 10**17),
    "one log time for all": lambda told: [told._replace(log_time_ns=START_NS)],
}


@pytest.mark.parametrize("name", RECORDERS)
def test_what_recorders_do_to_healthy_stamps_leaves_them_complete(name: str, tmp_path: Path) -> None:
    frames = make_frames(RIG, 60)
    found, coverage = read(written(tmp_path, frames, RECORDERS[name]))
    assert all(same_frame(a, b) for a, b in zip(found, frames, strict=True))
    assert coverage_line([*coverage.values()]) == ""


def test_exact_duplicates_are_skipped_as_such(tmp_path: Path) -> None:
    with open_recording(written(tmp_path, make_frames(RIG, COUNT), doubled)) as recording:
        stream = stream_of(recording, RIG)
        list(stream)
        balance = {topic.topic: topic for topic in stream.balance}
    assert balance[CAMERA].skipped == {"duplicate": COUNT}
    assert balance[CAMERA].adds_up


def test_a_second_message_of_one_stamp_and_other_bytes_is_no_duplicate(tmp_path: Path) -> None:
    def change(told: Told) -> Iterator[Told]:
        yield told
        if told.topic == CAMERA:
            yield told._replace(data=told.data[:-1] + bytes([told.data[-1] ^ 1]))

    _, coverage = read(written(tmp_path, make_frames(RIG, COUNT), change))
    assert against(coverage) == {CAMERA: {"stamp repeated": COUNT}}


def test_a_recorder_that_is_slow_at_first_misplaces_nothing(tmp_path: Path) -> None:
    frames = make_frames(RIG, 80)
    path = written(tmp_path, frames, delayed(lambda told: 10**9 if told.number < 50 and told.topic == CAMERA else 0))
    found, coverage = read(path)
    assert all(same_frame(a, b) for a, b in zip(found, frames, strict=True))
    assert against(coverage) == {CAMERA: {"stamp disagrees with its log time": 30}}


def test_the_rest_of_a_busy_recorder_keeps_its_stamps_and_is_told(tmp_path: Path) -> None:
    frames = make_frames(RIG, 60)
    path = written(tmp_path, frames, delayed(lambda told: 10**9 if 30 <= told.number < 40 else 0))
    found, coverage = read(path)
    assert all(same_frame(a, b) for a, b in zip(found, frames, strict=True))
    assert all(counts == {"stamp disagrees with its log time": 10} for counts in against(coverage).values())


def test_every_sensor_of_the_rig_has_its_state_and_numbers(tmp_path: Path) -> None:
    _, coverage = read(written(tmp_path, make_frames(RIG, COUNT)))
    assert {topic.sensor: (topic.state, topic.kind, topic.read, topic.regular) for topic in coverage.values()} == {
        sensor: (TopicState.READ, "camera" if sensor else "LiDAR", COUNT, COUNT) for sensor in RIG.sensors
    }


@pytest.mark.parametrize(("aside_m", "state"), [(0, TopicState.LEFT_OUT), (20, TopicState.NOT_COMPARED)])
def test_a_further_lidar_topic_is_left_out_only_where_its_points_are_a_part_of_the_other_s(
    tmp_path: Path, aside_m: int, state: TopicState
) -> None:
    def moved(frame: Frame, y_m: int) -> Frame:
        assert frame.cloud is not None
        xyz_m = 0.3 * frame.cloud.xyz_m + np.array([10, y_m, 0])
        return replace(frame, cloud=replace(frame.cloud, xyz_m=xyz_m.astype(np.float32)))

    frames, others = ([moved(frame, y_m) for frame in make_frames(RIG, COUNT)] for y_m in (0, aside_m))
    write_mcap(tmp_path / "others.mcap", RIG, others)
    with open_recording(tmp_path / "others.mcap") as recording:
        [topic] = [topic for topic in recording.topics() if topic.name == "/top/points"]
        messages = [
            (message.log_time_ns, bytes(message.data))
            for message in recording.messages()
            if message.topic == topic.name
        ]
        second = Extra(replace(topic, name="/second/points"), tuple(messages), recording.definition(topic.schema))
    write_mcap(tmp_path / "whole.mcap", RIG, frames)
    path = rewritten(tmp_path / "whole.mcap", tmp_path / "a.mcap", lambda told: [told], [second])
    with open_recording(path) as recording:
        [rig] = find_rigs(survey(recording))
    _, coverage = read(path, rig)
    [outside] = [one for name, one in coverage.items() if name.endswith("/points") and one.sensor is None]
    assert outside.state is state
    assert ("another LiDAR; record it in a frame of its own" in outside.reason) is (aside_m > 0)
