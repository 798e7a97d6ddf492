import numpy as np
import pytest

from auditor.measurement.disparity.stereo import seen_by_both, stereo_map, within


class Given:
    """A matcher that gives what it was given."""

    def __init__(self, disparity_px, step):
        self.disparity_px, self.step, self.range_px = np.asarray(disparity_px, np.float32), step, 64

    def match(self, left, right):
        return self.disparity_px


def mask(width, *columns):
    """One row that is set in these columns."""
    return np.isin(np.arange(width), columns)[None]


def given_map(disparity_px, step, reference_texture, source_texture):
    image = np.zeros((1, 1), dtype=np.uint8)
    return stereo_map(Given(disparity_px, step), image, image, reference_texture, source_texture)


@pytest.mark.parametrize(
    ("disparity_px", "column"),
    [(2.0, 4), (3.4, 3), (3.6, 2), (2.4, 4), (2.6, 3), (5.6, 0), (40.0, 0), (-1.0, 7), (-40.0, 7)],
)
def test_a_match_is_looked_up_in_the_nearest_column_and_at_the_edge_beyond_it(disparity_px, column):
    disparity, sees = np.full((1, 8), np.nan, np.float32), np.ones((1, 8), dtype=np.bool_)
    disparity[0, 6] = disparity_px
    for there in range(8):
        assert seen_by_both(disparity, 1, sees, mask(8, there))[0, 6] == (there == column)


def test_masks_are_looked_up_on_the_matchers_grid():
    # Column 3 of the grid is column 6 of the image; 4 px of disparity are two columns of the grid.
    disparity = np.full((1, 5), 4.0, np.float32)
    every = np.ones((2, 10), dtype=np.bool_)
    there = np.zeros((2, 10), dtype=np.bool_)
    there[0, 2] = True
    assert seen_by_both(disparity, 2, every, there).tolist() == [[False, False, False, True, False]]
    assert seen_by_both(disparity, 2, there, every).tolist() == [[False, True, False, False, False]]


def test_what_either_camera_does_not_see_is_not_valid():
    nowhere, every = np.zeros((1, 6), dtype=np.bool_), np.ones((1, 6), dtype=np.bool_)
    stereo = given_map(np.full((1, 6), 2.0), 2, every, every)
    assert stereo.valid.tolist() == [[False, True, True, True, True, True]]
    sees = np.ones((1, 12), dtype=np.bool_)
    sees[0, 6] = False
    assert within(stereo, sees, ~nowhere.repeat(2, axis=1)).valid.tolist() == [[False, True, True, False, True, True]]
    assert within(stereo, ~nowhere.repeat(2, axis=1), sees).valid.tolist() == [[False, True, True, True, False, True]]


def test_a_match_in_the_first_column_is_valid_and_one_left_of_it_or_none_is_not():
    nowhere = np.zeros((1, 3), dtype=np.bool_)
    stereo = given_map([[0.0, 2.1, np.nan]], 2, nowhere, nowhere)
    assert stereo.valid.tolist() == [[True, False, False]]
    assert given_map([[0.0, 2.0, 2.0]], 2, nowhere, nowhere).valid.tolist() == [[True, True, True]]
    assert (stereo.step, stereo.range_px) == (2, 64)


def test_a_pixel_is_textured_where_the_reference_is_or_the_source_at_the_match():
    disparity = np.full((1, 6), 2.0)  # one column of the grid
    nowhere = np.zeros((1, 6), dtype=np.bool_)
    assert given_map(disparity, 2, mask(6, 4), nowhere).textured.tolist() == mask(6, 4).tolist()
    assert given_map(disparity, 2, nowhere, mask(6, 2)).textured.tolist() == mask(6, 3).tolist()


def test_on_a_full_resolution_grid_texture_covers_two_pixels_and_ends_with_the_image():
    nowhere = np.zeros((2, 3), dtype=np.bool_)
    of_half = np.array([[False, True, False], [False, False, True]])
    found = given_map(np.zeros((3, 5)), 1, of_half, nowhere).textured
    assert found.tolist() == [[False, False, True, True, False]] * 2 + [[False, False, False, False, True]]
