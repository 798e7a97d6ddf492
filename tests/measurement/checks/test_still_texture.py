"""What stays in a lone camera's picture though it should have moved says nothing of the LiDAR, and is the camera's."""

from dataclasses import replace
from functools import cache

import cv2
import numpy as np

from auditor.lab.attacks.paper import BogusWall
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.measurement import measure_stream
from auditor.measurement.checks.in_time.parallax_conflict import parallax_conflicts
from auditor.measurement.checks.in_time.still_texture import NUMBERS, appeared, measure_still_texture, staying
from auditor.measurement.disparity.lidar import lidar_view
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.moment import Moment
from auditor.model.arrays import Image
from auditor.model.checks import Check, SensorCheck
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.rig import LIDAR

SGBM = find_matcher("sgbm")
WALL = BogusWall(range_m=9.0, lateral_m=-1.5, seed=1)
FAR = 12
OF_CAMERA = SensorCheck(Check.STILL_TEXTURE, 1, (LIDAR,))


@cache
def drive() -> SyntheticDrive:
    return make_drive(2, FAR + 2, n_cameras=1)


@cache
def frame_of(number: int) -> Frame:
    return drive().frame(number)


@cache
def pattern() -> Image:
    """Spots on a part of the picture, as a projector throws them."""
    spots = cv2.resize(np.random.default_rng(5).integers(0, 2, (12, 16), dtype=np.uint8) * 180, (256, 192))
    light = np.zeros((375, 1242), dtype=np.uint8)
    light[150:342, 400:656] = spots
    return light


def lit(frame: Frame) -> Frame:
    image = frame.images[1]
    light = pattern() if image.pixels.ndim == 2 else pattern()[..., None]
    return replace(
        frame, images={1: replace(image, pixels=cv2.add(image.pixels, np.broadcast_to(light, image.pixels.shape)))}
    )


def moment(number: int, *, thrown: bool = False, wall: bool = False) -> Moment:
    frame = lit(frame_of(number)) if thrown else frame_of(number)
    cloud = WALL.apply(frame.cloud, drive().rig) if wall else frame.cloud
    return Moment(frame.stamp_ns, frame.images[1].pixels, lidar_view(cloud, drive().rig, 1))


def statistics(frames: list[Frame]) -> list[float]:
    """Those of the frames that have one."""
    measured = [one[0] for one in measure_stream(frames, drive().rig, SGBM) if not isinstance(one, SkippedFrame)]
    return [one.shares[OF_CAMERA] for one in measured if OF_CAMERA in one.shares]


def test_a_pattern_that_stays_is_no_conflict_of_the_lidar():
    now, before, long_ago = (moment(n, thrown=True) for n in (FAR + 1, FAR, 0))
    found = parallax_conflicts(now, before, long_ago=long_ago.half)
    assert np.count_nonzero(found.points.lidar_conflicts) < 10
    assert found.still_texture > 0.4


def test_a_pattern_that_has_begun_is_no_conflict_of_the_lidar():
    drawn = cv2.resize(
        np.random.default_rng(5).random((20, 26)).astype(np.float32), (260, 200), interpolation=cv2.INTER_CUBIC
    )
    texture = np.clip(drawn * 255, 0, 255).astype(np.uint8)

    def covered(number: int) -> Moment:
        grey = moment(number).grey.copy()
        grey[130:330, 850:1110] = texture
        return replace(moment(number), grey=grey)

    found = parallax_conflicts(covered(FAR), covered(FAR - 1), long_ago=moment(0).half)
    assert np.count_nonzero(found.points.lidar_conflicts) < 10
    assert found.still_texture < 0.2


def test_what_has_appeared_shows_nowhere_nearby():
    now = moment(4, thrown=True)
    inside = np.flatnonzero(pattern()[now.view.row, now.view.column])
    shift = np.float32([[1, 0, NUMBERS.nearby_px - 1], [0, 1, 1 - NUMBERS.nearby_px]])
    shifted = cv2.warpAffine(moment(4, thrown=True).half, shift, now.half.shape[::-1], borderMode=cv2.BORDER_REPLICATE)
    new, elsewhere = appeared(now, moment(0).half, inside), appeared(now, shifted, inside)
    assert new.mean() > 0.8
    assert elsewhere.mean() < 0.05
    assert appeared(now, shifted, inside[:0]).shape == (0,)


def test_a_bogus_wall_stays_a_conflict_and_is_no_still_texture():
    now, before, long_ago = (moment(n, wall=True) for n in (9, 8, 0))
    found = parallax_conflicts(now, before, long_ago=long_ago.half)
    assert np.count_nonzero(found.points.lidar_conflicts) > 30
    assert found.still_texture < 0.2


def test_without_a_picture_of_long_ago_it_is_not_told():
    assert parallax_conflicts(moment(4), moment(3)).still_texture is None


def test_pictures_are_kept_for_as_long_a_way_as_is_asked_for():
    frames = [frame_of(number) for number in range(FAR + 2)]
    clean, thrown = statistics(frames), statistics([lit(one) for one in frames])
    assert 0 < len(clean) < len(frames) - 2
    assert max(clean) < 0.15
    assert np.median(thrown) > 0.4


def test_what_differs_in_one_earlier_picture_does_not_stay():
    now, before = moment(4, thrown=True), moment(3, thrown=True)
    inside = np.flatnonzero(pattern()[now.view.row, now.view.column])
    always, lately = (staying(now, (before.half, one), inside) for one in (moment(0, thrown=True).half, moment(0).half))
    assert np.count_nonzero(always) > 2 * np.count_nonzero(lately)
    assert not (lately & ~always & ~staying(now, (before.half, None), inside)).any()


def test_the_statistic_is_the_share_of_a_window_of_those_that_should_have_moved():
    now = moment(4)
    there = np.flatnonzero((np.abs(now.view.row - 300) < 20) & (np.abs(now.view.column - 600) < 20))
    stays = np.arange(there.size) % 2 == 0
    half = np.count_nonzero(stays) / (there.size + NUMBERS.pseudo_count)
    assert np.isclose(measure_still_texture(now, there, stays), half, atol=1e-6)
    assert measure_still_texture(now, there[:0], stays[:0]) == 0


def test_a_picture_that_is_repeated_with_fresh_noise_stays_and_is_no_conflict_of_the_lidar():
    picture, rng = frame_of(0).images[1].pixels, np.random.default_rng(3)

    def repeated(number: int) -> Moment:
        noise = rng.normal(0, 2, picture.shape)
        return replace(moment(number), grey=np.clip(picture + noise, 0, 255).astype(np.uint8))

    now, before, long_ago = (repeated(n) for n in (FAR + 1, FAR, 0))
    found = parallax_conflicts(now, before, long_ago=long_ago.half)
    assert found.still_texture > 0.8
    assert not found.points.valid.any()
    assert found.unmatched_share is None
