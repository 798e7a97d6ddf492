"""A vehicle whose cameras do not stand on one line, from its recordings to the attacked sensors."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.lab.attacks.paper import BogusWall, Facula
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.model.frames import Frame
from auditor.model.optics.sensors import NO_LENS, Lens
from auditor.model.rig import LIDAR
from auditor.recordings import write_mcap
from tests.making.perturbed_rigs import perturbed
from tests.making.scenes import moved
from tests.making.small_drives import DAY_NS, START_NS

OFFSETS_M = ((0.0, -0.1, 0.0), (0.0, 0.0, 0.15), (0.0, 0.0, 0.0))
LENSES = (Lens("plumb_bob", (-0.2, 0.05, 0.001, 0.0)), NO_LENS, NO_LENS)
ATTACKED = {1: range(2), 2: range(3, 5), 3: range(6, 8), LIDAR: range(9, 11)}


def street(trip: int, frames: int) -> SyntheticDrive:
    drive = make_drive(3, frames, width_px=396, height_px=120, trip=trip, start_ns=START_NS + trip * DAY_NS)
    return replace(drive, vehicle=replace(drive.vehicle, rig=moved(perturbed(drive.rig, LENSES, 1), OFFSETS_M)))


def attacked(drive: SyntheticDrive) -> Iterator[Frame]:
    facula, wall = Facula(510.0, 73.0, 253.0, 73.0), BogusWall(7.0, 0.0)
    for frame in drive.frames():
        hit = next((sensor for sensor, during in ATTACKED.items() if frame.number in during), None)
        images = {n: facula.apply(image) if n == hit else image for n, image in frame.images.items()}
        yield replace(frame, images=images, cloud=wall.apply(frame.cloud, drive.rig) if hit == LIDAR else frame.cloud)


def test_each_attacked_sensor_is_named(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    store, clean, tested = (str(tmp_path / name) for name in ("audit", "clean.mcap", "attacked.mcap"))
    for path, drive in ((clean, street(0, 5)), (tested, street(1, 11))):
        write_mcap(Path(path), drive.rig, attacked(drive) if path == tested else drive.frames())
    assert run(["inspect", clean]) == 0
    printed = " ".join(capfd.readouterr().out.split())
    assert "up to 1 attacked sensor at once can be identified" in printed
    assert "not on one line (S_2 by 4.0 px at 10 m): rectified pair by pair" in printed
    assert "WARNING" not in printed
    assert "left out" not in printed
    assert run(["calibrate", clean, "-r", "0.05", "--store", store]) == 0
    assert run(["scan", tested, "-r", "0.05", "--pictures", "none", "--store", store]) == 1
    capfd.readouterr()
    assert run(["query", "incidents", "--store", store, "--format", "json"]) == 0
    incidents = json.loads(capfd.readouterr().out)
    named = [row for row in incidents if row["attacked"]]
    assert [row["attacked"] for row in named] == [[1], [2], [3], [LIDAR]]
    # The means over half a second take a frame to follow from one attack to the next, and where one ends.
    assert sum(row["last_frame"] - row["first_frame"] + 1 for row in named) >= 4 * 2
