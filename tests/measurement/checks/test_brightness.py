import cv2
import numpy as np
import pytest

from auditor.measurement.checks.brightness import (
    BrightnessDifference,
    coarse,
    coarse_mask,
    compare_brightness,
    fit_gain,
    range_mask,
)
from auditor.measurement.disparity.lidar import RangeMask
from auditor.measurement.disparity.stereo import textured

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
    difference = compare_brightness(*map(coarse, pair))
    assert (difference.brighter_i, difference.brighter_k) == (0.0, 0.0)


def test_a_camera_of_another_gain_and_offset_shows_no_light(pair):
    i, k = pair
    difference = compare_brightness(coarse((i * 0.7 + 50).astype(np.uint8)), coarse(k))
    assert (difference.brighter_i, difference.brighter_k) == (0.0, 0.0)


def test_a_facula_names_the_brighter_camera(pair):
    i, k = pair
    assert compare_brightness(coarse(facula(i, 255)), coarse(k)).brighter_i > 0.9
    assert compare_brightness(coarse(facula(i, 255)), coarse(k)).brighter_k == 0.0
    assert compare_brightness(coarse(i), coarse(facula(k, 255))).brighter_k > 0.9


def test_darkness_in_one_camera_makes_the_other_the_brighter_one(pair):
    i, k = pair
    dark = facula(i, -255, radius=140)
    assert compare_brightness(coarse(dark), coarse(k)).brighter_k > 0.5
    assert compare_brightness(coarse(dark), coarse(k)).brighter_i == 0.0


def test_a_facula_over_half_the_image_does_not_spoil_the_fit_of_the_gain(pair):
    i, k = pair
    difference = compare_brightness(coarse(facula(i, 2000, radius=150)), coarse(k))
    assert difference.brighter_i == 1.0
    assert difference.brighter_k == 0.0


def test_light_that_lies_elsewhere_in_the_other_image_within_the_search_is_the_scene_s(pair):
    i, k = pair
    both = compare_brightness(coarse(facula(i, 2000, radius=30)), coarse(facula(k, 2000, radius=30, centre=(90, 320))))
    assert both.brighter_i == 0.0


def bright(pair, level=150):
    """The pictures of a bright scene with dark things in it."""
    return tuple(np.where(image < 80, image, np.minimum(level + image // 2, 255)).astype(np.uint8) for image in pair)


def test_light_that_swallows_dark_things_in_a_bright_scene_names_its_camera(pair):
    i, k = bright(pair)
    assert compare_brightness(coarse(i), coarse(k)) == BrightnessDifference(0.0, 0.0)
    in_i = compare_brightness(coarse(facula(i, 2000, radius=50)), coarse(k))
    in_k = compare_brightness(coarse(i), coarse(facula(k, 2000, radius=50)))
    assert in_i.brighter_i > 0.3 > in_i.brighter_k
    assert in_k.brighter_k > 0.3 > in_k.brighter_i


def test_a_sky_that_one_camera_alone_saturates_swallows_nothing(pair):
    i, k = bright(pair, level=220)
    k = (k * 0.75).astype(np.uint8)
    assert compare_brightness(coarse(i), coarse(k)) == BrightnessDifference(0.0, 0.0)
    assert compare_brightness(coarse(k[:, ::-1]), coarse(i[:, ::-1])) == BrightnessDifference(0.0, 0.0)


def test_near_things_find_their_partners_farther_away(pair):
    i, k = pair
    near = np.zeros((HEIGHT, WIDTH), dtype=bool)
    near[20:160, 200:500] = True
    lamp_i, lamp_k = facula(i, 255, radius=40), facula(k, 255, radius=40, centre=(90, 300 + 80))
    assert compare_brightness(coarse(lamp_i), coarse(lamp_k)).brighter_i > 0.2
    assert compare_brightness(coarse(lamp_i), coarse(lamp_k), coarse_mask(near)).brighter_i == 0.0
    assert compare_brightness(coarse(facula(i, 255)), coarse(k), coarse_mask(near)).brighter_i > 0.5


def test_what_near_things_hide_is_not_missed(pair):
    i, k = bright(pair)
    trunk = i.copy()
    trunk[:, 300:360] = 20
    near = np.zeros((HEIGHT, WIDTH), dtype=bool)
    near[:, 260:480] = True
    assert compare_brightness(coarse(trunk), coarse(k)).brighter_k > 0.3
    assert compare_brightness(coarse(trunk), coarse(k), coarse_mask(near)).brighter_k == 0.0


def test_a_cell_is_near_where_any_pixel_of_it_is():
    half = np.zeros((48, 156), dtype=np.bool_)  # two by two pixels a cell
    half[2, 5] = half[47, 155] = True
    assert np.argwhere(coarse_mask(half)).tolist() == [[1, 2], [23, 77]]


def test_the_search_is_five_of_78_columns():
    assert range_mask(780) == RangeMask(50, 150)


def by_hand(grid_i, grid_k, near):
    """Cell by cell: what lies in column u of k lies 0 to 5 columns farther left in i, what is near up to 15."""
    gain, offset = fit_gain(grid_k[:, 2:], grid_i[:, :-2])
    least = np.minimum(gain * grid_i + offset, 255)
    most = np.where(grid_i < 250, least, 255)
    brighter_i, brighter_k, darker_i, darker_k = np.zeros((4, 24, 78), dtype=np.bool_)
    for r, c in np.ndindex(24, 78):
        rows = slice(max(r - 1, 0), r + 2)
        for columns, may_hide in ((16, True), (6, False)):
            in_k, in_i = np.s_[rows, c : c + columns], np.s_[rows, max(c - columns + 1, 0) : c + 1]
            if may_hide or not near[r, c]:
                brighter_i[r, c] |= least[r, c] - grid_k[in_k].max() > 75
                brighter_k[r, c] |= grid_k[r, c] - most[in_i].max() > 75
        if not near[r, c]:
            darker_i[r, c] = grid_k[rows, c : c + 6].min() - most[r, c] > 40
            darker_k[r, c] = least[rows, max(c - 5, 0) : c + 1].min() - grid_k[r, c] > 40
    for of_i in (brighter_i, darker_i):
        of_i[:, 73:] = False
    for of_k in (brighter_k, darker_k):
        of_k[:, :5] = False
    brighter_i[:, :-2] |= darker_k[:, 2:]
    brighter_k[:, 2:] |= darker_i[:, :-2]
    return tuple(
        max(np.pad(cells, 5)[r : r + 6, c : c + 6].mean() for r, c in np.ndindex(29, 83))
        for cells in (brighter_i, brighter_k)
    )


@pytest.mark.parametrize("seed", range(5))
def test_the_difference_is_what_comparing_cell_by_cell_finds(seed):
    rng = np.random.default_rng(seed)
    scene = rng.uniform(60, 160, (24, 90))
    grid_i, grid_k = (np.float32(scene[:, 2:80] * 0.9 + 12), np.float32(scene[:, :78]))
    for grid in (grid_i, grid_k):
        for _ in range(3):
            at = np.s_[rng.integers(0, 24) :, rng.integers(0, 78) :][:2]
            spot = grid[at][: rng.integers(1, 9), : rng.integers(4, 30)]
            spot += np.float32(rng.choice([-100, -60, 60, 90, 200]))
        np.clip(grid, 0, 255, out=grid)
    near = rng.random((24, 78)) < (0.3 if seed else 0)
    found = compare_brightness(grid_i, grid_k, near if seed else None)
    assert (found.brighter_i, found.brighter_k) == pytest.approx(by_hand(grid_i, grid_k, near), abs=1e-6)


def street():
    """Cells of two levels, the same in both cameras: gain and offset are exactly one and nothing."""
    grid = np.full((24, 78), 100, dtype=np.float32)
    grid[:, :15] = grid[:, 60:] = 140
    return grid, grid.copy()


@pytest.mark.parametrize(("level", "share"), [(175, 0.0), (176, 30 / 36)])
def test_light_is_more_than_seventy_five_grey_levels(level, share):
    grid, lit = street()
    lit[9:15, 30:35] = level
    for found in (compare_brightness(lit, grid), compare_brightness(grid, lit)):
        assert max(found.brighter_i, found.brighter_k) == pytest.approx(share)
        assert min(found.brighter_i, found.brighter_k) == 0


@pytest.mark.parametrize(("level", "share"), [(60, 0.0), (59, 1.0)])
def test_darkness_is_more_than_forty_grey_levels(level, share):
    grid, dark = street()
    dark[9:15, 30:36] = level
    assert compare_brightness(dark, grid) == BrightnessDifference(0.0, share)
    assert compare_brightness(grid, dark) == BrightnessDifference(share, 0.0)


def line(count=400, every=0):
    """Values of one camera and of another of gain 1.5 and offset 10; every so many-th differs."""
    source = np.linspace(5, 140, count, dtype=np.float32)
    target = source * np.float32(1.5) + 10
    if every:
        target[::every] += 25
    return target, source


def test_gain_and_offset_are_those_of_the_six_tenths_that_fit_best():
    assert fit_gain(*line()) == pytest.approx((1.5, 10.0), abs=1e-3)
    assert fit_gain(*line(every=3)) == pytest.approx((1.5, 10.0), abs=1e-3)
    assert fit_gain(*line(every=2)) != pytest.approx((1.5, 10.0), abs=0.5)


def test_a_gain_is_never_taken_to_be_more_than_two_or_less_than_a_half():
    source = np.linspace(10, 60, 300, dtype=np.float32)
    assert fit_gain(source * 4, source)[0] == 2.0
    assert fit_gain(source / 4, source)[0] == 0.5


def test_fewer_than_a_hundred_values_that_are_not_saturated_make_no_gain():
    target, source = line(100)
    assert fit_gain(target, source)[0] == pytest.approx(1.5, abs=1e-3)
    assert fit_gain(target[1:], source[1:]) == (1.0, 0.0)
    target[50] = 250
    assert fit_gain(target, source) == (1.0, 0.0)


@pytest.mark.parametrize(("slope", "enough"), [(2.0, False), (2.1, True)])
def test_texture_is_more_than_two_grey_levels_a_pixel(slope, enough):
    ramp = np.tile(np.floor(np.arange(100) * slope).astype(np.uint8), (20, 1))
    if not enough:
        assert not textured(ramp)[:, 5:-5].any()  # exactly two
    else:
        assert textured(ramp)[:, 10:-10].any()


def test_texture_is_the_root_of_the_mean_square_over_five_by_five_pixels():
    # A dot of 64 has Sobel gradients of 8, 16 and 8 in the columns beside it: their mean squares are compared with 4.
    image = np.zeros((30, 30), dtype=np.uint8)
    image[15, 15] = 64
    gradient = np.zeros((30, 30))
    gradient[14:17, 14] = gradient[14:17, 16] = 8, 16, 8
    power = np.array(
        [[(gradient[r - 2 : r + 3, c - 2 : c + 3] ** 2).mean() for c in range(3, 27)] for r in range(3, 27)]
    )
    np.testing.assert_array_equal(textured(image)[3:27, 3:27], power > 4)
    assert not textured(np.full((30, 30), 77, dtype=np.uint8)).any()
