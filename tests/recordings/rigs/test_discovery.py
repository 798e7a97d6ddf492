import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from auditor.errors import RigError
from auditor.lab.simulation.vehicles import rotation
from auditor.measurement.disparity.rectification import rectification
from auditor.model.optics.geometry import Matrix, invert, motion, rotation_from_quaternion
from auditor.model.optics.sensors import NO_LENS, Lens
from auditor.model.rig import Rig
from auditor.recordings import check_rig, find_rigs, open_recording, read_rig, search_rigs, write_rig
from auditor.recordings import survey as survey_of
from auditor.recordings.decoding import CameraInfo, Header, Transform
from auditor.recordings.parameters import RIG_LIMITS
from auditor.recordings.recording import Topic
from auditor.recordings.synchronisation.survey import CloudTopic, ImageTopic, Sample, Survey
from tests.making.perturbed_rigs import perturbed
from tests.making.recorded_drives import make_frames, make_rig
from tests.making.small_drives import WRITERS

K = np.array([[700.0, 0, 320], [0, 700, 240], [0, 0, 1]])
LIDAR_AT = motion(rotation_from_quaternion(0.5, -0.5, 0.5, -0.5), np.array([0.0, -0.1, -0.3]))


def at(x: float, y: float = 0.0, z: float = 0.0) -> Matrix:
    return motion(np.eye(3), np.array([x, y, z]))


def turned(degrees: float, matrix: Matrix) -> Matrix:
    half = np.radians(degrees) / 2
    return matrix @ motion(rotation_from_quaternion(0, np.sin(half), 0, np.cos(half)), np.zeros(3))


def P(x: float) -> Matrix:
    return K @ np.hstack([np.eye(3), [[-x], [0], [0]]])


def info(
    frame: str, projection: Matrix, *, distortion: tuple[float, ...] = (), rotation: Matrix | None = None
) -> CameraInfo:
    return CameraInfo(
        Header(0, frame), 640, 480, distortion, K, np.eye(3) if rotation is None else rotation, projection
    )


def look(
    infos: dict[str, CameraInfo],
    transforms: dict[str, Matrix],
    *,
    clouds: dict[str, int] | None = None,
    images: str = "image_rect",
    parent: str = "base",
) -> Survey:
    image_topics = tuple(
        ImageTopic(Topic(f"/{name}/{images}", "sensor_msgs/msg/Image", "cdr"), known.header.frame_id, (640, 480), ())
        for name, known in infos.items()
    )
    cloud_topics = tuple(
        CloudTopic(Topic(f"/{name}/points", "sensor_msgs/msg/PointCloud2", "cdr"), name, points, ())
        for name, points in ({"top": 1000} if clouds is None else clouds).items()
    )
    return Survey(
        topics=tuple(sensor.topic for sensor in (*image_topics, *cloud_topics)),
        images=image_topics,
        clouds=cloud_topics,
        camera_infos={f"/{name}/camera_info": known for name, known in infos.items()},
        transforms=tuple(Transform(parent, child, matrix) for child, matrix in transforms.items()),
        problems=(),
        interleaved=True,
    )


def x_of(survey: Survey) -> dict[str, float]:
    (rig,) = find_rigs(survey)
    return {camera.name: round(float(camera.centre_m[0]), 9) for camera in rig.cameras}


def test_offsets_in_p_place_the_cameras_from_right_to_left() -> None:
    infos = {"left": info("left", P(0.0)), "middle": info("middle", P(0.2)), "right": info("right", P(0.5))}
    survey = look(infos, {"left": at(0), "middle": at(0.2), "right": at(0.5), "top": LIDAR_AT})
    (rig,) = find_rigs(survey)
    assert [(camera.number, camera.name) for camera in rig.cameras] == [(1, "right"), (2, "middle"), (3, "left")]
    assert rig.topic(1) == "/right/image_rect"
    assert np.allclose([camera.centre_m[0] for camera in rig.cameras], [0.5, 0.2, 0])
    assert rig.lidar
    assert rig.lidar.name == "top"
    assert np.allclose(rig.lidar.rig_SE3_lidar, LIDAR_AT)


def test_offsets_in_p_and_in_tf_are_not_added() -> None:
    infos = {"left": info("left", P(0.0)), "right": info("right", P(0.5))}
    assert x_of(look(infos, {"left": at(7), "right": at(7.5), "top": LIDAR_AT})) == {"right": 0.5, "left": 0.0}


def test_tf_places_cameras_whose_p_has_no_offsets() -> None:
    infos = {"left": info("left", P(0.0)), "right": info("right", P(0.0))}
    survey = look(infos, {"left": at(7), "right": at(7.5), "top": at(7) @ LIDAR_AT})
    assert x_of(survey) == {"right": 0.5, "left": 0.0}
    (rig,) = find_rigs(survey)
    assert rig.lidar
    assert np.allclose(rig.lidar.rig_SE3_lidar, LIDAR_AT)


def test_the_rig_origin_is_found_where_its_own_camera_is_absent() -> None:
    infos = {"a": info("a", P(0.2)), "b": info("b", P(0.5))}
    (rig,) = find_rigs(look(infos, {"a": at(7.2), "b": at(7.5), "top": at(7) @ LIDAR_AT}))
    assert rig.lidar
    assert np.allclose(rig.lidar.rig_SE3_lidar, LIDAR_AT)


def test_a_frame_that_cameras_share_is_the_one_that_p_projects_from() -> None:
    infos = {"a": info("head", P(0.2)), "b": info("head", P(0.5))}
    (rig,) = find_rigs(look(infos, {"head": at(7), "top": at(7) @ LIDAR_AT}))
    assert rig.lidar
    assert np.allclose(rig.lidar.rig_SE3_lidar, LIDAR_AT)


def test_two_stereo_pairs_that_each_start_at_zero_are_placed_by_tf() -> None:
    infos = {"a": info("a", P(0.0)), "b": info("b", P(0.3)), "c": info("c", P(0.0)), "d": info("d", P(0.3))}
    survey = look(infos, {"a": at(0), "b": at(0.3), "c": at(1.0), "d": at(1.3), "top": LIDAR_AT})
    assert x_of(survey) == {"d": 1.3, "c": 1.0, "b": 0.3, "a": 0.0}


def test_tf_is_followed_in_any_direction_over_several_steps() -> None:
    infos = {"left": info("left", P(0.0)), "right": info("right", P(0.5))}
    survey = look(infos, {"left": at(0), "right": at(0.5)})
    chain = (Transform("top", "mount", at(0, 0, 2)), Transform("mount", "base", invert(LIDAR_AT @ at(0, 0, 2))))
    survey = Survey(**{**survey.__dict__, "transforms": (*survey.transforms, *chain)})
    (rig,) = find_rigs(survey)
    assert rig.lidar
    assert np.allclose(rig.lidar.rig_SE3_lidar, LIDAR_AT)


def test_transforms_that_run_in_a_circle_end() -> None:
    infos = {"left": info("left", P(0.0)), "right": info("right", P(0.5))}
    survey = look(infos, {"left": at(0), "right": at(0.5)})
    circle = (Transform("a", "b", at(1)), Transform("b", "a", at(1)), Transform("left", "left", at(3)))
    survey = Survey(**{**survey.__dict__, "transforms": (*survey.transforms, *circle)})
    found = search_rigs(survey)
    assert [rig.sensors for rig in found.rigs] == [(0,)]
    assert any("tf does not connect /top/points" in reason for reason in found.reasons)


def test_cameras_that_look_elsewhere_are_each_a_rig_with_the_lidar() -> None:
    infos = {name: info(name, P(0.0)) for name in ("front", "left", "back")}
    turns = {"front": at(0), "left": turned(60, at(0.5)), "back": turned(180, at(1)), "top": LIDAR_AT}
    survey = look(infos, turns)
    rigs = find_rigs(survey)
    assert sorted(camera.name for rig in rigs for camera in rig.cameras) == ["back", "front", "left"]
    for rig in rigs:
        check_rig(rig, survey)
        assert (rig.by_time, rig.triples, rig.pairs, rig.max_attacked) == (True, ((0, 1, 1),), (), 0)
        assert rig.lidar is not None
        [camera] = rig.cameras
        seen = invert(turns[camera.name]) @ turns["top"]
        np.testing.assert_allclose(motion(camera.rotation, np.zeros(3)) @ rig.lidar.rig_SE3_lidar, seen, atol=1e-9)
    assert not search_rigs(survey).reasons


def test_cameras_that_look_elsewhere_are_no_rig_without_a_lidar_and_are_named() -> None:
    infos = {name: info(name, P(0.0)) for name in ("front", "left")}
    apart = look(infos, {"front": at(0), "left": turned(60, at(0.5))}, clouds={})
    with pytest.raises(
        RigError, match=r"no two cameras look the same way at a like scale \(front, left\), and no LiDAR"
    ):
        find_rigs(apart)
    with pytest.raises(
        RigError, match=r"neither P nor tf gives the positions of cameras \(front, left\), and no LiDAR"
    ):
        find_rigs(replace(apart, transforms=()))


def test_a_camera_that_looks_elsewhere_than_two_others_is_named_apart_from_them() -> None:
    infos = {name: info(name, P(0.0)) for name in ("a", "b", "left")}
    places = {"a": at(0), "b": at(0.3), "left": turned(90, at(0.1))}
    with pytest.raises(RigError) as refused:
        find_rigs(look(infos, places, clouds={}))
    assert "2 cameras look the same way (b, a)" in refused.value.what
    assert "no other camera looks the same way at a like scale (left)" in refused.value.what
    assert refused.value.remedy.startswith("add a third camera")


def test_a_lidar_that_tf_does_not_join_to_the_cameras_says_what_to_record() -> None:
    infos = {"a": info("a", P(0.0)), "b": info("b", P(0.2))}
    told = search_rigs(look(infos, {"a": at(0), "b": at(0.2)})).reasons
    assert "tf does not connect /top/points (frame 'top') with the camera frame 'a': record their tf, or " in told[0]
    assert told[1] == "2 cameras look the same way (b, a), and no LiDAR has a place beside them"


def test_a_lidar_far_away_is_on_another_vehicle_than_a_lone_camera() -> None:
    survey = look({"front": info("front", P(0.0))}, {"front": at(0), "top": at(RIG_LIMITS.most_apart_m + 1)})
    assert [rig.sensors for rig in search_rigs(survey).rigs] == [(0,)]


def test_a_camera_that_looks_elsewhere_is_a_rig_beside_the_group() -> None:
    infos = {name: info(name, P(0.0)) for name in ("a", "b", "left")}
    places = {"a": at(0), "b": at(0.3), "left": turned(90, at(0.1)), "top": LIDAR_AT}
    found = search_rigs(look(infos, places))
    assert [[camera.name for camera in rig.cameras] for rig in found.rigs] == [["b", "a"], ["left"]]
    assert not found.reasons
    alone = found.rigs[1]
    assert alone.by_time
    assert alone.lidar
    assert alone.lidar.topic == found.rigs[0].topic(0)


def test_two_topics_of_one_camera_are_one_rig() -> None:
    infos = {name: info("one", P(0.0)) for name in ("a", "b")}
    [rig] = find_rigs(look(infos, {"one": at(0), "top": LIDAR_AT}))
    assert rig.by_time


def test_two_groups_of_cameras_are_two_rigs() -> None:
    infos = {name: info(name, P(0.0)) for name in ("a", "b", "c", "d", "e")}
    places = {"a": at(0), "b": at(0.3), "c": turned(90, at(0)), "d": turned(90, at(0)) @ at(0.4)}
    places |= {"e": turned(90, at(0)) @ at(0.9), "top": LIDAR_AT}
    first, second = find_rigs(look(infos, places))
    assert [camera.name for camera in first.cameras] == ["e", "d", "c"]
    assert [camera.name for camera in second.cameras] == ["b", "a"]
    assert first.lidar
    assert second.lidar


def test_a_rectified_camera_beside_the_line_joins_and_makes_the_rig_one_of_pairs() -> None:
    infos = {name: info(name, P(0.0)) for name in ("a", "b", "high")}
    survey = look(infos, {"a": at(0), "b": at(0.5), "high": at(0.3, -0.4), "top": LIDAR_AT})
    assert list(x_of(survey)) == ["b", "high", "a"]
    (rig,) = find_rigs(survey)
    assert not rig.shares_view
    assert max(rig.off_line_px.values()) == pytest.approx(0.4 * 700 / 10)
    assert not search_rigs(survey).reasons
    check_rig(rig, survey)


def test_rectified_cameras_within_the_tolerance_of_a_line_stay_as_they_are() -> None:
    infos = {name: info(name, P(0.0)) for name in ("a", "b", "c")}
    survey = look(infos, {"a": at(0), "b": at(0.5), "c": at(0.3, -0.015), "top": LIDAR_AT})
    (rig,) = find_rigs(survey)
    assert rig.is_rectified
    assert rig.baseline_m(1, 2) == pytest.approx(0.2)
    assert len(rig.kind.baselines_m) == 2


def test_four_cameras_in_a_square_are_one_rig() -> None:
    infos = {n: info(n, P(0), distortion=(-0.1, 0, 0, 0)) for n in ("a", "b", "c", "d")}
    places = {"a": at(0), "b": at(0.4), "c": at(0, -0.4), "d": at(0.4, -0.4), "top": LIDAR_AT}
    survey = look(infos, places, images="image_raw")
    (rig,) = find_rigs(survey)
    assert sorted(camera.name for camera in rig.cameras) == ["a", "b", "c", "d"]
    assert {camera.name for camera in rig.cameras[:2]} == {"b", "d"}
    assert sorted(rig.kind.baselines_m) == pytest.approx([0.4] * 4 + [0.4 * 2**0.5] * 2)
    assert np.allclose(rectification(rig).rig.camera(1).rotation, np.eye(3))  # upright, not along a diagonal
    check_rig(Rig.from_dict(rig.to_dict()), survey)


def test_cameras_of_other_intrinsics_are_one_rig_to_be_rectified() -> None:
    other = P(0.5) * np.array([[1.2], [1.2], [1]])
    survey = look({"a": info("a", P(0.0)), "b": info("b", other)}, {"a": at(0), "b": at(0.5), "top": LIDAR_AT})
    (rig,) = find_rigs(survey)
    assert [camera.focal_px for camera in rig.cameras] == pytest.approx([840, 700])
    assert rectification(rig).rig.camera(1).focal_px == pytest.approx(700)
    check_rig(rig, survey)


def test_rectified_cameras_that_can_identify_stay_among_themselves() -> None:
    infos = {"a": info("a", P(0.0)), "b": info("b", P(0.2)), "c": info("c", P(0.5))}
    odd = info("odd", P(0.3) * np.array([[1.2], [1.2], [1]]))
    places = {"a": at(0), "b": at(0.2), "c": at(0.5), "odd": at(0.3), "top": LIDAR_AT}
    found = search_rigs(look({**infos, "odd": odd}, places))
    assert [camera.name for camera in found.rigs[0].cameras] == ["c", "b", "a"]
    assert [camera.name for camera in found.rigs[1].cameras] == ["odd"]
    assert found.rigs[1].by_time
    assert not found.reasons
    del infos["c"]
    (rig,) = find_rigs(look({**infos, "odd": odd}, places))
    assert [camera.name for camera in rig.cameras] == ["odd", "b", "a"]


def test_raw_images_of_a_stereo_calibration_are_placed_by_r_and_p() -> None:
    turns = {"a": rotation(0.02, -0.01, 0.03), "b": rotation(-0.01, 0.02, 0.0)}
    D = (-0.3, 0.1, 0.001, 0.0, 0.0)
    infos = {n: info(n, P(x), distortion=D, rotation=turns[n]) for n, x in (("a", 0.0), ("b", 0.4))}
    # tf speaks of the cameras as they are mounted.
    mounted_at = {n: at(x) @ motion(turns[n], np.zeros(3)) for n, x in (("a", 0.0), ("b", 0.4))}
    (rig,) = find_rigs(look(infos, {**mounted_at, "top": LIDAR_AT}, images="image_raw"))
    assert rig.camera(1).lens.coefficients == D[:4]
    assert rig.lidar
    for camera, x in ((rig.camera(1), 0.4), (rig.camera(2), 0.0)):
        expected = K @ turns[camera.name].T @ (at(-x) @ LIDAR_AT)[:3]
        assert np.allclose(camera.projection @ rig.lidar.rig_SE3_lidar, expected, atol=1e-9)
    ideal = rectification(rig).rig
    assert np.allclose(ideal.camera(1).centre_m - ideal.camera(2).centre_m, [0.4, 0, 0])


def test_raw_images_are_placed_and_turned_by_tf_where_p_has_no_offsets() -> None:
    D = (-0.3, 0.1, 0.0, 0.0)
    infos = {n: info(n, P(0), distortion=D) for n in ("a", "b")}
    places = {"a": turned(1, at(0)), "b": turned(-2, at(0.4, 0.05, 0.1)), "top": LIDAR_AT}
    (rig,) = find_rigs(look(infos, places, images="image_raw"))
    assert rig.lidar
    assert rig.baseline_m(1, 2) == pytest.approx(np.linalg.norm([0.4, 0.05, 0.1]))
    # Whatever frame the rig was given: the LiDAR lies where tf places it, seen from each camera.
    for camera in rig.cameras:
        expected = K @ (invert(places[camera.name]) @ LIDAR_AT)[:3]
        assert np.allclose(camera.projection @ rig.lidar.rig_SE3_lidar, expected, atol=1e-9)


def test_cameras_that_are_unreadable_or_see_little_together_are_left_out_with_the_reason() -> None:
    infos = {n: info(n, P(0), distortion=(-0.1, 0, 0, 0)) for n in ("a", "b", "high", "same", "away", "bent")}
    infos["bent"] = info("bent", P(0), distortion=(0.1,))
    places = {
        "a": at(0),
        "b": at(0.5),
        "high": at(0.2, -0.3),
        "same": at(0.5),
        "away": turned(19, at(0.9)),
        "bent": at(1),
    }
    found = search_rigs(look(infos, {**places, "top": LIDAR_AT}, images="image_raw"))
    assert [camera.name for camera in found.rigs[0].cameras] == ["away", "b", "high", "a"]
    assert len(found.rigs) == 1
    reasons = "; ".join(found.reasons)
    assert "/bent/image_raw: 1 coefficients do not fit the model plumb_bob" in reasons
    assert "high" not in reasons
    assert "same lies where b lies" in reasons
    infos["far"] = replace(info("far", P(0), distortion=(-0.1, 0, 0, 0)), intrinsics=np.diag([2000.0, 2000, 1]))
    assert "far" not in [
        c.name
        for c in search_rigs(look(infos, {**places, "far": at(2)}, clouds={}, images="image_raw")).rigs[0].cameras
    ]


def test_cameras_one_behind_the_other_are_each_a_rig_with_the_lidar() -> None:
    infos = {n: info(n, P(0), distortion=(-0.1, 0, 0, 0)) for n in ("front", "rear")}
    places = {"front": at(0), "rear": at(0.0, 0.0, -1.5), "top": LIDAR_AT}
    rigs = find_rigs(look(infos, places, images="image_raw"))
    assert sorted(rig.cameras[0].name for rig in rigs) == ["front", "rear"]
    with pytest.raises(RigError, match="front, rear stand one behind the other"):
        find_rigs(look(infos, places, images="image_raw", clouds={}))


def test_a_camera_behind_another_is_audited_with_those_it_is_not_behind() -> None:
    infos = {n: info(n, P(0), distortion=(-0.1, 0, 0, 0)) for n in ("a", "b", "c", "rear")}
    places = {"a": at(0), "b": at(0.5), "c": at(1.0), "rear": at(0.0, 0.0, -0.6), "top": LIDAR_AT}
    found = search_rigs(look(infos, places, images="image_raw"))
    assert [[camera.name for camera in rig.cameras] for rig in found.rigs] == [["c", "b", "a"], ["c", "b", "rear"]]
    assert not found.reasons


def test_a_camera_whose_pairs_see_too_little_is_audited_by_its_own_past_and_left_out_without_a_lidar() -> None:
    # Turned towards the line to a camera far ahead, narrow lenses show too little of their view, and that blurred.
    infos = {n: info(n, P(0), distortion=(-0.01, 0, 0, 0)) for n in ("a", "b", "ahead")}
    narrow = np.array([[2000.0, 0, 320], [0, 2000, 240], [0, 0, 1]])
    infos = {n: replace(known, intrinsics=narrow) for n, known in infos.items()}
    places = {"a": at(0), "b": at(0.5), "ahead": at(0.3, 0, 0.45), "top": LIDAR_AT}
    found = search_rigs(look(infos, places, images="image_raw"))
    assert [[camera.name for camera in rig.cameras] for rig in found.rigs] == [["b", "a"], ["ahead"]]
    assert not found.reasons
    del places["top"]
    found = search_rigs(look(infos, places, images="image_raw", clouds={}))
    assert not found.rigs
    assert "ahead shares too little of its view with a once both are rectified" in found.reasons


def test_a_rig_file_of_cameras_off_one_line_is_used_unless_a_pair_shares_no_view() -> None:
    infos = {n: info(n, P(0), distortion=(-0.1, 0, 0, 0)) for n in ("a", "b", "c")}
    survey = look(infos, {"a": at(0), "b": at(0.3), "c": at(0.6), "top": LIDAR_AT}, images="image_raw")
    description = find_rigs(survey)[0].to_dict()
    check_rig(Rig.from_dict(description), survey)
    description["cameras"][1]["projection"][1][3] -= 700 * 0.05
    off = Rig.from_dict(description)
    check_rig(off, survey)
    assert off.off_line_px[2] == pytest.approx(3.5)
    assert off.kind.baselines_m == pytest.approx((np.hypot(0.3, 0.05), np.hypot(0.3, 0.05), 0.6))
    assert not off.kind.matches(find_rigs(survey)[0].kind)
    left = off.camera(3)
    ahead = left.centre_m + np.array([0.01, 0.02, 5.0])
    projection = left.intrinsics @ left.rotation @ np.column_stack([np.eye(3), -ahead])
    in_front = Rig(off.lidar, (off.camera(1), replace(off.camera(2), projection=projection), left))
    with pytest.raises(RigError, match="look along the line they stand on"):
        check_rig(in_front, survey)


@pytest.mark.parametrize("ending", [".mcap", ".bag"])
@pytest.mark.parametrize(
    "lenses",
    [
        (Lens("plumb_bob", (-0.2, 0.05, 0.001, 0.0)), Lens("equidistant", (0.01, 0.0, 0.0, 0.0)), NO_LENS),
        (Lens("ds", (-0.2, 0.5)), Lens("omni", (0.9, -0.1, 0.02, 0.001, 0.0)), Lens("ftheta", (0.0, -0.05, 0.02, 0.0))),
    ],
    ids=["usual", "wide"],
)
def test_a_rig_that_is_not_rectified_survives_a_recording_and_a_rig_file(
    tmp_path: Path, ending: str, lenses: tuple[Lens, ...]
) -> None:
    rig = perturbed(make_rig(), lenses, seed=3)
    write_rig(rig, tmp_path / "rig.toml")
    assert read_rig(tmp_path / "rig.toml").rig_id == rig.rig_id
    WRITERS[ending](tmp_path / f"raw{ending}", rig, make_frames(rig, 3))
    with open_recording(tmp_path / f"raw{ending}") as recording:
        (found,) = find_rigs(survey_of(recording))
    assert [camera.lens.model for camera in found.cameras] == [lens.model for lens in lenses]
    for camera, lens in zip(found.cameras, lenses, strict=True):
        assert camera.lens.coefficients == pytest.approx(lens.coefficients, abs=1e-12)
    assert rig.lidar
    assert found.lidar
    for camera, again in zip(rig.cameras, found.cameras, strict=True):
        expected, read = (c.projection @ r.lidar.rig_SE3_lidar for c, r in ((camera, rig), (again, found)))
        assert np.allclose(expected, read, atol=1e-6)


def test_three_cameras_without_a_lidar_are_a_rig_and_two_are_not() -> None:
    infos = {"a": info("a", P(0.0)), "b": info("b", P(0.2)), "c": info("c", P(0.4))}
    (rig,) = find_rigs(look(infos, {}, clouds={}))
    assert rig.sensors == (1, 2, 3)
    del infos["c"]
    with pytest.raises(RigError) as refused:
        find_rigs(look(infos, {}, clouds={}))
    assert str(refused.value) == (
        "no triple possible: 2 cameras look the same way (b, a), and no LiDAR has a place beside them; "
        "add a third camera, or a LiDAR whose place beside a camera tf gives"
    )


def test_of_several_lidars_the_one_with_the_most_points_is_taken() -> None:
    infos = {"a": info("a", P(0.0)), "b": info("b", P(0.2))}
    survey = look(
        infos, {"a": at(0), "b": at(0.2), "top": LIDAR_AT, "bumper": LIDAR_AT}, clouds={"bumper": 9, "top": 99}
    )
    rig, other = find_rigs(survey)
    assert rig.topic(0) == "/top/points"
    assert (other.sensors, other.topic(0)) == ((0,), "/bumper/points")


def test_no_images_and_no_camera_info_are_distinguished() -> None:
    with pytest.raises(RigError, match="there are no camera images and no points"):
        find_rigs(look({}, {}, clouds={}))
    survey = look({"a": info("a", P(0.0))}, {}, clouds={})
    with pytest.raises(RigError, match="there is no camera info"):
        find_rigs(Survey(**{**survey.__dict__, "camera_infos": {}}))


NO_LENS_AT_ALL = replace(info("b", np.zeros((3, 4))), intrinsics=np.zeros((3, 3)))


def test_an_uncalibrated_camera_is_named() -> None:
    with pytest.raises(RigError, match="/b/image_rect: it is uncalibrated"):
        find_rigs(look({"a": info("a", P(0.0)), "b": NO_LENS_AT_ALL}, {"a": at(0)}, clouds={}))


def test_a_camera_info_elsewhere_is_found_by_its_frame() -> None:
    survey = look({"a": info("a", P(0.0)), "b": info("b", P(0.2))}, {"a": at(0), "b": at(0.2), "top": LIDAR_AT})
    moved = {f"/calibration{topic}": known for topic, known in survey.camera_infos.items()}
    assert x_of(Survey(**{**survey.__dict__, "camera_infos": moved})) == {"b": 0.2, "a": 0.0}


@pytest.mark.parametrize(
    ("known", "images", "rectified"),
    [
        (info("a", P(0), distortion=(-0.3, 0.1, 0, 0, 0)), "image_raw", False),
        (info("a", P(0), rotation=rotation_from_quaternion(0, 0.01, 0, 1)), "image_raw", False),
        (info("a", P(0), distortion=(-0.3, 0.1, 0, 0, 0)), "image_rect", True),
        (info("a", P(0), distortion=(0.0, 0, 0, 0, 0)), "image_raw", True),
        (info("a", P(0), rotation=np.zeros((3, 3))), "image_raw", True),
    ],
)
def test_whether_images_are_rectified_follows_from_name_distortion_and_rotation(
    known: CameraInfo, images: str, rectified: bool
) -> None:
    survey = look({"a": known, "b": info("b", P(0.2))}, {"a": at(0), "b": at(0.2), "top": LIDAR_AT}, images=images)
    (rig,) = find_rigs(survey)
    assert rig.camera(2).rectified is rectified
    check_rig(rig, survey)


def test_images_of_kitti_converters_are_rectified_whatever_their_name() -> None:
    known = info("camera_gray_left", P(0.0), distortion=(-0.3, 0.1, 0, 0, 0))
    infos = {"kitti/camera_gray_left": known, "kitti/camera_gray_right": info("camera_gray_right", P(0.5))}
    places = {"camera_gray_left": at(0), "camera_gray_right": at(0.5), "top": LIDAR_AT}
    survey = look(infos, places, images="image_raw")
    check_rig(find_rigs(survey)[0], survey)


def test_the_rectified_topic_of_a_camera_is_preferred_and_the_compressed_one_last() -> None:
    survey = look({"a": info("a", P(0.0)), "b": info("b", P(0.2))}, {"a": at(0), "b": at(0.2), "top": LIDAR_AT})
    names = ["/a/image_raw", "/a/image_rect/compressed", "/a/image_rect_color/compressed"]
    more = tuple(ImageTopic(Topic(name, "sensor_msgs/msg/Image", "cdr"), "a", (640, 480), ()) for name in names)
    (rig,) = find_rigs(Survey(**{**survey.__dict__, "images": (*more, *survey.images)}))
    assert rig.topic(2) == "/a/image_rect"
    (rig,) = find_rigs(Survey(**{**survey.__dict__, "images": (*more, survey.images[1])}))
    assert rig.topic(2) == "/a/image_rect/compressed"


def test_a_rig_file_keeps_every_digit_and_every_name(tmp_path: Path) -> None:
    rig = make_rig(4)
    description = rig.to_dict()
    description["cameras"][1]["projection"][0][2] = 0.1 + 0.2
    description["cameras"][0]["name"] = 'odd "name"\n\\ \x7f \u20ac [table]'
    odd = type(rig).from_dict(description)
    write_rig(odd, tmp_path / "rig.toml")
    assert read_rig(tmp_path / "rig.toml").to_dict() == odd.to_dict()
    assert read_rig(tmp_path / "rig.toml").rig_id == odd.rig_id
    no_lidar = make_rig(3, lidar=False)
    write_rig(no_lidar, tmp_path / "rig.toml")
    assert read_rig(tmp_path / "rig.toml").rig_id == no_lidar.rig_id
    assert [path.name for path in tmp_path.iterdir()] == ["rig.toml"]


def test_offsets_in_a_rig_file_are_kept_and_refused_where_they_are_no_numbers(tmp_path: Path) -> None:
    rig = make_rig(2)
    given = replace(rig, lidar=replace(rig.lidar, offset_ns=-12_345_678))
    write_rig(given, tmp_path / "rig.toml")
    assert read_rig(tmp_path / "rig.toml").rig_id == given.rig_id
    text = (tmp_path / "rig.toml").read_text()
    (tmp_path / "rig.toml").write_text(text.replace("-12345678", '"soon"'))
    with pytest.raises(RigError, match="soon"):
        read_rig(tmp_path / "rig.toml")


@pytest.mark.parametrize("text", ["", "nonsense = ", "[[cameras]]\nnumber = 1\n", "\xff"])
def test_a_rig_file_that_holds_no_rig_is_a_clear_error(tmp_path: Path, text: str) -> None:
    (tmp_path / "rig.toml").write_text(text, "latin-1")
    with pytest.raises(RigError, match=r"rig\.toml: .*; .*--write-rig"):
        read_rig(tmp_path / "rig.toml")


def test_a_rig_file_that_is_not_there_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(RigError, match=r"missing.toml.*No such file.*; check the path"):
        read_rig(tmp_path / "missing.toml")


def test_a_rig_that_names_other_topics_is_refused_by_their_names() -> None:
    survey = look({"a": info("a", P(0.0))}, {})
    with pytest.raises(RigError, match=r"no topic /top/points, /cam1/image_rect.*it has /a/image_rect"):
        check_rig(make_rig(3), Survey(**{**survey.__dict__, "topics": survey.topics[:1]}))


def test_a_rig_file_of_a_vehicle_with_other_images_is_refused() -> None:
    survey = look({"a": info("a", P(0.0)), "b": info("b", P(0.2))}, {"a": at(0), "b": at(0.2), "top": LIDAR_AT})
    description = find_rigs(survey)[0].to_dict()
    description["cameras"][0]["width_px"] = 641
    with pytest.raises(RigError, match="/b/image_rect has images of 640 x 480 px, not 641 x 480"):
        check_rig(Rig.from_dict(description), survey)


def test_six_real_cameras_that_look_all_around_are_six_rigs(real_data: Path) -> None:
    calibrations = json.loads((real_data / "nuscenes_one_frame" / "calibration.json").read_text())["images"]
    infos, places = {}, {}
    for name, camera in calibrations.items():
        infos[name] = info(name, np.hstack([np.array(camera["cam2img"])[:3, :3], np.zeros((3, 1))]))
        places[name] = invert(np.array(camera["lidar2cam"]))
    rigs = find_rigs(look(infos, places, parent="top"))
    assert {rig.cameras[0].name for rig in rigs} == set(infos)
    assert all(rig.by_time for rig in rigs)


def renamed(survey: Survey, spans: dict[str, range]) -> Survey:
    """The survey with messages of its sensors in these seconds; of a sensor that is not named in all of them."""

    def samples(name: str) -> tuple[Sample, ...]:
        return tuple(Sample(s * 10**9, s * 10**9) for s in spans.get(name.split("/")[1], range(20)))

    return replace(
        survey,
        images=tuple(replace(one, samples=samples(one.topic.name)) for one in survey.images),
        clouds=tuple(replace(one, samples=samples(one.topic.name)) for one in survey.clouds),
    )


def test_a_topic_that_is_renamed_is_named_and_costs_the_others_nothing() -> None:
    infos = {name: info(frame, P(0.0)) for name, frame in (("a", "a"), ("b", "b"), ("c", "c"), ("new", "b"))}
    survey = look(infos, {"a": at(7), "b": at(7.2), "c": at(7.5), "top": at(7) @ LIDAR_AT})
    found = search_rigs(renamed(survey, {"b": range(9), "new": range(9, 20)}))
    [rig] = found.rigs
    assert ([camera.name for camera in rig.cameras], rig.lidar is not None) == (["c", "b", "a"], True)
    [why] = [one for one in found.left_out if one.of == "/new/image_rect"]
    assert "/new/image_rect goes on where /b/image_rect ends, in the same frame" in str(why)
    assert not any("goes on" in reason for reason in search_rigs(renamed(survey, {})).reasons)


def test_points_that_are_renamed_are_named() -> None:
    infos = {"left": info("left", P(0.0)), "right": info("right", P(0.5))}
    survey = look(infos, {"left": at(0), "right": at(0.5), "top": LIDAR_AT}, clouds={"top": 1000, "new": 2000})
    in_one_frame = replace(survey, clouds=tuple(replace(cloud, frame_id="top") for cloud in survey.clouds))
    found = search_rigs(renamed(in_one_frame, {"top": range(9), "new": range(9, 20)}))
    assert [rig.lidar.name for rig in found.rigs if rig.lidar] == ["top"]
    assert any("/new/points goes on where /top/points ends" in reason for reason in found.reasons)
