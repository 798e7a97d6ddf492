import cv2
import numpy as np
import pytest

from auditor.measurement.checks.photometric_consistency import (
    Patches,
    matchable,
    matches_of,
    ncc_at,
    photometric_consistency,
)
from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.lidar import RangeMask
from auditor.measurement.disparity.stereo import StereoMap
from tests.making.scenes import HEIGHT, WIDTH, plane_images, plane_rig

PATCH_FLOOR = 9.0
FAINTEST = 6  # grey levels either way: a patch's norm is 42, and must be above 40
DEPTH_M = 9.0  # disparity 20 px between S_1 and S_3


def flat_map(disparity_px, step=2):
    shape = (HEIGHT // step, WIDTH // step)
    disparity = np.full(shape, disparity_px, dtype=np.float32)
    valid = np.arange(shape[1]) - disparity / step >= 0
    return StereoMap(disparity, valid, np.ones(shape, dtype=bool), step, 128)


def consistency(reference, source, stereo):
    return photometric_consistency(Patches.of(reference), source, stereo)


@pytest.fixture
def half_res():
    images = plane_images(plane_rig(), DEPTH_M)
    return halve(images[3]), halve(images[1])


def test_images_of_one_plane_are_consistent_at_its_disparity(half_res):
    pair = consistency(*half_res, flat_map(20))
    assert np.median(pair.ncc[:, 20:]) > 0.9
    assert pair.comparable[:, 22:].all()
    assert not pair.comparable[:, :22].any()  # ten without a match, and twelve beside them
    assert not pair.inconsistent.any()


def test_a_full_resolution_map_gives_the_same_ncc(half_res):
    coarse, fine = (
        consistency(*half_res, flat_map(20)),
        consistency(*half_res, flat_map(20, step=1)),
    )
    np.testing.assert_array_equal(coarse.ncc, fine.ncc)
    np.testing.assert_array_equal(coarse.comparable, fine.comparable)


def test_a_change_of_brightness_and_contrast_is_consistent(half_res):
    reference, source = half_res
    pair = consistency(reference, (source * 0.7 + 40).astype(np.uint8), flat_map(20))
    assert not pair.inconsistent.any()


def test_where_one_camera_sees_something_else_they_are_inconsistent_and_nowhere_else(half_res):
    reference, source = half_res
    source = source.copy()
    source[10:50, 60:110] = 255
    pair = consistency(reference, source, flat_map(20))
    assert pair.inconsistent[
        16:44, 78:112
    ].all()  # ten half-resolution pixels to the right of it, less the patch's radius
    assert not pair.inconsistent[:, 125:].any()


@pytest.mark.parametrize("brighter", [0, 1], ids=["the reference", "the source"])
@pytest.mark.parametrize("gain", [1.5, 2.0, 3.0])
def test_what_a_longer_exposure_saturates_is_not_inconsistent_and_light_is(half_res, gain, brighter):
    images = [cv2.normalize(one, None, 20, 245, cv2.NORM_MINMAX) for one in half_res]
    images[brighter] = np.clip(images[brighter] * gain, 0, 255).astype(np.uint8)
    pair = consistency(*images, flat_map(20))
    assert pair.inconsistent.mean() < 0.002
    images[brighter][15:45, 60:110] = 255
    assert consistency(*images, flat_map(20)).inconsistent[20:40, 82:104].mean() > 0.3


def striped(amplitude):
    """Upright stripes a pixel wide, so many grey levels above and below 128, and one white pixel."""
    image = np.tile(np.where(np.arange(160) % 2, 128 + amplitude, 128 - amplitude).astype(np.uint8), (60, 1))
    image[0, 0] = 255
    return image


@pytest.mark.parametrize(("amplitude", "comparable"), [(FAINTEST, True), (FAINTEST - 1, False)])
@pytest.mark.parametrize("textured", [0, 1], ids=["in the reference", "in the source"])
def test_what_has_texture_in_either_image_is_comparable(textured, amplitude, comparable):
    pair = [striped(0), striped(0)]
    pair[textured] = striped(amplitude)
    found = consistency(*pair, flat_map(0))
    assert found.comparable[5:-5, 5:-5].all() == comparable
    inside = slice(10, None)
    np.testing.assert_array_equal(found.inconsistent[inside, inside], found.comparable[inside, inside])


def test_where_neither_image_has_texture_nothing_is_comparable():
    grey = np.full((60, 160), 128, dtype=np.uint8)
    assert not consistency(grey, grey + np.uint8(90), flat_map(0)).comparable.any()


@pytest.mark.parametrize("gain", [0.4, 1.5])
def test_a_sky_that_saturates_is_not_inconsistent_beside_a_camera_of_another_gain(gain):
    scene = np.random.default_rng(1).uniform(20, 160, (60, 160))
    scene = np.repeat(np.repeat(scene[::6, ::6], 6, axis=0), 6, axis=1)[:60, :160]
    scene[:20] = 400
    source = np.clip(scene * gain, 0, 255).astype(np.uint8)
    assert not consistency(np.clip(scene, 0, 255).astype(np.uint8), source, flat_map(0)).inconsistent.any()


def test_what_a_nearer_surface_to_the_right_hides_is_not_comparable(half_res):
    stereo = flat_map(20)
    stereo.disparity_px[:, 90:120] = 80  # lands at columns 50 to 80: what lies there at a disparity of 20 is hidden
    comparable = consistency(*half_res, stereo).comparable
    assert not comparable[:, 62:90].any()
    assert comparable[:, 125:].all()


def test_stereo_s_mistake_in_a_pixel_beside_good_ones_is_consistent(half_res):
    stereo = flat_map(20)
    stereo.disparity_px[30, 80] = 90
    assert not consistency(*half_res, stereo).inconsistent.any()


def test_pixels_without_a_disparity_are_not_comparable(half_res):
    nothing = StereoMap(
        np.full((60, 160), np.nan, np.float32), np.zeros((60, 160), bool), np.ones((60, 160), bool), 2, 128
    )
    assert not consistency(*half_res, nothing).comparable.any()


def test_single_points_are_consistent_at_the_right_disparity_and_half_a_pixel_beside_it_only(half_res):
    row, column = np.array([30, 40, 0, 59]), np.array([80, 100, 60, 150])
    right = ncc_at(*half_res, row, column, np.full(4, 10, np.float32))
    assert right.min() > 0.8
    assert ncc_at(*half_res, row, column, np.full(4, 10.5, np.float32)).min() > 0.8
    assert ncc_at(*half_res, row, column, np.full(4, 13, np.float32)).max() < 0.6


def test_a_point_whose_match_lies_outside_the_image_is_compared_with_its_edge(half_res):
    row, column = np.array([30]), np.array([5])
    assert -1 <= ncc_at(*half_res, row, column, np.array([60], np.float32))[0] <= 1
    last = half_res[1].shape[1] - 1
    for at, beyond in ((0, 3.0), (0, 60.0), (last, -1.0), (last, -3.0)):
        edge, outside = (ncc_at(*half_res, row, np.array([at]), np.array([px], np.float32)) for px in (0.0, beyond))
        assert edge == outside


def test_no_points_have_no_ncc(half_res):
    nothing = np.zeros(0, dtype=np.int64)
    assert ncc_at(*half_res, nothing, nothing, np.zeros(0, np.float32)).shape == (0,)


def patches(image, border):
    """(h, w, 7, 7) patches around each pixel of an image that goes on beyond its border."""
    padded = np.pad(image.astype(np.float64), 3, mode=border)
    return np.lib.stride_tricks.sliding_window_view(padded, (7, 7))


def correlated(one, other):
    """Zero-mean correlations of patches (..., 7, 7), the floor added to their norms."""
    one, other = (patch - patch.mean(axis=(-2, -1), keepdims=True) for patch in (one, other))
    norms = [np.sqrt((patch**2).sum(axis=(-2, -1))) + PATCH_FLOOR for patch in (one, other)]
    return (one * other).sum(axis=(-2, -1)) / (norms[0] * norms[1])


@pytest.mark.parametrize("contrast", [1.0, 0.05])
def test_the_correlation_of_two_pictures_is_that_of_each_patch_by_itself(contrast):
    rng = np.random.default_rng(5)
    scene = cv2.GaussianBlur(rng.uniform(0, 255, (40, 90)), (3, 3), 0) * contrast + 20
    reference, source = (scene + rng.normal(0, 4 * contrast, scene.shape)).astype(np.uint8), scene.astype(np.uint8)
    disparity = np.float32(2 * rng.integers(0, 6, (40, 90)))
    stereo = StereoMap(disparity, np.ones((40, 90), bool), np.ones((40, 90), bool), 2, 128)
    column = np.clip(np.arange(90) - disparity.astype(int) // 2, 0, 89)
    warped = np.take_along_axis(source, column, axis=1)
    expected = correlated(patches(reference, "reflect"), patches(warped, "reflect"))
    np.testing.assert_allclose(consistency(reference, source, stereo).ncc, expected, atol=2e-4)


@pytest.mark.parametrize("contrast", [1.0, 0.05])
def test_the_correlation_of_a_point_is_the_best_of_three_half_a_pixel_apart(contrast):
    rng = np.random.default_rng(6)
    reference, source = ((rng.uniform(0, 255, (2, 30, 50))) * contrast).astype(np.uint8)
    row, column = rng.integers(0, 30, 200), rng.integers(0, 50, 200)
    disparity = np.float32(rng.choice([-1.0, 0.0, 0.2, 3.5, 7.8, 20.0, 60.0], 200))
    doubled = np.zeros((30, 100), np.int64)
    doubled[:, ::2], doubled[:, 1::2] = source, source
    doubled[:, 1:-1:2] = (source[:, :-1].astype(int) + source[:, 1:]) // 2
    padded = np.pad(doubled, ((3, 3), (30, 30)), mode="edge")
    expected = []
    for r, c, d in zip(row, column, disparity, strict=True):
        middle = int(np.clip(np.rint((c - d) * 2), 0, 98)) + 30
        one = patches(reference, "edge")[r, c]
        shifted = [padded[r : r + 7, middle + s - 6 : middle + s + 7 : 2].astype(float) for s in (-1, 0, 1)]
        expected.append(max(correlated(one, other) for other in shifted))
    np.testing.assert_allclose(ncc_at(reference, source, row, column, disparity), expected, atol=1e-3)


@pytest.mark.parametrize(("gap_px", "comparable"), [(4, True), (5, False)])
def test_what_lands_more_than_two_pixels_left_of_its_left_neighbours_hides_them(gap_px, comparable):
    # The surface to the right of column 80 lands `gap_px` / 2 half-resolution pixels further left than its neighbour.
    stereo = flat_map(20)
    stereo.disparity_px[:, 80:] = 20 + 2 + gap_px
    pair = consistency(*(striped(40),) * 2, stereo)
    assert pair.comparable[30, 79] == comparable


def test_invalid_pixels_and_twelve_on_each_side_of_them_are_not_comparable():
    stereo = flat_map(0)
    stereo.valid[30, 80] = False
    comparable = consistency(*(striped(40),) * 2, stereo).comparable
    expected = np.ones((60, 160), dtype=np.bool_)
    expected[30, 68:93] = False
    np.testing.assert_array_equal(comparable, expected)


def test_what_a_matcher_can_see_ends_at_nine_tenths_of_its_range():
    assert matchable(128) == RangeMask(0.9 * 128, 128)


def test_matches_are_where_stereo_s_disparities_lead_and_what_only_one_camera_sees_has_none():
    stereo = flat_map(20)
    stereo.disparity_px[30, 40] = np.nan
    stereo.valid[30, 40] = False
    found = matches_of(stereo)
    expected = np.broadcast_to(np.arange(160, dtype=np.float32) - 10, (60, 160)).copy()
    expected[30, 40] = -1
    np.testing.assert_array_equal(found.column, expected)
    assert not found.seen[:, :22].any()
    assert found.seen[:29, 22:].all()
    assert not found.seen[30, 28:53].any()
