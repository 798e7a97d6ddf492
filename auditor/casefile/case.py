"""A case under way: its incident with the seconds around it, its folder, and what is left out of it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from auditor.casefile.folder import write_file
from auditor.casefile.redaction import Redaction
from auditor.model.measurement import Region
from auditor.model.rig import LIDAR
from auditor.model.stamps import NANOSECONDS
from auditor.reporting.incident.incident import Incident
from auditor.store.export import Table, rows_of
from auditor.store.queries import run_sqls


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
