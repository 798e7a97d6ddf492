"""Light on the whole of one camera's lens is found by its darkest parts; gains and tone curves leave these dark."""

import numpy as np
import pytest

from auditor.measurement.checks.veiling_light import measure_veiling_light
from tests.making.scenes import plane_frame, plane_rig, seen_by_pair

FOUND = 0.2
"""From which on a frame is raised by the prior that ships."""


def measured(change_of_source=lambda levels: levels, change_of_reference=lambda levels: levels, together=True):
    """What camera 1, the source, and camera 3, the reference, have of veiling light."""
    rig = plane_rig()
    pictures = {
        one: (image.pixels - np.float32(20)) * np.float32(0.6) for one, image in plane_frame(rig).images.items()
    }
    changes = {1: change_of_source, 3: change_of_reference}
    levels = {one: changes[one](pictures[one]).clip(0, 255).astype(np.uint8) for one in changes}
    return measure_veiling_light(seen_by_pair(levels, rig, together=together), 1, 3)


@pytest.mark.parametrize(("gain", "offset"), [(0.6, 90), (1.0, 80), (0.3, 150)])
def test_light_on_the_whole_lens_shows_in_the_camera_that_it_fell_into(gain, offset):
    def lit(levels):
        return levels * gain + offset

    of_source, of_reference = measured(lit)
    assert of_source > FOUND
    assert of_reference == 0
    of_source, of_reference = measured(change_of_reference=lit)
    assert of_source == 0
    assert of_reference > FOUND


@pytest.mark.parametrize(
    "change",
    [lambda levels: levels, lambda levels: levels * 1.5, lambda levels: levels * 0.5, lambda levels: levels + 10],
    ids=["as it is", "brighter", "darker", "another black level"],
)
def test_gains_and_a_slightly_higher_black_level_are_none(change):
    assert max(measured(change)) < FOUND


def test_what_sees_too_little_with_another_camera_tells_nothing():
    assert measured(together=False) == (None, None)
