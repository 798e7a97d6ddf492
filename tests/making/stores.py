"""Small stores, made with the store's own writers."""

from datetime import UTC, datetime, timedelta
from decimal import Decimal

import numpy as np

from auditor.model.calibration import Thresholds
from auditor.model.checks import rig_sensor_checks
from auditor.model.fault_features import COLUMNS
from auditor.model.frames import Presence, SensorState, SkippedFrame
from auditor.model.measurement import Counts, Coverage, Measurement, Procedure, Statistic
from auditor.model.rig import Camera, Lidar, Rig
from auditor.model.verdict import Verdict, VerdictKind
from auditor.store.evaluation_tables import CaseFeatures
from auditor.store.records import JudgementRecord, JudgingRules, MeasurementRecord, RecordingRecord
from auditor.store.store import Store

PERIOD_NS = 100_000_000
RULES = JudgingRules("d" * 12, "{}", "0.0", z_offset=0.02, z_range=(-4.0, 12.0))
PROCEDURE = Procedure("sgbm", '{"half":true}')
NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
KINDS = {
    "c": VerdictKind.CLEAN,
    "u": VerdictKind.UNIDENTIFIED,
    "n": VerdictKind.NOT_AUDITABLE,
    "s": VerdictKind.SUSPECT,
}


def make_rig(n=3, *, lidar=True, name="cam", focal_px=700.0):
    def camera(number):
        projection = np.array([[focal_px, 0, 600, 0], [0, focal_px, 180, 0], [0, 0, 1, 0]])
        projection[0, 3] = focal_px * 0.3 * (number - 1)
        return Camera(number, f"{name}{number}", f"/{name}{number}", 1242, 375, projection)

    return Rig(Lidar("velo", "/velo", np.eye(4)) if lidar else None, tuple(camera(k) for k in range(1, n + 1)))


def make_measurement(rig, number, errors=None, *, statistics=(), missing=(), stamp_ns=None):
    """A frame whose gated E of each triple, in thousandths, is `errors`; its plain E is half of that.

    Errors that end before the fallback leave it unmeasured.

    `statistics` are those of the rig's first sensor checks; sensors there have fingerprints of their own in each frame.
    """
    errors = [10] * len(rig.triples) if errors is None else list(errors)
    errors += [None] * (len(rig.measured_triples) - len(errors)) if len(errors) == len(rig.triples) else []
    presence = {s: Presence(SensorState.MISSING if s in missing else SensorState.PRESENT, 0) for s in rig.sensors}
    counts = tuple(None if E is None else Counts(2000, E, 1000, E, 0) for E in errors)
    looked = {"compared_share": 0.875, "compared_by_two_share": 0.75}
    coverage = {s: Coverage(0.25, 0.5, 0.125, **looked) if s else Coverage(returns=1000 + number) for s in rig.sensors}
    shares = dict(zip(rig_sensor_checks(rig), statistics, strict=False))
    prints = {s: 10 * number + s for s in rig.sensors if s not in missing}
    return Measurement(
        number,
        number * PERIOD_NS if stamp_ns is None else stamp_ns,
        presence,
        counts,
        coverage,
        shares=shares,
        fingerprints=prints,
    )


def part_columns(rig, recording, experiment, *, drawn=3, name=None, chunk=0, synthetic=False):
    """What all parts of evaluations are known by; clean frames are not drawn."""
    drawn = None if experiment == "clean" else drawn
    return {
        "recording_id": recording * 64,
        "name": name or f"{recording}.mcap",
        "synthetic": synthetic,
        "rig_id": rig.rig_id,
        "procedure": PROCEDURE,
        "experiment": experiment,
        "seed": drawn,
        "draws": drawn,
        "chunk": chunk,
    }


def make_features(rig, frame, *, late=(), missing=()):
    """The fault features of a case: none, except for cameras whose pairs would be on their rows a frame earlier."""
    pairs, columns = rig.pairs, len(COLUMNS)
    features = [None] * (columns * len(pairs))
    for place, pair in enumerate(pairs):
        for side, camera in zip(("lagged_i", "lagged_k"), pair, strict=True):
            values = {"row_aligned": 0.5, "offset_share": 0.5, side: 1.0 if camera in late else 0.25}
            for name, value in values.items():
                features[place * columns + COLUMNS.index(name)] = value
    return CaseFeatures(
        present=[s not in missing for s in rig.sensors],
        fingerprint=[None if s in missing else 10 * frame + s for s in rig.sensors],
        brightness={
            "level": [None if s == 0 else 100.0 for s in rig.sensors],
            "saturated_share": [None if s == 0 else 0.0 for s in rig.sensors],
        },
        fault_features=features,
        fault_features_after=features,
    )


def new_store(folder):
    return Store.open(folder / "audit", create=True)


def add_measurement(store, rig, frames, *, recording="a", name=None, clock="relative", **record):
    """A recording, its rig, and its finished measurement; returns the id of the measurement."""
    recording_id = recording * 64
    store.write_recording(
        RecordingRecord(recording_id, name or f"{recording}.mcap", f"/logs/{recording}.mcap", clock=clock)
    )
    store.write_rig(rig)
    return add_frames(store, rig, recording_id, frames, **record)


def add_frames(store, rig, recording_id, frames, *, poses=(), **record):
    settings = {"procedure": PROCEDURE, "balance": (), "versions": {}, "measured_at": NOON, "seconds": 1.0, **record}
    measurement = MeasurementRecord(recording_id, rig.rig_id, **settings)
    with store.frames_writer(measurement.measurement_id, rig) as writer:
        for frame in frames:
            if isinstance(frame, SkippedFrame):
                writer.skip(frame)
            else:
                # Tests give statistics as shares, whatever the check.
                writer.add(frame, [frame.shares.get(one) for one in rig_sensor_checks(rig)])
        for pose in poses:
            writer.add_pose(pose)
        writer.commit(measurement)
    return measurement.measurement_id


def make_thresholds(rig, theta=0.1, *, r="0", calibration_id="c" * 32, statistic=Statistic.GATED, resolvable=True):
    return Thresholds(
        calibration_id,
        statistic,
        Decimal(r),
        theta=dict.fromkeys(rig.triples, theta),
        samples=dict.fromkeys(rig.triples, 100),
        resolvable=resolvable,
    )


def add_judgement(
    store, rig, measurement_id, kinds, *, minutes=0, stamps=None, scores=None, method="algorithm2", **thresholds
):
    """Verdicts from one character a frame: c, u, n, s, or the number of the one attacked sensor; ' ' for none."""
    record = JudgementRecord(
        measurement_id, method, make_thresholds(rig, **thresholds), RULES, judged_at=NOON + timedelta(minutes=minutes)
    )
    verdicts = [
        (
            frame,
            stamps[frame] if stamps else frame * PERIOD_NS,
            make_verdict(rig, kind, scores[frame] if scores else 0.1),
        )
        for frame, kind in enumerate(kinds)
        if kind != " "
    ]
    store.write_judgement(record, verdicts)
    return record.judgement_id


def make_verdict(rig, kind, gap=0.1):
    e = "0" * len(rig.triples)
    if kind.isdigit():
        return Verdict(VerdictKind.ATTACKED, e, attacked=(int(kind),), named=(int(kind),), gap=gap)
    return Verdict(KINDS[kind], e, gap=gap, reason="a reason" if kind in "ns" else "")


def skip(number, reason="no LiDAR", sensor=0):
    return SkippedFrame(number, number * PERIOD_NS, reason, sensor)
