"""Middlebury's cones, nine views on one line, as a rig of nine cameras without a LiDAR."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from auditor.cli import run
from auditor.measurement import measure
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.model.frames import CameraImage, Frame, Presence, SensorState
from auditor.model.rig import Camera, Rig
from auditor.recordings import write_mcap
from tests.making.audits import ask

VIEWS = 9
FOCAL_PX, STEP_M = 500.0, 0.04  # Middlebury gives neither; disparities do not depend on them
TRUTH_PER_PX = 4


@pytest.fixture(scope="module")
def cones(real_data: Path) -> tuple[Rig, Frame]:
    cameras, images = [], {}
    for number in range(1, VIEWS + 1):
        view = VIEWS - number  # im0 is the leftmost
        pixels = cv2.imread(str(real_data / "middlebury_multiview" / "cones" / f"im{view}.ppm"))
        height, width = pixels.shape[:2]
        P = np.array([[FOCAL_PX, 0, 225, -FOCAL_PX * STEP_M * view], [0, FOCAL_PX, 187, 0], [0, 0, 1, 0]])
        cameras.append(Camera(number, f"im{view}", f"/im{view}/image_rect", width, height, P))
        images[number] = CameraImage(number, 10**18, pixels)
    states = {number: Presence(SensorState.PRESENT) for number in images}
    return Rig(None, tuple(cameras)), Frame(0, 10**18, states, None, images)


def test_every_triple_of_nine_cameras_is_measured(cones: tuple[Rig, Frame]) -> None:
    rig, frame = cones
    measurement, _ = measure(frame, rig, SgbmMatcher())
    assert len(measurement.counts) == 84
    assert all(c is not None and c.gated_valid_px > 50_000 // 4 for c in measurement.counts)
    assert rig.max_attacked == 6


def test_disparities_of_the_pair_with_ground_truth_are_right(real_data: Path, cones: tuple[Rig, Frame]) -> None:
    rig, frame = cones
    left, right = VIEWS - 2, VIEWS - 6
    disparity_px = measure(frame, rig, SgbmMatcher())[1].maps[right, left].disparity_px
    truth = cv2.imread(str(real_data / "middlebury_multiview" / "cones" / "disp2.pgm"), cv2.IMREAD_GRAYSCALE)
    full = disparity_px.repeat(2, axis=0).repeat(2, axis=1)[: truth.shape[0], : truth.shape[1]]
    off_px = np.abs(full - truth / np.float32(TRUTH_PER_PX))[truth > 0]  # pixels that the right one cannot see included
    shares = [float(np.mean(off_px <= limit)) for limit in (1, 2, 3)]
    print(f"{off_px.size} pixels, within 1, 2 and 3 px: {shares}")
    assert shares[2] > 0.87
    assert shares[0] > 0.79


def test_nine_cameras_go_through_the_whole_chain(cones: tuple[Rig, Frame], tmp_path: Path) -> None:
    rig, frame = cones
    write_mcap(tmp_path / "cones.mcap", rig, [frame])
    store = str(tmp_path / "audit")
    assert run(["scan", str(tmp_path / "cones.mcap"), "--measure-only", "--store", store]) == 3
    sql = "SELECT count(*) AS errors, count(DISTINCT (i, j, k)) AS triples FROM errors WHERE E_gated IS NOT NULL"
    assert ask(tmp_path / "audit", sql) == [{"errors": 84, "triples": 84}]
