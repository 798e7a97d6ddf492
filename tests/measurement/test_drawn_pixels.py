"""What a recorder drew into pictures is told by what does not change, and nothing is compared there."""

from dataclasses import replace

import numpy as np
import pytest

from auditor.measurement import measure_stream
from auditor.measurement.disparity.matchers import SgbmMatcher
from auditor.measurement.drawn_pixels import DrawnPixels
from auditor.measurement.shared_view import prepare
from auditor.model.checks import Check, CountedPair
from tests.making.scenes import plane_frame, plane_rig

RIG = plane_rig()
BOX = np.s_[30:70, 100:220]
PATCH = 6
"""Half of a patch, px."""


def noisy(count, draw=None, seed=0):
    """Frames of one scene with the noise of cameras; `draw` changes the pictures of camera 1, by frame."""
    rng = np.random.default_rng(seed)
    frames = []
    for number in range(count):
        frame = plane_frame(RIG)
        images = {
            n: replace(
                image, pixels=np.clip(image.pixels + rng.normal(0, 3, image.pixels.shape), 0, 255).astype(np.uint8)
            )
            for n, image in frame.images.items()
        }
        if draw is not None:
            images[1] = replace(images[1], pixels=draw(number, images[1].pixels.copy()))
        frames.append(replace(frame, number=number, stamp_ns=number * 100_000_000, images=images))
    return frames


def box(_, pixels, level=200):
    pixels[BOX] = level
    return pixels


def hidden(frames):
    """(H, W) what of the last of some frames camera 1 does not see."""
    followed = DrawnPixels()
    for frame in frames:
        prepared = followed.hidden(prepare(frame, RIG, [], [], colour=False))
    masks = prepared.valid_masks
    return ~masks[1] if masks else np.zeros(prepared.greys[1].shape, dtype=np.bool_)


@pytest.mark.parametrize("level", [0, 20, 200])
def test_a_box_that_is_drawn_into_all_pictures_is_hidden_from_the_second_on_with_the_patches_around_it(level):
    def draw(number, pixels):
        return box(number, pixels, level)

    assert not hidden(noisy(1, draw)).any()
    expected = np.zeros((120, 320), dtype=np.bool_)
    expected[30 - PATCH : 70 + PATCH, 100 - PATCH : 220 + PATCH] = True
    np.testing.assert_array_equal(hidden(noisy(2, draw)), expected)
    np.testing.assert_array_equal(hidden(noisy(6, draw)), expected)


@pytest.mark.parametrize(
    "draw",
    [
        None,
        lambda _, pixels: box(_, pixels, 255),
        lambda number, pixels: box(number, pixels, 190 + number % 2),
        lambda number, pixels: box(number, pixels) if number else pixels,
        lambda _, pixels: np.clip(pixels + 60.0, 0, 255).astype(np.uint8),
    ],
    ids=["a scene", "what saturates", "what changes", "what was not there at first", "light that falls into it"],
)
def test_nothing_else_is_hidden(draw):
    assert not hidden(noisy(4, draw)).any()


def test_light_on_what_was_drawn_is_seen():
    frames = noisy(6, lambda number, pixels: np.minimum(box(number, pixels) + np.uint8(40 * (number > 3)), 249))
    assert hidden(frames[:4]).any()
    assert not hidden(frames).any()


def test_pictures_that_do_not_change_tell_nothing():
    first, second = noisy(2)
    assert not hidden([first, first, first]).any()
    assert not hidden([first, first, second]).any()
    assert hidden([*noisy(2, box), noisy(2, box)[-1]]).any()


def test_what_was_drawn_into_one_camera_adds_no_light_to_it():
    def added(draw):
        *_, (measurement, _) = measure_stream(noisy(3, draw), RIG, SgbmMatcher())
        grid = measurement.cells[CountedPair(Check.ADDED_LIGHT, 1, 3, 1)]
        return np.abs(grid.total.astype(int)).sum(), grid.valid.astype(int).sum()

    (drawn, compared), (lit, _), (none, every) = added(box), added(lambda n, p: box(n, p, 255)), added(None)
    assert lit > 3 * drawn
    assert drawn < 2 * none + 10
    assert 0.5 * every < compared < every
