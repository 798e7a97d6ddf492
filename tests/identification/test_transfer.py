"""A calibration for other rigs: which is closest, and what a judgement by it says of vehicle, LiDAR and machine."""

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.faults import fault_scores, faults_of
from auditor.identification.scores import TONES, thresholds_from
from auditor.identification.thresholds import check_calibration
from auditor.identification.transfer import (
    OPENCV,
    OPENCV_CPU,
    calibration_for,
    closeness,
    for_like_cameras,
    for_sparser_lidar,
    halvings_of_points,
    marks_of,
)
from auditor.model.calibration import PRIOR, Calibration, CleanFrames, Marks, prior_calibration
from auditor.model.checks import Check, SensorCheck, rig_sensor_checks
from auditor.model.fault_features import COLUMNS, OF_LIDAR, ObservedFeatures
from auditor.model.measurement import BRIGHTNESS, Procedure, Statistic
from auditor.model.rig import Rig, Triple
from auditor.model.rig_kind import Similarity
from auditor.model.verdict import Cause
from tests.making.scenes import plane_rig

RIG = plane_rig((1.04, 0.74, 0.4, 0.0))
CHECKS = rig_sensor_checks(RIG)
PROCEDURE = Procedure("sgbm", "{}")
FRAMES = 20
R = Decimal("0.01")
FLAGGED = np.ones(FRAMES, dtype=np.bool_)
MACHINE = {OPENCV: "5.0.0", OPENCV_CPU: "SSE *AVX2", "numpy": "2.3"}


def clean(recording_id="a", returns=18_000.0, level=0.3, **changed):
    """Clean frames with one value of every statistic, and fault scores of 0.5."""
    stamps = np.arange(FRAMES, dtype=np.int64) * 100_000_000
    jitter = np.linspace(-0.01, 0.01, FRAMES)
    scores = dict.fromkeys(faults_of(RIG.sensors), 0.5 + jitter)
    usual = {"returns": np.full(FRAMES, returns), "versions": MACHINE}
    known = {"errors": {}, "statistics": dict.fromkeys(CHECKS, level + jitter), "strengths": scores}
    return CleanFrames(recording_id, stamps, **known | usual | changed)


def calibration(*recordings):
    return Calibration("c", RIG.kind, PROCEDURE, recordings)


def marks(of, returns=18_000.0, versions=MACHINE, recording_id="b", similarity=Similarity.SAME):
    return marks_of(of, similarity, recording_id, halvings_of_points(of.clean, RIG, np.full(5, returns)), versions)


def test_a_recording_of_the_same_vehicle_and_machine_has_no_mark():
    assert marks(calibration(clean())) == Marks()


def test_a_recording_that_the_calibration_was_made_of_is_in_sample():
    assert marks(calibration(clean("a"), clean("b"))).in_sample
    assert not marks(calibration(clean("a"), clean("c"))).in_sample


def test_the_similarity_of_rig_kinds_is_handed_on():
    assert marks(calibration(clean()), similarity=Similarity.SIMILAR) == Marks(Similarity.SIMILAR)


@pytest.mark.parametrize(
    ("returns", "another"), [(9_000, True), (12_500, True), (13_500, False), (25_000, False), (25_500, True)]
)
def test_a_lidar_with_far_fewer_or_more_points_in_view_is_another_one(returns, another):
    assert marks(calibration(clean()), returns=returns).other_lidar is another


def test_drives_weigh_alike_however_many_frames_they_have_and_some_frames_without_points_do_not_matter():
    busy, bare = clean(returns=20_000.0), clean("open", returns=16_000.0)
    many = replace(bare, returns=np.full(500, 16_000.0))
    seen = np.array([10_000.0] * 5 + [np.nan, 0.0])
    assert halvings_of_points([busy, busy, bare], RIG, seen) == pytest.approx(1)
    assert halvings_of_points([busy, busy, many], RIG, seen) == pytest.approx(1)
    assert halvings_of_points([busy, many], RIG, np.full(3, 36_000.0)) == pytest.approx(-1)


def test_without_points_on_one_side_no_lidar_is_another_one():
    unknown = clean(returns=np.nan)
    without = replace(unknown, returns=np.zeros(0))
    assert np.isnan(halvings_of_points([without], RIG, np.full(3, 9_000.0)))
    assert np.isnan(halvings_of_points([clean()], RIG, np.full(3, np.nan)))
    assert np.isnan(halvings_of_points([], RIG, np.zeros(0)))
    assert np.isnan(CleanFrames("none", np.arange(FRAMES), {}, {}, {}).usual_returns)
    assert np.isnan(halvings_of_points([clean()], RIG, np.zeros(3)))
    for few in (without, unknown):
        assert not marks(calibration(few), returns=1_000).other_lidar


def test_of_the_prior_a_lidar_is_compared_by_its_points_a_radian_of_the_view():
    kitti = Rig(None, (replace(RIG.cameras[0], width_px=1242, projection=np.diag([721.5, 721.5, 1, 1])[:3]),))
    assert halvings_of_points([], kitti, np.full(3, 18_900.0)) == pytest.approx(0, abs=0.01)
    assert halvings_of_points([], kitti, np.full(3, 18_900.0 / 4)) == pytest.approx(2, abs=0.01)


@pytest.mark.parametrize("known", [(), (clean("a"), clean("b"))], ids=["prior", "learnt"])
def test_of_a_sparser_lidar_more_isolated_points_are_expected_and_nothing_else_is(known):
    usual = thresholds_from(known, CHECKS, len(CHECKS), R)
    half, quarter, double = (for_sparser_lidar(usual, halvings) for halvings in (1.0, 2.0, -1.0))
    assert double == usual
    isolated = [check for check in CHECKS if check.check is Check.ISOLATED_POINTS]
    assert isolated
    for check in isolated:
        means = [one.expected[check].mean for one in (usual, half, quarter)]
        assert np.diff(means) == pytest.approx([1.35, 1.35])
        assert half.expected[check].deviation == usual.expected[check].deviation
    assert {check for check in CHECKS if half.expected[check] != usual.expected[check]} == set(isolated)
    assert (half.causes, half.limit, half.drives) == (usual.causes, usual.limit, usual.drives)


PAIR = plane_rig((0.54, 0.0))
LEVELS, NO_LEVELS = np.array([90.0, np.nan]), np.full(2, np.nan)


@pytest.mark.parametrize(
    "blue", [{}, {1: LEVELS, 2: LEVELS}, {1: NO_LEVELS, 2: NO_LEVELS}], ids=["grey", "colour", "nan"]
)
def test_two_cameras_of_a_kind_are_expected_to_predict_each_other_where_nothing_was_learnt(blue):
    checks = rig_sensor_checks(PAIR)
    prior = thresholds_from((), checks, len(checks), R)
    of_a_kind = for_like_cameras(prior, (1, 2), {("blue_level", camera): levels for camera, levels in blue.items()})
    changed = {check.check for check in checks if of_a_kind.expected[check] != prior.expected[check]}
    assert changed == {Check.ADDED_LIGHT, Check.REMOVED_LIGHT, Check.PHOTOMETRIC_INCONSISTENCY}
    for check in checks:
        before, after = prior.expected[check], of_a_kind.expected[check]
        assert after.mean + 3.5 * after.deviation <= before.mean + 3.5 * before.deviation


def test_what_was_learnt_cameras_of_two_kinds_and_more_than_two_keep_their_thresholds():
    checks = rig_sensor_checks(PAIR)
    prior, learnt = (thresholds_from(known, checks, len(checks), R) for known in ((), (clean("a"),)))
    assert for_like_cameras(prior, (1, 2), {("blue_level", 1): LEVELS}) == prior
    assert for_like_cameras(prior, (1, 2, 3), {}) == prior
    assert for_like_cameras(learnt, (1, 2), {}) == learnt


def test_the_prior_alone_expects_something_of_every_check_and_fault():
    prior = prior_calibration(RIG.kind, PROCEDURE)
    assert (prior.calibration_id, prior.recordings, prior.samples) == (PRIOR, (), {})
    thresholds = thresholds_from(prior.clean, CHECKS, len(CHECKS), R, prior.calibration_id)
    assert thresholds.drives == 0
    assert set(thresholds.expected) == set(CHECKS)
    assert set(thresholds.causes) == {fault for fault in faults_of(RIG.sensors) if fault[0] not in TONES}
    assert (Cause.RAIN, 0) in thresholds.causes


@pytest.mark.parametrize("sensors", [RIG.sensors, RIG.sensors[1:]])
def test_the_faults_of_a_rig_are_those_that_scores_are_made_of(sensors):
    nothing = np.full((FRAMES, len(RIG.pairs)), np.nan)
    cameras = tuple(camera.number for camera in RIG.cameras)
    seen = ObservedFeatures(
        RIG.pairs, dict.fromkeys(COLUMNS, nothing), cameras, dict.fromkeys(BRIGHTNESS, nothing[:, : RIG.n])
    )
    assert set(fault_scores(seen, np.arange(FRAMES), sensors)) == set(faults_of(sensors))


@pytest.mark.parametrize(
    ("versions", "says"),
    [
        (MACHINE, ""),
        ({**MACHINE, "numpy": "1.26"}, ""),
        ({}, ""),
        ({OPENCV: "4.12.0"}, "OpenCV 4.12.0, not 5.0.0"),
        ({OPENCV: "5.0.0", OPENCV_CPU: "SSE NEON"}, "another CPU (*AVX2 NEON)"),
        ({OPENCV: "4.12.0", OPENCV_CPU: "SSE"}, "OpenCV 4.12.0, not 5.0.0, another CPU (*AVX2)"),
    ],
)
def test_counts_of_another_opencv_or_cpu_are_told(versions, says):
    learnt = calibration(clean("a"), clean("c"), clean("old", versions={}))
    assert marks(learnt, versions=versions).measured_otherwise == says


PART = plane_rig((0.74, 0.4, 0.0))


def larger(rig: Rig, by: float = 1.03) -> Rig:
    """The rig with images and focal lengths that are larger by a factor."""
    cameras = tuple(
        replace(camera, width_px=round(by * camera.width_px), projection=np.diag([by, by, 1]) @ camera.projection)
        for camera in rig.cameras
    )
    return Rig(rig.lidar, cameras)


def calibrated_on(rig: Rig) -> Calibration:
    return Calibration("c", rig.kind, PROCEDURE, ())


@pytest.mark.parametrize(
    ("calibrated", "rank", "similarity"),
    [
        (PART, (False, 0), Similarity.SAME),
        (RIG, (False, 1), Similarity.SAME),
        (larger(PART), (True, 0), Similarity.SIMILAR),
        (larger(RIG), (True, 1), Similarity.SIMILAR),
    ],
    ids=["same", "part", "similar", "similar part"],
)
def test_the_same_vehicle_is_closer_than_a_similar_one_also_with_more_sensors(calibrated, rank, similarity) -> None:
    calibration = calibrated_on(calibrated)
    assert closeness(calibration, PART) == rank
    held = calibration_for(calibration, PART)
    assert (held is calibration) is (rank[1] == 0)
    assert check_calibration(held, rig_kind=PART.kind, procedure=PROCEDURE) is similarity


def told_apart(keys):
    """Of each key other values, all of its own."""
    return {key: np.full(FRAMES, float(number)) for number, key in enumerate(keys, start=1)}


@pytest.mark.parametrize("lidar", [True, False])
def test_what_is_known_of_a_rig_is_known_of_a_part_of_it_by_the_part_s_own_numbers(lidar) -> None:
    """The part has the same view without S_1: its S_1, S_2 and S_3 are the whole's S_2, S_3 and S_4."""
    part = plane_rig((0.74, 0.4, 0.0), lidar)
    errors = told_apart((statistic, triple) for statistic in Statistic for triple in RIG.measured_triples)
    features = told_apart((name, pair) for name in COLUMNS for pair in RIG.pairs)
    brightness = told_apart((name, camera) for name in BRIGHTNESS for camera in range(1, 5))
    known = clean(
        errors=errors, statistics=told_apart(CHECKS), unmasked=told_apart(CHECKS[::-1]), features=features,
        brightness=brightness, missing=dict.fromkeys((0, 3), FLAGGED), frozen={4: FLAGGED},
    )  # fmt: skip
    (found,) = calibration_for(calibration(known), part).clean
    for (statistic, triple), E in found.errors.items():
        assert E is errors[statistic, Triple(*(sensor and sensor + 1 for sensor in triple))]
    assert len(found.errors) == len(Statistic) * len(part.measured_triples)
    measured = known.statistics if lidar else known.unmasked
    for check, values in found.statistics.items():
        whole = check.sensor and check.sensor + 1
        assert values is measured[SensorCheck(check.check, whole, tuple(sensor + 1 for sensor in check.others))]
    assert len(found.statistics) > 20
    assert (set(found.missing), set(found.frozen)) == ({0, 2} if lidar else {2}, {3})
    of_lidar = {} if lidar else dict.fromkeys(OF_LIDAR, np.full((FRAMES, 3), np.nan))
    seen = ObservedFeatures(
        part.pairs,
        {name: np.stack([features[name, (i + 1, k + 1)] for i, k in part.pairs], axis=1) for name in COLUMNS}
        | of_lidar,
        (1, 2, 3),
        {name: np.stack([brightness[name, camera] for camera in (2, 3, 4)], axis=1) for name in BRIGHTNESS},
    )
    strengths = fault_scores(seen, found.stamps_ns, part.sensors)
    np.testing.assert_equal(dict(found.strengths), strengths)


def test_other_rigs_are_not_close() -> None:
    for other in (larger(PART, 1.1), larger(RIG, 1.1), plane_rig((0.4, 0.0))):
        assert closeness(calibrated_on(other), PART) is None
        assert calibration_for(calibrated_on(other), PART) is None
