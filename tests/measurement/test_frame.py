from dataclasses import replace

import numpy as np
import pytest

from auditor.measurement import measure
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.measurement.frame import brightness
from auditor.model.checks import Check, CountedPair, SensorCheck
from auditor.model.frames import CameraImage, Frame
from auditor.model.measurement import Statistic
from auditor.model.rig import Triple
from tests.making.scenes import HEIGHT, WIDTH, plane_frame, plane_rig, scene

MATCHER = SgbmMatcher()


def errors(frame: Frame, positions: tuple[float, ...] = (0.6, 0.3, 0.0)) -> dict[tuple[int, ...], float | None]:
    rig = plane_rig(positions, lidar=0 in frame.presence)
    measurement, _ = measure(frame, rig, MATCHER)
    return {
        tuple(t): c.disparity_error(Statistic.GATED) if c else None
        for t, c in zip(rig.measured_triples, measurement.counts, strict=True)
    }


def test_a_clean_plane_has_no_disparity_error_in_any_triple() -> None:
    E = errors(plane_frame(plane_rig()))
    assert list(E) == [(0, 1, 3), (0, 2, 3), (1, 2, 3), (0, 1, 2)]
    assert all(value is not None and value < 0.03 for value in E.values())


@pytest.mark.parametrize(
    ("attacked", "above"),
    [
        (1, {(0, 1, 3), (1, 2, 3), (0, 1, 2)}),
        (2, {(0, 2, 3), (1, 2, 3), (0, 1, 2)}),
        (3, {(0, 1, 3), (0, 2, 3), (1, 2, 3)}),
    ],
)
def test_a_blinded_camera_raises_exactly_the_triples_that_hold_it(
    attacked: int, above: set[tuple[int, int, int]]
) -> None:
    frame = scene()
    frame.images[attacked].pixels[:, WIDTH // 4 : 3 * WIDTH // 4] = 255
    E = errors(frame)
    assert {t for t, value in E.items() if value is not None and value > 0.1} == above


def test_a_wall_nearer_than_the_search_range_is_inconsistent_and_counted_as_out_of_range() -> None:
    rig = plane_rig()
    frame = plane_frame(rig)
    assert frame.cloud is not None
    frame.cloud.xyz_m[:] *= np.float32(1.3 / 9.0)  # 138 px at 0.6 m
    measurement, _ = measure(frame, rig, MATCHER)
    counts = measurement.counts[rig.triples.index(Triple(0, 1, 3))]
    assert counts is not None
    assert counts.out_of_range_px > 0.9 * counts.valid_px
    assert counts.inconsistent_px > 0.9 * counts.valid_px


def test_a_missing_sensor_leaves_the_triples_without_it_measured() -> None:
    E = errors(plane_frame(plane_rig(), without=frozenset({1})))
    assert [t for t, value in E.items() if value is not None] == [(0, 2, 3)]


def test_three_cameras_without_a_lidar_are_measured() -> None:
    assert list(errors(plane_frame(plane_rig(lidar=False)))) == [(1, 2, 3)]


def test_a_lidar_with_two_cameras_is_measured() -> None:
    positions = (0.6, 0.0)
    E = errors(plane_frame(plane_rig(positions)), positions)
    assert list(E) == [(0, 1, 2)]
    assert E[0, 1, 2] is not None


def test_too_few_valid_pixels_are_no_disparity_error() -> None:
    frame = plane_frame(plane_rig())
    assert frame.cloud is not None
    thin = Frame(0, 0, frame.presence, type(frame.cloud)(0, frame.cloud.xyz_m[:100]), frame.images)
    assert errors(thin)[0, 1, 3] is None
    assert errors(thin)[1, 2, 3] is not None


def test_colour_and_grey_images_of_one_scene_give_the_same_counts() -> None:
    rig = plane_rig()
    frame = plane_frame(rig)
    colour = {n: CameraImage(n, 0, np.repeat(i.pixels[:, :, None], 3, axis=2)) for n, i in frame.images.items()}
    coloured = Frame(0, 0, frame.presence, frame.cloud, colour)
    assert measure(frame, rig, MATCHER)[0].counts == measure(coloured, rig, MATCHER)[0].counts


def test_coverage_tells_saturated_and_textureless_pixels_and_returns() -> None:
    frame = plane_frame(plane_rig())
    frame.images[2].pixels[: HEIGHT // 2] = 255
    coverage = measure(frame, plane_rig(), MATCHER)[0].coverage
    assert coverage[2].saturated_share == pytest.approx(0.5, abs=0.01)
    assert coverage[2].textureless_share == pytest.approx(0.5, abs=0.06)
    assert coverage[1].textureless_share == pytest.approx(0.0, abs=0.01)
    assert coverage[0].returns == (WIDTH // 2) * (HEIGHT // 2)


def test_full_and_half_resolution_agree_on_a_clean_scene() -> None:
    rig = plane_rig()
    counts = measure(plane_frame(rig), rig, SgbmMatcher(step=1))[0].counts
    assert all(c is not None and c.gated_valid_px > 1000 and c.disparity_error(Statistic.GATED) < 0.03 for c in counts)


def test_without_the_leftmost_of_three_cameras_the_other_two_are_compared_with_the_lidar() -> None:
    rig = plane_rig()
    measurement, _ = measure(plane_frame(rig, without=frozenset({3})), rig, MATCHER)
    assert [counts is not None for counts in measurement.counts] == [False, False, False, True]
    assert set(measurement.cells) == {
        CountedPair(Check.LIDAR_CONFLICT, 1, 2, 0),
        CountedPair(Check.LOST_RETURNS, 1, 2, 0),
        *(
            CountedPair(check, 1, 2, camera)
            for check in (Check.ADDED_LIGHT, Check.PHOTOMETRIC_INCONSISTENCY)
            for camera in (1, 2)
        ),
    }
    assert {one for one in measurement.shares if one.check is Check.POINT_DROPOUT} == {
        SensorCheck(Check.POINT_DROPOUT, 0, (2,))
    }


def test_what_the_lidar_s_range_masks_change_is_measured_without_them_too() -> None:
    rig = plane_rig()
    frame = plane_frame(rig)
    assert frame.cloud is not None
    assert not measure(frame, rig, MATCHER)[0].unmasked_cells
    near = frame.cloud.xyz_m[: len(frame.cloud.xyz_m) // 2]
    near *= np.float32(1.3 / 9.0)
    masked, alone = measure(frame, rig, MATCHER)[0], measure(replace(frame, cloud=None), rig, MATCHER)[0]
    of_pair = {counted for counted in alone.cells if (counted.i, counted.k) == (1, 3)}
    assert len(of_pair) == 4
    assert of_pair <= set(masked.unmasked_cells)
    for counted in of_pair:
        assert masked.cells[counted].valid.sum() < alone.cells[counted].valid.sum()
        assert np.array_equal(masked.unmasked_cells[counted].valid, alone.cells[counted].valid)
        assert np.array_equal(masked.unmasked_cells[counted].total, alone.cells[counted].total)
    assert not alone.unmasked_cells


def test_brightness_has_the_levels_of_the_channels_of_a_colour_image():
    image = np.zeros((4, 6, 3), dtype=np.uint8)
    image[...] = 30, 60, 90
    image[0, :, 2] = 250
    greys = np.full((4, 6), 64, dtype=np.uint8)
    greys[0, 0] = 255
    seen = brightness(image, greys)
    assert (seen.blue_level, seen.red_level) == (30, 130)
    assert (seen.level, seen.saturated_share) == (pytest.approx(64 + 191 / 24), 1 / 24)
    assert brightness(greys, greys) == replace(seen, blue_level=None, red_level=None)
