"""Bogus walls in the scans of synthetic streets: beams, gaps and road as a real LiDAR has them."""

import numpy as np
import pytest

from auditor.lab.attacks.paper import BogusWall, angular_steps, road_below_m
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.model.frames import PointCloud


@pytest.fixture(scope="module")
def drive() -> SyntheticDrive:
    return make_drive(3, 1, width_px=414, height_px=125)


def axes(drive: SyntheticDrive, xyz_m: np.ndarray) -> np.ndarray:
    """Right, down and forward of the LiDAR."""
    assert drive.rig.lidar is not None
    return xyz_m @ drive.rig.lidar.rig_SE3_lidar[:3, :3].T.astype(np.float32)


def test_the_road_is_found_below_the_lidar(drive: SyntheticDrive) -> None:
    assert road_below_m(axes(drive, drive.cloud(0).xyz_m)) == pytest.approx(1.65 + 0.076, abs=0.06)


def test_a_clouds_own_density_is_found(drive: SyntheticDrive) -> None:
    right, down = np.rad2deg(angular_steps(axes(drive, drive.cloud(0).xyz_m)))
    assert right == pytest.approx(0.17, rel=0.1)
    assert 0.33 < down < 0.6


def test_a_wall_keeps_the_beams_and_their_order_and_leaves_nothing_behind_it(drive: SyntheticDrive) -> None:
    cloud = drive.cloud(0)
    wall = BogusWall(range_m=7, lateral_m=0.5, bottom_m=0.2)
    before, after = axes(drive, cloud.xyz_m), axes(drive, wall.apply(cloud, drive.rig).xyz_m)
    kept, added = after[: len(before)], after[len(before) :]
    np.testing.assert_allclose(
        np.cross(before, kept) / (np.linalg.norm(before, axis=1) * np.linalg.norm(kept, axis=1))[:, None], 0, atol=1e-4
    )
    moved = np.any(kept != before, axis=1)
    assert moved.sum() > 1000
    assert len(added) < 0.1 * moved.sum()
    across, down = after[:, 0] / after[:, 2] * 7, after[:, 1] / after[:, 2] * 7
    lower = road_below_m(before) - 0.2
    outline = (after[:, 2] > 0) & (np.abs(across - 0.5) < 1.24) & (down < lower - 0.01) & (down > lower - 1.49)
    assert after[outline, 2].max() < 7.15
    assert (np.abs(kept[moved, 2] - 7) < 0.1).all()


def test_where_no_pulse_returned_the_wall_is_as_dense_as_the_cloud(drive: SyntheticDrive) -> None:
    cloud = drive.cloud(0)
    wall = BogusWall(range_m=7, lateral_m=0.0, bottom_m=0.2)
    points = axes(drive, cloud.xyz_m)
    whole = wall.apply(cloud, drive.rig)
    hollow = PointCloud(
        cloud.stamp_ns, cloud.xyz_m[~((np.abs(points[:, 0]) < points[:, 2] * 0.25) & (points[:, 2] > 7.2))]
    )
    filled = wall.apply(hollow, drive.rig)
    counts = [np.count_nonzero(np.abs(axes(drive, c.xyz_m)[:, 2] - 7) < 0.1) for c in (hollow, whole, filled)]
    assert counts[2] - counts[0] > 500
    assert counts[2] == pytest.approx(counts[1], rel=0.25)


def test_a_wall_is_the_same_for_the_same_seed_and_scan_only(drive: SyntheticDrive) -> None:
    cloud = drive.cloud(0)
    one, again, other = (BogusWall(8, 0, seed=seed).apply(cloud, drive.rig).xyz_m for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert not np.array_equal(one, other)
