"""From the store to the page of one incident."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from auditor.model.pictures import Pictures
from auditor.reporting.incident.audits import audit_of, outline
from auditor.reporting.incident.drawing import Drawing
from auditor.reporting.incident.examples import Example, ShownExample, examples_of, kept_examples
from auditor.reporting.incident.incident import Incident
from auditor.reporting.incident.loading import incident_parts, page_of
from auditor.reporting.incident.page import IncidentPage
from auditor.reporting.sketch import Track, sketch, track_of
from auditor.store.export import rows_of
from auditor.store.queries import run_query, run_sql
from auditor.store.store import Store
from auditor.store.versions.records import CalibrationVersion, read_version

_KEPT_DRAWINGS = 4
"""Recordings whose frames stay in memory: incidents of one recording follow each other."""


@dataclass(frozen=True)
class OneIncident:
    """The page of one incident: `page` has the recordings that it runs through, each with its part of it alone.

    `row` is that of the view `incidents`, `reviews` are those of the view `incident_reviews`, the last first.
    `versions` say how the calibrations were made, by their ids, where that is known. `neighbours` are other incidents
    of these recordings. `shown` are the frames that show it, the strongest first; `sketch` is an SVG image of
    the drive, empty where no poses were recorded. `former` is the name that the page has from before the incident grew.
    """

    row: Mapping[str, Any]
    page: IncidentPage
    reviews: tuple[Mapping[str, Any], ...]
    versions: Mapping[str, CalibrationVersion]
    neighbours: tuple[Mapping[str, Any], ...]
    shown: tuple[ShownExample, ...] = ()
    sketch: str = ""
    former: str = ""


class Incidents:
    """All incidents of a store; what several pages need is read once. Raises StoreError."""

    def __init__(self, store: Store, pictures: Pictures) -> None:
        self._store = store
        self._pictures = pictures
        self.rows: Sequence[dict[str, Any]] = rows_of(run_query(store, "incidents", {}))
        self._reviews = rows_of(run_sql(store, "FROM incident_reviews ORDER BY reviewed_at DESC, review_id DESC"))
        self._judgements = store.current_judgements()
        self._calibration_recordings = store.calibration_recordings()
        self._examples = examples_of(store)
        self._drawing = lru_cache(maxsize=_KEPT_DRAWINGS)(self._read)
        self._track = lru_cache(maxsize=_KEPT_DRAWINGS)(self._read_track)

    def one(self, row: Mapping[str, Any], shown: tuple[ShownExample, ...] | None = None) -> OneIncident:
        """The page of the incident of a row. `shown` are the frames that show it; those of the store unless given."""
        if shown is None:
            shown = kept_examples(self._store, self.examples(row)) if self._pictures != Pictures.NONE else ()
        small = Pictures.NONE if shown and self._pictures != Pictures.ALL else self._pictures
        parts = []
        for measurement_id, incident in incident_parts(row, 1):
            drawing = self._drawing(measurement_id)
            parts.append(replace(drawing.part, incidents=(drawing.drawn(incident, small),)))
        calibrations = {part.provenance.calibration_id for part in parts} - {""}
        known = {one: read_version(self._store, one) for one in calibrations if one in self._calibration_recordings}
        places = {part.provenance.measurement_id for part in parts}
        return OneIncident(
            row,
            page_of(self._store, parts),
            tuple(one for one in self._reviews if one["incident_id"] == row["incident_id"]),
            {name: version for name, version in known.items() if version is not None},
            tuple(
                one
                for one in self.rows
                if one is not row and any(part["measurement_id"] in places for part in one["parts"])
            ),
            shown,
            self._sketch(row),
        )

    def examples(self, row: Mapping[str, Any]) -> tuple[Example, ...]:
        """The frames that show the incident of a row."""
        return self._examples.get(row["incident_id"], ())

    def _sketch(self, row: Mapping[str, Any]) -> str:
        incident = Incident(self._store, row)
        track = self._track(incident.measurement_id)
        return sketch(track, incident.part["first_frame"], incident.part["last_frame"]) if track is not None else ""

    def _read_track(self, measurement_id: str) -> Track | None:
        return track_of(self._store, measurement_id)

    def _read(self, measurement_id: str) -> Drawing:
        measurement = self._store.measurement(measurement_id)
        recording = self._store.recording(measurement.recording_id)
        audit = audit_of(self._store, measurement, recording, self._judgements)
        return Drawing(self._store, audit, outline(self._store, audit, self._calibration_recordings))
