"""How much of a camera is lit, and how much of that saturates: by hand, on grids of one value but for one place."""

import numpy as np
import pytest

from auditor.measurement.fault_features.added_light import AddedLight, added_light
from auditor.model.checks import Check, CountedPair
from auditor.model.measurement import LIGHT_STEPS, Cells

ROWS, COLUMNS = 40, 60
LIT = slice(20, 26), slice(30, 38)
"""Of 6 x 8 cells: a window; its middle is the cell (23, 34), and the pixel (92, 136)."""


def cells(lit=(1, 1), valid=16):
    """What two voters say of camera 1: all its light lies in one window, `lit` of the largest residual."""
    found = {}
    for other, share in zip((2, 3), lit, strict=True):
        grid = np.full((ROWS, COLUMNS), valid, dtype=np.uint8)
        total = np.zeros((ROWS, COLUMNS), dtype=np.int8)
        total[LIT] = round(share * LIGHT_STEPS * 16)
        found[CountedPair(Check.ADDED_LIGHT, 1, other, 1)] = Cells(grid, total)
    return found


def images(**white):
    """Grey images at half resolution, of levels of which none is crowded, white in some (rows, columns)."""
    shape, found = (4 * ROWS, 4 * COLUMNS), {}
    levels = np.clip(np.random.default_rng(0).normal(90, 20, shape), 0, 200).astype(np.uint8)
    for camera in (1, 2, 3):
        found[camera] = levels.copy()
        if f"c{camera}" in white:
            found[camera][white[f"c{camera}"]] = 255
    return found


SPOT = slice(90, 95), slice(130, 140)
FAR = slice(0, 5), slice(0, 10)


@pytest.mark.parametrize(
    ("white", "saturated"),
    [
        ({}, 0),
        ({"c1": SPOT}, 50),
        ({"c1": FAR}, 0),
        ({"c1": SPOT, "c2": SPOT}, 0),
        ({"c1": SPOT, "c2": FAR, "c3": FAR}, 50),
    ],
    ids=["nothing", "in the light", "elsewhere", "in half of the others too", "the others elsewhere"],
)
def test_what_saturates_in_the_light_is_counted_where_most_others_do_not(white, saturated):
    assert added_light(cells(), images(**white))[1].saturated == saturated


def test_lit_are_the_windows_of_which_all_others_say_that_light_was_added():
    whole, half, one_alone = (added_light(cells(lit), images())[1].lit for lit in ((1, 1), (1, 0.3), (1, 0)))
    assert whole > half > one_alone == 0


def test_a_camera_of_which_nothing_could_be_compared_is_left_out():
    assert added_light(cells(valid=0), images()) == {}
    assert set(added_light(cells(), images())) == {1}
    assert isinstance(added_light(cells(), images())[1], AddedLight)
