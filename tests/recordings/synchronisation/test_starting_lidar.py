"""Clouds of a LiDAR that has not started, or is blind, are not there, which is no attack; others are as they are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auditor.model.frames import Frame, PointCloud, SensorState
from auditor.recordings import open_recording, write_mcap
from tests.making.recorded_drives import make_frames, make_rig, split, stream_of

RIG = make_rig(3)


def emptied(frames: list[Frame], *numbers: int, left: int = 0) -> list[Frame]:
    out = []
    for frame in frames:
        assert frame.cloud is not None
        few = replace(frame.cloud, xyz_m=frame.cloud.xyz_m[:left])
        out.append(replace(frame, cloud=few) if frame.number in numbers else frame)
    return out


def read(path: Path, *numbers: int, left: int = 0) -> tuple[list[Frame], int, tuple[str, ...]]:
    """The frames, how many clouds are damaged, and the remarks."""
    write_mcap(path / "a.mcap", RIG, emptied(make_frames(RIG, 8), *numbers, left=left))
    with open_recording(path / "a.mcap") as recording:
        stream = stream_of(recording, RIG)
        frames, skipped = split(stream)
        assert not skipped
        [lidar] = [topic for topic in stream.balance if topic.sensor == 0]
        chosen = [frame for frame in stream.chosen([*numbers]) if isinstance(frame, Frame)]
        by_number = {frame.number: frame for frame in frames}
        assert [one.presence for one in chosen] == [by_number[one.number].presence for one in chosen]
        return frames, lidar.damaged, stream.remarks


def test_first_clouds_that_are_empty_are_not_there(tmp_path: Path) -> None:
    frames, damaged, remarks = read(tmp_path, 0, 1)
    states = [frame.presence[0].state for frame in frames]
    assert states == [SensorState.DAMAGED] * 2 + [SensorState.PRESENT] * 6
    assert frames[0].cloud is None
    assert damaged == 2
    assert "has not started" in frames[0].presence[0].reason
    assert any("has not started" in remark for remark in remarks)


def test_first_clouds_of_a_handful_of_points_are_not_there(tmp_path: Path) -> None:
    frames, damaged, _ = read(tmp_path, 0, 1, left=7)
    assert damaged == 2
    assert frames[1].presence[0].state is SensorState.DAMAGED


@pytest.mark.parametrize("nothing", [np.zeros((0, 3)), np.full((9, 3), np.nan), np.zeros((9, 3))])
def test_a_lidar_that_goes_blind_is_not_there_and_since_when_is_said(tmp_path: Path, nothing: np.ndarray) -> None:
    frames = make_frames(RIG, 8)
    blind = [replace(frame, cloud=PointCloud(frame.stamp_ns, nothing.astype(np.float32))) for frame in frames[5:]]
    write_mcap(tmp_path / "a.mcap", RIG, [*frames[:5], *blind])
    with open_recording(tmp_path / "a.mcap") as recording:
        stream = stream_of(recording, RIG)
        seen, _ = split(stream)
        assert [frame.presence[0].state for frame in seen] == [SensorState.PRESENT] * 5 + [SensorState.DAMAGED] * 3
        assert [frame.cloud is None for frame in seen] == [False] * 5 + [True] * 3
        assert stream.undecoded == ("top: 3 messages from 0.5 s on: it shows nothing: no beam of it returned",)


def test_a_cloud_of_a_handful_of_points_behind_a_full_one_is_as_it_was_recorded(tmp_path: Path) -> None:
    frames, damaged, remarks = read(tmp_path, 3, 4, left=7)
    assert damaged == 0
    assert remarks == ()
    clouds = [() if frame.cloud is None else frame.cloud.xyz_m for frame in frames]
    assert [len(xyz_m) for xyz_m in clouds] == [50, 50, 50, 7, 7, 50, 50, 50]
