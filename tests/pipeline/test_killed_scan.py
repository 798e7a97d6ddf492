"""A scan that is killed loses nothing that was finished, and the next one completes it."""

import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from tests.making.small_drives import START_NS, write_drive

MINUTE_NS = 60 * 10**9
KILLS = 1


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    """A store with thresholds, and three recordings of which one is attacked."""
    folder = tmp_path_factory.mktemp("night")
    small = {"count": 6, "seed": 1, "positions_m": (0.6, 0.3, 0.0)}
    drives = [
        write_drive(folder / "one.mcap", **small),
        write_drive(folder / "two.mcap", **small, start_ns=START_NS + MINUTE_NS, attacked={1: range(1, 6)}),
        write_drive(folder / "three.bag", **small, start_ns=START_NS + 2 * MINUTE_NS),
    ]
    assert run(["calibrate", str(drives[0]), "-r", "0", "--store", str(folder / "thresholds")]) == 0
    assert run(["store", "remove", "one.mcap", "--yes", "--store", str(folder / "thresholds")]) == 0
    return folder / "thresholds", drives


def scan(store: Path, drives: list[Path]) -> list[str]:
    return ["scan", *map(str, drives), "-r", "0.001", "--store", str(store), "--jobs", "1"]


def tables(store: Path) -> dict[str, bytes]:
    """What must be the same whatever happened in between: frames and verdicts, by their ids."""
    return {
        f"{t}/{p.name}": p.read_bytes()
        for t in ("frames", "cells", "fault_features", "regions", "verdicts")
        for p in sorted((store / t).glob("*.parquet"))
    }


def files(store: Path) -> int:
    """How far a scan has come: files there, finished or under way."""
    return sum(path.is_file() for path in store.rglob("*"))


def test_scans_killed_at_seeded_points_of_progress_are_completed_to_the_same_bytes(
    night: tuple[Path, list[Path]], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    thresholds, drives = night
    undisturbed = shutil.copytree(thresholds, tmp_path / "undisturbed")
    first = files(undisturbed)
    assert run(scan(undisturbed, drives)) == 1
    expected = tables(undisturbed)
    assert len(expected) == 15
    points = random.Random(7).sample(range(first + 1, files(undisturbed)), KILLS)
    finished = []
    for kill, point in enumerate(points):
        store = shutil.copytree(thresholds, tmp_path / f"killed{kill}")
        program = [sys.executable, "-m", "auditor", *scan(store, drives)]
        with subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
            while files(store) < point and process.poll() is None:
                time.sleep(0.01)
            process.send_signal(signal.SIGKILL)
        time.sleep(0.5)  # its worker ends a moment later
        finished.append(len(list((store / "measurements").glob("*.parquet"))))
        capfd.readouterr()
        code, remarks = run(scan(store, drives)), capfd.readouterr().err
        assert code == 1, remarks
        assert remarks.count("measured before") == finished[-1], remarks
        assert tables(store) == expected
    assert 0 < sum(finished) < KILLS * len(drives), "kills fell before and after finished recordings"


@pytest.mark.parametrize("again", [False, True])
def test_what_another_scan_finished_meanwhile_stays_as_it_is(
    night: tuple[Path, list[Path]], tmp_path: Path, *, again: bool
) -> None:
    task, theirs = MeasureTask(night[1][0], tmp_path / "audit", again=again), dict[Path, int]()
    if again:
        measure_recording(task, lambda *_: None)

    def kept() -> dict[Path, int]:
        return {
            path: path.stat().st_ino for table in ("frames", "measurements") for path in task.store.glob(f"{table}/*")
        }

    def meanwhile(_: str, frames: int) -> None:
        if frames == 1:
            measure_recording(task, lambda *_: None)
            theirs.update({path: inode for path, inode in kept().items() if path.suffix == ".parquet"})

    measure_recording(task, meanwhile)
    assert len(theirs) == 2
    assert kept() == theirs
