"""The rows of an incident for other programs: Parquet and CSV, JSON for a ticket, and a timeline in JSON lines."""

import json
from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import auditor
from auditor.casefile.case import Case, in_words
from auditor.reporting.incident.incident import Incident
from auditor.store.export import as_json, encode, with_texts
from auditor.store.queries import run_sqls

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
    what = f"{sensors} attacked" if sensors else f"{incident.row['kind']} finding"
    # a name too short to be searched for is left out before it is part of a sentence
    described = case.redaction.value(_ticket(incident, remarks))
    title = f"{what} for {incident.row['seconds']:.1f} s in {described['name']}"
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
    what = " + ".join(map(in_words, incident.attacked)) or "no sensor named"
    first = f"incident begins: {row['kind']}, {what}; {row['evidence'] or 'no evidence in words'}"
    yield {**_at(incident.part["from_ns"], first, f"Incident begins{clock}"), **same}
    for frame in case.frames:
        if frame["in_incident"]:
            gap = "" if frame["gap"] is None else f", gap {frame['gap']:.2f}"
            message = f"frame {frame['frame']}: {frame['kind']}, {what}{gap}"
            yield {**_at(frame["stamp_ns"], message, f"Frame captured{clock}"), **same, "frame": frame["frame"]}
    last = f"incident ends after {row['frames']} frames: {row['kind']}, {what}"
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
