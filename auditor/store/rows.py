"""Records as rows of their tables, and rows as records."""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from datetime import UTC
from typing import Any

from auditor.model.calibration import Marks, Thresholds
from auditor.model.checks import rig_sensor_checks
from auditor.model.coverage import TimeCoverage, TopicCoverage, TopicState
from auditor.model.frames import FramePose, TopicBalance
from auditor.model.measurement import Procedure, Statistic
from auditor.model.rig import Rig
from auditor.model.rig_kind import Similarity
from auditor.model.verdict import FINDINGS, Alternative, AttackLabel, Evidence, FaultHypothesis, Verdict, VerdictKind
from auditor.store.records import (
    DIGITS_OF_R,
    GivenLabel,
    JudgementRecord,
    MeasurementRecord,
    RecordingRecord,
    Sighting,
    StoredJudgement,
    StoredMeasurement,
    rig_kind_fields,
    to_utc,
)
from auditor.store.schema import SCHEMA_VERSION
from auditor.store.tables import Row

_TIME_FIELDS = tuple(field.name for field in fields(TimeCoverage))


def recording_row(recording: RecordingRecord) -> Row:
    """The row of a recording."""
    sightings = [
        {**vars(one), "seen_at": one.seen_at and to_utc(one.seen_at), "measurements": list(one.measurements)}
        for one in recording.sightings
    ]
    return {
        **vars(recording),
        "files": list(recording.files),
        "damage": list(recording.damage),
        "sightings": sightings,
        "conflicts": None if recording.conflicts is None else list(recording.conflicts),
    }


def stored_recording(row: Mapping[str, Any]) -> RecordingRecord:
    """The recording of a row; rows of before sightings were kept have the one of their name and path."""
    sightings = row["sightings"] or [{"name": row["name"], "path": row["path"]}]
    return RecordingRecord(
        **{
            **row,
            "files": tuple(row["files"]),
            "damage": tuple(row["damage"]),
            "sightings": tuple(map(_sighting, sightings)),
            "conflicts": None if row["conflicts"] is None else tuple(row["conflicts"]),
        }
    )


def _sighting(fields: Mapping[str, Any]) -> Sighting:
    seen_at, measurements = fields.get("seen_at"), fields.get("measurements")
    return Sighting(
        fields["name"],
        fields["path"],
        seen_at and seen_at.replace(tzinfo=UTC),
        fields.get("stamp"),
        tuple(measurements or ()),
    )


def label_rows(recording_id: str, labels: Iterable[AttackLabel], rig: Rig | None) -> list[Row]:
    """The rows of what a recording itself says was attacked; `rig` numbers the sensors."""
    sensors = {rig.topic(sensor): sensor for sensor in rig.sensors} if rig else {}
    return [
        {
            "recording_id": recording_id,
            "topic": label.topic,
            "sensor": sensors.get(label.topic),
            "attack": label.attack,
            "from_ns": label.from_ns,
            "to_ns": label.to_ns,
            "parameters": json.dumps(label.parameters, sort_keys=True),
        }
        for label in labels
    ]


def stored_label(row: Mapping[str, Any]) -> AttackLabel:
    """The label of a row."""
    values = {name: row[name] for name in ("topic", "attack", "from_ns", "to_ns")}
    return AttackLabel(**values, parameters=json.loads(row["parameters"]))


def given_label_rows(recording_id: str, labels: Iterable[GivenLabel]) -> list[Row]:
    """The rows of what persons said of a recording."""
    return [{**vars(label), "recording_id": recording_id, "given_at": to_utc(label.given_at)} for label in labels]


def stored_given_label(row: Mapping[str, Any]) -> GivenLabel:
    """The given label of a row."""
    given_at = row["given_at"].replace(tzinfo=UTC)
    return GivenLabel(given_at, **{name: row[name] for name in row if name not in {"given_at", "recording_id"}})


def rig_row(rig: Rig) -> Row:
    """The row of a rig."""
    return {
        "rig_id": rig.rig_id,
        "kind": str(rig.kind),
        "rig_kind": rig_kind_fields(rig.kind),
        "n": rig.n,
        "sensors": [{"sensor": s, "name": rig.name(s), "topic": rig.topic(s)} for s in rig.sensors],
        "reference_cameras": list(rig.references),
        "max_attacked": rig.max_attacked,
        "description": rig.description,
    }


def triple_rows(rig: Rig) -> Iterator[Row]:
    """The rows of a rig's measured triples, in their order: the fallback is the last."""
    for position, triple in enumerate(rig.measured_triples, start=1):
        yield {
            "rig_id": rig.rig_id,
            "position": position,
            **triple._asdict(),
            "baseline_m": rig.baseline_m(triple.j, triple.k),
            "fallback": triple == rig.fallback,
        }


def sensor_check_rows(rig: Rig) -> Iterator[Row]:
    """The rows of a rig's sensor checks, in their order."""
    for position, sensor_check in enumerate(rig_sensor_checks(rig), start=1):
        yield {
            "rig_id": rig.rig_id,
            "position": position,
            "check_name": sensor_check.check.value,
            "sensor": sensor_check.sensor,
            "others": list(sensor_check.others),
        }


def measurement_row(measurement: MeasurementRecord) -> Row:
    """The row of a measurement, but for what its frames decide."""
    return {
        **vars(measurement),
        **vars(measurement.procedure),
        "measurement_id": measurement.measurement_id,
        "balance": [{**vars(topic), "skipped": dict(sorted(topic.skipped.items()))} for topic in measurement.balance],
        "coverage": None if measurement.coverage is None else [_coverage_fields(one) for one in measurement.coverage],
        "pose_topics": None if measurement.pose_topics is None else [vars(topic) for topic in measurement.pose_topics],
        "versions": dict(sorted(measurement.versions.items())),
        "measured_at": to_utc(measurement.measured_at),
        "schema_version": SCHEMA_VERSION,
    }


def pose_row(measurement_id: str, placed: FramePose) -> Row:
    """The row of one frame and topic."""
    row = {**vars(placed), **vars(placed.pose), "measurement_id": measurement_id}
    del row["pose"]
    return row


def _coverage_fields(topic: TopicCoverage) -> Row:
    time = vars(topic.time) if topic.time else dict.fromkeys(_TIME_FIELDS)
    return {**{name: value for name, value in vars(topic).items() if name != "time"}, **time}


def _coverage_of(row: Mapping[str, Any]) -> TopicCoverage:
    topic = {name: value for name, value in row.items() if name not in _TIME_FIELDS}
    times = {name: row[name] for name in _TIME_FIELDS}
    time = None if times["held_ns"] is None else TimeCoverage(**times)
    return TopicCoverage(**{**topic, "state": TopicState(topic["state"]), "time": time})


_OF_MEASUREMENTS = tuple(one.name for one in fields(StoredMeasurement) if one.name != "procedure")
_PROCEDURE = tuple(one.name for one in fields(Procedure))

MEASUREMENT_COLUMNS = (*_OF_MEASUREMENTS, *_PROCEDURE)
"""What `stored_measurement` needs of a row."""


def stored_measurement(row: Mapping[str, Any]) -> StoredMeasurement:
    """The measurement of a row."""
    same = {name: row[name] for name in _OF_MEASUREMENTS}
    others = {
        "procedure": Procedure(*(row[name] for name in _PROCEDURE)),
        "balance": tuple(TopicBalance(**topic) for topic in row["balance"]),
        "measured_at": row["measured_at"].replace(tzinfo=UTC),
        "coverage": None if row["coverage"] is None else tuple(_coverage_of(one) for one in row["coverage"]),
        **{name: tuple(row[name] or ()) for name in ("damage", "calibration_warnings", "remarks")},
    }
    return StoredMeasurement(**{**same, **others})


def judgement_row(judgement: JudgementRecord, rig: Rig) -> Row:
    """The row of a judgement, but for what its verdicts decide."""
    thresholds = judgement.thresholds
    return {
        "judgement_id": judgement.judgement_id,
        "measurement_id": judgement.measurement_id,
        "calibration_id": thresholds.calibration_id,
        "method": str(judgement.method),
        "r": round(thresholds.r, DIGITS_OF_R),
        "transferred": thresholds.transferred,
        "judged_at": to_utc(judgement.judged_at),
        "recounted": judgement.recounted,
        "judged_with": list(judgement.judged_with),
        "absent_sensors": list(judgement.absent_sensors),
        "calibrated_as": judgement.calibrated_as and list(judgement.calibrated_as),
        "similarity": judgement.marks.similarity.value,
        "in_sample": judgement.marks.in_sample,
        "other_lidar": judgement.marks.other_lidar,
        "measured_otherwise": judgement.marks.measured_otherwise or None,
        "judging_version": judgement.rules.judging_version,
        "auditor_version": judgement.rules.auditor_version,
        "rules": judgement.rules.digest,
        "judging_settings": judgement.rules.settings,
        "schema_version": SCHEMA_VERSION,
        **_threshold_columns(judgement, rig),
    }


def _threshold_columns(judgement: JudgementRecord, rig: Rig) -> Row:
    thresholds, rules = judgement.thresholds, judgement.rules
    if isinstance(thresholds, Thresholds):
        return {
            "resolvable": thresholds.resolvable,
            "statistic": thresholds.statistic.value,
            "theta": [thresholds.theta.get(triple) for triple in rig.measured_triples],
            "samples": [thresholds.samples.get(triple) for triple in rig.measured_triples],
            "drives": None,
        }
    of_checks = [thresholds.expected.get(one) for one in rig_sensor_checks(rig)]
    return {
        "resolvable": True,
        "statistic": None,
        "check_mean": [one and one.mean for one in of_checks],
        "check_deviation": [one and one.deviation for one in of_checks],
        "check_samples": [one and one.samples for one in of_checks],
        "z_limit": thresholds.limit,
        "z_offset": rules.z_offset,
        "z_range": list(rules.z_range),
        "drives": thresholds.drives,
        "score_threshold": thresholds.evidence_limit,
        "incidents_per_hour": thresholds.incidents_per_hour,
    }


def _marks(row: Mapping[str, Any]) -> Marks:
    """The marks of a judgement; older rows say of them whether it was transferred, and no more."""
    unknown = Similarity.OTHER if row["transferred"] else Similarity.SAME
    return Marks(
        similarity=Similarity(row["similarity"]) if row["similarity"] else unknown,
        in_sample=bool(row["in_sample"]),
        other_lidar=bool(row["other_lidar"]),
        measured_otherwise=row["measured_otherwise"] or "",
    )


_OF_JUDGEMENTS = tuple(one.name for one in fields(StoredJudgement) if one.name not in {"counts", "marks"})

JUDGEMENT_COLUMNS = (
    *(*_OF_JUDGEMENTS, *VerdictKind),
    *("similarity", "in_sample", "other_lidar", "measured_otherwise"),
)
"""What `stored_judgement` needs of a row."""


def stored_judgement(row: Mapping[str, Any]) -> StoredJudgement:
    """The judgement of a row."""
    counts = {kind: row[kind.value] for kind in VerdictKind}
    others = {
        "statistic": row["statistic"] and Statistic(row["statistic"]),
        "r": row["r"].normalize(),
        "judged_at": row["judged_at"].replace(tzinfo=UTC),
        "counts": counts,
        "in_incidents": sum(counts[one] for one in FINDINGS) if row["in_incidents"] is None else row["in_incidents"],
        "in_alerts": row["in_alerts"] or 0,
        "recounted": bool(row["recounted"]),
        "marks": _marks(row),
        **{name: tuple(row[name] or ()) for name in ("absent_sensors", "judged_with")},
    }
    return StoredJudgement(**{**{name: row.get(name) for name in _OF_JUDGEMENTS}, **others})


def verdict_columns(
    judgement_id: str, measurement_id: str, judged: Sequence[tuple[int, int, Verdict]]
) -> dict[str, Sequence[object]]:
    """The columns of the verdicts on some frames, each with its frame number and stamp."""
    verdicts = [verdict for _, _, verdict in judged]
    findings = [verdict.finding for verdict in verdicts]
    return {
        "judgement_id": [judgement_id] * len(judged),
        "measurement_id": [measurement_id] * len(judged),
        "frame": [frame for frame, _, _ in judged],
        "stamp_ns": [stamp_ns for _, stamp_ns, _ in judged],
        "e": [one.e for one in verdicts],
        "kind": [one.kind for one in verdicts],
        "attacked": [one.attacked for one in verdicts],
        "named": [one.named for one in verdicts],
        "out_of_system": [one.out_of_system for one in verdicts],
        "gap": [one.gap for one in verdicts],
        "reason": [one.reason or None for one in verdicts],
        "evidence": [_as_dicts(one.evidence) for one in verdicts],
        "alternatives": [_as_dicts(one.alternatives) for one in verdicts],
        "causes": [_as_dicts(one.causes) for one in verdicts],
        "finding": [one and one.kind for one in findings],
        "finding_attacked": [one and one.attacked for one in findings],
        "posterior": [one.posterior for one in verdicts],
        "log10_ratio": [one.log10_ratio for one in verdicts],
        "event": [one and one.event for one in findings],
        "alert": [one and one.alert for one in findings],
        "event_added": [one and one.added for one in findings],
    }


def _as_dicts(entries: Sequence[Evidence | Alternative | FaultHypothesis]) -> list[dict[str, Any]] | tuple[()]:
    """Most frames have none."""
    return [entry._asdict() for entry in entries] if entries else ()
