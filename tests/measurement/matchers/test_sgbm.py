import numpy as np
import pytest

from auditor.errors import SettingError
from auditor.measurement.disparity.matchers import find_matcher
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


def test_settings_differ_where_disparities_can() -> None:
    assert find_matcher("sgbm").settings != find_matcher("sgbm-full").settings


def test_an_unknown_matcher_is_refused_with_the_known_names() -> None:
    with pytest.raises(SettingError, match=r"no matcher is called 'psm'; use one of: sgbm, sgbm-full"):
        find_matcher("psm")
