"""Ways to hide on real frames: KITTI's drive 0009 as LiDAR + 3 or 4 cameras, a third as large."""

from pathlib import Path

import pytest

from auditor.cli import run
from auditor.cli.exit_codes import Exit
from tests.making.audits import Audit
from tests.making.logs_of_real_frames import CAMERAS, Drive, real_log
from tests.making.logs_of_strangers import NO_ATTACK, Attack, write

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
