"""What a page draws of one recording: coverage of its sensors, verdicts over time, incidents with their pictures."""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from auditor.model.checks import rig_sensor_checks
from auditor.model.measurement import REGION_STEP, Region, Statistic
from auditor.model.pictures import Pictures
from auditor.model.rig import LIDAR
from auditor.model.verdict import Method, VerdictKind
from auditor.reporting.incident.audits import Audit, mapping
from auditor.reporting.incident.cameras_beside import beside, camera_rigs, named_by_pasts
from auditor.reporting.incident.contradictions import contradictions, largest_things
from auditor.reporting.incident.examples import data_uri
from auditor.reporting.incident.page import DamagedPortion, IncidentPart, PageView, RecordingPart, SensorLine, Truth
from auditor.reporting.incident.provenance import Provenance
from auditor.reporting.incident.timeline import ThresholdComparison, Timeline, sensor_scores, with_evidence
from auditor.reporting.plots import Series
from auditor.store.export import rows_of
from auditor.store.queries import run_query, run_sql
from auditor.store.records import FrameErrors
from auditor.store.store import Store
from auditor.store.tables import read_rows

_COVERAGE = """
    SELECT
        sensor,
        count(*) FILTER (state = 'present') AS present,
        count(*) FILTER (state = 'missing') AS missing,
        count(*) FILTER (state = 'damaged') AS damaged,
        median(saturated_share) AS saturated_share,
        median(textureless_share) AS textureless_share,
        median(returns) AS returns,
        any_value(measurement.compared_share[position]) AS compared_share,
        any_value(measurement.compared_by_two_share[position]) AS compared_by_two_share
    FROM sensors
    JOIN stored_measurements AS measurement USING (measurement_id)
    WHERE measurement_id = '{}'
    GROUP BY sensor
"""


class Drawing:
    """One recording in full. What all of its incidents share is read once: `part` is the recording without them."""

    def __init__(self, store: Store, audit: Audit, part: RecordingPart) -> None:
        self._store = store
        self._measurement_id = audit.measurement.measurement_id
        statistic = (audit.judgement and audit.judgement.statistic) or Statistic.GATED
        self._errors = store.load_errors(self._measurement_id, statistic)
        truths = _truths(store, audit)
        part = replace(part, sensors=_coverage(store, audit, part.sensors), truths=truths)
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
        self._recording_id = audit.recording.recording_id
        self._rig, self._things = audit.rig, largest_things(store, self._measurement_id, audit.rig)
        self._camera_rigs = camera_rigs(store, self._recording_id, audit.rig)

    def drawn(self, incident: IncidentPart, pictures: Pictures) -> IncidentPart:
        """An incident of the recording with its figure, its frames' verdicts and its pictures."""
        if self._timeline is None:
            return incident
        views = incident_views(self._store, self._measurement_id, self._errors, incident, pictures)
        frames = self._timeline.frames_of(incident)
        told = contradictions(self._things, self._rig, frames, incident.attacked)
        seconds = incident.from_ns, incident.to_ns
        said = beside(self._store, self._rig, self._camera_rigs, told, *seconds)
        drawn = replace(self._timeline.drawn(incident), views=views, contradictions=told, beside=said)
        if incident.kind is not VerdictKind.UNIDENTIFIED:
            return drawn
        named = named_by_pasts(self._store, self._recording_id, self._measurement_id, *seconds)
        return replace(drawn, named_by_pasts=named)


def _measured(
    store: Store, audit: Audit, by: Provenance, errors: FrameErrors, frames: Sequence[Mapping[str, Any]]
) -> ThresholdComparison:
    """What a judgement compared with its thresholds, frame by frame; nothing of those before there was a limit."""
    if by.method != Method.ROBUST:
        curves = [Series("E", line.triple, (), line.theta) for line in by.thresholds]
        return ThresholdComparison(errors.frames, errors.E[:, : len(curves)], curves)
    if by.limit is None:
        return ThresholdComparison(errors.frames, np.zeros((len(errors.frames), 0)), [])
    scores = run_query(store, "report_scores", {"measurement": audit.measurement.measurement_id})
    z = scores["z"].combine_chunks().flatten().to_numpy(zero_copy_only=False).astype(np.float64)
    absent = {frame["frame"]: frozenset(frame["out_of_system"] or ()) for frame in frames}
    numbers = scores["frame"].to_numpy()
    # what was measured by an earlier version lacks the checks that came since: they stand at the end
    checks = rig_sensor_checks(audit.rig)[: len(z) // max(len(numbers), 1)]
    missing = [absent.get(number, frozenset()) for number in numbers.tolist()]
    values = sensor_scores(z.reshape(len(numbers), len(checks)), checks, audit.rig.sensors, missing)
    evidence = {frame["frame"]: frame["evidence"] or () for frame in frames}
    values = with_evidence(values, [evidence.get(number, ()) for number in numbers.tolist()], audit.rig.sensors)
    return ThresholdComparison(
        numbers, values, [Series("S", (sensor,), (), by.limit, "limit") for sensor in audit.rig.sensors]
    )


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


def _coverage(store: Store, audit: Audit, sensors: Sequence[SensorLine]) -> tuple[SensorLine, ...]:
    """Count the states of each sensor and take the medians of its coverage."""
    rows = rows_of(run_sql(store, _COVERAGE.format(audit.measurement.measurement_id)))
    of_sensors = {row.pop("sensor"): row for row in rows}
    return tuple(replace(sensor, **of_sensors.get(sensor.number, {})) for sensor in sensors)


def incident_views(
    store: Store,
    measurement_id: str,
    errors: FrameErrors,
    incident: IncidentPart,
    pictures: Pictures = Pictures.INCIDENTS,
) -> tuple[PageView, ...]:
    """The pictured frames of an incident: all, the strongest alone (`incidents`), or none.

    Of each frame the reference view with inconsistent pixels comes first, then the named ones. Where no camera is
    named, every other camera is shown, and the reference view itself where there is none. What an attacked sensor lost
    is drawn in the second kind: a camera's in its own picture, the LiDAR's in the reference's.
    """
    inside = (errors.frames >= incident.first_frame) & (errors.frames <= incident.last_frame)
    pictured = np.flatnonzero(inside & np.isin(errors.frames, store.pictured_frames(measurement_id)))
    if not len(pictured) or pictures == Pictures.NONE:
        return ()
    if pictures == Pictures.INCIDENTS:
        pictured = pictured[[np.argmax(np.nansum(errors.E[pictured], axis=1))]]
    frames = map(int, errors.frames[pictured])
    return tuple(view for frame in frames for view in _frame_views(store, measurement_id, frame, incident))


def _frame_views(store: Store, measurement_id: str, frame: int, incident: IncidentPart) -> tuple[PageView, ...]:
    picture = store.picture(measurement_id, frame)
    if picture is None or picture.reference not in picture.views:
        return ()
    images = {sensor: data_uri("jpg", jpeg) for sensor, jpeg in picture.views.items()}
    identified = [sensor for sensor in incident.attacked if sensor in images]
    others = [sensor for sensor in images if sensor != picture.reference and not incident.attacked]
    damaged = [r for r in store.load_regions(measurement_id, picture.frame) if r.sensor in incident.attacked]
    if any(region.sensor == LIDAR for region in damaged) and picture.reference not in identified:
        identified.append(picture.reference)
    mask = data_uri("png", picture.mask_png)
    return (
        PageView(picture.reference, picture.frame, images[picture.reference], mask),
        *(
            PageView(sensor, picture.frame, images[sensor], portions=tuple(map(_portion, _lying_in(damaged, sensor))))
            for sensor in identified or others or [picture.reference]
        ),
    )


def _lying_in(regions: list[Region], view: int) -> list[Region]:
    return [region for region in regions if region.view == view]


def _portion(region: Region) -> DamagedPortion:
    # A PNG tells its width and height after its signature and the head of its first chunk.
    width, height = struct.unpack(">II", region.mask[16:24])
    return DamagedPortion(
        sensor=region.sensor,
        width_px=width * REGION_STEP,
        height_px=height * REGION_STEP,
        mask=data_uri("png", region.mask),
        box_px=region.box_px,
        share=region.share,
        points=region.points,
        solid=region.solid,
    )
