"""Every verb that reads recordings reads each within a budget; small files that ask for much work get little."""

import json
import shutil
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from auditor.cli import run
from auditor.model.optics.geometry import Matrix, motion
from auditor.model.optics.sensors import NO_LENS, POLYNOMIAL, Lens
from auditor.pipeline import many
from auditor.pipeline.many import limits_by_size
from auditor.pipeline.workers import MEMORY_MB, SILENT_S, Limits, run_within
from auditor.recordings import open_recording, schemas
from auditor.recordings.formats.found import MAX_TOPICS
from auditor.recordings.recording import Definition, Topic
from auditor.recordings.writers.mcap_file import mcap_file
from auditor.recordings.writers.messages import MessageMaker
from tests.making import recorded_drives
from tests.making.small_drives import write_drive

START_NS = 1_700_000_000 * 10**9
PERIOD_NS = 10**8
SIZE_PX = (160, 120)
SPACING_M = 0.1
BENT = Lens(POLYNOMIAL, (-0.05, 0.01, 0.0, 0.0))

Placing = Literal["line", "around", "front"]


def write_many_cameras(
    path: Path, count: int, placing: Placing = "line", *, rectified: bool = False, lidar: bool = True, frames: int = 12
) -> Path:
    """An MCAP file of `count` cameras, placed by tf, with noise for pictures: see `_place`."""
    maker, rng = MessageMaker("cdr"), np.random.default_rng(0)
    width, height = SIZE_PX
    K = np.array([[100.0, 0, width / 2], [0, 100, height / 2], [0, 0, 1]])
    P = np.hstack([K, np.zeros((3, 1))])
    image = "image_rect" if rectified else "image_raw"
    places = {f"cam{number:03}": _place(number, count, placing) for number in range(count)}
    pixels = {name: rng.integers(0, 256, (height, width), np.uint8) for name in places}
    points = rng.normal(0, 10, (200, 4)).astype(np.float32)
    with mcap_file(path, profile="ros2", compression="none") as file:

        def add(topic: str, schema: str, stamp_ns: int, data: bytes) -> None:
            definition = Definition("ros2msg", maker.definition(schema).encode())
            file.write(Topic(topic, schema, "cdr"), definition, stamp_ns, data)

        tree = {**places, **({"top": np.eye(4)} if lidar else {})}
        add("/tf_static", schemas.TRANSFORMS, START_NS, maker.transforms("base", tree, START_NS))
        for stamp_ns in range(START_NS, START_NS + frames * PERIOD_NS, PERIOD_NS):
            for name in places:
                lens = NO_LENS if rectified else BENT
                info = maker.camera_info(P, width, height, stamp_ns, name, lens)
                add(f"/{name}/camera_info", schemas.CAMERA_INFO, stamp_ns, info)
                add(f"/{name}/{image}", *_image(maker, pixels[name], stamp_ns, name))
            if lidar:
                add("/top/points", schemas.POINT_CLOUD, stamp_ns, maker.point_cloud(points, stamp_ns, "top"))
    return path


def _image(maker: MessageMaker, pixels: np.ndarray, stamp_ns: int, name: str) -> tuple[str, int, bytes]:
    schema, data = maker.image(pixels, stamp_ns, name, "raw")
    return schema, stamp_ns, data


def _place(number: int, count: int, placing: Placing) -> Matrix:
    """On a line, in rows above each other, or around the car; each looks along its z axis. `base` has z ahead."""
    if placing == "line":
        return motion(np.eye(3), np.array([SPACING_M * number, 0, 0]))
    if placing == "front":
        return motion(np.eye(3), np.array([SPACING_M * (number % 10), SPACING_M * (number // 10), 0]))
    angle = 2 * np.pi * number / count
    turn = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    return motion(turn, turn @ np.array([0, 0, 1.5]))


READING = ("inspect", "convert", "attack", "calibrate", "scan", "evaluate", "train-matcher")
TOO_MANY = 7
MANY = {"line": 28, "around": 28, "front": 12}
"""Cameras of a recording, by how they are placed; all of them in front are compared with all."""

MOST_MB = 300


@pytest.fixture(scope="module")
def drive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_drive(tmp_path_factory.mktemp("drive") / "long.mcap", count=60)


@pytest.mark.parametrize("verb", READING)
def test_every_verb_that_reads_recordings_has_the_same_budgets(verb: str, capfd: pytest.CaptureFixture[str]) -> None:
    assert run([verb, "--help"]) == 0
    shown = " ".join(capfd.readouterr().out.split())
    assert "--memory-limit MB Memory that one recording may take before it is given up. [default: 4096" in shown
    assert "--time-limit SECONDS Time that one recording may take. [default: any, while it makes progress" in shown


def test_inspect_goes_on_after_a_recording_over_its_budget(drive: Path, capfd: pytest.CaptureFixture[str]) -> None:
    shutil.copy(drive, drive.with_name("other.mcap"))
    assert run(["inspect", str(drive), str(drive.with_name("other.mcap")), "--time-limit", "0.001"]) == 3
    first, second = (line for line in capfd.readouterr().err.splitlines() if line.strip())
    assert "long.mcap" in first
    assert "other.mcap" in second
    assert "give it more with --time-limit or --memory-limit" in second


@pytest.mark.parametrize("verb", [["convert"], ["attack", "--on", "S_1"]])
def test_a_copy_over_its_budget_leaves_nothing_behind(
    drive: Path, tmp_path: Path, verb: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    assert run([*verb, str(drive), str(tmp_path / "copy.mcap"), "--time-limit", "0.001"]) == 2
    assert "took longer than 0.001 s" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("verb", ["evaluate", "calibrate"])
def test_other_verbs_end_a_recording_over_its_budget_in_one_line(
    verb: str, drive: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert run([verb, str(drive), "--store", str(tmp_path / "audit"), "--time-limit", "0.001"]) == 2
    assert "it took longer than 0.001 s and was ended" in capfd.readouterr().err


def test_the_memory_that_is_given_is_the_limit_of_its_process(drive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which process is ended by it, test_workers says: a recording may be done before a busy machine looks."""
    given, limits = [], many.limits_by_size
    monkeypatch.setattr(many, "limits_by_size", lambda *of: given.append(limits(*of)(drive).memory_mb) or limits(*of))
    assert run(["inspect", str(drive), "--memory-limit", "3999"]) == 0
    assert set(given) == {3999}


def test_the_defaults_are_by_size(drive: Path) -> None:
    limits, of_streets = limits_by_size()(drive), limits_by_size()(None)
    assert limits.memory_mb == of_streets.memory_mb == MEMORY_MB
    assert limits.silent_s is not None
    assert limits.silent_s > SILENT_S == of_streets.silent_s


def test_a_function_within_limits_gives_its_result_and_its_error(drive: Path) -> None:
    assert run_within(Limits(), Path.exists, drive)
    with pytest.raises(Exception, match="auditor failed on it: FileNotFoundError") as caught:
        run_within(Limits(), Path.stat, Path("/nowhere"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("placing", MANY)
def test_very_many_cameras_take_little_memory_and_those_left_out_are_named(
    tmp_path: Path, placing: Placing, capfd: pytest.CaptureFixture[str]
) -> None:
    path = write_many_cameras(tmp_path / "many.mcap", MANY[placing], placing, frames=2)
    inspect = ["inspect", str(path), "--format", "json", "--memory-limit", str(MOST_MB)]
    assert run(inspect) == 3, "those that are left out are not audited"
    [described] = json.loads(capfd.readouterr().out)
    compared = {sensor["name"] for rig in described["rigs"] for sensor in rig["sensors"]}
    named = " ".join(described["left_out"])
    assert all(f"cam{number:03}" in compared or f"cam{number:03}" in named for number in range(MANY[placing]))


def test_too_many_topics_are_one_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "topics.mcap"
    recorded_drives.mcap_file(path, [(f"/topic{number}", 10**18, b"{}") for number in range(MAX_TOPICS + TOO_MANY)])
    with open_recording(path) as recording:
        assert recording.topics() is recording.topics()
        assert sum(1 for _ in recording.messages()) == MAX_TOPICS
        [damage] = recording.damage
    assert (
        str(damage) == f"it has more than {MAX_TOPICS} topics: {TOO_MANY} are left out, and their {TOO_MANY} messages"
    )
    assert run(["inspect", str(path)]) == 3
    shown = capfd.readouterr().out
    assert len(shown.splitlines()) < 300
    assert "and 9800 more topics" in shown
    assert shown.count("topics: 7 are left out") == 1
