"""What a judgement says of its calibration: whether its recording, its LiDAR and its machine are those of others."""

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest

from auditor.identification.faults import SCORED, ObservedFeatures, fault_scores, faults_of
from auditor.identification.marks import OPENCV, OPENCV_CPU, is_another_lidar, marks_of, without_lidar
from auditor.identification.scores import EITHER_WAY, thresholds_from
from auditor.model.calibration import PRIOR, Calibration, CleanFrames, Marks, prior_calibration
from auditor.model.checks import Check, rig_sensor_checks
from auditor.model.measurement import Procedure
from auditor.model.rig_kind import Similarity
from auditor.model.verdict import Cause
from tests.making.scenes import plane_rig

RIG = plane_rig((1.04, 0.74, 0.4, 0.0))
CHECKS = rig_sensor_checks(RIG)
PROCEDURE = Procedure("sgbm", "{}")
FRAMES = 20
R = Decimal("0.01")
MACHINE = {OPENCV: "5.0.0", OPENCV_CPU: "SSE *AVX2", "numpy": "2.3"}


def clean(recording_id="a", returns=18_000.0, level=0.3, **changed):
    """Clean frames with one value of every statistic, and fault scores of 0.5."""
    stamps = np.arange(FRAMES, dtype=np.int64) * 100_000_000
    jitter = np.linspace(-0.01, 0.01, FRAMES)
    scores = dict.fromkeys(faults_of(RIG.sensors), 0.5 + jitter)
    usual = {"returns": np.full(FRAMES, returns), "versions": MACHINE}
    return CleanFrames(recording_id, stamps, {}, dict.fromkeys(CHECKS, level + jitter), scores, **usual | changed)


def calibration(*recordings):
    return Calibration("c", RIG.kind, PROCEDURE, recordings)


def marks(of, returns=18_000.0, versions=MACHINE, recording_id="b", similarity=Similarity.SAME):
    return marks_of(of, similarity, recording_id, np.full(5, returns), versions)


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
    seen = np.array([13_000.0] * 5 + [np.nan, 0.0])
    assert is_another_lidar([busy, busy, bare], seen)
    assert is_another_lidar([busy, busy, many], seen)
    assert not is_another_lidar([bare], seen)


def test_without_points_on_one_side_no_lidar_is_another_one():
    unknown = clean(returns=np.nan)
    assert not is_another_lidar([replace(unknown, returns=np.zeros(0))], np.full(3, 9_000.0))
    assert not is_another_lidar([unknown], np.full(3, 9_000.0))
    assert not is_another_lidar([clean()], np.full(3, np.nan))
    assert not is_another_lidar([], np.full(3, 9_000.0))


def test_without_its_lidar_a_calibration_leaves_the_lidars_checks_and_faults_to_the_prior():
    learnt = calibration(clean("a"), clean("b"))
    prior = thresholds_from((), CHECKS, len(CHECKS), R)
    whole = thresholds_from(learnt.clean, CHECKS, len(CHECKS), R)
    part = thresholds_from(without_lidar(learnt).clean, CHECKS, len(CHECKS), R)
    for check in CHECKS:
        assert part.expected[check] == (prior if check.sensor == 0 else whole).expected[check]
        assert whole.expected[check].drives == 2
    for fault in faults_of(RIG.sensors):
        assert part.causes[fault] == (prior if fault[1] == 0 else whole).causes[fault]
    assert {check.check for check in CHECKS if part.expected[check].drives == 0} == {
        Check.LIDAR_CONFLICT,
        Check.POINT_DROPOUT,
        Check.ISOLATED_POINTS,
    }


def test_the_prior_alone_expects_something_of_every_check_and_fault():
    prior = prior_calibration(RIG.kind, PROCEDURE)
    assert (prior.calibration_id, prior.recordings, prior.samples) == (PRIOR, (), {})
    thresholds = thresholds_from(prior.clean, CHECKS, len(CHECKS), R, prior.calibration_id)
    assert thresholds.drives == 0
    assert set(thresholds.expected) == set(CHECKS)
    assert set(thresholds.causes) == {fault for fault in faults_of(RIG.sensors) if fault[0] not in EITHER_WAY}
    assert (Cause.RAIN, 0) in thresholds.causes


@pytest.mark.parametrize("sensors", [RIG.sensors, RIG.sensors[1:]])
def test_the_faults_of_a_rig_are_those_that_scores_are_made_of(sensors):
    nothing = np.full((FRAMES, len(RIG.pairs)), np.nan)
    cameras = tuple(camera.number for camera in RIG.cameras)
    seen = ObservedFeatures(RIG.pairs, dict.fromkeys(SCORED, nothing), cameras, *(nothing[:, : RIG.n],) * 2)
    assert set(fault_scores(seen, np.arange(FRAMES), sensors)) == set(faults_of(sensors))


def test_a_calibration_without_the_lidar_is_made_once():
    learnt = calibration(clean())
    assert without_lidar(learnt) is without_lidar(learnt)


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
