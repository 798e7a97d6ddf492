"""The first clouds of a LiDAR that has not started have no points, which is no attack; later ones are as they are."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from auditor.model.frames import Frame, SensorState
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


def test_a_cloud_that_is_empty_behind_a_full_one_is_as_it_was_recorded(tmp_path: Path) -> None:
    frames, damaged, remarks = read(tmp_path, 3, 4)
    assert damaged == 0
    assert remarks == ()
    assert [frame.presence[0].state for frame in frames] == [SensorState.PRESENT] * 8
    clouds = [np.zeros((0, 3)) if frame.cloud is None else frame.cloud.xyz_m for frame in frames]
    assert [len(xyz_m) for xyz_m in clouds] == [50, 50, 50, 0, 0, 50, 50, 50]
