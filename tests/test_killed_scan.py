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
from tests.small_drives import write_drive

KILLS = 10


@pytest.fixture(scope="module")
def night(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Path]]:
    """A store with thresholds, and three recordings of which one is attacked."""
    folder = tmp_path_factory.mktemp("night")
    drives = [
        write_drive(folder / "one.mcap", count=40, seed=1),
        write_drive(folder / "two.mcap", count=40, seed=1, attacked={1: range(10, 30)}),
        write_drive(folder / "three.bag", count=40, seed=1),
    ]
    assert run(["calibrate", str(drives[0]), "-r", "0", "--store", str(folder / "thresholds")]) == 0
    for table in ("recordings", "rigs", "triples", "measurements", "frames", "labels", "pictures"):
        shutil.rmtree(folder / "thresholds" / table, ignore_errors=True)
    return folder / "thresholds", drives


def scan(store: Path, drives: list[Path]) -> subprocess.Popen[str]:
    command = [
        sys.executable,
        "-m",
        "auditor",
        "scan",
        *map(str, drives),
        "-r",
        "0",
        "--store",
        str(store),
        "--jobs",
        "1",
    ]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def tables(store: Path) -> dict[str, bytes]:
    """What must be the same whatever happened in between: frames and verdicts, by their ids."""
    return {
        f"{t}/{p.name}": p.read_bytes() for t in ("frames", "verdicts") for p in sorted((store / t).glob("*.parquet"))
    }


def test_scans_killed_at_seeded_points_are_completed_to_the_same_bytes(
    night: tuple[Path, list[Path]], tmp_path: Path
) -> None:
    thresholds, drives = night
    undisturbed = shutil.copytree(thresholds, tmp_path / "undisturbed")
    started = time.monotonic()
    with scan(undisturbed, drives) as process:
        process.communicate()
    seconds = time.monotonic() - started
    expected = tables(undisturbed)
    assert len(expected) == 6
    points = random.Random(7)
    measured_before = 0
    for kill in range(KILLS):
        store = shutil.copytree(thresholds, tmp_path / f"killed{kill}")
        with scan(store, drives) as process:
            time.sleep(seconds * points.uniform(0.25, 0.95))
            process.send_signal(signal.SIGKILL)
            process.communicate()
        finished = len(list((store / "measurements").glob("*.parquet"))) if (store / "measurements").exists() else 0
        with scan(store, drives) as process:
            _, remarks = process.communicate()
        assert process.returncode == 1, remarks
        assert remarks.count("measured before") == finished, remarks
        assert tables(store) == expected
        measured_before += finished
    assert 0 < measured_before < KILLS * len(drives), "the kills fell before, between and after finished recordings"
