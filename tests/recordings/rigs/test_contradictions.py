"""What a recording says twice of its calibration, and how each way to read it places the cameras."""

from dataclasses import replace

import numpy as np
import pytest

from auditor.model.optics.geometry import motion
from auditor.recordings import contradictions, find_rigs, read_by, search_rigs
from auditor.recordings.decoding import CameraInfo, Header
from auditor.recordings.rigs.calibrations import STANDARD, Axes, Conventions, Positions, Scale, of_pictures
from auditor.recordings.rigs.cameras import find_views
from auditor.recordings.synchronisation.survey import Survey
from tests.recordings.rigs.test_discovery import LIDAR_AT, K, P, at, info, look, x_of

PLACES = {"left": at(0), "middle": at(0.3), "right": at(0.5), "top": LIDAR_AT}
X_M = {"left": 0.0, "middle": 0.3, "right": 0.5}


def surveyed(sign: float = 1.0) -> Survey:
    return look({name: info(name, P(sign * x)) for name, x in X_M.items()}, PLACES)


def of_size(width_px: int, height_px: int, **changes: object) -> CameraInfo:
    return replace(info("left", P(0.3)), width_px=width_px, height_px=height_px, **changes)


def test_p_and_tf_that_agree_leave_one_way_to_read_them() -> None:
    assert contradictions(surveyed()) == ((), (STANDARD,), ())


@pytest.mark.parametrize("sign", [-1.0, 2.0, 1.2])
def test_p_and_tf_that_differ_are_two_ways_to_place_the_cameras(sign: float) -> None:
    found = contradictions(surveyed(sign))
    assert "P puts middle" in found.sentences[0]
    assert found.candidates == (STANDARD, Conventions(Positions.TF))
    by_tf = replace(surveyed(sign), conventions=Conventions(Positions.TF))
    assert x_of(by_tf) == X_M


def test_a_tf_of_four_digits_contradicts_nothing() -> None:
    rough = {**PLACES, "middle": at(0.3004), "right": at(0.4996)}
    survey = look({name: info(name, P(x)) for name, x in X_M.items()}, rough)
    assert not contradictions(survey).sentences


def test_negated_positions_turn_the_order_of_the_cameras() -> None:
    survey = replace(surveyed(-1.0), conventions=Conventions(Positions.NEGATED))
    assert x_of(survey) == X_M


@pytest.mark.parametrize("size_px", [(320, 240), (1280, 960), (213, 160)])
def test_pictures_of_another_size_scale_k_and_p_by_one_ratio(size_px: tuple[int, int]) -> None:
    found = of_pictures(of_size(640, 480), size_px)
    np.testing.assert_allclose(found.intrinsics, np.diag([size_px[0] / 640, size_px[1] / 480, 1]) @ K)
    assert (found.width_px, found.height_px) == size_px
    recorded = of_pictures(of_size(640, 480), size_px, Scale.RECORDED)
    np.testing.assert_array_equal(recorded.intrinsics, K)


@pytest.mark.parametrize("size_px", [(480, 640), (640, 480), (640, 300)])
def test_sizes_without_one_ratio_leave_k_and_p_alone(size_px: tuple[int, int]) -> None:
    np.testing.assert_array_equal(of_pictures(of_size(640, 480), size_px).intrinsics, K)


def test_a_binning_may_have_been_divided_by_already() -> None:
    survey = surveyed()
    wide = {
        topic: replace(one, width_px=1280, height_px=960, binning=(2, 2)) for topic, one in survey.camera_infos.items()
    }
    found = contradictions(replace(survey, camera_infos=wide))
    assert found.candidates == (STANDARD, Conventions(scale=Scale.RECORDED))
    assert "declares 1280 x 960 px, binned by 2, and the pictures have 640 x 480 px" in found.sentences[0]


OPTICAL_SE3_BODY = motion(np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]), np.zeros(3))


@pytest.mark.parametrize("offsets", [True, False])
def test_frames_of_bodies_are_another_way_to_read_tf(offsets: bool) -> None:
    infos = {name: info(name, P(x if offsets else 0)) for name, x in X_M.items()}
    bodies = {name: at(x) @ OPTICAL_SE3_BODY for name, x in X_M.items()}
    upright = motion(OPTICAL_SE3_BODY[:3, :3], np.array([0.0, -0.1, -0.3]))
    survey = look(infos, {**bodies, "top": upright})
    found = contradictions(survey)
    assert bool(found.sentences) is offsets, "P has the places of optical frames"
    assert "by tf left looks up, seen from" in found.doubts[0]
    assert found.candidates[0] == STANDARD
    assert Conventions(axes=Axes.BODY) in found.candidates
    [rig] = find_rigs(read_by(survey, Conventions(axes=Axes.BODY)))
    [true] = find_rigs(look({name: info(name, P(x)) for name, x in X_M.items()}, {**PLACES, "top": upright}))
    assert {camera.name: round(float(camera.centre_m[0]), 6) for camera in rig.cameras} == X_M
    assert rig.lidar
    assert true.lidar
    np.testing.assert_allclose(rig.lidar.rig_SE3_lidar, true.lidar.rig_SE3_lidar, atol=1e-12)


def test_optical_frames_are_read_in_one_way_whatever_else_is_wrong() -> None:
    assert {one.axes for one in contradictions(surveyed(-1.0)).candidates} == {Axes.OPTICAL}
    assert len(read_by(surveyed(), STANDARD).transforms) == len(surveyed().transforms)


def test_a_frame_that_tf_does_not_know_is_that_of_the_pictures() -> None:
    survey = surveyed()
    unknown = {
        topic: replace(one, header=Header(0, f"{one.header.frame_id}/Scene_optical"), projection=P(0))
        for topic, one in survey.camera_infos.items()
    }
    survey = replace(survey, camera_infos=unknown)
    [rig] = find_rigs(survey)
    assert {camera.name: round(float(camera.centre_m[0]), 6) for camera in rig.cameras} == X_M
    assert rig.lidar
    [repair, *_] = [repair for view in find_views(survey, []) for repair in view.repairs]
    assert "tf does not know 'left/Scene_optical'" in repair
    assert "the frame 'left' of its pictures was taken" in repair


def test_rectified_pictures_go_with_the_info_of_rectified_pictures() -> None:
    survey = surveyed()
    no_P = {topic: replace(one, projection=np.zeros((3, 4))) for topic, one in survey.camera_infos.items()}
    assert any(rig.cameras for rig in search_rigs(replace(survey, camera_infos=no_P)).rigs), "K says it all"
    raw = {topic: replace(one, distortion=(-0.3, 0.1, 0.0, 0.0, 0.0)) for topic, one in no_P.items()}
    rectified = {f"{topic}_rect": one for topic, one in survey.camera_infos.items()}
    assert not any(rig.cameras for rig in search_rigs(replace(survey, camera_infos=raw)).rigs)
    assert x_of(replace(survey, camera_infos=raw | rectified)) == X_M
