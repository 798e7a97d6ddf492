"""From the store to the page of one incident."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from auditor.model.pictures import Pictures
from auditor.reporting.incident.audits import audit_of, outline
from auditor.reporting.incident.drawing import Drawing
from auditor.reporting.incident.loading import incident_parts, page_of
from auditor.reporting.incident.page import IncidentPage
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
    of these recordings.
    """

    row: Mapping[str, Any]
    page: IncidentPage
    reviews: tuple[Mapping[str, Any], ...]
    versions: Mapping[str, CalibrationVersion]
    neighbours: tuple[Mapping[str, Any], ...]


class Incidents:
    """All incidents of a store; what several pages need is read once. Raises StoreError."""

    def __init__(self, store: Store, pictures: Pictures) -> None:
        self._store = store
        self._pictures = pictures
        self.rows: Sequence[dict[str, Any]] = rows_of(run_query(store, "incidents", {}))
        self._reviews = rows_of(run_sql(store, "FROM incident_reviews ORDER BY reviewed_at DESC, review_id DESC"))
        self._judgements = store.current_judgements()
        self._calibration_recordings = store.calibration_recordings()
        self._drawing = lru_cache(maxsize=_KEPT_DRAWINGS)(self._read)

    def one(self, row: Mapping[str, Any]) -> OneIncident:
        """The page of the incident of a row."""
        parts = []
        for measurement_id, incident in incident_parts(row, 1):
            drawing = self._drawing(measurement_id)
            parts.append(replace(drawing.part, incidents=(drawing.drawn(incident, self._pictures),)))
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
        )

    def _read(self, measurement_id: str) -> Drawing:
        measurement = self._store.measurement(measurement_id)
        recording = self._store.recording(measurement.recording_id)
        audit = audit_of(self._store, measurement, recording, self._judgements)
        return Drawing(self._store, audit, outline(self._store, audit, self._calibration_recordings))
