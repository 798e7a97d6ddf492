"""Cameras that record a region of interest, or bin their pixels, are measured as those that record all (CameraInfo)."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.measurement import measure
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.model.frames import Frame
from auditor.recordings import find_rigs, open_recording, search_rigs, survey, synchronise
from auditor.recordings.decoding.interface import ImageRegion
from tests.making.sensor_forms import Sensor, write_sensors

REGION = ImageRegion(140, 60, 960, 300)
WHOLE_PX = (1242, 375)
BY = 2
FRAMES = 3


@cache
def drive() -> tuple[SyntheticDrive, tuple[Frame, ...]]:
    made = make_drive(1, FRAMES, n_cameras=2, vehicle=1)
    return made, tuple(made.frames())


def error(folder: Path, sensor: Sensor) -> float:
    """E of the drive's only triple over all its frames."""
    made, frames = drive()
    path = write_sensors(folder / "a.mcap", made.rig, frames, sensor)
    with open_recording(path) as recording:
        surveyed = survey(recording)
        [rig] = find_rigs(surveyed)
        whole = [item for item in synchronise(recording, rig, surveyed) if isinstance(item, Frame)]
        counts = [measure(frame, rig, SgbmMatcher())[0].counts[0] for frame in whole]
    assert len(counts) == FRAMES
    inconsistent, valid = np.sum([(one.inconsistent_px, one.valid_px) for one in counts if one is not None], axis=0)
    assert valid > 500
    return float(inconsistent / valid)


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory) -> float:
    return error(tmp_path_factory.mktemp("whole"), Sensor())


@pytest.mark.parametrize(
    "sensor",
    [
        Sensor(REGION),
        Sensor(binning=(BY, BY)),
        Sensor(REGION, (BY, BY)),
        Sensor(REGION, info_px=(960, 300), written_for=REGION),
        Sensor(REGION, info_px=(0, 0)),
        Sensor(ImageRegion(0, 0, *WHOLE_PX)),
    ],
    ids=["region", "binned", "both", "written for the region", "no size", "all as a region"],
)
def test_a_region_and_a_binning_leave_the_disparity_error_alone(tmp_path: Path, sensor: Sensor, usual: float) -> None:
    found = error(tmp_path, sensor)
    print(f"E = {found:.3f}, of the whole sensor {usual:.3f}")
    # Of binned pictures E is lower: its 3 px are twice as far. With the region or the binning ignored it is over 0.8.
    assert abs(found - usual) < 0.06


def test_k_and_p_move_by_the_region_and_are_divided_by_the_binning(tmp_path: Path) -> None:
    made, frames = drive()
    path = write_sensors(tmp_path / "a.mcap", made.rig, frames[:1], Sensor(REGION, (BY, 0)))
    with open_recording(path) as recording:
        [rig] = find_rigs(survey(recording))
    for camera, whole in zip(rig.cameras, made.rig.cameras, strict=True):
        expected = np.array(whole.intrinsics)
        expected[0, 2] -= REGION.left_px
        expected[1, 2] -= REGION.top_px
        expected[0] /= BY
        np.testing.assert_allclose(camera.intrinsics, expected)
        np.testing.assert_allclose(camera.centre_m, whole.centre_m, atol=1e-9)
        assert (camera.width_px, camera.height_px) == (480, 300)


@pytest.mark.parametrize("info_px", [(1242, 375), (480, 300)])
def test_a_camera_whose_pictures_are_neither_is_left_out_with_the_reason(
    tmp_path: Path, info_px: tuple[int, int]
) -> None:
    made, frames = drive()
    wrong = Sensor(ImageRegion(140, 60, 500, 300), info_px=info_px)
    path = write_sensors(tmp_path / "a.mcap", made.rig, frames[:1], _Recording(wrong, REGION))
    with open_recording(path) as recording:
        found = search_rigs(survey(recording))
    assert [one.cameras for one in found.rigs] == [()], "the LiDAR is a rig alone"
    assert any("its pictures have 960 x 300 px" in reason for reason in found.reasons)


class _Recording(Sensor):
    """A sensor whose pictures show another region than its camera info says."""

    def __init__(self, said: Sensor, shown: ImageRegion) -> None:
        super().__init__(said.region, said.binning, said.info_px)
        object.__setattr__(self, "shown", Sensor(shown))

    def picture(self, pixels: np.ndarray) -> np.ndarray:
        return self.shown.picture(pixels)  # type: ignore[attr-defined]
