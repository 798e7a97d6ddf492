"""Writing a case: one incident as a folder that other tools take, and as a zip of it."""

import shutil
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import auditor
from auditor.casefile.case import Case
from auditor.casefile.folder import files_of, new_file, new_folder, write_manifest
from auditor.casefile.recorded import write_kept, write_recorded
from auditor.casefile.redaction import LEFT_OUT, NO_REDACTION, Redaction
from auditor.casefile.rows import write_rows, write_ticket, write_timeline
from auditor.errors import AuditorError
from auditor.model.pictures import Content, Pictures
from auditor.pipeline.many import limits_by_size
from auditor.pipeline.pictures import location_of
from auditor.pipeline.remote.spool import Spool
from auditor.pipeline.workers import LimitsOf, run_within
from auditor.reporting.incident.examples import ShownExample, ShownPicture, in_order
from auditor.reporting.incident.incident import Incident
from auditor.reporting.incident.loading import Incidents, OneIncident
from auditor.reporting.incident.render import render_one
from auditor.reporting.templates import fill
from auditor.store.log.chains import heads
from auditor.store.log.signatures import SigningKey
from auditor.store.reviews import incident_called
from auditor.store.store import Store

INDEX = "index.html"
"""The first page of a case."""

_PLACE = "place.svg"

SECONDS = 2.0
"""Before and after the incident so much belongs to a case."""


@dataclass(frozen=True)
class CaseSettings:
    """How a case is written: with so many seconds around the incident, redacted or not, signed where a key is given."""

    seconds: float = SECONDS
    redact: bool = False
    key: SigningKey | None = None
    limits: LimitsOf = field(default_factory=limits_by_size)


@dataclass(frozen=True)
class WrittenCase:
    """A case that was written: its incident, how many files it has, and sentences on what it lacks."""

    incident_id: str
    files: int
    remarks: tuple[str, ...]


def write_case(store: Store, beginning: str, into: Path, settings: CaseSettings) -> WrittenCase:
    """Write the incident whose id begins so into a new folder, whole or not at all.

    Raises StoreError where no or several incidents begin so, and SettingError where the folder exists or cannot be
    written. A recording that is gone or is another by now is no error: the case says what it lacks for that.
    """
    # a redacted page has no pictures of its own: those in the folder are blurred
    incidents = Incidents(store, Pictures.NONE if settings.redact else Pictures.INCIDENTS)
    incident = Incident(store, incident_called(store, incidents.rows, beginning))
    redaction = Redaction.of_store(store) if settings.redact else NO_REDACTION
    with new_folder(into) as folder:
        case = Case(incident, settings.seconds, folder, redaction)
        remarks = _of_several(incident) + _write_recorded(case, settings.limits)
        write_rows(case)
        title = write_ticket(case, remarks)
        write_timeline(case)
        shown = _shown(case)
        page = incidents.one(incident.row, () if redaction.on else shown or None)
        if redaction.on:
            page = _redacted(page, redaction, shown)
        if page.sketch:
            case.write(_PLACE, page.sketch.encode())
        case.write("page.html", render_one(page, index=INDEX, beside=True).encode())
        case.write(INDEX, _index(case, title, remarks, shown).encode())
        write_manifest(folder, _predicate(case, remarks), settings.key)
        files = len(files_of(folder))
    return WrittenCase(incident.incident_id, files, remarks)


def write_zip(folder: Path, target: Path) -> None:
    """Write a case as a zip, whole or not at all; its files lie in a folder of the case's name. Raises SettingError."""
    with new_file(target) as beside, zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in files_of(folder):
            archive.write(folder / name, f"{folder.name}/{name}")


def _write_recorded(case: Case, limits: LimitsOf) -> tuple[str, ...]:
    """Write what needs the recording, or say in one sentence why it is not there."""
    try:
        with Spool().copied(location_of(case.incident.recording)) as [where, *_]:
            return run_within(limits(where), write_recorded, where, case)
    except AuditorError as error:
        for half in case.folder.iterdir():
            shutil.rmtree(half) if half.is_dir() else half.unlink()
        instead = "; the pictures are those that the store keeps" if write_kept(case) else " and no pictures"
        return (f"no clip{instead}: {case.redaction.text(error.what)}",)


def _of_several(incident: Incident) -> tuple[str, ...]:
    parts = len(incident.row["parts"])
    if parts == 1:
        return ()
    return (f"the incident runs through {parts} recordings: clip and pictures are of the one with its strongest frame",)


def _redacted(page: OneIncident, redaction: Redaction, shown: tuple[ShownExample, ...]) -> OneIncident:
    """The page without names, and without what reviewers wrote; its pictures are blurred already."""
    reviews = tuple({**review, "reason": LEFT_OUT} for review in page.reviews)
    # The picture of a rig has the names of its sensors, and is no text that they are looked for in.
    recordings = tuple(replace(part, rig_picture="") for part in page.page.recordings)
    without = replace(page, reviews=reviews, sketch="", page=replace(page.page, recordings=recordings))
    changed: OneIncident = redaction.value(without)
    return replace(changed, shown=shown)


def _shown(case: Case) -> tuple[ShownExample, ...]:
    """The pictures of the case, by the frames that they are of."""
    shown, redacted = [], case.redaction.on
    for example in case.incident.examples:
        beginning = f"{case.place_of(example.measurement_id, str(example.frame))}_S"
        pictures = []
        for path in (case.folder / "pictures").glob(f"{beginning}*"):
            sensor, content, _ = path.name.removeprefix(beginning).split(".")
            pictures.append(ShownPicture(f"pictures/{path.name}", int(sensor), Content(content), blurred=redacted))
        if pictures:
            named = replace(example, name=LEFT_OUT) if redacted else example
            shown.append(ShownExample(named, in_order(pictures)))
    return tuple(shown)


def _index(case: Case, title: str, remarks: tuple[str, ...], shown: tuple[ShownExample, ...]) -> str:
    """The first page as HTML. All of its text is escaped; it refers to files of its folder alone."""
    return fill(
        "case.html",
        {
            "title": title,
            "auditor_version": auditor.__version__,
            "incident_id": case.incident.incident_id,
            "words": case.evidence,
            "remarks": remarks,
            "shown": shown,
            "has_place": (case.folder / _PLACE).is_file(),
            "files": files_of(case.folder),
        },
    )


def _predicate(case: Case, remarks: tuple[str, ...]) -> Mapping[str, Any]:
    """What the manifest says of the case: what made it, of which store and recording, and by which calibration."""
    incident = case.incident
    judgement = incident.store.current_judgements()[incident.measurement_id]
    store_heads = {name: head.sha256 for name, head in heads(incident.store.folder).items()}
    return {
        "tool": {"name": "auditor", "version": auditor.__version__},
        "made_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "incident_id": incident.incident_id,
        "recording_sha256": incident.recording.recording_id,
        "measurement_id": incident.measurement_id,
        "judgement_id": incident.part["judgement_id"],
        "calibration_id": judgement.calibration_id,
        "method": judgement.method,
        "r": str(judgement.r),
        # the name of a chain begins with that of the machine that wrote it
        "store_heads": sorted(store_heads.values()) if case.redaction.on else store_heads,
        "seconds_around": case.seconds,
        "redacted": case.redaction.on,
        "lacks": list(remarks),
    }
