"""Texture that light adds to one camera is found where the other one sees smooth surfaces."""

import cv2
import numpy as np
import pytest

from auditor.measurement.checks.added_texture import measure_added_texture
from tests.making.scenes import plane_images, plane_rig, seen_by_pair

SIZE_PX = (640, 240)
SOURCE, REFERENCE = 1, 3
FOUND = 0.35
"""From which on a frame of three cameras is raised by the prior that ships."""
SMOOTH = slice(60, 200)


def pictures():
    """What the source and the reference see: a road, of which they see little texture, between strong blotches."""
    seen = plane_images(plane_rig(size_px=SIZE_PX), 9.0)
    levels = {one: cv2.blur(seen[one], (5, 5)).astype(np.float32) for one in (SOURCE, REFERENCE)}
    for one in levels.values():
        one[SMOOTH] = 60 + (one[SMOOTH] - 128) * 0.2
    return levels


def measured(of_source=lambda levels: levels, of_reference=lambda levels: levels, known=None, together=True):
    """Added texture of the source, and of the reference."""
    changes = {SOURCE: of_source, REFERENCE: of_reference}
    levels = {one: changes[one](picture).clip(0, 255).astype(np.uint8) for one, picture in pictures().items()}
    seen = seen_by_pair(levels, plane_rig(size_px=SIZE_PX), known, together=together)
    return measure_added_texture(seen, SOURCE, REFERENCE)


def speckle(levels, grain_px=2.0):
    """Laser speckle over the whole lens, brighter by 36 levels on average."""
    grains = cv2.GaussianBlur(np.random.default_rng(7).exponential(1, levels.shape), (0, 0), grain_px)
    return levels + 36 + (grains - grains.mean()) / grains.std() * 20


def projected(levels):
    """A picture of something else, thrown over the whole lens at 30 %."""
    other = np.random.default_rng(3).integers(0, 2, (12, 32)).astype(np.float32) * 255
    return levels + 0.3 * cv2.resize(other, levels.shape[::-1], interpolation=cv2.INTER_NEAREST)


@pytest.mark.parametrize("light", [speckle, lambda levels: speckle(levels, 4.0), projected])
def test_texture_of_light_shows_in_the_camera_that_it_fell_into(light):
    of_source, of_reference = measured(of_source=light)
    assert of_source > FOUND
    assert of_reference < 0.02
    of_source, of_reference = measured(of_reference=light)
    assert of_source < 0.02
    assert of_reference > FOUND


def test_light_without_texture_is_none():
    assert measured(of_source=lambda levels: levels + 60) == (0, 0)


@pytest.mark.parametrize(
    "change",
    [
        lambda levels: levels,
        lambda levels: levels * 0.2,
        lambda levels: 255 * (levels / 255) ** 0.5,
        lambda levels: cv2.GaussianBlur(levels, (0, 0), 4),
        lambda levels: levels + np.random.default_rng(0).normal(0, 14, levels.shape),
    ],
    ids=["as it is", "darker", "steeper in the dark", "blurred", "noisy"],
)
def test_faults_of_a_camera_are_no_texture_of_either(change):
    assert max(measured(of_source=change)) < FOUND / 4
    assert max(measured(of_reference=change)) < FOUND / 4


def clouds(level, contrast):
    """A change of what is smooth into a sky of that level."""

    def change(levels):
        sky = levels.copy()
        sky[SMOOTH] = level + (levels[SMOOTH] - 60) * contrast
        return sky

    return change


@pytest.mark.parametrize(("level", "least", "most"), [(254, 0, 0), (232, FOUND, 1)], ids=["saturates", "is smooth"])
def test_where_the_other_camera_saturates_it_shows_no_texture(level, least, most):
    of_source, _ = measured(of_source=clouds(200, 3), of_reference=clouds(level, 0.5))
    assert least <= of_source <= most


def test_the_edge_of_what_a_camera_sees_is_no_texture():
    """Rectified pictures are black beyond what their camera saw."""
    mask = np.ones(SIZE_PX[::-1], dtype=np.bool_)
    mask[np.arange(SIZE_PX[1]) % 40 < 6] = False
    assert measured(of_source=lambda levels: levels * mask)[0] > FOUND / 2
    assert measured(of_source=lambda levels: levels * mask, known={SOURCE: mask})[0] == 0


def test_what_sees_too_little_with_another_camera_tells_nothing():
    assert measured(together=False) == (None, None)
