"""Audits of a store: one measurement of a recording with its current judgement, and what a page's tables say of it."""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import chain
from typing import Any

from auditor.errors import StoreError
from auditor.model.checks import counting_checks, rig_sensor_checks
from auditor.model.rig import Rig
from auditor.model.verdict import FINDINGS, Method, VerdictKind
from auditor.reporting.incident.examples import data_uri
from auditor.reporting.incident.page import EDGE, Clock, RecordingPart, SensorLine
from auditor.reporting.incident.provenance import CheckLine, FileLine, Provenance, ThresholdLine
from auditor.reporting.rig_picture import rig_picture
from auditor.reporting.rig_plan import in_lidar_frame
from auditor.store.export import rows_of
from auditor.store.queries import run_query
from auditor.store.records import RecordingRecord, StoredJudgement, StoredMeasurement
from auditor.store.store import Store
from auditor.store.tables import read_rows, read_table

CalibrationRecordings = Mapping[str, tuple[str, ...]]
"""The recordings that each calibration was made from, by its id."""


@dataclass(frozen=True, eq=False)
class Audit:
    """One measurement of a recording, with its current judgement."""

    recording: RecordingRecord
    measurement: StoredMeasurement
    judgement: StoredJudgement | None
    rig: Rig


def audits_of(store: Store, wanted: str | None, calibration_recordings: CalibrationRecordings) -> list[Audit]:
    """The latest measurement of each rig of each wanted recording, by time of recording."""
    recordings = {
        recording.recording_id: recording
        for recording in (store.recordings() if wanted is None else store.recordings_called(wanted))
        if wanted is not None or recording.superseded_by is None
    }
    if wanted is not None and not recordings:
        raise StoreError(
            f"no recording has the name or id {wanted!r}", where=store.folder, remedy="see auditor query summary"
        )
    latest: dict[tuple[str, str], StoredMeasurement] = {}
    for measurement in sorted(store.measurements(), key=lambda one: one.measured_at):
        if measurement.recording_id in recordings:
            latest[measurement.recording_id, measurement.rig_id] = measurement
    if not latest:
        raise StoreError("nothing was measured", where=store.folder, remedy="run auditor scan first")
    judgements = store.current_judgements()
    audits = [
        audit_of(store, measurement, recordings[measurement.recording_id], judgements)
        for measurement in latest.values()
    ]
    if wanted is None:
        audits = _without_calibration(audits, calibration_recordings)
    return sorted(audits, key=lambda audit: (audit.recording.from_ns or 0, audit.recording.name))


def audit_of(
    store: Store,
    measurement: StoredMeasurement,
    recording: RecordingRecord,
    judgements: Mapping[str, StoredJudgement],
) -> Audit:
    """The audit of a measurement; `judgements` are the current ones by measurement."""
    judgement = judgements.get(measurement.measurement_id)
    return Audit(recording, measurement, judgement, store.rig(measurement.rig_id))


def _without_calibration(audits: list[Audit], calibration_recordings: CalibrationRecordings) -> list[Audit]:
    """Leave out what was only calibrated on: its audit was not asked for. All stay where that would leave none."""
    taught = set(chain.from_iterable(calibration_recordings.values()))
    asked_for = [audit for audit in audits if audit.judgement or audit.recording.recording_id not in taught]
    return asked_for or audits


def outline(store: Store, audit: Audit, calibration_recordings: CalibrationRecordings) -> RecordingPart:
    """What the tables at the top of the page need."""
    ticks = read_table("frames", store.source("frames", audit.measurement.measurement_id), ["stamp_ns", "skipped"])
    stamps_ns = [tick["stamp_ns"] for tick in ticks.to_pylist() if tick["skipped"] != EDGE]
    origin_ns, to_ns = (min(stamps_ns), max(stamps_ns)) if stamps_ns else (0, 0)
    counts = audit.judgement.counts if audit.judgement else {}
    recording = audit.recording
    return RecordingPart(
        recording_id=recording.recording_id,
        name=recording.name,
        vehicle=recording.vehicle,
        date=str(recording.date) if recording.date else None,
        drive=recording.drive,
        damage=tuple(dict.fromkeys((*recording.damage, *audit.measurement.damage))),
        other_names=recording.other_names,
        paths=tuple(dict.fromkeys(one.path for one in recording.sightings)),
        superseded_by=_called(store, [recording.superseded_by] if recording.superseded_by else []),
        conflicts=_called(store, recording.conflicts or ()),
        clock=Clock(origin_ns, utc=recording.clock == "utc"),
        measured=audit.measurement.measured,
        to_ns=to_ns,
        verdicts={kind: counts[kind] for kind in VerdictKind if counts.get(kind)},
        told=audit.judgement.found if audit.judgement else 0,
        alone=_alone(store, audit.judgement),
        skipped=audit.measurement.skipped,
        sensors=_sensor_lines(audit.rig),
        triples=audit.rig.measured_triples,
        balance=audit.measurement.balance,
        covered=audit.measurement.coverage or (),
        provenance=_provenance(store, audit, calibration_recordings),
        rig_picture=data_uri("svg", rig_picture([in_lidar_frame(audit.rig)]).encode()),
    )


def _alone(store: Store, judgement: StoredJudgement | None) -> int:
    """How many frames with a finding belong to no event; by the paper's method all do."""
    if judgement is None or judgement.method != Method.ROBUST:
        return 0
    verdicts = read_table("verdicts", store.source("verdicts", judgement.judgement_id), ["kind", "finding"])
    return sum(row["kind"] in FINDINGS and row["finding"] is None for row in verdicts.to_pylist())


def _called(store: Store, recording_ids: Iterable[str]) -> tuple[str, ...]:
    """The names of recordings, with the beginnings of their ids."""
    there = (store.recording(known) for known in recording_ids if store.has_recording(known))
    return tuple(f"{one.name} ({one.recording_id[:12]})" for one in there)


def _sensor_lines(rig: Rig) -> tuple[SensorLine, ...]:
    return tuple(
        SensorLine(sensor, rig.name(sensor), rig.topic(sensor), "LiDAR" if sensor in rig.lidars else "camera")
        for sensor in rig.sensors
    )


def _provenance(store: Store, audit: Audit, calibration_recordings: CalibrationRecordings) -> Provenance:
    measurement, judgement = audit.measurement, audit.judgement
    measured = Provenance(
        measurement_id=measurement.measurement_id,
        rig_id=measurement.rig_id,
        rig_kind=str(audit.rig.kind),
        matcher=measurement.procedure.matcher,
        settings=mapping(measurement.procedure.settings),
        counting_version=measurement.procedure.counting_version,
        versions=measurement.versions,
    )
    if judgement is None:
        return measured
    (row,) = read_rows("judgements", store.source("judgements", judgement.judgement_id))
    (measured_row,) = read_rows("measurements", store.source("measurements", measurement.measurement_id))
    return replace(
        measured,
        judgement_id=judgement.judgement_id,
        judged_at=judgement.judged_at,
        judging_version=row["judging_version"],
        judged_with=row["auditor_version"] or "",
        rules=row["rules"] or "",
        judging_settings=mapping(row["judging_settings"] or ""),
        files=(*_files(measured_row), *_files(row)),
        calibration_id=judgement.calibration_id,
        calibrated_on=calibration_recordings.get(judgement.calibration_id, ()),
        method=judgement.method,
        statistic=judgement.statistic,
        r=judgement.r,
        resolvable=judgement.resolvable,
        transferred=judgement.transferred,
        marks=judgement.marks,
        recounted=judgement.recounted,
        incidents_per_hour=row["incidents_per_hour"],
        score_threshold=row["score_threshold"],
        limit=row["z_limit"],
        drives=judgement.drives,
        thresholds=tuple(_threshold_lines(audit.rig, row)),
        checks=tuple(_check_lines(store, audit)),
    )


def _files(row: Mapping[str, Any]) -> Iterator[FileLine]:
    """The files that the row of a manifest finishes."""
    return (FileLine(one["path"], one["size"], one["sha256"]) for one in row["outputs"] or ())


def _threshold_lines(rig: Rig, row: Mapping[str, Any]) -> Iterator[ThresholdLine]:
    """Those of a judgement's row by the paper's method, in the order of triples.

    Judgements of earlier versions know fewer of them: later ones were added at the end.
    """
    if row["method"] != Method.ROBUST:
        for triple, theta, samples in zip(rig.measured_triples, row["theta"], row["samples"], strict=False):
            yield ThresholdLine(triple, theta, samples or 0)


def _check_lines(store: Store, audit: Audit) -> Iterator[CheckLine]:
    """The checks that count in a frame that lacks no sensor, by the robust method."""
    counting = counting_checks(rig_sensor_checks(audit.rig), frozenset())
    rows = rows_of(run_query(store, "report_thresholds", {"measurement": audit.measurement.measurement_id}))
    for row in rows:
        if row["position"] - 1 in counting:
            yield CheckLine(
                row["check_name"],
                row["sensor"],
                tuple(row["others"]),
                row["expected"],
                row["theta"],
                row["samples"] or 0,
            )


def mapping(text: str) -> dict[str, object]:
    """The entries of a JSON object; JSON of another kind is one entry without a name."""
    value = json.loads(text) if text else {}
    return value if isinstance(value, dict) else {"": value}
