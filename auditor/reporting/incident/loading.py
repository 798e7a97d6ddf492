"""From the store to the incident page: no recording is needed."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from itertools import count
from typing import Any

import auditor
from auditor.model.pictures import Pictures
from auditor.model.verdict import VerdictKind
from auditor.reporting.incident.audits import Audit, audits_of, outline
from auditor.reporting.incident.drawing import Drawing
from auditor.reporting.incident.examples import Example, examples_of, kept_examples
from auditor.reporting.incident.page import IncidentPage, IncidentPart, RecordingPart
from auditor.store.export import rows_of
from auditor.store.queries import run_query
from auditor.store.store import Store

MOST_SECTIONS = 12
"""Recordings that are shown in full; of more, those with the most frames raised."""

MOST_DRAWN = 6
"""Incidents that are drawn; of more, those with named sensors first, then the longest."""


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
    for one in part.incidents:
        if one.number not in drawn:
            incidents.append(one)
            continue
        wanted = [
            example
            for example in examples.get(one.incident_id, ())
            if example.measurement_id == audit.measurement.measurement_id
            and (pictures == Pictures.ALL or "strongest" in example.what)
        ]
        shown = kept_examples(store, wanted)
        small = Pictures.NONE if shown and pictures != Pictures.ALL else pictures
        incidents.append(replace(drawing.drawn(one, small), shown=shown))
    return replace(drawing.part, incidents=tuple(incidents))


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
