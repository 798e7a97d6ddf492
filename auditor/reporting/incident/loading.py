"""From the store to the page of recordings, and to that of one incident: no recording is needed."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import lru_cache
from itertools import count
from typing import Any

import auditor
from auditor.model.pictures import Pictures
from auditor.model.verdict import VerdictKind
from auditor.reporting.incident.audits import Audit, audit_of, audits_of, outline
from auditor.reporting.incident.drawing import Drawing
from auditor.reporting.incident.examples import Example, ShownExample, examples_of, kept_examples
from auditor.reporting.incident.incident import Incident
from auditor.reporting.incident.page import IncidentPage, IncidentPart, RecordingPart
from auditor.reporting.sketch import Track, sketch, track_of
from auditor.store.export import rows_of
from auditor.store.queries import run_query, run_sql
from auditor.store.store import Store
from auditor.store.versions.records import CalibrationVersion, read_version

MOST_SECTIONS = 12
"""Recordings that are shown in full; of more, those with the most frames raised."""

MOST_DRAWN = 6
"""Incidents that are drawn; of more, those with named sensors first, then the longest."""

_KEPT_DRAWINGS = 4
"""Recordings whose frames stay in memory: incidents of one recording follow each other."""


def load_page(store: Store, recording: str | None = None, pictures: Pictures = Pictures.INCIDENTS) -> IncidentPage:
    """Everything that the page shows of one recording (by name, id or first digits of its id), or of all.

    Raises StoreError where the store has no such recording, or was not measured.
    """
    called = store.recordings_called(recording) if recording is not None else []
    if len(called) == 1:
        recording = called[0].recording_id  # queries do not know its other names
    calibration_recordings = store.calibration_recordings()
    audits = audits_of(store, recording, calibration_recordings)
    outlines = [outline(store, audit, calibration_recordings) for audit in audits]
    numbered = _numbered(outlines, _incidents(store, recording))
    shown = {part.provenance.measurement_id for part in sorted(numbered, key=lambda part: -part.raised)[:MOST_SECTIONS]}
    drawn = {incident.number for _, incident in page_of(store, numbered).incidents[:MOST_DRAWN]}
    examples = examples_of(store) if pictures != Pictures.NONE else {}
    full = [
        _in_full(store, audit, part, drawn, pictures, examples) if part.provenance.measurement_id in shown else part
        for audit, part in zip(audits, numbered, strict=True)
    ]
    return page_of(store, full)


def _in_full(
    store: Store,
    audit: Audit,
    part: RecordingPart,
    drawn: set[int],
    pictures: Pictures,
    examples: Mapping[str, tuple[Example, ...]],
) -> RecordingPart:
    """The part with its coverage, its drawings and its pictures: of each incident its strongest frame, or all."""
    drawing, incidents = Drawing(store, audit, part), []
    for incident in part.incidents:
        if incident.number not in drawn:
            incidents.append(incident)
            continue
        wanted = [
            example
            for example in examples.get(incident.incident_id, ())
            if example.measurement_id == audit.measurement.measurement_id
            and (pictures == Pictures.ALL or "strongest" in example.what)
        ]
        shown = kept_examples(store, wanted)
        incidents.append(replace(drawing.drawn(incident, _beside(shown, pictures)), shown=shown))
    return replace(drawing.part, incidents=tuple(incidents))


def _beside(shown: Sequence[ShownExample], pictures: Pictures) -> Pictures:
    """Which of the pictures that measuring kept stand beside those at full resolution."""
    return Pictures.NONE if shown and pictures != Pictures.ALL else pictures


def page_of(store: Store, parts: Sequence[RecordingPart]) -> IncidentPage:
    """The page of some recordings, made now."""
    return IncidentPage(
        made_at=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        auditor_version=auditor.__version__,
        store=str(store.folder),
        recordings=tuple(parts),
    )


def _incidents(store: Store, recording: str | None) -> Mapping[str, list[IncidentPart]]:
    """What each measurement has of every incident, as the query of that name finds them."""
    incidents: dict[str, list[IncidentPart]] = {}
    for number, row in enumerate(rows_of(run_query(store, "incidents", {"recording": recording}))):
        for measurement_id, part in incident_parts(row, number):
            incidents.setdefault(measurement_id, []).append(part)
    return incidents


def incident_parts(row: Mapping[str, Any], number: int) -> Iterator[tuple[str, IncidentPart]]:
    """What each measurement has of the incident of a row of the view `incidents`, in order."""
    for place, part in enumerate(row["parts"], start=1):
        yield (
            part["measurement_id"],
            IncidentPart(
                number=number,
                incident_id=row["incident_id"],
                kind=VerdictKind(row["kind"]),
                attacked=tuple(row["attacked"]),
                first_frame=part["first_frame"],
                last_frame=part["last_frame"],
                frames=part["frames"],
                from_ns=part["from_ns"],
                to_ns=part["to_ns"],
                grade=row["grade"],
                evidence=row["evidence"] or "",
                alternatives=row["alternatives"] or "",
                causes=row["causes"] or "",
                part=place,
                parts=len(row["parts"]),
            ),
        )


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


@dataclass(frozen=True)
class OneIncident:
    """The page of one incident: `page` has the recordings that it runs through, each with its part of it alone.

    `row` is that of the view `incidents`, `reviews` are those of the view `incident_reviews`, the last first.
    `versions` say how the calibrations were made, by their ids, where that is known. `neighbours` are other incidents
    of these measurements, `same` those of other rigs that say the same at its time. `shown` are the frames that show
    it, the strongest first; `sketch` is an SVG image of the drive, empty where no poses were recorded. `former` is the
    name that the page has from before the incident grew.
    """

    row: Mapping[str, Any]
    page: IncidentPage
    reviews: tuple[Mapping[str, Any], ...]
    versions: Mapping[str, CalibrationVersion]
    neighbours: tuple[Mapping[str, Any], ...]
    same: tuple[Mapping[str, Any], ...] = ()
    shown: tuple[ShownExample, ...] = ()
    sketch: str = ""
    former: str = ""


class IncidentList:
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
        small = _beside(shown, self._pictures)
        parts = []
        for measurement_id, incident in incident_parts(row, 1):
            drawing = self._drawing(measurement_id)
            parts.append(replace(drawing.part, incidents=(drawing.drawn(incident, small),)))
        calibrations = {part.provenance.calibration_id for part in parts} - {""}
        versions = {one: read_version(self._store, one) for one in calibrations if one in self._calibration_recordings}
        places = {part.provenance.measurement_id for part in parts}
        return OneIncident(
            row,
            page_of(self._store, parts),
            tuple(one for one in self._reviews if one["incident_id"] == row["incident_id"]),
            {name: version for name, version in versions.items() if version is not None},
            tuple(
                one
                for one in self.rows
                if one is not row and any(part["measurement_id"] in places for part in one["parts"])
            ),
            tuple(
                one for one in self.rows if row["incident_id"] == one["same_as"] or row["same_as"] == one["incident_id"]
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
