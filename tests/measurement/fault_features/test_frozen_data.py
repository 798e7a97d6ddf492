from dataclasses import replace

import numpy as np

from auditor.measurement.fault_features.collect import fingerprints
from auditor.model.frames import CameraImage
from tests.making.scenes import plane_frame, plane_rig


def test_equal_data_have_equal_fingerprints_and_one_pixel_makes_another():
    frame = plane_frame(plane_rig())
    pixels = frame.images[2].pixels.copy()
    pixels[5, 7] ^= 1
    changed = replace(frame, images={**frame.images, 2: CameraImage(2, 0, pixels)})
    first, again, other = (fingerprints(f) for f in (frame, plane_frame(plane_rig()), changed))
    assert set(first) == {0, 1, 2, 3}
    assert first == again
    assert {s for s in first if first[s] != other[s]} == {2}


def test_a_missing_sensor_has_none_and_a_view_of_an_array_has_its_own():
    frame = plane_frame(plane_rig(), without=frozenset({0, 1}))
    flipped = replace(frame.images[2], pixels=frame.images[2].pixels[:, ::-1])
    assert set(fingerprints(frame)) == {2, 3}
    mirrored = fingerprints(replace(frame, images={2: flipped}))[2]
    assert mirrored == fingerprints(replace(frame, images={2: replace(flipped, pixels=np.array(flipped.pixels))}))[2]
    assert mirrored != fingerprints(frame)[2]


def test_a_dazzled_camera_has_none_and_a_black_one_does():
    frame = plane_frame(plane_rig())
    white, black = (CameraImage(n, 0, np.full_like(frame.images[n].pixels, level)) for n, level in ((1, 255), (2, 0)))
    assert set(fingerprints(replace(frame, images={**frame.images, 1: white, 2: black}))) == {0, 2, 3}
