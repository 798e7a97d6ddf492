"""What a page draws of one recording: coverage of its sensors, verdicts over time, incidents with their pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import SensorState
from auditor.model.measurement import Statistic
from auditor.model.pictures import Pictures
from auditor.model.verdict import Method
from auditor.reporting.incident.audits import Audit, mapping
from auditor.reporting.incident.images import incident_views
from auditor.reporting.incident.page import IncidentPart, RecordingPart, SensorLine, Truth
from auditor.reporting.incident.provenance import Provenance
from auditor.reporting.incident.scores import sensor_scores
from auditor.reporting.incident.timeline import Curve, Measured, Timeline
from auditor.store.export import rows_of
from auditor.store.queries import run_query
from auditor.store.records import FrameErrors
from auditor.store.store import Store
from auditor.store.tables import read_rows, read_table

COVERAGE = ("saturated_share", "textureless_share", "unmatched_share", "returns")


class Drawing:
    """One recording in full. What all of its incidents share is read once: `part` is the recording without them."""

    def __init__(self, store: Store, audit: Audit, part: RecordingPart) -> None:
        self._store = store
        self._measurement_id = audit.measurement.measurement_id
        statistic = (audit.judgement and audit.judgement.statistic) or Statistic.GATED
        self._errors = store.load_errors(self._measurement_id, statistic)
        truths = _truths(store, audit)
        part = replace(part, sensors=_coverage(store, audit, self._errors, part.sensors), truths=truths)
        self._timeline = None
        if audit.judgement is not None and len(self._errors.frames):
            frames = rows_of(run_query(store, "report_frames", {"measurement": self._measurement_id}))
            measured = _measured(store, audit, part.provenance, self._errors, frames)
            self._timeline = Timeline(part, measured, frames)
            part = replace(
                part,
                overview=self._timeline.overview(),
                agreement=self._timeline.agreement() if truths else None,
                remarks=self._timeline.remarks(),
            )
        self.part = part

    def drawn(self, incident: IncidentPart, pictures: Pictures) -> IncidentPart:
        """An incident of the recording with its figure, its frames' verdicts and its pictures."""
        if self._timeline is None:
            return incident
        views = incident_views(self._store, self._measurement_id, self._errors, incident, pictures)
        return replace(self._timeline.drawn(incident), views=views)


def _measured(
    store: Store, audit: Audit, by: Provenance, errors: FrameErrors, frames: Sequence[Mapping[str, Any]]
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
    # what was measured by an earlier version lacks the checks that came since: they stand at the end
    checks = rig_sensor_checks(audit.rig)[: len(z) // max(len(numbers), 1)]
    missing = [absent.get(number, frozenset()) for number in numbers.tolist()]
    values = sensor_scores(z.reshape(len(numbers), len(checks)), checks, audit.rig.sensors, missing)
    return Measured(numbers, values, [Curve("S", (sensor,), by.limit, "limit") for sensor in audit.rig.sensors])


def _truths(store: Store, audit: Audit) -> tuple[Truth, ...]:
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
            parameters=mapping(row.get("parameters") or "{}"),
        )
        for row in (*carried, *given)
    )


def _coverage(store: Store, audit: Audit, errors: FrameErrors, sensors: Sequence[SensorLine]) -> tuple[SensorLine, ...]:
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
