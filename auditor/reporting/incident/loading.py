"""From the store to the incident page: no recording is needed."""

import json
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import chain, count
from typing import Any

import numpy as np
from numpy.typing import NDArray

import auditor
from auditor.errors import StoreError
from auditor.model.checks import counting_checks, rig_sensor_checks
from auditor.model.frames import SensorState
from auditor.model.measurement import Statistic
from auditor.model.pictures import Pictures
from auditor.model.rig import Rig
from auditor.model.verdict import Method, VerdictKind
from auditor.reporting.incident.images import incident_views
from auditor.reporting.incident.page import (
    EDGE,
    Clock,
    IncidentPage,
    IncidentPart,
    RecordingPart,
    SensorLine,
    Truth,
)
from auditor.reporting.incident.provenance import CheckLine, Provenance, ThresholdLine
from auditor.reporting.incident.scores import sensor_scores
from auditor.reporting.incident.timeline import Curve, Measured, Timeline
from auditor.store.export import rows_of
from auditor.store.queries import run_query
from auditor.store.records import FrameErrors, RecordingRecord, StoredJudgement, StoredMeasurement
from auditor.store.store import Store
from auditor.store.tables import read_rows, read_table

MOST_SECTIONS = 12
"""Recordings that are shown in full; of more, those with the most frames raised."""

MOST_DRAWN = 6
"""Incidents that are drawn; of more, those with named sensors first, then the longest."""

COVERAGE = ("saturated_share", "textureless_share", "unmatched_share", "returns")


_CalibrationRecordings = Mapping[str, tuple[str, ...]]
"""The recordings that each calibration was made from, by its id."""


@dataclass(frozen=True, eq=False)
class _Audit:
    """One measurement of a recording, with its current judgement."""

    recording: RecordingRecord
    measurement: StoredMeasurement
    judgement: StoredJudgement | None
    rig: Rig


def load_page(store: Store, recording: str | None = None, pictures: Pictures = Pictures.INCIDENTS) -> IncidentPage:
    """Everything that the page shows of one recording (by name, id or first digits of its id), or of all.

    Raises StoreError where the store has no such recording, or was not measured.
    """
    called = store.recordings_called(recording) if recording is not None else []
    if len(called) == 1:
        recording = called[0].recording_id  # queries do not know its other names
    calibration_recordings = store.calibration_recordings()
    audits = _audits(store, recording, calibration_recordings)
    outlines = [_outline(store, audit, calibration_recordings) for audit in audits]
    numbered = _numbered(outlines, _incidents(store, recording))
    shown = {part.provenance.measurement_id for part in sorted(numbered, key=lambda part: -part.raised)[:MOST_SECTIONS]}
    drawn = {incident.number for _, incident in _page(store, numbered).incidents[:MOST_DRAWN]}
    full = [
        _in_full(store, audit, part, drawn, pictures) if part.provenance.measurement_id in shown else part
        for audit, part in zip(audits, numbered, strict=True)
    ]
    return _page(store, full)


def _page(store: Store, parts: Sequence[RecordingPart]) -> IncidentPage:
    return IncidentPage(
        made_at=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        auditor_version=auditor.__version__,
        store=str(store.folder),
        recordings=tuple(parts),
    )


def _audits(store: Store, wanted: str | None, calibration_recordings: _CalibrationRecordings) -> list[_Audit]:
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
        _Audit(
            recordings[measurement.recording_id],
            measurement,
            judgements.get(measurement.measurement_id),
            store.rig(measurement.rig_id),
        )
        for measurement in latest.values()
    ]
    if wanted is None:
        audits = _without_calibration(audits, calibration_recordings)
    return sorted(audits, key=lambda audit: (audit.recording.from_ns or 0, audit.recording.name))


def _without_calibration(audits: list[_Audit], calibration_recordings: _CalibrationRecordings) -> list[_Audit]:
    """Leave out what was only calibrated on: its audit was not asked for. All stay where that would leave none."""
    taught = set(chain.from_iterable(calibration_recordings.values()))
    asked_for = [audit for audit in audits if audit.judgement or audit.recording.recording_id not in taught]
    return asked_for or audits


def _outline(store: Store, audit: _Audit, calibration_recordings: _CalibrationRecordings) -> RecordingPart:
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
        in_incidents=audit.judgement.in_incidents if audit.judgement else 0,
        skipped=audit.measurement.skipped,
        sensors=_sensor_lines(audit.rig),
        triples=audit.rig.measured_triples,
        balance=audit.measurement.balance,
        covered=audit.measurement.coverage or (),
        provenance=_provenance(store, audit, calibration_recordings),
    )


def _called(store: Store, recording_ids: Iterable[str]) -> tuple[str, ...]:
    """The names of recordings, with the beginnings of their ids."""
    there = (store.recording(known) for known in recording_ids if store.has_recording(known))
    return tuple(f"{one.name} ({one.recording_id[:12]})" for one in there)


def _incidents(store: Store, recording: str | None) -> Mapping[str, list[IncidentPart]]:
    """What each measurement has of every incident, as the query of that name finds them."""
    incidents: dict[str, list[IncidentPart]] = {}
    for number, row in enumerate(rows_of(run_query(store, "incidents", {"recording": recording}))):
        for place, part in enumerate(row["parts"], start=1):
            incident = IncidentPart(
                number=number,
                kind=VerdictKind(row["kind"]),
                attacked=tuple(row["attacked"]),
                first_frame=part["first_frame"],
                last_frame=part["last_frame"],
                frames=part["frames"],
                from_ns=part["from_ns"],
                to_ns=part["to_ns"],
                evidence=row["evidence"] or "",
                alternatives=row["alternatives"] or "",
                causes=row["causes"] or "",
                part=place,
                parts=len(row["parts"]),
            )
            incidents.setdefault(part["measurement_id"], []).append(incident)
    return incidents


def _numbered(parts: Sequence[RecordingPart], incidents: Mapping[str, list[IncidentPart]]) -> list[RecordingPart]:
    """The parts with their incidents, numbered through the whole page, from 1; what runs on keeps its number."""
    numbers: defaultdict[int, int] = defaultdict(count(1).__next__)
    return [
        replace(
            part,
            incidents=tuple(
                replace(incident, number=numbers[incident.number])
                for incident in sorted(
                    incidents.get(part.provenance.measurement_id, ()), key=lambda one: (one.from_ns, one.attacked)
                )
            ),
        )
        for part in parts
    ]


def _sensor_lines(rig: Rig) -> tuple[SensorLine, ...]:
    return tuple(SensorLine(sensor, rig.name(sensor), rig.topic(sensor)) for sensor in rig.sensors)


def _provenance(store: Store, audit: _Audit, calibration_recordings: _CalibrationRecordings) -> Provenance:
    measurement, judgement = audit.measurement, audit.judgement
    measured = Provenance(
        measurement_id=measurement.measurement_id,
        rig_id=measurement.rig_id,
        rig_kind=str(audit.rig.kind),
        matcher=measurement.procedure.matcher,
        settings=_mapping(measurement.procedure.settings),
        counting_version=measurement.procedure.counting_version,
        versions=measurement.versions,
    )
    if judgement is None:
        return measured
    (row,) = read_rows("judgements", store.source("judgements", judgement.judgement_id))
    return replace(
        measured,
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


def _threshold_lines(rig: Rig, row: Mapping[str, Any]) -> Iterator[ThresholdLine]:
    """Those of a judgement's row by the paper's method, in the order of triples.

    Judgements of earlier versions know fewer of them: later ones were added at the end.
    """
    if row["method"] != Method.ROBUST:
        for triple, theta, samples in zip(rig.measured_triples, row["theta"], row["samples"], strict=False):
            yield ThresholdLine(triple, theta, samples or 0)


def _check_lines(store: Store, audit: _Audit) -> Iterator[CheckLine]:
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


def _in_full(store: Store, audit: _Audit, part: RecordingPart, drawn: set[int], pictures: Pictures) -> RecordingPart:
    """The part with its coverage, its drawings and its pictures."""
    statistic = (audit.judgement and audit.judgement.statistic) or Statistic.GATED
    errors = store.load_errors(audit.measurement.measurement_id, statistic)
    truths = _truths(store, audit)
    part = replace(part, sensors=_coverage(store, audit, errors, part.sensors), truths=truths)
    if audit.judgement is None or not len(errors.frames):
        return part
    frames = rows_of(run_query(store, "report_frames", {"measurement": audit.measurement.measurement_id}))
    timeline = Timeline(part, _measured(store, audit, part.provenance, errors, frames), frames)
    return replace(
        part,
        overview=timeline.overview(),
        agreement=timeline.agreement() if truths else None,
        remarks=timeline.remarks(),
        incidents=tuple(
            replace(
                timeline.drawn(incident),
                views=incident_views(store, audit.measurement.measurement_id, errors, incident, pictures),
            )
            if incident.number in drawn
            else incident
            for incident in part.incidents
        ),
    )


def _measured(
    store: Store, audit: _Audit, by: Provenance, errors: FrameErrors, frames: Sequence[Mapping[str, Any]]
) -> Measured:
    """What a judgement compared with its thresholds, frame by frame; nothing of those before there was a limit."""
    if by.method != Method.ROBUST:
        curves = [Curve("E", line.triple, line.theta) for line in by.thresholds]
        return Measured(errors.frames, errors.E[:, : len(curves)], curves)
    if by.limit is None:
        return Measured(errors.frames, np.zeros((len(errors.frames), 0)), [])
    scores = run_query(store, "report_scores", {"measurement": audit.measurement.measurement_id})
    z = scores["z"].combine_chunks().flatten().to_numpy(zero_copy_only=False).astype(np.float64)
    absent = {frame["frame"]: frozenset(frame["out_of_system"] or ()) for frame in frames}
    numbers = scores["frame"].to_numpy()
    checks = rig_sensor_checks(audit.rig)
    missing = [absent.get(number, frozenset()) for number in numbers.tolist()]
    values = sensor_scores(z.reshape(len(numbers), len(checks)), checks, audit.rig.sensors, missing)
    return Measured(numbers, values, [Curve("S", (sensor,), by.limit, "limit") for sensor in audit.rig.sensors])


def _truths(store: Store, audit: _Audit) -> tuple[Truth, ...]:
    recording_id = audit.recording.recording_id
    carried = read_rows("labels", store.source("labels", recording_id)) if recording_id in store.ids("labels") else []
    given = [vars(label) for label in store.given_labels(recording_id) if label.attack is not None]
    sensors = {audit.rig.topic(sensor): sensor for sensor in audit.rig.sensors}
    return tuple(
        Truth(
            sensor=sensors.get(row["topic"]),
            topic=row["topic"],
            attack=row["attack"],
            from_ns=row["from_ns"],
            to_ns=row["to_ns"],
            parameters=_mapping(row.get("parameters") or "{}"),
        )
        for row in (*carried, *given)
    )


def _coverage(
    store: Store, audit: _Audit, errors: FrameErrors, sensors: Sequence[SensorLine]
) -> tuple[SensorLine, ...]:
    """Count the states of each sensor and take the medians of its coverage."""
    path = store.source("frames", audit.measurement.measurement_id)
    table = read_table("frames", path, ["skipped", *COVERAGE])
    table = table.filter(table["skipped"].is_null())
    medians: dict[str, list[float | None]] = {}
    for name in COVERAGE:
        values = table[name].combine_chunks().flatten().to_numpy(zero_copy_only=False)
        medians[name] = [_median(column) for column in values.astype(np.float64).reshape(len(table), len(sensors)).T]
    return tuple(
        replace(
            sensor,
            present=int((errors.states[:, place] == SensorState.PRESENT).sum()),
            missing=int((errors.states[:, place] == SensorState.MISSING).sum()),
            damaged=int((errors.states[:, place] == SensorState.DAMAGED).sum()),
            saturated_share=medians["saturated_share"][place],
            textureless_share=medians["textureless_share"][place],
            unmatched_share=medians["unmatched_share"][place],
            returns=medians["returns"][place],
        )
        for place, sensor in enumerate(sensors)
    )


def _median(values: NDArray[np.float64]) -> float | None:
    known = values[~np.isnan(values)]
    return float(np.median(known)) if len(known) else None


def _mapping(text: str) -> dict[str, object]:
    """The entries of a JSON object; JSON of another kind is one entry without a name."""
    value = json.loads(text) if text else {}
    return value if isinstance(value, dict) else {"": value}
