import cv2
import numpy as np
import pytest

from auditor.evidence.photometric import Light, coarse, coarse_mask, compare_light, reach
from auditor.evidence.visibility import Reach

HEIGHT, WIDTH, SHIFT = 188, 621, 20


@pytest.fixture
def pair():
    """Half-resolution pictures of a right and a left camera, 20 px apart."""
    rng = np.random.default_rng(3)
    wide = cv2.resize(rng.integers(20, 170, (6, 12)).astype(np.uint8), (WIDTH + SHIFT, HEIGHT))
    return wide[:, SHIFT : SHIFT + WIDTH].copy(), wide[:, :WIDTH].copy()


def facula(image, amplitude, radius=100, centre=(90, 300)):
    rho2 = (np.arange(HEIGHT)[:, None] - centre[0]) ** 2 + (np.arange(WIDTH) - centre[1]) ** 2
    light = amplitude * np.exp(-rho2 / (2 * (radius / 2) ** 2))
    return np.clip(image + light, 0, 255).astype(np.uint8)


def test_clean_pictures_show_no_light(pair):
    light = compare_light(*map(coarse, pair))
    assert (light.brighter_i, light.brighter_k) == (0.0, 0.0)


def test_a_camera_of_another_gain_and_offset_shows_no_light(pair):
    i, k = pair
    light = compare_light(coarse((i * 0.7 + 50).astype(np.uint8)), coarse(k))
    assert (light.brighter_i, light.brighter_k) == (0.0, 0.0)


def test_a_facula_names_the_brighter_camera(pair):
    i, k = pair
    assert compare_light(coarse(facula(i, 255)), coarse(k)).brighter_i > 0.9
    assert compare_light(coarse(facula(i, 255)), coarse(k)).brighter_k == 0.0
    assert compare_light(coarse(i), coarse(facula(k, 255))).brighter_k > 0.9


def test_darkness_in_one_camera_makes_the_other_the_brighter_one(pair):
    i, k = pair
    dark = facula(i, -255, radius=140)
    assert compare_light(coarse(dark), coarse(k)).brighter_k > 0.5
    assert compare_light(coarse(dark), coarse(k)).brighter_i == 0.0


def test_a_facula_over_half_the_image_does_not_spoil_the_fit_of_the_gain(pair):
    i, k = pair
    light = compare_light(coarse(facula(i, 2000, radius=150)), coarse(k))
    assert light.brighter_i == 1.0
    assert light.brighter_k == 0.0


def test_light_that_lies_elsewhere_in_the_other_picture_within_its_reach_is_the_scene_s(pair):
    i, k = pair
    both = compare_light(coarse(facula(i, 2000, radius=30)), coarse(facula(k, 2000, radius=30, centre=(90, 320))))
    assert both.brighter_i == 0.0


def bright(pair, level=150):
    """The pictures of a bright scene with dark things in it."""
    return tuple(np.where(image < 80, image, np.minimum(level + image // 2, 255)).astype(np.uint8) for image in pair)


def test_light_that_swallows_dark_things_in_a_bright_scene_names_its_camera(pair):
    i, k = bright(pair)
    assert compare_light(coarse(i), coarse(k)) == Light(0.0, 0.0)
    in_i = compare_light(coarse(facula(i, 2000, radius=50)), coarse(k))
    in_k = compare_light(coarse(i), coarse(facula(k, 2000, radius=50)))
    assert in_i.brighter_i > 0.3 > in_i.brighter_k
    assert in_k.brighter_k > 0.3 > in_k.brighter_i


def test_a_sky_that_one_camera_alone_saturates_swallows_nothing(pair):
    i, k = bright(pair, level=220)
    k = (k * 0.75).astype(np.uint8)
    assert compare_light(coarse(i), coarse(k)) == Light(0.0, 0.0)
    assert compare_light(coarse(k[:, ::-1]), coarse(i[:, ::-1])) == Light(0.0, 0.0)


def test_near_things_find_their_partners_farther_away(pair):
    i, k = pair
    near = np.zeros((HEIGHT, WIDTH), dtype=bool)
    near[20:160, 200:500] = True
    lamp_i, lamp_k = facula(i, 255, radius=40), facula(k, 255, radius=40, centre=(90, 300 + 80))
    assert compare_light(coarse(lamp_i), coarse(lamp_k)).brighter_i > 0.2
    assert compare_light(coarse(lamp_i), coarse(lamp_k), coarse_mask(near)).brighter_i == 0.0
    assert compare_light(coarse(facula(i, 255)), coarse(k), coarse_mask(near)).brighter_i > 0.5


def test_what_near_things_hide_is_not_missed(pair):
    i, k = bright(pair)
    trunk = i.copy()
    trunk[:, 300:360] = 20
    near = np.zeros((HEIGHT, WIDTH), dtype=bool)
    near[:, 260:480] = True
    assert compare_light(coarse(trunk), coarse(k)).brighter_k > 0.3
    assert compare_light(coarse(trunk), coarse(k), coarse_mask(near)).brighter_k == 0.0


def test_its_reach_is_five_of_78_columns():
    assert reach(780) == Reach(50, 150)
