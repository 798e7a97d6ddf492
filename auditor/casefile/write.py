"""Writing a case: one incident as a folder that other tools take, and as a zip of it."""

import json
import shutil
import zipfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import auditor
from auditor.casefile.case import LEFT_OUT, NO_REDACTION, Case, Redaction, in_words
from auditor.casefile.folder import files_of, new_file, new_folder, write_manifest
from auditor.casefile.recorded import write_kept, write_recorded
from auditor.errors import AuditorError
from auditor.model.pictures import Content, Pictures
from auditor.pipeline.many import limits_by_size
from auditor.pipeline.pictures import location_of
from auditor.pipeline.remote.spool import Spool
from auditor.pipeline.workers import LimitsOf, run_within
from auditor.reporting.incident.examples import ShownExample, ShownPicture, in_order
from auditor.reporting.incident.incident import Incident
from auditor.reporting.incident.loading import IncidentList, OneIncident
from auditor.reporting.incident.render import render_one
from auditor.reporting.templates import fill
from auditor.store.export import as_json, encode, with_texts
from auditor.store.log.chains import heads
from auditor.store.log.signatures import SigningKey
from auditor.store.queries import run_sqls
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
    incidents = IncidentList(store, Pictures.NONE if settings.redact else Pictures.INCIDENTS)
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


_BY_NAMES = frozenset({"poses", "calibrations"})
"""Tables that say where or by which recordings: a redacted case has none of them."""

_CLOCKS = {
    "utc": "",
    "relative": " (not UTC: the recorder counts from a start of its own)",
    "unknown": " (not known to be UTC: the recorder states no time zone)",
}


def write_rows(case: Case) -> None:
    """Write each table of the incident as rows/NAME.parquet and rows/NAME.csv. Raises OSError and StoreError."""
    left_out = _BY_NAMES if case.redaction.on else ()
    wanted = {name: sql for name, sql in _tables(case).items() if name not in left_out}
    for name, table in run_sqls(case.incident.store, wanted).items():
        redacted = with_texts(table, case.redaction.cell) if case.redaction.on else table
        for form in ("parquet", "csv"):
            case.write(f"rows/{name}.{form}", encode(redacted, form))


def _tables(case: Case) -> dict[str, str]:
    """SQL for each table: rows of the views of that name."""
    parts, within = case.incident.row["parts"], case.where("stamp_ns")
    own = f"incident_id = '{case.incident.incident_id}'"
    near = f"SEMI JOIN (FROM verdicts WHERE {within}) AS near USING (measurement_id, frame)"
    recordings, measurements, judgements = (
        ", ".join(f"'{part[column]}'" for part in parts)
        for column in ("recording_id", "measurement_id", "judgement_id")
    )
    of_judgements = f"SEMI JOIN (FROM judgements WHERE judgement_id IN ({judgements})) AS judgement"
    return {
        "incident": f"FROM incidents WHERE {own}",
        "incident_frames": f"FROM incident_frames WHERE {own} ORDER BY stamp_ns",
        "verdicts": f"FROM verdicts WHERE {within} ORDER BY frame",
        "sensors": f"FROM sensors WHERE {within} ORDER BY frame, position",
        "statistics": f"FROM statistics WHERE {within} ORDER BY frame, position",
        "regions": f"FROM regions {near} ORDER BY frame, sensor",
        "poses": f"FROM poses {near} ORDER BY frame, topic",
        "recordings": f"FROM recordings WHERE recording_id IN ({recordings})",
        "measurements": f"FROM measurements WHERE measurement_id IN ({measurements})",
        "judgements": f"FROM judgements WHERE judgement_id IN ({judgements})",
        "calibrations": f"FROM (FROM calibrations SELECT * EXCLUDE samples) {of_judgements} USING (calibration_id)",
    }


def write_ticket(case: Case, remarks: tuple[str, ...]) -> str:
    """Write ticket.json, one flat object; gives its title. Raises OSError."""
    incident = case.incident
    sensors = " + ".join(f"S_{sensor}" for sensor in incident.attacked)
    subject = f"{sensors} attacked" if sensors else f"{incident.row['kind']} finding"
    # a name too short to be searched for is left out before it is part of a sentence
    described = case.redaction.value(_ticket(incident, remarks))
    title = f"{subject} for {incident.row['seconds']:.1f} s in {described['name']}"
    case.write("ticket.json", as_json({"title": title, **described}))
    return title


def _ticket(incident: Incident, remarks: tuple[str, ...]) -> dict[str, Any]:
    row, recording = incident.row, incident.recording
    return {
        "incident_id": incident.incident_id,
        "kind": row["kind"],
        "sensors": [f"S_{sensor}" for sensor in incident.attacked],
        "attacked_names": row["attacked_names"],
        "vehicle": recording.vehicle,
        "name": recording.name,
        "path": recording.path,
        "recording_sha256": recording.recording_id,
        "from_ns": row["from_ns"],
        "to_ns": row["to_ns"],
        "from_utc": row["from_utc"],
        "clock": recording.clock,
        "seconds": row["seconds"],
        "frames": row["frames"],
        "first_frame": incident.part["first_frame"],
        "last_frame": incident.part["last_frame"],
        "strongest_frame": incident.strongest,
        "largest_gap": row["largest_gap"],
        "evidence": row["evidence"],
        "alternatives": row["alternatives"],
        "causes": row["causes"],
        "measurement_id": incident.measurement_id,
        "judgement_id": incident.part["judgement_id"],
        "auditor_version": auditor.__version__,
        "remarks": list(remarks),
    }


def write_timeline(case: Case) -> None:
    """Write timeline.jsonl as Timesketch imports it: a line for the beginning, each frame and the end. Raises OSError.

    Stamps count from 1970 there also where the recording's clock does not, and the line says so.
    """
    lines = (json.dumps(case.redaction.value(line)) for line in _timeline(case))
    case.write("timeline.jsonl", "".join(f"{line}\n" for line in lines).encode())


def _timeline(case: Case) -> Iterator[dict[str, Any]]:
    incident, row = case.incident, case.incident.row
    clock = _CLOCKS[incident.recording.clock]
    same = {"incident_id": incident.incident_id, "name": incident.recording.name, "data_type": "auditor:incident"}
    subject = " + ".join(map(in_words, incident.attacked)) or "no sensor named"
    first = f"incident begins: {row['kind']}, {subject}; {row['evidence'] or 'no evidence in words'}"
    yield {**_at(incident.part["from_ns"], first, f"Incident begins{clock}"), **same}
    for frame in case.frames:
        if frame["in_incident"]:
            gap = "" if frame["gap"] is None else f", gap {frame['gap']:.2f}"
            message = f"frame {frame['frame']}: {frame['kind']}, {subject}{gap}"
            yield {**_at(frame["stamp_ns"], message, f"Frame captured{clock}"), **same, "frame": frame["frame"]}
    last = f"incident ends after {row['frames']} frames: {row['kind']}, {subject}"
    yield {**_at(incident.part["to_ns"], last, f"Incident ends{clock}"), **same}


def _at(stamp_ns: int, message: str, description: str) -> dict[str, Any]:
    moment = datetime.fromtimestamp(stamp_ns // 10**9, UTC).replace(microsecond=stamp_ns % 10**9 // 1000)
    return {
        "message": message,
        "datetime": moment.isoformat(timespec="microseconds"),
        "timestamp": stamp_ns // 1000,
        "timestamp_desc": description,
        "stamp_ns": stamp_ns,
    }
