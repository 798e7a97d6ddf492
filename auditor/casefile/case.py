"""A case under way: its incident with the seconds around it, its folder, and what is left out of it."""

import re
import socket
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from auditor.casefile.folder import write_file
from auditor.model.measurement import Region
from auditor.model.rig import LIDAR, Rig
from auditor.model.stamps import NANOSECONDS
from auditor.reporting.incident.incident import Incident
from auditor.store.export import Table, rows_of
from auditor.store.log.entry import user
from auditor.store.queries import run_sql, run_sqls
from auditor.store.store import Store

LEFT_OUT = "[left out]"

_NAMED = frozenset(
    {
        "name",
        "names",
        "path",
        "paths",
        "files",
        "vehicle",
        "drive",
        "drive_id",
        "topic",
        "topics",
        "pose_topics",
        "strongest_name",
        "attacked_names",
        "other_names",
        "sensor_name",
        "frame_id",
        "store",
        "superseded_by",
        "conflicts",
        "author",
        "made_by",
        "review_reason",
    }
)
"""Columns and fields that hold names, paths, or what a person wrote."""

_SHORTEST = 3
"""Shorter names are left out of those columns alone: in a sentence they would be found in every other word."""


@dataclass(frozen=True)
class Redaction:
    """The names and paths that a case leaves out wherever they stand in text; one that is not `on` leaves all in."""

    secrets: tuple[str, ...] = ()
    on: bool = True

    @classmethod
    def of_store(cls, store: Store) -> "Redaction":
        """All names and paths that a store knows, and those of this machine."""
        secrets: set[str] = {str(store.folder), socket.gethostname(), user(), str(Path.home())}
        for record in store.recordings():
            secrets |= {record.name, record.path, *record.files, record.vehicle or "", record.drive or ""}
            secrets |= {text for one in record.sightings for text in (one.name, one.path, str(Path(one.path).parent))}
        for rig_id in store.ids("rigs"):
            secrets |= set(_names_of(store.rig(rig_id)))
        secrets |= {row["author"] for row in rows_of(run_sql(store, "SELECT DISTINCT author FROM reviews"))}
        return cls(
            tuple(sorted({one for one in secrets if len(one) >= _SHORTEST and one != "/"}, key=len, reverse=True))
        )

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        return re.compile("|".join(rf"(?<!\w){re.escape(secret)}(?!\w)" for secret in self.secrets) or r"(?!)")

    def text(self, text: str) -> str:
        """A text without names and paths."""
        return self._pattern.sub(LEFT_OUT, text)

    def cell(self, column: str, text: str) -> str:
        """A text of a column or field."""
        return LEFT_OUT if self.on and column in _NAMED and text else self.text(text)

    def value(self, value: Any, name: str = "") -> Any:  # noqa: ANN401 - of any type, and of the same
        """A value in which every text is changed: of data classes, lists, tuples and dictionaries, all the way down."""
        if isinstance(value, str) and type(value) is str:
            return self.cell(name, value)
        if isinstance(value, dict):
            return {key: self.value(item, str(key)) for key, item in value.items()}
        if isinstance(value, tuple) and hasattr(value, "_fields"):
            return type(value)(*(self.value(item, field) for field, item in zip(value._fields, value, strict=True)))
        if isinstance(value, list | tuple):
            return type(value)(self.value(item, name) for item in value)
        if is_dataclass(value) and not isinstance(value, type):
            changed = {one.name: self.value(getattr(value, one.name), one.name) for one in fields(value) if one.init}
            return replace(value, **changed)
        return value


NO_REDACTION = Redaction(on=False)


def _names_of(rig: Rig) -> Iterable[str]:
    return (text for sensor in rig.sensors for text in (rig.name(sensor), rig.topic(sensor)))


@dataclass(frozen=True, eq=False)
class Case:
    """An incident that is written into a folder; `seconds` before and after it belong to the case."""

    incident: Incident
    seconds: float
    folder: Path
    redaction: Redaction

    def write(self, name: str, content: bytes) -> None:
        """Write a file of the case. Raises OSError."""
        write_file(self.folder / name, content)

    @property
    def evidence(self) -> str:
        """The evidence in words."""
        return self.redaction.text(self.incident.row["evidence"] or "no evidence in words")

    @cached_property
    def frames(self) -> list[dict[str, Any]]:
        """The verdicts of the frames from the first second to the last, with what is `in_incident`, by frame."""
        return [{**row, "in_incident": row["frame"] in self._inside} for row in rows_of(self._tables["verdicts"])]

    @cached_property
    def _inside(self) -> set[int]:
        """The incident's frames in the recording with its strongest."""
        return {row["frame"] for row in rows_of(self._tables["own"])}

    @cached_property
    def _tables(self) -> Mapping[str, Table]:
        within, own = self.where("stamp_ns"), f"incident_id = '{self.incident.incident_id}'"
        return run_sqls(
            self.incident.store,
            {
                "verdicts": f"FROM verdicts WHERE {within} ORDER BY frame",
                "own": f"FROM incident_frames WHERE {own} AND {within}",
            },
        )

    def where(self, stamp: str) -> str:
        """A condition of SQL: rows of the measurement within the seconds."""
        margin, part = round(self.seconds * NANOSECONDS), self.incident.part
        low, high = part["from_ns"] - margin, part["to_ns"] + margin
        return f"measurement_id = '{self.incident.measurement_id}' AND {stamp} BETWEEN {low} AND {high}"

    def regions(self, frame: int, measurement_id: str | None = None) -> list[Region]:
        """The damaged portions of the attacked sensors in one of the incident's frames; of all where none is named."""
        if frame not in self._inside or measurement_id not in (None, self.incident.measurement_id):
            return []
        attacked = self.incident.attacked
        regions = self.incident.store.load_regions(self.incident.measurement_id, frame)
        return [region for region in regions if not attacked or region.sensor in attacked]

    def place_of(self, measurement_id: str, name: str) -> str:
        """The name of a file of a frame in the case: of other recordings it begins with their measurement."""
        return name if measurement_id == self.incident.measurement_id else f"{measurement_id[:8]}_{name}"


def in_words(sensor: int) -> str:
    """A sensor as people write it."""
    return f"S_{sensor} (LiDAR)" if sensor == LIDAR else f"S_{sensor}"
