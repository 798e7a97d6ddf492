"""Light over the whole image of one camera is found, and exposures are not taken for it."""

import numpy as np
import pytest

from auditor.measurement.checks.veiling_light import darkest, veiling_light

SCENE = np.random.default_rng(2).integers(8, 200, (60, 80)).astype(np.uint8)
DARK = darkest(SCENE)


def by_other(pixels):
    """What a camera of this image has of veiling light, by one that sees the scene as it is; and the other way."""
    shown = darkest(np.clip(np.rint(pixels), 0, 255).astype(np.uint8))
    return veiling_light(shown, DARK), veiling_light(DARK, shown)


def test_what_is_added_to_the_darkest_level_counts_above_what_exposures_do():
    assert DARK == 8
    assert by_other(SCENE + 60.0) == (pytest.approx((68 - 12 - 20) / 50), 0)
    assert by_other(SCENE + 100.0)[0] == 1


@pytest.mark.parametrize(
    "changed", [SCENE * 2.0, SCENE * 0.4, 255 * (SCENE / 255) ** 0.7, SCENE + 20.0], ids=["", "gain 0.4", "gamma", ""]
)
def test_exposures_and_a_little_light_are_none(changed):
    assert by_other(changed) == (0, 0)


def test_black_pixels_are_no_part_of_the_scene_and_a_black_image_says_nothing():
    framed = SCENE.copy()
    framed[:5] = 0
    assert darkest(framed) == DARK
    assert darkest(np.zeros_like(SCENE)) is None
    assert veiling_light(None, DARK) is veiling_light(DARK, None) is None
