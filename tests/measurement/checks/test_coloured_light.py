"""Light of one colour in one of two colour cameras is found, and nothing else is taken for it."""

import cv2
import numpy as np
import pytest

from auditor.measurement.checks.coloured_light import of_one_channel
from auditor.measurement.checks.light import CameraLevels, light_difference

SIZE = 120, 160


def scene(seed=3):
    """(h, w, 3) patches of many colours and levels."""
    small = np.random.default_rng(seed).integers(5, 200, (12, 16, 3)).astype(np.float32)
    return cv2.resize(small, SIZE[::-1], interpolation=cv2.INTER_CUBIC).clip(0, 255).astype(np.uint8)


def lit(pixels, channels, amount, columns):
    found = pixels.astype(np.int16)
    for channel in channels:
        found[:, columns, channel] += amount
    return found.clip(0, 255).astype(np.uint8)


def coloured(reference, source):
    def view(pixels):
        return CameraLevels(cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY), pixels)

    column = np.broadcast_to(np.arange(SIZE[1], dtype=np.float32), SIZE)
    found = light_difference(view(reference), view(source), column, np.ones(SIZE, dtype=np.bool_))
    return found.coloured


@pytest.mark.parametrize("channel", [0, 1, 2])
@pytest.mark.parametrize("share", [0.2, 0.4])
def test_light_in_one_channel_shows_where_it_fell_and_in_the_camera_that_it_fell_into(channel, share):
    middle = round(share * SIZE[1])
    struck = lit(scene(), [channel], 60, slice(middle))
    inside, outside = np.s_[10:-10, 5 : middle - 10], np.s_[10:-10, middle + 10 : -5]
    for sign, found in ((1, coloured(struck, scene())), (-1, coloured(scene(), struck))):
        assert (sign * found[inside]).mean() > 0.35
        assert np.abs(found[outside]).mean() < 0.12


@pytest.mark.parametrize("channels", [[0, 1], [1, 2], [0, 1, 2]])
def test_light_in_several_channels_is_not_of_one_colour(channels):
    assert np.abs(coloured(lit(scene(), channels, 60, slice(60)), scene())).mean() < 0.05


def test_white_balance_and_exposure_are_not_light():
    toned = (scene() * np.float32([1.3, 0.9, 0.75])).clip(0, 255).astype(np.uint8)
    assert np.abs(coloured(toned, scene())).mean() < 0.05


def test_a_little_light_in_the_other_channels_leaves_most_of_it():
    residuals = [np.full((1, 1), value, dtype=np.float32) for value in (2.0, 0.2, 0.1)]
    assert of_one_channel(*residuals) == 1
    assert of_one_channel(*(-one for one in residuals)) == -1


def test_another_surface_is_brighter_in_one_channel_and_darker_in_another():
    residuals = [np.full((1, 1), value, dtype=np.float32) for value in (0.6, 0.0, -0.4)]
    assert of_one_channel(*residuals) == 0


def test_where_two_channels_saturate_nothing_is_known():
    white = scene()
    white[:, :60, 1:] = 255
    assert (coloured(lit(white, [0], 60, slice(60)), white)[:, :50] == 0).all()


def test_a_grey_camera_knows_no_colours():
    grey = cv2.cvtColor(scene(), cv2.COLOR_BGR2GRAY)
    column = np.broadcast_to(np.arange(SIZE[1], dtype=np.float32), SIZE)
    found = light_difference(CameraLevels(grey, scene()), CameraLevels(grey), column, np.ones(SIZE, dtype=np.bool_))
    assert found.coloured is None
