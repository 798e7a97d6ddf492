import numpy as np

from auditor.measurement.checks.count_grid import cells_of_consistency, cells_of_points
from auditor.measurement.checks.lidar_conflict import VerifiedConflicts
from auditor.measurement.checks.photometric_consistency import PairConsistency


def test_points_are_counted_in_the_cell_they_lie_in():
    row, column = np.array([0, 7, 8, 20, 20]), np.array([0, 7, 7, 30, 31])
    valid = np.array([True, True, True, True, False])
    lidar_conflicts = np.array([False, True, False, True, False])
    cells = cells_of_points(VerifiedConflicts(row, column, valid, lidar_conflicts), height_px=21, width_px=33)
    assert cells.valid.shape == (3, 5)
    assert cells.valid.tolist() == [[2, 0, 0, 0, 0], [1, 0, 0, 0, 0], [0, 0, 0, 1, 0]]
    assert cells.inconsistent.tolist() == [[1, 0, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 1, 0]]


def test_half_resolution_pixels_are_counted_in_fours_and_the_ragged_edge_is_kept():
    rng = np.random.default_rng(0)
    comparable = rng.random((13, 22)) < 0.7
    inconsistent = comparable & (rng.random((13, 22)) < 0.3)
    cells = cells_of_consistency(PairConsistency(np.zeros((13, 22), np.float32), comparable, inconsistent))
    assert cells.valid.shape == (4, 6)
    for grid, mask in ((cells.valid, comparable), (cells.inconsistent, inconsistent)):
        by_hand = [[mask[4 * r : 4 * r + 4, 4 * c : 4 * c + 4].sum() for c in range(6)] for r in range(4)]
        assert grid.tolist() == by_hand
        assert grid.dtype == np.uint8


def test_pixels_of_what_is_too_near_are_left_out():
    comparable = np.ones((8, 8), dtype=bool)
    near = np.zeros((8, 8), dtype=bool)
    near[:, 4:] = True
    cells = cells_of_consistency(PairConsistency(np.zeros((8, 8), np.float32), comparable, comparable), near)
    assert cells.valid.tolist() == cells.inconsistent.tolist() == [[16, 0], [16, 0]]
