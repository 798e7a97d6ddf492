import numpy as np
import pytest

from auditor.errors import SettingError
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.disparity.matchers.interface import for_pair
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from tests.making.scenes import HEIGHT, WIDTH, plane_images, plane_rig


@pytest.mark.parametrize("step", [2, 1])
def test_a_plane_is_matched_everywhere_the_source_sees_it(step: int) -> None:
    images = plane_images(plane_rig(), depth_m=9.0)  # 20 px at 0.6 m
    disparity = SgbmMatcher(step).match(images[3], images[1])
    assert disparity.shape == (HEIGHT // step, WIDTH // step)
    seen = disparity[:, 24 // step :]
    assert np.mean(np.abs(seen - 20.0) < 1.0) > 0.98


def test_the_leftmost_columns_have_disparities_although_the_search_range_reaches_past_them() -> None:
    images = plane_images(plane_rig(), depth_m=90.0)  # 2 px at 0.6 m, 128 px are searched
    disparity = SgbmMatcher().match(images[3], images[1])
    assert np.mean(np.abs(disparity[:, 4:60] - 2.0) < 1.0) > 0.95


def test_no_pixel_is_left_out_where_the_images_do_not_match_at_all() -> None:
    rng = np.random.default_rng(1)
    left, right = (rng.integers(0, 256, (HEIGHT, WIDTH)).astype(np.uint8) for _ in range(2))
    assert not np.isnan(SgbmMatcher().match(left, right)).any()


def test_odd_sizes_keep_their_last_row_and_column() -> None:
    image = np.random.default_rng(0).integers(0, 256, (75, 301)).astype(np.uint8)
    assert SgbmMatcher().match(image, image).shape == (38, 151)


def test_near_cameras_are_searched_only_as_far_as_what_is_two_metres_away():
    # f b of KITTI's cameras 0.07, 0.13 and 0.54 m apart, and of two that are nearly one.
    ranges = [SgbmMatcher().reaching(disparity_1m_px).range_px for disparity_1m_px in (48.0, 94.0, 390.0, 1.0)]
    assert ranges == [32, 64, 128, 32]
    assert SgbmMatcher(1).reaching(30.0).range_px == 16


def test_near_cameras_have_the_disparities_that_the_whole_range_gives():
    images = plane_images(plane_rig(), depth_m=9.0)
    whole, near = (matcher.match(images[3], images[2]) for matcher in (SgbmMatcher(), SgbmMatcher().reaching(60.0)))
    assert np.mean(np.abs(whole[:, 12:] - near[:, 12:]) < 0.5) > 0.98
    assert np.median(near) == np.median(whole) == pytest.approx(10, abs=0.25)


def test_the_pair_of_a_rig_is_matched_by_its_own_distance():
    class Networks:
        range_px = 192

    rig, network = plane_rig(), Networks()
    wide, narrow = (for_pair(SgbmMatcher(), rig, *pair) for pair in ((1, 3), (1, 2)))
    assert wide.range_px == SgbmMatcher().reaching(rig.camera(3).focal_px * rig.baseline_m(1, 3)).range_px
    assert narrow.range_px <= wide.range_px
    assert for_pair(network, rig, 1, 2) is network


def test_settings_differ_where_disparities_can() -> None:
    assert find_matcher("sgbm").settings != find_matcher("sgbm-full").settings


def test_a_matcher_has_the_name_that_finds_it() -> None:
    for name, step in (("sgbm", 2), ("sgbm-full", 1)):
        found = find_matcher(name)
        assert isinstance(found, SgbmMatcher)
        assert (found.name, found.step) == (name, step)


def test_an_unknown_matcher_is_refused_with_the_known_names() -> None:
    with pytest.raises(SettingError, match=r"no matcher is called 'psm'; use one of: sgbm, sgbm-full"):
        find_matcher("psm")
