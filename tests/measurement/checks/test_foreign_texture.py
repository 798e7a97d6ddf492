"""What is painted into one picture of three is found, where the others agree what is there and how far away."""

from itertools import combinations

import cv2
import numpy as np
import pytest

from auditor.measurement.checks.foreign_texture import measure_foreign_texture
from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.disparity.stereo import stereo_map, textured
from auditor.measurement.frame_views import FrameViews
from tests.making.scenes import plane_images, plane_rig

SIZE_PX = (640, 240)
FOUND = 0.3
"""From which on a frame is raised by the prior that ships."""
PLACE = (slice(80, 190), slice(250, 420))


def pictures(depth_m=9.0):
    """What three cameras see: blotches, as a street has, in place of noise."""
    seen = plane_images(plane_rig(size_px=SIZE_PX), depth_m)
    return {camera: cv2.blur(picture, (9, 9)).astype(np.uint8) for camera, picture in seen.items()}


def painted(levels, seed=5):
    """A picture with something else painted into it, as bright and as textured."""
    other = levels.copy()
    blotches = np.random.default_rng(seed).integers(0, 256, levels.shape).astype(np.uint8)
    other[PLACE] = cv2.blur(blotches, (9, 9))[PLACE]
    return other


def measured(levels, rig=None):
    """What each camera shows that two others do not: by pair of these, and camera."""
    half = {camera: halve(picture) for camera, picture in levels.items()}
    texture = {camera: textured(picture) for camera, picture in half.items()}
    maps = {
        (i, k): stereo_map(SgbmMatcher(), levels[k], levels[i], texture[k], texture[i])
        for i, k in combinations(sorted(levels), 2)
    }
    seen = FrameViews(half, {}, maps, {}, rig or plane_rig(size_px=SIZE_PX))
    return {(*pair, camera): share for pair in maps for camera, share in measure_foreign_texture(seen, *pair).items()}


@pytest.mark.parametrize("camera", [1, 2, 3])
def test_what_is_painted_into_one_picture_shows_in_it_by_both_others_and_in_no_other(camera):
    levels = pictures()
    levels[camera] = painted(levels[camera])
    shares = measured(levels)
    assert {shown for (*_, shown), share in shares.items() if share > FOUND} == {camera}
    assert max(share for (*_, shown), share in shares.items() if shown != camera) < 0.05


def test_pictures_as_they_are_hold_nothing_foreign():
    assert max(share for share in measured(pictures()).values()) < 0.05


@pytest.mark.parametrize(
    "change",
    [
        lambda levels: (levels * 0.5).astype(np.uint8),
        lambda levels: (levels * 0.6 + 60).astype(np.uint8),
        lambda levels: cv2.GaussianBlur(levels, (0, 0), 2.0),
    ],
    ids=["darker", "another black level", "out of focus"],
)
def test_another_exposure_or_focus_is_the_same_texture(change):
    levels = pictures()
    levels[2] = change(levels[2])
    assert max(share for share in measured(levels).values()) < 0.05


def test_soft_light_is_no_texture():
    levels, (rows, columns) = pictures(), np.indices(SIZE_PX[::-1])
    light = 90 * np.exp(-((rows - 120) ** 2 + (columns - 330) ** 2) / (2 * 60**2))
    levels[2] = (levels[2] + light).clip(0, 255).astype(np.uint8)
    assert measured(levels)[1, 3, 2] < 0.1


def test_two_cameras_say_nothing_of_each_other():
    levels = pictures()
    assert measured({camera: levels[camera] for camera in (1, 3)}) == {}


def test_cameras_close_together_do_not_say_what_one_far_away_has_to_show():
    rig = plane_rig((0.6, 0.06, 0.0), size_px=SIZE_PX)
    seen = plane_images(rig, 9.0)
    shares = measured({camera: cv2.blur(picture, (9, 9)).astype(np.uint8) for camera, picture in seen.items()}, rig)
    assert set(shares) == {(1, 2, 3), (1, 3, 2)}
