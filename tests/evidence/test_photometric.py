import cv2
import numpy as np
import pytest

from auditor.evidence.photometric import coarse, coarse_mask, compare_light

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


def test_what_is_too_near_is_not_looked_at(pair):
    i, k = pair
    near = np.zeros((HEIGHT, WIDTH), dtype=bool)
    near[20:160, 200:420] = True
    assert compare_light(coarse(facula(i, 255)), coarse(k), coarse_mask(near)).brighter_i == 0.0
