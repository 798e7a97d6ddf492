"""Light of one wavelength falls into one channel; a veil lifts all levels; sound and radio waves add no light."""

import numpy as np
import pytest

from auditor.lab.attacks.catalogue import ON_CAMERA
from auditor.lab.attacks.coloured_light import COLOURS, ColouredFacula, InfraredFacula, ProjectedObject, Veil
from auditor.lab.attacks.interference import AcousticBlur, ElectromagneticStripes
from auditor.lab.attacks.kinds import AttackDraw
from auditor.lab.attacks.paper import Facula
from auditor.model.frames import CameraImage
from tests.making.scenes import plane_rig

SIZE = 60, 90


def image(level=50, *, colour=True):
    return CameraImage(1, 5, np.full((*SIZE, 3) if colour else SIZE, level, dtype=np.uint8))


def gradient():
    """Each channel rises along the rows, from another level."""
    row = np.arange(SIZE[0], dtype=np.uint8)[:, None]
    return CameraImage(1, 5, np.stack([np.broadcast_to(row + 60 * c, SIZE) for c in range(3)], axis=2).copy())


@pytest.mark.parametrize(("colour", "channel"), COLOURS.items())
def test_a_laser_of_one_colour_falls_into_one_channel(colour, channel):
    shown = ColouredFacula(100, 10, 45, 30, colour).apply(image()).pixels
    assert shown[30, 45, channel] == 150
    assert (np.delete(shown, channel, axis=2) == 50).all()


def test_a_grey_camera_records_the_share_of_the_colour():
    shown = [ColouredFacula(100, 10, 45, 30, colour).apply(image(colour=False)).pixels.max() for colour in COLOURS]
    assert shown == [50 + 11, 50 + 59, 50 + 30]


def test_infrared_falls_into_all_channels_as_a_facula_does():
    place = 100, 10, 45, 30
    assert (InfraredFacula(*place).apply(image()).pixels == Facula(*place).apply(image()).pixels).all()


def test_a_veil_lifts_every_level_and_ends_at_white():
    assert np.unique(Veil(60).apply(image()).pixels).tolist() == [110]
    assert np.unique(Veil(60).apply(image(220)).pixels).tolist() == [255]


def test_a_projected_sign_is_red_with_a_white_bar():
    shown = ProjectedObject(100, 40, 45, 30).apply(image()).pixels
    assert shown[30, 45].tolist() == [150, 150, 150]
    assert shown[36, 45].tolist() == [50, 50, 150]
    assert shown[30, 70].tolist() == [50, 50, 50]
    assert ProjectedObject(100, 40, 45, 30).apply(image(colour=False)).pixels[36, 45] == 50 + 30


def test_blur_smears_along_its_line_and_keeps_the_mean():
    point = image(0, colour=False).pixels.copy()
    point[30, 45] = 210
    along = AcousticBlur(7, 0).apply(CameraImage(1, 5, point)).pixels
    assert along[30, 42:49].tolist() == [30] * 7
    assert along.sum() == 210
    up = AcousticBlur(7, 90).apply(CameraImage(1, 5, point)).pixels
    assert up[27:34, 45].tolist() == [30] * 7


def test_rows_after_a_lost_one_move_up_and_change_their_colours():
    clean, shown = gradient().pixels, ElectromagneticStripes(1, 10, 20).apply(gradient()).pixels
    changed = (shown != clean).any(axis=(1, 2))
    assert np.flatnonzero(changed).tolist() == list(range(20, 30))
    blue, green, red = clean[21, 0].astype(float)
    assert shown[20, 0].tolist() == [round(1.5 * green), round((blue / 1.5 + red / 1.8) / 2), round(1.8 * green)]


def test_two_lost_rows_move_the_stripe_and_leave_its_colours():
    clean, shown = gradient().pixels, ElectromagneticStripes(1, 10, 20, lost_rows=2).apply(gradient()).pixels
    assert (shown[20:30] == clean[22:32]).all()


def test_no_stripes_change_nothing():
    assert (ElectromagneticStripes(0, 10, 20).apply(gradient()).pixels == gradient().pixels).all()


@pytest.mark.parametrize("kind", ON_CAMERA)
@pytest.mark.parametrize("colour", [False, True])
def test_every_kind_can_be_drawn_and_says_what_determines_it(kind, colour):
    camera = plane_rig((0.6, 0.1, 0.0)).camera(1)
    drawn = [ON_CAMERA[kind](AttackDraw(np.random.default_rng(4), "opaque", None), camera) for _ in range(2)]
    assert drawn[0].parameters == drawn[1].parameters
    rows = np.random.default_rng(1).integers(0, 200, (camera.height_px, camera.width_px), dtype=np.uint8)
    seen = CameraImage(1, 5, np.repeat(rows[..., None], 3, axis=2) if colour else rows)
    changed = drawn[0].apply(seen).pixels
    assert changed.shape == seen.pixels.shape
    assert (changed != seen.pixels).any()
