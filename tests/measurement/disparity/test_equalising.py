import numpy as np
import pytest

from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher, equalised
from tests.making.scenes import plane_images, plane_rig, scene


def picture(seed=0, low=10, high=200, size=(100, 200)):
    return np.random.default_rng(seed).integers(low, high, size).astype(np.uint8)


@pytest.mark.parametrize(
    "response",
    [lambda x: 0.5 * x, lambda x: 1.2 * x + 10, lambda x: 255 * (x / 255) ** 0.6, lambda x: np.minimum(x, 150)],
    ids=["half the gain", "gain and offset", "gamma", "cut off"],
)
def test_a_gain_is_undone(response):
    like = picture()
    image = np.clip(np.rint(response(like.astype(float))), 0, 255).astype(np.uint8)
    moved = equalised(image, like)
    within = image < response(190.0)  # at the cut and beyond the last quantile nothing can be told
    assert np.abs(moved.astype(int) - like)[within].mean() < 2


def test_of_another_picture_of_the_same_levels_hardly_a_level_moves():
    image = picture(1)
    assert np.abs(equalised(image, picture(2)).astype(int) - image).max() <= 4
    assert np.abs(equalised(image, image).astype(int) - image).max() <= 1


@pytest.mark.parametrize("level", [0, 77, 255])
def test_an_image_of_one_level_is_not_changed(level):
    constant = np.full((20, 30), level, np.uint8)
    np.testing.assert_array_equal(equalised(constant, picture()), constant)


def test_an_image_like_one_of_one_level_has_that_level_between_its_quantiles():
    image = picture()
    moved = equalised(image, np.full((20, 30), 90, np.uint8))
    assert (moved[(image > 15) & (image < 195)] == 90).all()


def test_an_order_of_levels_is_never_turned_round():
    image, like = picture(3), picture(4, low=0, high=256) // 3
    moved = equalised(image, like)
    by_level = [moved[image == level] for level in np.unique(image)]
    assert all(one.min() == one.max() for one in by_level)
    assert (np.diff([int(one[0]) for one in by_level]) >= 0).all()


def test_black_stays_dark_and_white_bright():
    image = picture(low=0, high=256)
    image[0, 0], image[0, 1] = 0, 255
    moved = equalised(image, picture(5, low=60, high=120))
    assert moved[0, 0] < 10
    assert moved[0, 1] > 200


def test_images_may_have_different_sizes():
    assert equalised(picture(), picture(1, size=(33, 47))).shape == (100, 200)


@pytest.mark.parametrize("step", [2, 1])
@pytest.mark.parametrize("gain", [0.5, 1.6])
def test_a_matcher_gives_a_source_of_another_gain_nearly_the_same_disparities(step, gain):
    images = {number: image.pixels for number, image in scene().images.items()}
    matcher = SgbmMatcher(step)
    other = np.clip(images[1] * gain, 0, 255).astype(np.uint8)
    same, changed = (matcher.match(images[3], source)[:, 24 // step :] for source in (images[1], other))
    assert np.mean(np.abs(same - changed) < 1) > 0.97
    assert np.mean(np.abs(changed - 20) < 1) > 0.97


def test_noise_without_any_gain_is_matched_as_before():
    images = plane_images(plane_rig(), depth_m=9.0)
    assert np.mean(np.abs(SgbmMatcher().match(images[3], images[1])[:, 12:] - 20) < 1) > 0.98
