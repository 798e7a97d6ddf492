"""Opaque lights are found without stereo, which matches nothing there: no other camera shows them."""

import cv2
import numpy as np
import pytest

from auditor.measurement.checks.unmatched_light import measure_unmatched_light
from tests.making.scenes import FOCAL, plane_images, plane_rig, seen_by_pair

SIZE_PX = (640, 240)
SOURCE, REFERENCE = 1, 3
DEPTH_M, BASELINE_M = 9.0, 0.6
FOUND = 0.3
"""From which on a frame is raised by the prior that ships."""


def disc(levels, u=400, level=255, radius_px=25):
    """A picture with an opaque disc painted into it."""
    return cv2.circle(levels.copy(), (u, 120), radius_px, level, -1)


def pictures():
    """What the source and the reference see: blotches, as a street has, in place of noise."""
    seen = plane_images(plane_rig(size_px=SIZE_PX), DEPTH_M)
    return {one: cv2.blur(seen[one], (9, 9)).astype(np.uint8) for one in (SOURCE, REFERENCE)}


def measured(of_source=lambda levels: levels, of_reference=lambda levels: levels, known=None, together=True):
    """Unmatched light of the source, and of the reference."""
    changes = {SOURCE: of_source, REFERENCE: of_reference}
    levels = {one: changes[one](picture) for one, picture in pictures().items()}
    seen = seen_by_pair(levels, plane_rig(size_px=SIZE_PX), known, together=together)
    return measure_unmatched_light(seen, SOURCE, REFERENCE)


def test_an_opaque_light_shows_in_the_camera_that_it_fell_into():
    of_source, of_reference = measured(of_source=disc)
    assert of_source > FOUND
    assert of_reference == 0
    of_source, of_reference = measured(of_reference=disc)
    assert of_source == 0
    assert of_reference > FOUND


def test_what_does_not_saturate_may_be_stray_light():
    def lit(levels):
        stray = np.random.default_rng(0).integers(160, 240, levels.shape).astype(np.uint8)
        return np.where(disc(levels) == 255, stray, levels)

    assert measured(of_source=lit) == (0, 0)


@pytest.mark.parametrize(
    "change",
    [
        lambda levels: levels,
        lambda levels: (levels * 0.5).astype(np.uint8),
        lambda levels: (levels * 1.6).clip(0, 255).astype(np.uint8),
        lambda levels: (levels * 0.6 + 60).astype(np.uint8),
    ],
    ids=["as it is", "darker", "brighter", "another black level"],
)
def test_other_exposures_are_none(change):
    assert measured(of_source=change) == (0, 0)
    assert measured(of_reference=change) == (0, 0)


@pytest.mark.parametrize("depth_m", [2.5, 100.0])
def test_what_both_show_at_some_depth_is_none_whatever_stereo_chose(depth_m):
    """An object that is bright itself lies where its depth puts it in the other picture."""
    beside = round(FOCAL * BASELINE_M / depth_m)
    assert measured(of_source=lambda levels: disc(levels, 400 - beside), of_reference=disc) == (0, 0)


def test_what_lies_farther_beside_than_the_nearest_depth_is_not_the_same():
    beside = round(FOCAL * BASELINE_M / 1.0)
    assert min(measured(of_source=lambda levels: disc(levels, 400 - beside), of_reference=disc)) > FOUND


def test_what_may_lie_beyond_the_other_picture_is_none():
    found = measured(of_source=lambda levels: disc(levels, 600), of_reference=lambda levels: disc(levels, 40))
    assert found == (0, 0)


def test_where_the_other_camera_saturates_it_may_be_as_bright():
    def dazzled(levels):
        lit = levels.copy()
        lit[90:150] = 255
        return lit

    assert measured(of_source=disc, of_reference=dazzled)[0] == 0


def test_what_the_other_camera_does_not_see_may_be_as_bright():
    """Rectified pictures are black beyond what their camera saw."""
    mask = np.ones(SIZE_PX[::-1], dtype=np.bool_)
    mask[:, 420:460] = False

    def cut(levels):
        return np.where(mask, levels, np.uint8(0))

    assert measured(of_source=disc, of_reference=cut, known={REFERENCE: mask})[0] == 0
    assert measured(of_source=disc, of_reference=cut)[0] > FOUND, "it is the mask that tells"


def test_what_a_camera_does_not_see_is_no_light_of_it():
    mask = np.ones(SIZE_PX[::-1], dtype=np.bool_)
    mask[80:160, 360:440] = False
    assert measured(of_source=disc, known={SOURCE: mask})[0] == 0


def test_cameras_that_see_too_little_together_tell_nothing():
    assert measured(together=False) == (None, None)
