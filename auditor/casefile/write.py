"""Writing a case: one incident as a folder that other tools take, and as a zip of it."""

import shutil
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import auditor
from auditor.casefile.folder import new_file, new_folder, write_file
from auditor.casefile.incident import CaseIncident
from auditor.casefile.manifest import files_of, write_manifest
from auditor.casefile.recorded import RecordedTask, words_of, write_kept, write_recorded
from auditor.casefile.redaction import LEFT_OUT, Redaction
from auditor.casefile.rows import ticket, write_rows, write_ticket, write_timeline
from auditor.errors import AuditorError
from auditor.model.pictures import Content, Pictures
from auditor.pipeline.many import LimitsOf, limits_by_size
from auditor.pipeline.pictures.at_hand import location_of
from auditor.pipeline.workers import run_within
from auditor.reporting.incident.examples import ShownExample, ShownPicture, in_order
from auditor.reporting.incident.one import Incidents, OneIncident
from auditor.reporting.incident.render import render_one
from auditor.reporting.sketch import sketch, track_of
from auditor.reporting.templates import fill
from auditor.store import Store
from auditor.store.log import heads
from auditor.store.log.signatures import SigningKey
from auditor.store.reviews import incident_called

INDEX = "index.html"
"""The first page of a case."""

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
class Case:
    """A case that was written: its incident, how many files it has, and sentences on what it lacks."""

    incident_id: str
    files: int
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class CasePage:
    """What the page shows; `words` is the evidence, `remarks` what the case lacks, `shown` its pictures."""

    title: str
    auditor_version: str
    incident_id: str
    words: str
    remarks: tuple[str, ...]
    shown: tuple[ShownExample, ...]
    has_place: bool
    files: tuple[str, ...]


def render_case(page: CasePage) -> str:
    """The page as HTML. All of its text is escaped; it refers to files of its folder alone."""
    return fill("case.html", {"page": page})


def write_case(store: Store, beginning: str, into: Path, settings: CaseSettings) -> Case:
    """Write the incident whose id begins so into a new folder, whole or not at all.

    Raises StoreError where no or several incidents begin so, and SettingError where the folder exists or cannot be
    written. A recording that is gone or is another by now is no error: the case says what it lacks for that.
    """
    # a redacted page has no pictures of its own: those in the folder are blurred
    incidents = Incidents(store, Pictures.NONE if settings.redact else Pictures.INCIDENTS)
    incident = CaseIncident(store, incident_called(store, incidents.rows, beginning), settings.seconds)
    redaction = Redaction.of_store(store) if settings.redact else None
    with new_folder(into) as folder:
        remarks = _of_several(incident) + _write_recorded(incident, folder, settings, redaction)
        write_rows(incident, folder, redaction)
        described = ticket(incident, remarks, redaction)
        write_ticket(described, folder)
        write_timeline(incident, folder, redaction)
        track = track_of(store, incident.measurement_id) if redaction is None else None
        if track is not None:
            place = sketch(track, incident.part["first_frame"], incident.part["last_frame"])
            write_file(folder / "place.svg", place.encode())
        shown = _shown(incident, folder, redaction)
        page = incidents.one(incident.row, () if redaction else shown or None)
        page = _redacted(page, redaction, shown) if redaction else page
        write_file(folder / "page.html", render_one(page, index=INDEX, beside=True).encode())
        words = words_of(incident, redaction)
        write_file(folder / INDEX, _index(incident, folder, described["title"], words, remarks, shown).encode())
        write_manifest(folder, _predicate(incident, remarks, settings, redaction), settings.key)
        files = len(files_of(folder))
    return Case(incident.incident_id, files, remarks)


def write_zip(folder: Path, target: Path) -> None:
    """Write a case as a zip, whole or not at all; its files lie in a folder of the case's name. Raises SettingError."""
    with new_file(target) as beside, zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in files_of(folder):
            archive.write(folder / name, f"{folder.name}/{name}")


def _write_recorded(
    incident: CaseIncident, folder: Path, settings: CaseSettings, redaction: Redaction | None
) -> tuple[str, ...]:
    """Write what needs the recording, or say in one sentence why it is not there."""
    try:
        where = location_of(incident.recording)
        task = RecordedTask(str(where), incident.store.folder, incident.row, incident.seconds, folder, redaction)
        return run_within(settings.limits(where), write_recorded, task)
    except AuditorError as error:
        for half in folder.iterdir():
            shutil.rmtree(half) if half.is_dir() else half.unlink()
        pictures = write_kept(incident, folder, redaction)
        instead = "; the pictures are those that the store keeps" if pictures else " and no pictures"
        reason = redaction.text(error.what) if redaction else error.what
        return (f"no clip{instead}: {reason}",)


def _of_several(incident: CaseIncident) -> tuple[str, ...]:
    parts = len(incident.row["parts"])
    if parts == 1:
        return ()
    return (f"the incident runs through {parts} recordings: clip and pictures are of the one with its strongest frame",)


def _redacted(page: OneIncident, redaction: Redaction, shown: tuple[ShownExample, ...]) -> OneIncident:
    """The page without names, and without what reviewers wrote; its pictures are blurred already."""
    reviews = tuple({**one, "reason": LEFT_OUT} for one in page.reviews)
    changed: OneIncident = redaction.value(replace(page, reviews=reviews, place=""))
    return replace(changed, shown=shown)


def _shown(incident: CaseIncident, folder: Path, redaction: Redaction | None) -> tuple[ShownExample, ...]:
    """The pictures of the case, by the frames that they are of."""
    shown = []
    for one in incident.examples:
        beginning = f"{incident.place_of(one.measurement_id, str(one.frame))}_S"
        pictures = []
        for path in (folder / "pictures").glob(f"{beginning}*"):
            sensor, content, _ = path.name.removeprefix(beginning).split(".")
            address = f"pictures/{path.name}"
            pictures.append(ShownPicture(address, int(sensor), Content(content), blurred=redaction is not None))
        if pictures:
            example = replace(one, name=LEFT_OUT) if redaction else one
            shown.append(ShownExample(example, in_order(pictures)))
    return tuple(shown)


def _index(
    incident: CaseIncident,
    folder: Path,
    title: str,
    words: str,
    remarks: tuple[str, ...],
    shown: tuple[ShownExample, ...],
) -> str:
    return render_case(
        CasePage(
            title,
            auditor.__version__,
            incident.incident_id,
            words=words,
            remarks=remarks,
            shown=shown,
            has_place=(folder / "place.svg").is_file(),
            files=tuple(files_of(folder)),
        )
    )


def _predicate(
    incident: CaseIncident, remarks: tuple[str, ...], settings: CaseSettings, redaction: Redaction | None
) -> Mapping[str, Any]:
    """What the manifest says of the case: what made it, of which store and recording, and by which calibration."""
    judgement = incident.store.current_judgements()[incident.measurement_id]
    known = {name: head.sha256 for name, head in heads(incident.store.folder).items()}
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
        "store_heads": sorted(known.values()) if redaction is not None else known,
        "seconds_around": settings.seconds,
        "redacted": redaction is not None,
        "lacks": list(remarks),
    }
