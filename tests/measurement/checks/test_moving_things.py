import numpy as np

from auditor.measurement.moving_things import FoundElsewhere, _alike_parts, _neighbours, moving

K = np.array([[700.0, 0, 310], [0, 700, 90], [0, 0, 1]])
MOVED_M = np.array([0.3, 0.0, 0.8])


def seen(point_m):
    return (point_m @ K.T)[:, :2] / point_m[:, 2:]


def back_of_a_car(depth_m=10.0):
    rng = np.random.default_rng(1)
    return np.column_stack([rng.uniform(-0.6, 0.6, 40), rng.uniform(-0.5, 0.5, 40), np.full(40, depth_m)])


def found(point_m, before_m):
    return FoundElsewhere(seen(point_m), point_m, seen(before_m), np.ones(len(point_m), dtype=np.intp))


def depths_at(before_m, nearest=np.inf):
    depth_m = np.full((90, 310), np.inf, dtype=np.float32)
    column, row = np.rint(seen(before_m).T / 2).astype(int)
    depth_m[row, column] = np.minimum(before_m[:, 2], nearest)
    return depth_m


def test_what_moved_as_the_lidar_saw_it_move_moves():
    car_m = back_of_a_car()
    before_m = car_m + MOVED_M
    assert moving(K, depths_at(before_m), found(car_m, before_m)).all()


def test_a_scene_behind_a_wall_does_not_move():
    wall_m = back_of_a_car()
    scene_m = wall_m * 3 + np.array([0.0, 0.0, 1.0])
    assert not moving(K, depths_at(wall_m), found(wall_m, scene_m)).any(), "the wall comes no nearer, the scene does"


def test_a_rear_window_moves_with_its_car_though_the_rows_met_the_boot_a_moment_ago():
    car_m, window_m = back_of_a_car(), back_of_a_car(11.5) - np.array([0.0, 1.0, 0.0])
    both_m = np.concatenate([car_m, window_m])
    before_m = both_m + MOVED_M
    depth_m = depths_at(before_m, nearest=10.8)
    assert not moving(K, depth_m, found(window_m, before_m[40:])).any(), "alone its depths do not fit"
    assert moving(K, depth_m, found(both_m, before_m)).all()


def test_neighbours_are_one_thing_where_their_depths_changed_alike():
    left = [(10.0, 10.0), (15.0, 12.0), (22.0, 14.0)]
    pixel = np.array([*left, *left, (200.0, 10.0)])
    deeper_m = np.array([0.0, 0.1, 0.0, 1.5, 1.4, 1.5, 0.0])
    things = [part.tolist() for group in _neighbours(pixel) for part in _alike_parts(group, deeper_m)]
    assert sorted(map(sorted, things)) == [[0, 1, 2], [3, 4, 5], [6]]


def test_where_nothing_is_found_nothing_moves():
    assert moving(K, depths_at(back_of_a_car()), found(np.zeros((0, 3)), np.zeros((0, 3)))).shape == (0,)
