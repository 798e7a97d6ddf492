import numpy as np
import pytest

from auditor.evidence.likeness import likeness, likeness_at
from auditor.evidence.reduction import halve
from auditor.evidence.stereo import StereoMap
from tests.evidence.scenes import HEIGHT, WIDTH, plane_images, plane_rig

DEPTH_M = 9.0  # disparity 20 px between S_1 and S_3


def flat_map(disparity_px, step=2):
    shape = (HEIGHT // step, WIDTH // step)
    disparity = np.full(shape, disparity_px, dtype=np.float32)
    valid = np.arange(shape[1]) - disparity / step >= 0
    return StereoMap(disparity, valid, np.ones(shape, dtype=bool), step, 128)


@pytest.fixture
def halves():
    images = plane_images(plane_rig(), DEPTH_M)
    return halve(images[3]), halve(images[1])


def test_pictures_of_one_plane_are_alike_at_its_disparity(halves):
    pair = likeness(*halves, flat_map(20))
    assert np.median(pair.alike[:, 20:]) > 0.9
    assert pair.comparable[:, 22:].all()
    assert not pair.comparable[:, :22].any()  # ten without a match, and twelve beside them
    assert not pair.unlike.any()


def test_a_full_resolution_map_gives_the_same_likeness(halves):
    coarse, fine = likeness(*halves, flat_map(20)), likeness(*halves, flat_map(20, step=1))
    np.testing.assert_array_equal(coarse.alike, fine.alike)
    np.testing.assert_array_equal(coarse.comparable, fine.comparable)


def test_a_change_of_brightness_and_contrast_is_not_unlike(halves):
    reference, witness = halves
    pair = likeness(reference, (witness * 0.7 + 40).astype(np.uint8), flat_map(20))
    assert not pair.unlike.any()


def test_where_one_camera_sees_something_else_they_are_unlike_and_nowhere_else(halves):
    reference, witness = halves
    witness = witness.copy()
    witness[10:50, 60:110] = 255
    pair = likeness(reference, witness, flat_map(20))
    assert pair.unlike[16:44, 78:112].all()  # ten half-resolution pixels to the right of it, less the patch's reach
    assert not pair.unlike[:, 125:].any()


@pytest.mark.parametrize(("level", "comparable"), [(128, True), (255, False)])
def test_without_texture_light_is_compared_unless_it_saturates(level, comparable):
    grey = np.full((60, 160), level, dtype=np.uint8)
    pair = likeness(grey, grey, flat_map(20))
    assert pair.comparable[:, 22:].all() == comparable
    assert not pair.unlike.any()


@pytest.mark.parametrize("added", [60, -60])
@pytest.mark.parametrize("brighter", [0, 1])
def test_light_or_darkness_that_only_one_camera_sees_is_unlike_where_there_is_no_texture(brighter, added):
    shade = np.tile(np.linspace(80, 160, 60, dtype=np.float32)[:, None], (1, 160)).astype(np.uint8)
    pair = [shade, shade.copy()]
    pair[brighter][20:45, 60:110] += np.uint8(added % 256)
    found = likeness(*pair, flat_map(0)).unlike
    assert found[26:39, 66:104].all()
    assert not found[:, 120:].any()


@pytest.mark.parametrize("gain", [0.8, 1.2])
def test_a_sky_that_saturates_in_one_camera_is_not_unlike_where_the_other_s_lens_darkens_it(gain):
    scene = np.random.default_rng(1).uniform(20, 180, (60, 160))
    scene = np.repeat(np.repeat(scene[::6, ::6], 6, axis=0), 6, axis=1)[:60, :160]
    scene[:20] = 400
    fade = np.linspace(1, 0.6, 160)  # to 240 at the right edge of the reference
    reference = np.clip(scene * np.where(scene > 255, fade, 1), 0, 255).astype(np.uint8)
    witness = np.clip(scene / gain, 0, 255).astype(np.uint8)
    assert not likeness(reference, witness, flat_map(0)).unlike[:16].any()


def test_what_a_nearer_surface_to_the_right_hides_is_not_comparable(halves):
    stereo = flat_map(20)
    stereo.disparity_px[:, 90:120] = 80  # lands at columns 50 to 80: what lies there at a disparity of 20 is hidden
    comparable = likeness(*halves, stereo).comparable
    assert not comparable[:, 62:90].any()
    assert comparable[:, 125:].all()


def test_stereo_s_mistake_in_a_pixel_beside_good_ones_is_not_unlike(halves):
    stereo = flat_map(20)
    stereo.disparity_px[30, 80] = 90
    assert not likeness(*halves, stereo).unlike.any()


def test_pixels_without_a_disparity_are_not_comparable(halves):
    nothing = StereoMap(
        np.full((60, 160), np.nan, np.float32), np.zeros((60, 160), bool), np.ones((60, 160), bool), 2, 128
    )
    assert not likeness(*halves, nothing).comparable.any()


def test_single_points_are_alike_at_the_right_disparity_and_half_a_pixel_beside_it_only(halves):
    row, column = np.array([30, 40, 0, 59]), np.array([80, 100, 60, 150])
    right = likeness_at(*halves, row, column, np.full(4, 10, np.float32))
    assert right.min() > 0.8
    assert likeness_at(*halves, row, column, np.full(4, 10.5, np.float32)).min() > 0.8
    assert likeness_at(*halves, row, column, np.full(4, 13, np.float32)).max() < 0.6


def test_a_point_whose_match_lies_outside_the_image_is_compared_with_its_edge(halves):
    row, column = np.array([30]), np.array([5])
    assert -1 <= likeness_at(*halves, row, column, np.array([60], np.float32))[0] <= 1


def test_no_points_have_no_likeness(halves):
    nothing = np.zeros(0, dtype=np.int64)
    assert likeness_at(*halves, nothing, nothing, np.zeros(0, np.float32)).shape == (0,)
