"""Light laid over images: never darker than black, never brighter than white, only where it falls."""

import numpy as np
import pytest

from auditor.lab.attacks.interference import LaserPattern, Stripes
from auditor.model.frames import CameraImage


def image(level, shape=(40, 60)):
    return CameraImage(1, 5, np.full(shape, level, dtype=np.uint8))


def pattern():
    """A blue upper half."""
    pixels = np.zeros((10, 20, 3), dtype=np.uint8)
    pixels[:5, :, 0] = 100
    return LaserPattern("blue", pixels)


def test_a_pattern_is_stretched_over_the_image_and_clipped():
    grey = pattern().apply(image(200)).pixels
    assert grey.shape == (40, 60)
    assert np.unique(grey[:20]).tolist() == [255]
    assert np.unique(grey[20:]).tolist() == [200]


def test_a_colour_image_gets_it_channel_by_channel():
    shown = pattern().apply(image(50, (40, 60, 3))).pixels
    assert shown[0, 0].tolist() == [150, 50, 50]
    assert shown[39, 0].tolist() == [50, 50, 50]


@pytest.mark.parametrize(("amplitude", "lit"), [(60.0, 160), (-60.0, 40), (-200.0, 0), (200.0, 255)])
def test_stripes_brighten_or_darken_a_share_of_the_rows(amplitude, lit):
    shown = Stripes(amplitude, period_px=10, phase_px=3, duty=0.3).apply(image(100)).pixels
    assert (shown == shown[:, :1]).all()
    rows = [row for row in range(40) if shown[row, 0] == lit]
    assert rows == [row for row in range(40) if (row - 3) % 10 < 3]
    assert set(shown[:, 0].tolist()) == {100, lit}


def test_equal_stripes_are_equal_attacks():
    assert Stripes(1.0, 10, 3) == Stripes(1.0, 10, 3)
    assert hash(Stripes(1.0, 10, 3)) == hash(Stripes(1.0, 10, 3))
    assert Stripes(1.0, 10, 3) != Stripes(-1.0, 10, 3)
