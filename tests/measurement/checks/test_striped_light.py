"""Light in rows of one of two cameras is found, and nothing that lies across rows is taken for it."""

import cv2
import numpy as np
import pytest

from auditor.measurement.checks.striped_light import RowExcess

SIZE = 120, 240


def scene(moved=0, down=0):
    """(h, w) a picture of patches, seen from further to the right, or with its rows moved."""
    small = np.random.default_rng(4).integers(20, 160, (12, 40)).astype(np.float32)
    whole = cv2.resize(small, (400, SIZE[0] + 20), interpolation=cv2.INTER_CUBIC)
    return whole[10 + down : 10 + down + SIZE[0], 20 + moved : 20 + moved + SIZE[1]].clip(0, 255).astype(np.uint8)


def lit(pixels, rows, columns=slice(None), amount=60):
    found = pixels.astype(np.int16)
    found[rows, columns] += amount
    return found.clip(0, 255).astype(np.uint8)


def seen(one, other):
    """What a camera has of light in rows, by the other one."""
    return RowExcess.of(one).above(RowExcess.of(other))


@pytest.mark.parametrize("height", [1, 2, 6])
def test_light_in_some_rows_shows_in_the_camera_that_it_fell_into(height):
    struck = scene()
    for top in range(5, SIZE[0], 20):
        struck = lit(struck, slice(top, top + height))
    assert seen(struck, scene(moved=8)) > 0.25
    assert seen(scene(moved=8), struck) < 0.15


def test_where_half_of_the_rows_are_lit_one_other_camera_cannot_tell_which_of_them():
    struck = scene()
    for top in range(0, SIZE[0], 20):
        struck = lit(struck, slice(top, top + 10))
    assert seen(struck, scene()) > 0.1
    assert seen(scene(), struck) > 0.1


@pytest.mark.parametrize("rows", [slice(90, None), slice(40, 70), slice(30)], ids=["below", "in the middle", "above"])
def test_what_lies_beside_darker_rows_is_no_light_in_rows(rows):
    darker = scene()
    darker[rows] = darker[rows] * np.float32(0.4)
    assert seen(darker, scene(moved=8)) < 0.03


@pytest.mark.parametrize(
    "changed",
    [
        scene(moved=8),
        scene(down=2),
        lit(scene(), slice(None)),
        lit(scene(), slice(40, 44), slice(150)),
        (scene() * np.float32(0.6)).astype(np.uint8),
        cv2.GaussianBlur(scene(), (0, 0), 2),
    ],
    ids=["seen from beside", "rows lie apart", "veil", "light in less of the rows", "exposure", "blur"],
)
def test_what_lies_across_rows_or_in_all_of_them_is_none(changed):
    assert seen(changed, scene()) == 0
    assert seen(scene(), changed) == 0


def test_rows_that_saturate_or_are_black_say_nothing():
    white, black = lit(scene(), slice(60), amount=255), scene()
    black[60:] = 0
    assert seen(white, black) is None
    assert seen(lit(white, slice(80, 84)), scene()) > 0.25, "by the rows that are left"
