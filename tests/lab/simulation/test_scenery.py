"""Streets in colour: cameras of several spectra, tone curves, exposures and lenses under several kinds of light."""

import colorsys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from auditor.errors import SettingError
from auditor.lab.simulation import conditions
from auditor.lab.simulation.conditions import CONDITIONS, EXPOSURE
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.lab.simulation.responses import (
    ExposureChange,
    changed_exposure,
    draw_changes,
    draw_responses,
    kinds_of,
)
from auditor.lab.simulation.spectra import channels, reflectances, spectral_radiance
from auditor.lab.simulation.stray_light import SunSeen, draw_lens, with_stray_light
from auditor.lab.simulation.surfaces import Piece
from auditor.lab.simulation.textures import Tile
from auditor.model.parameters import list_parameters

SMALL = {"width_px": 310, "height_px": 94}
LUMA = np.array([0.114, 0.587, 0.299])


def small(condition: str | None = "clear", seed: int = 21, frames: int = 4, **more: Any) -> SyntheticDrive:
    return make_drive(seed, frames, condition=condition, **(SMALL | more))


@pytest.fixture(scope="module")
def mixed() -> SyntheticDrive:
    return small(n_cameras=4, kinds=("grey", "colour", "grey", "colour"))


def test_grey_cameras_give_one_channel_and_colour_cameras_three(mixed: SyntheticDrive) -> None:
    frame = mixed.frame(1)
    assert [frame.images[camera].pixels.shape for camera in (1, 2, 3, 4)] == [(94, 310), (94, 310, 3)] * 2
    assert {image.pixels.dtype for image in frame.images.values()} == {np.dtype(np.uint8)}


def test_a_frame_is_the_same_whenever_it_is_made(mixed: SyntheticDrive) -> None:
    again = small(n_cameras=4, kinds=("grey", "colour", "grey", "colour"))
    again.frame(0)
    for camera in (1, 2):
        np.testing.assert_array_equal(mixed.image(2, camera).pixels, again.image(2, camera).pixels)


def test_a_condition_changes_pictures_and_neither_the_street_nor_its_plain_drive() -> None:
    plain, clear = small(None), small("clear")
    np.testing.assert_array_equal(plain.depth_m(1, 3), clear.depth_m(1, 3))
    np.testing.assert_array_equal(plain.cloud(1).xyz_m, clear.cloud(1).xyz_m)
    assert plain.scenery is None
    assert plain.image(1, 3).pixels.ndim == 2
    assert not np.array_equal(small("overcast").image(1, 1).pixels, clear.image(1, 1).pixels)


@pytest.mark.parametrize("condition", list(CONDITIONS))
def test_every_condition_gives_pictures_that_are_neither_black_nor_white(condition: str) -> None:
    drive = small(condition, seed=31)
    for camera in (1, 2, 3):
        pixels = drive.image(1, camera).pixels
        assert 20 < pixels.mean() < 190
        assert np.mean(pixels >= 254) < 0.35
        assert np.std(pixels) > 15


def test_channels_are_sums_of_bands(mixed: SyntheticDrive) -> None:
    scenery = mixed.scenery
    assert scenery is not None
    camera, weights = mixed.rig.camera(1), np.array([[0.2, 0.4, 0.1, 0.3]])
    world_SE3_rig, rays, surfaces, hits = mixed._seen(1, camera)

    def rendered(bands: np.ndarray) -> np.ndarray:
        seen = channels(bands, scenery.reflectance, scenery.emission, scenery.day)
        return spectral_radiance(rays, hits, surfaces, mixed.atlas, scenery.day, scenery.road_m, seen, world_SE3_rig)

    bands, grey = rendered(np.eye(4)), rendered(weights)
    np.testing.assert_allclose(grey[0], np.tensordot(weights[0], bands, axes=1), rtol=1e-3, atol=1e-4)


def test_foliage_is_brighter_against_asphalt_in_a_grey_camera_than_in_luma() -> None:
    pieces = [Piece((0, 0, 0), (1, 0, 0), (0, 1, 0), tile, body=body) for body in range(40) for tile in (Tile.LEAVES,)]
    leaves = reflectances(pieces, 3)[:, 0]
    [asphalt] = reflectances([replace(pieces[0], tile=Tile.ASPHALT)], 3)[:, 0]
    [grey] = draw_responses(["grey"], 3)[0].bands
    in_grey, in_luma = leaves @ grey / (asphalt @ grey), leaves[:, :3] @ LUMA / (asphalt[:3] @ LUMA)
    assert np.median(in_grey / in_luma) > 1.4


def test_cars_have_any_colour_and_faces_of_one_car_have_one() -> None:
    def car(body: int, tile: Tile) -> Piece:
        return Piece((0, 0, 0), (1, 0, 0), (0, 1, 0), tile, body=body, albedo=0.2)

    paint = reflectances([car(body, Tile.PAINT) for body in range(1, 60)], 3)[:, 0, :3]
    rear = reflectances([car(body, Tile.REAR) for body in range(1, 60)], 3)[:, 0, :3]
    np.testing.assert_array_equal(paint, rear)
    hsv = np.array([colorsys.rgb_to_hsv(r, g, b) for b, g, r in paint])
    coloured = hsv[hsv[:, 1] > 0.4]
    assert 15 < len(coloured) < 45
    assert np.ptp(coloured[:, 0]) > 0.7


def test_no_surface_reflects_more_visible_light_than_falls_on_it() -> None:
    pieces = [Piece((0, 0, 0), (1, 0, 0), (0, 1, 0), Tile.PAINT, body=body, albedo=0.7) for body in range(60)]
    assert (reflectances(pieces, 3)[:, :, :3] * 0.7).max() <= 0.96


def test_cameras_of_one_kind_are_one_model_and_those_of_two_kinds_two() -> None:
    first, second, third, fourth = draw_responses(("grey", "colour", "grey", "colour"), 5)
    assert (first.gamma, first.knee) == (third.gamma, third.knee)
    assert (second.gamma, second.knee) == (fourth.gamma, fourth.knee)
    np.testing.assert_allclose(first.bands, third.bands, rtol=0.15)
    assert first.lens != third.lens
    exposures = [
        one.exposure / other.exposure for one, other in (draw_responses(("grey", "colour"), n) for n in range(30))
    ]
    assert min(exposures) < 0.8
    assert max(exposures) > 1.25


def test_a_tone_curve_rises_from_black_to_white_and_is_flatter_above_its_knee() -> None:
    [model] = draw_responses(["grey"], 5)
    curve = replace(model, gamma=1.0, knee=0.6, slope=0.3, black=0.02).curve.astype(int)
    assert (curve[0], curve[-1]) == (5, 255)
    assert (np.diff(curve) >= 0).all()
    below, above = curve[1000] - curve[600], curve[1900] - curve[1500]
    assert above == pytest.approx(0.3 * below, abs=2)


def test_a_vehicles_cameras_are_grey_or_colour_or_mixed_as_kittis() -> None:
    kinds = {kinds_of(vehicle, 4) for vehicle in range(40)}
    assert kinds == {("grey",) * 4, ("colour",) * 4, ("grey", "colour", "grey", "colour")}
    assert {kinds_of(vehicle, 3) for vehicle in range(40)} >= {("grey", "colour", "colour")}
    assert kinds_of(7, 3) == kinds_of(7, 3)


def test_exposure_changes_in_steps_and_ramps_of_one_camera_or_of_all() -> None:
    changes = (ExposureChange(1.0, 0.0, 1.3, None), ExposureChange(2.0, 1.0, 0.8, 2))
    assert [changed_exposure(changes, 1, t) for t in (0.9, 1.1, 3.5)] == pytest.approx([1, 1.3, 1.3])
    assert [changed_exposure(changes, 2, t) for t in (0.9, 1.5, 2.5, 3.5)] == pytest.approx(
        [1, 1.3, 1.3 * 0.8**0.5, 1.3 * 0.8]
    )
    assert changed_exposure((ExposureChange(0, 0, 9.0, None),), 1, 1.0) == EXPOSURE.bounds[1]
    drawn = [one for seed in range(40) for one in draw_changes(3, 1.2, np.random.default_rng(seed))]
    assert {one.camera for one in drawn} == {None, 1, 2, 3}
    assert max(one.start_s for one in drawn) < 1.2


def test_a_step_of_exposure_shows_in_the_pictures_of_its_camera_alone(mixed: SyntheticDrive) -> None:
    assert mixed.scenery is not None
    still = replace(mixed, scenery=replace(mixed.scenery, changes=()))
    step = ExposureChange(0.0, 0.0, 0.7, 1)
    stepped = replace(mixed, scenery=replace(mixed.scenery, changes=(step,)))
    assert stepped.image(1, 1).pixels.mean() < still.image(1, 1).pixels.mean() - 10
    np.testing.assert_array_equal(stepped.image(1, 3).pixels, still.image(1, 3).pixels)


def test_white_balance_drifts_and_begins_where_it_was_metered() -> None:
    [colour] = draw_responses(["colour"], 5)
    drifting = replace(colour, drift=(0.1, -0.1), drift_s=4.0, phase=0.0)
    assert drifting.balance(0.0) == pytest.approx([1, 1, 1])
    assert drifting.balance(1.0) == pytest.approx([np.exp(0.1), 1, np.exp(-0.1)], rel=1e-5)


def test_a_lens_spreads_light_and_keeps_its_sum() -> None:
    lens = replace(draw_lens(np.random.default_rng(1)), veil=0.0, bloom=0.05)
    image = np.zeros((1, 96, 320), dtype=np.float32)
    image[0, 40:56, 150:170] = 4
    spread = with_stray_light(image.copy(), lens, None)
    assert spread.sum() == pytest.approx(image.sum(), rel=0.02)
    assert spread[0, 48, 175] > 10 * spread[0, 48, 260] > 0


def test_ghosts_lie_on_the_line_through_the_sun_and_differ_from_lens_to_lens() -> None:
    dark, sun = np.zeros((1, 200, 600), dtype=np.float32), SunSeen(u=500.0, v=60.0, share=1.0)
    lenses = [replace(draw_lens(np.random.default_rng(n)), veil=0.0, bloom=0.0, glare=0.0) for n in (1, 2)]
    ghosts = [with_stray_light(dark.copy(), lens, sun)[0] for lens in lenses]
    for lens, light in zip(lenses, ghosts, strict=True):
        row, column = np.nonzero(light > 0)
        off_line = np.abs((column - 300) * (60 - 100) - (row - 100) * (500 - 300)) / np.hypot(200, 40)
        assert off_line.max() < max(ghost.radius_px for ghost in lens.ghosts) * 600 / 1242 + 4
        assert 2 / 255 < light.max() < 1
    assert not np.array_equal(*ghosts)
    assert not with_stray_light(dark.copy(), lenses[0], replace(sun, share=0.0)).any()


def test_a_hidden_sun_makes_no_flare() -> None:
    drive = small("low sun", seed=32, style="industrial")
    assert drive.scenery is not None
    camera = drive.rig.camera(3)
    world_SE3_rig, rays, surfaces, hits = drive._seen(0, camera)
    ahead = replace(drive.scenery.day, light=replace(drive.scenery.day.light, sun=(0.0, -0.1, 0.995)))
    scenery = replace(drive.scenery, day=ahead)
    seen = scenery.sun_seen(camera, (world_SE3_rig, rays, surfaces, replace(hits, piece=np.full_like(hits.piece, -1))))
    hidden = scenery.sun_seen(camera, (world_SE3_rig, rays, surfaces, replace(hits, piece=np.zeros_like(hits.piece))))
    assert seen is not None
    assert hidden is not None
    assert (seen.share, hidden.share) == (1, 0)
    behind = replace(ahead, light=replace(ahead.light, sun=(0.0, -0.1, -0.995)))
    assert replace(drive.scenery, day=behind).sun_seen(camera, (world_SE3_rig, rays, surfaces, hits)) is None


def test_puddles_mirror_and_swallow_a_lidars_pulses() -> None:
    dry, wet = small("overcast"), small("wet")
    on_road = [np.count_nonzero(drive.cloud(1).xyz_m[:, 2] < -1.6) for drive in (dry, wet)]
    assert on_road[1] < 0.9 * on_road[0]
    assert np.count_nonzero(wet.surfaces.gloss) > np.count_nonzero(dry.surfaces.gloss)
    np.testing.assert_array_equal(dry.depth_m(1, 3), wet.depth_m(1, 3))


def test_dusk_has_lamps_that_cameras_and_lidar_see() -> None:
    dusk, clear = small("dusk"), small("clear")
    assert len(dusk.surfaces) > len(clear.surfaces)
    assert dusk.scenery is not None
    assert dusk.scenery.emission is not None
    assert dusk.scenery.emission.max() >= 1


def test_unknown_conditions_and_kinds_that_do_not_fit_are_refused() -> None:
    with pytest.raises(SettingError, match=r"no condition 'fog'.*clear"):
        small("fog")
    with pytest.raises(SettingError, match="2 kinds for 3 cameras"):
        small("clear", kinds=("grey", "colour"))
    with pytest.raises(SettingError, match="condition None"):
        small(None, kinds=("grey", "grey", "grey"))


def test_every_number_of_the_scenery_has_a_unit_and_a_source() -> None:
    groups = [one for one in vars(conditions).values() if type(one).__module__ == conditions.__name__]
    assert len(groups) >= 7
    assert all(found.unit and found.source for found in list_parameters(*groups, *CONDITIONS.values()))
