"""How much of a camera saturates in added light: by hand, on grids of one value but for one place."""

import numpy as np
import pytest

from auditor.measurement.fault_features.added_light import saturated_by_light
from auditor.model.checks import Check, CountedPair
from auditor.model.measurement import LIGHT_STEPS, Cells

ROWS, COLUMNS = 40, 60
LIT = slice(20, 26), slice(30, 38)
"""Of 6 x 8 cells: a window; its middle is the cell (23, 34), and the pixel (92, 136)."""


def cells(valid=16):
    """What two voters say of camera 1: all its light lies in one window, of the largest residual."""
    found = {}
    for other in (2, 3):
        grid = np.full((ROWS, COLUMNS), valid, dtype=np.uint8)
        total = np.zeros((ROWS, COLUMNS), dtype=np.int8)
        total[LIT] = LIGHT_STEPS * 16
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
    assert saturated_by_light(cells(), images(**white))[1] == saturated


def test_a_camera_of_which_nothing_could_be_compared_is_left_out():
    assert saturated_by_light(cells(valid=0), images()) == {}
    assert set(saturated_by_light(cells(), images())) == {1}
