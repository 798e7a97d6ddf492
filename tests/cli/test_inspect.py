"""`auditor inspect` shows where every message went and how the sensors' clocks lie."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.model.frames import CameraImage, Frame
from auditor.recordings import write_mcap
from tests.making.audits import ask
from tests.making.scenes import plane_rig
from tests.making.small_drives import FOUR_CAMERAS, PERIOD_NS, drive_frames

RIG = plane_rig(FOUR_CAMERAS)
LATE_NS = 7_000_000


def moved(frame: Frame, by_ns: int) -> Frame:
    images = {n: CameraImage(n, i.stamp_ns + by_ns, i.pixels) for n, i in frame.images.items()}
    cloud = replace(frame.cloud, stamp_ns=frame.cloud.stamp_ns + by_ns)
    return replace(frame, stamp_ns=frame.stamp_ns + by_ns, images=images, cloud=cloud)


def test_late_starters_offsets_jumps_and_the_balance_are_shown(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    frames = list(drive_frames(RIG, 40))
    for number, frame in enumerate(frames):
        images = {n: i for n, i in frame.images.items() if n != 2 or number >= 5}
        images[3] = replace(images[3], stamp_ns=images[3].stamp_ns + LATE_NS)
        frames[number] = moved(replace(frame, images=images), -100 * PERIOD_NS if number >= 30 else 0)
    write_mcap(tmp_path / "a.mcap", RIG, frames)
    assert run(["inspect", str(tmp_path / "a.mcap"), "--format", "json"]) == 3
    [described] = json.loads(capfd.readouterr().out)
    [rig] = described["rigs"]
    sensors = {sensor["sensor"]: sensor for sensor in rig["sensors"]}
    for sensor in sensors.values():
        skipped = sum(sensor["skipped"].values())
        assert sensor["read"] == sensor["used"] + sensor["unused"] + sensor["damaged"] + skipped
    assert [sensors[s]["read"] for s in ("S_0", "S_1", "S_2")] == [40, 40, 35]
    assert sensors["S_3"]["offset_ms"] == 7
    assert sensors["S_1"]["offset_ms"] == 0
    assert rig["clock_jumps"] == 1
    assert rig["period_ms"] == 100
    assert rig["frames"] + sum(rig["skipped"].values()) == 40
    assert any("jumps back" in problem for problem in described["problems"])
    assert run(["inspect", str(tmp_path / "a.mcap")]) == 3
    shown = capfd.readouterr().out
    assert "offset_ms" in shown
    assert "the clock jumped back 1 times" in shown


def test_a_sensor_that_starts_late_says_when(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    frames = [
        replace(frame, images={n: i for n, i in frame.images.items() if n != 2 or frame.number >= 10})
        for frame in drive_frames(RIG, 20)
    ]
    write_mcap(tmp_path / "a.mcap", RIG, frames)
    assert run(["inspect", str(tmp_path / "a.mcap"), "--format", "json"]) == 3
    [rig] = json.loads(capfd.readouterr().out)[0]["rigs"]
    late, other = rig["sensors"][2], rig["sensors"][1]
    assert late["from_s"] - other["from_s"] == pytest.approx(0.9)
    assert late["to_s"] == other["to_s"]
    assert late["present"] == 10


def test_offsets_given_in_a_rig_file_reach_the_store(tmp_path: Path) -> None:
    write_mcap(tmp_path / "a.mcap", RIG, drive_frames(RIG, 4))
    rig, store = tmp_path / "rig.toml", tmp_path / "audit"
    assert run(["inspect", str(tmp_path / "a.mcap"), "--write-rig", str(rig)]) == 0
    rig.write_text(rig.read_text().replace("[lidar]\n", "[lidar]\noffset_ns = -3000000\n"))
    assert run(["scan", str(tmp_path / "a.mcap"), "--rig", str(rig), "--measure-only", "--store", str(store)]) == 3
    rows = ask(store, "SELECT DISTINCT sensor, skew_ns FROM sensors WHERE sensor < 2 ORDER BY sensor")
    assert [row["skew_ns"] for row in rows] == [3_000_000, 0]


def test_a_rig_file_is_tried_before_a_scan_needs_it(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    recording, rig = str(tmp_path / "a.mcap"), tmp_path / "rig.toml"
    write_mcap(tmp_path / "a.mcap", RIG, drive_frames(RIG, 4))
    assert run(["inspect", recording, "--write-rig", str(rig)]) == 0
    rig.write_text(rig.read_text().replace("camera_1", "renamed"))
    capfd.readouterr()
    assert run(["inspect", recording, "--rig", str(rig)]) in {0, 2}
    first = capfd.readouterr()
    assert "renamed" in first.out + first.err
    assert run(["inspect", recording, "--rig", str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capfd.readouterr().err
