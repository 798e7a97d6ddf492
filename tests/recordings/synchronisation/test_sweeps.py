"""Clouds that are parts of a LiDAR's sweep are put together, so that what the cameras see is of one revolution."""

import json
from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import pytest

from auditor.cli import run
from auditor.model.arrays import Points
from auditor.model.frames import Frame, PointCloud, Presence, SensorState
from auditor.model.rig import Rig, Sweep
from auditor.recordings import find_rigs, open_recording, read_rig, survey, synchronise, write_mcap, write_rig
from auditor.recordings.synchronisation.sectors import Sector, in_parts, sector_of, show_whole_sweeps, sweep_of
from tests.making.recorded_drives import PERIOD_NS, START_NS, make_frame, make_rig, split

RIG = make_rig(3)
TURN = 2 * np.pi
ROUND = 720
AHEAD = -np.pi / 2
"""Where the cameras of `make_rig` look, around the LiDAR."""
FRAMES = 12


def points_at(angle: Points, direction: int) -> Points:
    """Points 10 m away, which remember their revolution as a height; the LiDAR looks ahead in the middle of one."""
    revolution = angle // TURN
    azimuth = AHEAD + direction * (angle - np.pi)
    return np.column_stack([10 * np.cos(azimuth), 10 * np.sin(azimuth), revolution / 10]).astype(np.float32)


def in_clouds(parts: float, phase: float = 0.0, direction: int = 1, lost: Collection[int] = ()) -> Iterator[Frame]:
    """A drive whose LiDAR writes so many clouds a revolution, the first of which begins at `phase`; some are lost."""
    angle = (np.arange(FRAMES * ROUND) + 0.5) / ROUND * TURN
    part = ((angle - phase) // (TURN / parts)).astype(int)
    items = [(START_NS + n * PERIOD_NS, make_frame(RIG, n, without=[0])) for n in range(FRAMES)]
    for number in np.unique(part):
        stamp_ns = START_NS + round((((number + 0.5) * TURN / parts + phase) / TURN - 0.5) * PERIOD_NS)
        cloud = PointCloud(stamp_ns, points_at(angle[part == number], direction))
        if number not in lost:
            items.append((stamp_ns, Frame(0, stamp_ns, {0: Presence(SensorState.PRESENT)}, cloud, {})))
    return (frame for _, frame in sorted(items, key=lambda item: item[0]))


def read(path: Path) -> tuple[Rig, list[Frame], dict[str, int], bool]:
    """The rig, the frames, what became of the LiDAR's messages, and whether they add up."""
    with open_recording(path) as recording:
        surveyed = survey(recording)
        [rig] = find_rigs(surveyed)
        stream = synchronise(recording, rig, surveyed)
        frames, _ = split(stream)
        [balance] = [topic for topic in stream.balance if topic.sensor == 0]
        counts = {"read": balance.read, "used": balance.used, "damaged": balance.damaged, **balance.skipped}
        return rig, frames, counts, balance.adds_up


@pytest.mark.parametrize(("count", "whole"), [(3, True), (40, False), (190, False), (194, True)])
def test_a_sweep_of_64_parts_is_told_from_three_turns(count: int, *, whole: bool) -> None:
    """A LiDAR alone has given 40 clouds before anything else is known; of three clouds nothing is in parts."""
    step = TURN / 64
    assert show_whole_sweeps([Sector(n * step, step) for n in range(count)]) is whole
    assert show_whole_sweeps([Sector(0.1, TURN)] * count)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize(("parts", "phase"), [(20, 0.0), (2, 0.0), (2, np.pi / 2), (3, 0.5), (20.6, 1.0), (75.4, 0.3)])
def test_the_parts_of_a_sweep_are_one_cloud(tmp_path: Path, parts: float, phase: float, direction: int) -> None:
    write_mcap(tmp_path / "parts.mcap", RIG, in_clouds(parts, phase, direction))
    rig, frames, _, adds_up = read(tmp_path / "parts.mcap")
    assert rig.lidar
    assert rig.lidar.sweep
    assert rig.lidar.sweep.parts in (int(parts), round(parts))
    assert adds_up
    whole = [frame for frame in frames if frame.cloud is not None]
    assert len(whole) >= FRAMES - 2
    for frame in whole:
        assert frame.cloud is not None
        ahead = frame.cloud.xyz_m[frame.cloud.xyz_m[:, 1] < -3]
        assert len(set(ahead[:, 2].tolist())) == 1, "what the cameras see is of one revolution"
        assert len(frame.cloud.xyz_m) >= ROUND * (1 - 1 / parts)
        skews_ns = [presence.skew_ns or 0 for presence in frame.presence.values()]
        assert max(map(abs, skews_ns)) <= PERIOD_NS // 20


def test_a_sweep_that_lacks_a_part_is_damaged(tmp_path: Path) -> None:
    write_mcap(tmp_path / "parts.mcap", RIG, in_clouds(20, lost=[105]))
    _, frames, counts, adds_up = read(tmp_path / "parts.mcap")
    assert adds_up
    assert counts["damaged"] == 19
    [damaged] = [frame for frame in frames if frame.presence[0].state is SensorState.DAMAGED]
    assert damaged.presence[0].reason == "the sweep has 19 of its 20 parts"


def test_a_sweep_that_the_beginning_cut_is_no_damage(tmp_path: Path) -> None:
    write_mcap(tmp_path / "parts.mcap", RIG, in_clouds(20, lost=range(13)))
    _, frames, counts, adds_up = read(tmp_path / "parts.mcap")
    assert adds_up
    assert counts["damaged"] == 0
    assert counts["edge"] == 7
    assert all(frame.presence[0].state is SensorState.PRESENT for frame in frames)


def test_inspect_says_that_clouds_are_parts(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    write_mcap(tmp_path / "parts.mcap", RIG, in_clouds(20))
    run(["inspect", str(tmp_path / "parts.mcap")])
    assert "20 clouds of top make one sweep" in capfd.readouterr().out
    run(["inspect", str(tmp_path / "parts.mcap"), "--format", "json"])
    assert json.loads(capfd.readouterr().out)[0]["rigs"][0]["clouds_a_sweep"] == 20


def test_a_rig_file_keeps_how_a_sweep_is_put_together(tmp_path: Path) -> None:
    write_mcap(tmp_path / "parts.mcap", RIG, in_clouds(20))
    rig, *_ = read(tmp_path / "parts.mcap")
    write_rig(rig, tmp_path / "rig.toml")
    again = read_rig(tmp_path / "rig.toml")
    assert again.rig_id == rig.rig_id
    assert again.lidar
    assert isinstance(again.lidar.sweep, Sweep)


def test_whole_sweeps_and_one_direction_are_no_parts() -> None:
    rng = np.random.default_rng(1)
    whole = [sector_of(rng.normal(0, 10, (500, 3)).astype(np.float32)) for _ in range(12)]
    ahead = [Sector(0.01 * number % 0.05, 1.2) for number in range(12)]
    assert not in_parts(whole)
    assert not in_parts(ahead)
    assert sweep_of(whole, 0.0) is None
    assert sector_of(np.zeros((40, 3), np.float32)) is None


def test_a_few_points_elsewhere_move_no_sector() -> None:
    azimuth = np.linspace(0.1, 0.4, 200)
    points = np.column_stack([10 * np.cos(azimuth), 10 * np.sin(azimuth), 0 * azimuth]).astype(np.float32)
    points[::25] *= np.float32(-1)
    found = sector_of(points)
    assert found is not None
    assert found.azimuth_rad == pytest.approx(0.25, abs=0.03)
    assert found.width_rad < 0.4
