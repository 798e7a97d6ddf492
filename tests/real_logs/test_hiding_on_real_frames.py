"""Ways to hide on real frames: KITTI's drive 0009 as LiDAR + 3 or 4 cameras, a third as large."""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from auditor.cli import run
from auditor.cli.exit_codes import Exit
from tests.making.audits import Audit
from tests.making.logs_of_strangers import NO_ATTACK, Attack, Log, record, write
from tests.making.vehicles_of_strangers import LIDAR_FRAME, Seen

CAMERAS = {"gray_right": 1, "color_right": 3, "gray_left": 0, "color_left": 2}
"""From right to left."""
SMALLER = 3
_LIDAR = "velodyne_points"


@dataclass(frozen=True)
class Drive:
    """Some cameras of the drive, and its LiDAR; a vehicle as `record` takes it."""

    data: Path
    cameras: tuple[str, ...] = tuple(CAMERAS)
    size_px: tuple[int, int] = (1242 // SMALLER, 375 // SMALLER)
    form: str = "png"
    lidar_topic: str = "/velo/points"
    parent: str = "camera_rectified"

    def topic(self, camera: str) -> str:
        return f"/{camera}/image_rect/compressed"

    def info(self, camera: str) -> str:
        return f"/{camera}/camera_info"

    def projection(self, camera: str) -> NDArray[np.float64]:
        """P, (3, 4), of the smaller images: the centre of their first pixel is that of nine."""
        centre = (1 / SMALLER - 1) / 2
        scale = np.array([[1 / SMALLER, 0, centre], [0, 1 / SMALLER, centre], [0, 0, 1]])
        return scale @ self._calibration[f"P_rect_0{CAMERAS[camera]}"].reshape(3, 4)

    def mounts(self) -> dict[str, NDArray[np.float64]]:
        """By frame where it sits in that of the first grey camera, (4, 4)."""
        rectified, lidar = np.eye(4), np.eye(4)
        rectified[:3, :3] = self._calibration["R_rect_00"].reshape(3, 3)
        lidar[:3, :3], lidar[:3, 3] = self._mounted["R"].reshape(3, 3), self._mounted["T"]
        found = {LIDAR_FRAME: rectified @ lidar}
        for camera in self.cameras:
            place = np.eye(4)
            P = self.projection(camera)
            place[:3, 3] = -np.linalg.solve(P[:, :3], P[:, 3])
            found[f"{camera}_optical"] = place
        return found

    def stamp_ns(self, sensor: str, moment: int) -> int:
        folder = f"image_0{CAMERAS[sensor]}" if sensor in CAMERAS else _LIDAR
        line = (self._frames / folder / "timestamps.txt").read_text().splitlines()[moment]
        return int(np.datetime64(line.replace(" ", "T"), "ns").astype(np.int64))

    def see(self, moment: int) -> Seen:
        images = {}
        for camera in self.cameras:
            path = self._frames / f"image_0{CAMERAS[camera]}" / "data" / f"{moment:010d}.png"
            whole = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE if "gray" in camera else cv2.IMREAD_COLOR)
            images[camera] = cv2.resize(whole, self.size_px, interpolation=cv2.INTER_AREA)
        scan = np.fromfile(self._frames / _LIDAR / "data" / f"{moment:010d}.bin", np.float32).reshape(-1, 4)
        return Seen(images, scan[:, :3])

    @property
    def _day(self) -> Path:
        return self.data / "kitti_raw_2011_09_26_drive_0009" / "2011_09_26"

    @property
    def _frames(self) -> Path:
        return self._day / "2011_09_26_drive_0009_sync"

    @cached_property
    def _calibration(self) -> dict[str, NDArray[np.float64]]:
        return _rows(self._day / "calib_cam_to_cam.txt")

    @cached_property
    def _mounted(self) -> dict[str, NDArray[np.float64]]:
        return _rows(self._day / "calib_velo_to_cam.txt")


def real_log(drive: Drive, moments: range, attack: Attack = NO_ATTACK, without: Collection[str] = ()) -> Log:
    """A log of some frames of the drive; the messages of some topics are missing where it is attacked."""
    log = record(drive, moments, attack=attack, scene=drive.see, clock=drive.stamp_ns)
    return [sent for sent in log if sent.topic not in without or sent.moment not in attack.moments]


def _rows(path: Path) -> dict[str, NDArray[np.float64]]:
    rows = (line.partition(":") for line in path.read_text().splitlines())
    numbers = {key: values.split() for key, _, values in rows}
    return {key: np.array(values, np.float64) for key, values in numbers.items() if key.split("_")[0] in "PRT"}


SCANNED, HIT = range(20, 27), range(23, 27)
THREE = ("gray_right", "color_right", "color_left")
REFERENCE = "color_left"
WALL = Attack(wall=True, moments=HIT, ahead_m=8.0)
NOT_SILENCED = {Exit.FINDINGS, Exit.INCOMPLETE, Exit.FINDINGS_INCOMPLETE}
SPOT = Attack(("gray_right",), moments=HIT)


@pytest.fixture(scope="module")
def calibrated(real_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store with calibrations of the rig of four cameras and of that of three."""
    folder = tmp_path_factory.mktemp("real")
    for drive, moments in ((Drive(real_data), range(8)), (Drive(real_data, THREE), range(8, 16))):
        clean = write(folder / f"{len(drive.cameras)}.mcap", real_log(drive, moments))
        assert run(["calibrate", str(clean), "--store", str(folder / "audit")]) == Exit.CLEAN
    return folder / "audit"


@pytest.mark.parametrize(
    ("cameras", "attack"),
    [(tuple(CAMERAS), NO_ATTACK), (tuple(CAMERAS), SPOT), (THREE, NO_ATTACK), (THREE, WALL)],
    ids=["clean 4", "spot 4", "clean 3", "wall 3"],
)
def test_what_hides_nothing_is_clean_or_found(cameras, attack: Attack, audit: Audit, real_data: Path, tmp_path: Path):
    drive = Drive(real_data, cameras)
    answer = audit.scan(write(tmp_path / "log.mcap", real_log(drive, SCANNED, attack)))
    assert answer.code == (Exit.FINDINGS if attack.moments else Exit.CLEAN), answer


def test_a_wall_is_not_hidden_by_removing_the_reference_camera(audit: Audit, real_data: Path, tmp_path: Path):
    drive = Drive(real_data, THREE)
    log = real_log(drive, SCANNED, WALL, without={drive.topic(REFERENCE)})
    answer = audit.scan(write(tmp_path / "log.mcap", log))
    assert answer.code in NOT_SILENCED, "the two cameras that are left stand too close to check the LiDAR"


def test_a_spot_is_not_hidden_by_one_repeated_stamp(audit: Audit, real_data: Path, tmp_path: Path):
    log = real_log(Drive(real_data), SCANNED, SPOT)
    last = {sent.topic: sent.stamp_ns for sent in log if sent.moment < HIT.start}
    hidden = [sent.restamped(last[sent.topic]) if sent.moment in HIT else sent for sent in log]
    answer = audit.scan(write(tmp_path / "log.mcap", hidden))
    assert answer.code in NOT_SILENCED, answer
