import numpy as np
import pytest

from auditor.measurement.checks.collect import collect_checks
from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.disparity.stereo import stereo_map, textured
from auditor.model.checks import resolves_depth
from tests.making.scenes import plane_frame, plane_rig


def checks_of(rig, without=frozenset()):
    frame = plane_frame(rig, without=without)
    half_res = {n: halve(image.pixels) for n, image in frame.images.items()}
    texture = {n: textured(half) for n, half in half_res.items()}
    pairs = [(i, 3) for i in (1, 2) if i in half_res and 3 in half_res]
    maps = {
        (i, k): stereo_map(SgbmMatcher(), frame.images[k].pixels, frame.images[i].pixels, texture[k], texture[i])
        for i, k in pairs
    }
    views = {3: lidar_view(frame.cloud, rig, 3)} if frame.cloud is not None else {}
    return collect_checks(half_res, maps, views, rig)


def test_every_matched_pair_and_every_pair_s_brightness_is_checked():
    frame_checks = checks_of(plane_rig())
    assert set(frame_checks.lidar_conflicts) == set(frame_checks.photometric_inconsistencies) == {(1, 3), (2, 3)}
    assert set(frame_checks.brightness_differences) == {(1, 2), (1, 3), (2, 3)}
    assert frame_checks.point_dropout == {3: pytest.approx(0, abs=0.01)}
    assert all(cells.valid.shape == (15, 40) for cells in frame_checks.photometric_inconsistencies.values())
    # At the images' left and right edges some pixels have nothing to be matched by.
    for cells in (*frame_checks.lidar_conflicts.values(), *frame_checks.photometric_inconsistencies.values()):
        assert not cells.inconsistent[:, 4:-1].any()


def test_without_a_lidar_there_are_no_lidar_conflicts():
    frame_checks = checks_of(plane_rig(), without=frozenset({0}))
    assert not frame_checks.lidar_conflicts
    assert set(frame_checks.photometric_inconsistencies) == {(1, 3), (2, 3)}


def test_a_missing_camera_s_pairs_are_not_checked():
    frame_checks = checks_of(plane_rig(), without=frozenset({1}))
    assert (
        set(frame_checks.photometric_inconsistencies)
        == set(frame_checks.lidar_conflicts)
        == set(frame_checks.brightness_differences)
        == {(2, 3)}
    )


def test_a_pair_too_close_together_has_no_lidar_conflicts_but_photometric_inconsistencies():
    rig = plane_rig((0.6, 0.06, 0.0))
    assert resolves_depth(rig, 1, 3)
    assert not resolves_depth(rig, 2, 3)
    frame_checks = checks_of(rig)
    assert set(frame_checks.lidar_conflicts) == {(1, 3)}
    assert set(frame_checks.photometric_inconsistencies) == {(1, 3), (2, 3)}


def test_what_lies_behind_the_counts_is_there_to_be_drawn():
    frame_checks = checks_of(plane_rig())
    points, map_ = frame_checks.verified_conflicts[1, 3], frame_checks.consistencies[1, 3]
    assert points.valid.sum() == frame_checks.lidar_conflicts[1, 3].valid.sum()
    assert np.count_nonzero(map_.comparable) == frame_checks.photometric_inconsistencies[1, 3].valid.sum()
