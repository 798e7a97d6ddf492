import numpy as np
import pytest

from auditor.measurement.disparity.stereo import textured


@pytest.mark.parametrize(("slope", "enough"), [(2.0, False), (2.1, True)])
def test_texture_is_more_than_two_grey_levels_a_pixel(slope, enough):
    ramp = np.tile(np.floor(np.arange(100) * slope).astype(np.uint8), (20, 1))
    if not enough:
        assert not textured(ramp)[:, 5:-5].any()  # exactly two
    else:
        assert textured(ramp)[:, 10:-10].any()


def test_texture_is_the_root_of_the_mean_square_over_five_by_five_pixels():
    # A dot of 64 has Sobel gradients of 8, 16 and 8 in the columns beside it: their mean squares are compared with 4.
    image = np.zeros((30, 30), dtype=np.uint8)
    image[15, 15] = 64
    gradient = np.zeros((30, 30))
    gradient[14:17, 14] = gradient[14:17, 16] = 8, 16, 8
    power = np.array(
        [[(gradient[r - 2 : r + 3, c - 2 : c + 3] ** 2).mean() for c in range(3, 27)] for r in range(3, 27)]
    )
    np.testing.assert_array_equal(textured(image)[3:27, 3:27], power > 4)
    assert not textured(np.full((30, 30), 77, dtype=np.uint8)).any()
