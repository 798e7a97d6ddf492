"""Small stores for the tests of the incident page, made with the store's own writers."""

import hashlib
from dataclasses import replace
from datetime import UTC, datetime
from decimal import Decimal

import cv2
import numpy as np

from auditor.identification.cross_validation import robust_thresholds
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.paper import judge_frames as judge_by_paper
from auditor.identification.parameters import SCORE_LIMITS
from auditor.identification.prior import OFFSET
from auditor.identification.robust import judge_frames
from auditor.identification.systems import System
from auditor.identification.thresholds import thresholds_at
from auditor.model.calibration import Calibration, CleanFrames
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import Presence, SensorState, SkippedFrame, TopicBalance
from auditor.model.measurement import Counts, Coverage, Measurement, Procedure, Statistic
from auditor.model.pictures import Picture
from auditor.model.rig import Camera, Lidar, Rig
from auditor.model.verdict import AttackLabel
from auditor.store.calibrations import make_calibration
from auditor.store.records import JudgementRecord, JudgingRules, MeasurementRecord, RecordingRecord
from auditor.store.store import Store
from auditor.store.versions.history import put_first_in_force
from tests.making.calibrations import clean_frames

START_NS = 1_317_042_145_904_000_000
PERIOD_NS = 100_000_000
RULES = JudgingRules("d" * 12, "{}", "0.0", OFFSET, (SCORE_LIMITS.lowest, SCORE_LIMITS.highest))
PROCEDURE = Procedure("sgbm_3way", '{"range_px":128,"scale":0.5}')
WHEN = datetime(2026, 1, 2, 3, 4, tzinfo=UTC).replace(tzinfo=None)
VALID_PX = 10_000


def make_rig(names=("velo", "right", "middle", "left"), *, lidar=True):
    def projection(x_m):
        return np.array([[700.0, 0.0, 600.0, -700.0 * x_m], [0.0, 700.0, 180.0, 0.0], [0.0, 0.0, 1.0, 0.0]])

    cameras = tuple(
        Camera(number, name, f"/{name}/image", 1242, 375, projection(0.5 * (len(names) - number)))
        for number, name in enumerate(names[1:], start=1)
    )
    return Rig(Lidar(names[0], f"/{names[0]}/points", np.eye(4)) if lidar else None, cameras)


def add_recording(
    store,
    name="drive.mcap",
    *,
    rig=None,
    frames=40,
    attacks=(),
    labelled=True,
    missing=(),
    unmeasured=(),
    skipped=(),
    edge=(),
    clock="utc",
    r="0",
    judged=True,
    pictured=(),
    damage=(),
    vehicle="car 7",
    regions=(),
    coverage=None,
    drives=None,
):
    """Keep one recording. `attacks` are (sensors, first, last); `missing` are (sensor, frame).

    It is judged by the paper's method; where `drives` are given, by the robust one that so many drives taught.
    """
    rig = rig or make_rig()
    recording_id = hashlib.sha256(name.encode()).hexdigest()
    store.write_rig(rig)
    store.write_recording(
        RecordingRecord(
            recording_id, name, f"/logs/{name}", (name,), 1000, "mcap", clock, START_NS, None, vehicle, damage=damage
        )
    )
    if labelled:
        store.write_labels(recording_id, _labels(rig, attacks), rig)
    record = MeasurementRecord(
        recording_id,
        rig.rig_id,
        PROCEDURE,
        _balance(rig, frames),
        {"auditor": "0.1.0", "cv2": "5.0.0"},
        WHEN,
        1.5,
        coverage=coverage,
    )
    with store.frames_writer(record.measurement_id, rig) as writer:
        for frame in range(frames):
            if frame in edge:
                writer.skip(SkippedFrame(frame, START_NS + frame * PERIOD_NS, "edge"))
            elif frame in skipped:
                writer.skip(SkippedFrame(frame, START_NS + frame * PERIOD_NS, "reference missing", rig.n))
            else:
                measured = _measurement(rig, frame, attacks=attacks, missing=missing, unmeasured=unmeasured)
                writer.add(replace(measured, regions=regions), _statistics(rig, frame, attacks, measured))
        writer.commit(record)
    for frame in pictured:
        store.write_picture(record.measurement_id, Picture(frame, rig.n, *_picture(rig)))
    if judged and drives is None:
        _judge(store, rig, record.measurement_id, r)
    elif judged:
        _judge_robust(store, rig, record.measurement_id, r, drives)
    return record.measurement_id


def new_store(folder):
    return Store.open(folder / "audit", create=True)


def _labels(rig, attacks):
    return [
        AttackLabel(rig.topic(s), "facula", START_NS + first * PERIOD_NS, START_NS + last * PERIOD_NS, {"A": 510})
        for sensors, first, last in attacks
        for s in sensors
    ]


def _balance(rig, frames):
    topics = [
        TopicBalance(rig.topic(s), "sensor_msgs/msg/Image", s, frames + 2, frames, 0, 0, {"edge": 2})
        for s in rig.sensors
    ]
    return (*topics, TopicBalance("/imu", "sensor_msgs/msg/Imu", None, 400, 0, 400))


def _measurement(rig, frame, *, attacks, missing, unmeasured):
    attacked = {s for sensors, first, last in attacks if first <= frame <= last for s in sensors}
    absent = {sensor for sensor, when in missing if when == frame}
    counts = []
    for place, triple in enumerate(rig.measured_triples):
        inconsistent = 4000 + 37 * frame if attacked & set(triple) else 500 + (frame * 7 + place) % 50
        valid = 100 if frame in unmeasured else VALID_PX
        measured = Counts(valid, min(inconsistent, valid), valid, min(inconsistent, valid), 0)
        counts.append(None if absent & set(triple) else measured)
    return Measurement(
        number=frame,
        stamp_ns=START_NS + frame * PERIOD_NS,
        presence={
            s: Presence(SensorState.MISSING if s in absent else SensorState.PRESENT, None if s in absent else 0)
            for s in rig.sensors
        },
        counts=tuple(counts),
        coverage={
            s: Coverage(returns=18_000 + frame) if s == 0 else Coverage(0.01, 0.2, None if s == rig.n else 0.05)
            for s in rig.sensors
            if s not in absent
        },
    )


def _statistics(rig, frame, attacks, measured):
    """Every check of an attacked sensor is far above the limit, and so is every one by an attacked camera alone."""
    attacked = {s for sensors, first, last in attacks if first <= frame <= last for s in sensors}
    return [
        (0.9 if attacked & set(one.nameable) else 0.01 + 0.001 * (frame % 20))
        if all(measured.presence[s].state is SensorState.PRESENT for s in one.needed)
        else None
        for one in rig_sensor_checks(rig)
    ]


def _judge(store, rig, measurement_id, r):
    samples = {(Statistic.GATED, triple): [0.01 + 0.001 * rank for rank in range(50)] for triple in rig.triples}
    calibration = make_calibration(rig.kind, PROCEDURE, clean_frames(samples, ["ab" * 32]))
    put_first_in_force(store, calibration)
    thresholds = thresholds_at(calibration, Statistic.GATED, Decimal(r))
    errors = store.load_errors(measurement_id, Statistic.GATED)
    missing = [
        frozenset(s for s, state in zip(rig.sensors, states, strict=True) if state != "present")
        for states in errors.states
    ]
    verdicts = judge_by_paper(errors.E, thresholds, rig.triples, rig.sensors, missing, rig.fallback)
    rows = zip(errors.frames.tolist(), errors.stamps_ns.tolist(), verdicts, strict=True)
    store.write_judgement(JudgementRecord(measurement_id, "algorithm2", thresholds, RULES, WHEN), rows)


def robust_judging(rig, r, drives):
    """The system of a whole rig, and the thresholds that so many synthetic drives teach."""
    clean = tuple(
        CleanFrames(
            f"{drive:064x}",
            START_NS + PERIOD_NS * np.arange(20),
            {},
            {one: np.full(20, 0.05) + 0.002 * np.arange(20) for one in rig_sensor_checks(rig)},
            {},
        )
        for drive in range(drives)
    )
    system = System(rig_sensor_checks(rig), rig.triples, rig.sensors, rig.fallback)
    return system, robust_thresholds(Calibration("c" * 64, rig.kind, PROCEDURE, clean), system, Decimal(r))


def _judge_robust(store, rig, measurement_id, r, drives):
    system, thresholds = robust_judging(rig, r, drives)
    stored = store.load_statistics(measurement_id)
    present = stored.states == SensorState.PRESENT
    series = FrameSeries.of_recording(stored.stamps_ns, stored.statistics, present, stored.fingerprints, {})
    rows = zip(stored.frames.tolist(), stored.stamps_ns.tolist(), judge_frames(series, system, thresholds), strict=True)
    store.write_judgement(JudgementRecord(measurement_id, "robust", thresholds, RULES, WHEN), rows)


def _picture(rig):
    grey = np.tile(np.linspace(0, 255, 621).astype(np.uint8), (187, 1))
    mask = np.zeros((187, 621, 4), np.uint8)
    mask[60:120, 200:300] = (0, 110, 255, 150)
    views = {camera.number: cv2.imencode(".jpg", grey)[1].tobytes() for camera in rig.cameras}
    return views, cv2.imencode(".png", mask)[1].tobytes()
