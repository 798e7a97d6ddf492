"""What a store knows of one incident: the rows that its case file is made of."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from auditor.model.measurement import Region
from auditor.model.rig import LIDAR, Rig
from auditor.reporting.incident.examples import Example, examples_of
from auditor.store import RecordingRecord, Store, rows_of
from auditor.store.export import Table
from auditor.store.queries import run_sqls

_NS_PER_S = 10**9


@dataclass(frozen=True, eq=False)
class CaseIncident:
    """One incident with the seconds around it; `row` is that of the view `incidents`.

    An incident may run through several recordings: all that comes from a recording is of the `part` that has the
    strongest frame. `seconds` before and after it belong to the case.
    """

    store: Store
    row: Mapping[str, Any]
    seconds: float

    @property
    def incident_id(self) -> str:
        """Its whole id."""
        return str(self.row["incident_id"])

    @property
    def attacked(self) -> tuple[int, ...]:
        """The attacked sensors; none where none is named."""
        return tuple(self.row["attacked"])

    @cached_property
    def part(self) -> Mapping[str, Any]:
        """What the recording with the strongest frame has of it."""
        strongest = self.row["strongest_measurement_id"] or self.row["measurement_id"]
        [part] = [one for one in self.row["parts"] if one["measurement_id"] == strongest]
        return dict(part)

    @property
    def measurement_id(self) -> str:
        """The measurement that the pictures and the clip follow."""
        return str(self.part["measurement_id"])

    @cached_property
    def recording(self) -> RecordingRecord:
        """The recording with the strongest frame."""
        return self.store.recording(self.part["recording_id"])

    @cached_property
    def rig(self) -> Rig:
        """The rig as it was measured with."""
        return self.store.rig(self.store.measurement(self.measurement_id).rig_id)

    @cached_property
    def frames(self) -> list[dict[str, Any]]:
        """The verdicts of the frames from the first second to the last, with what is `in_incident`, by frame."""
        return [{**row, "in_incident": row["frame"] in self._inside} for row in rows_of(self._tables["verdicts"])]

    @cached_property
    def _inside(self) -> set[int]:
        """Its own frames in this recording."""
        return {row["frame"] for row in rows_of(self._tables["own"])}

    @cached_property
    def examples(self) -> tuple[Example, ...]:
        """The frames that show it, the strongest first; some may be of other recordings of its drive."""
        return examples_of(self.store, self.incident_id).get(self.incident_id, ())

    @property
    def own_examples(self) -> set[int]:
        """Those of the recording with the strongest frame."""
        return {one.frame for one in self.examples if one.measurement_id == self.measurement_id}

    @property
    def strongest(self) -> int | None:
        """Its strongest frame."""
        return next((one.frame for one in self.examples if "strongest" in one.what), None)

    def place_of(self, measurement_id: str, name: str) -> str:
        """The name of a file of a frame in the case: of other recordings it begins with their measurement."""
        return name if measurement_id == self.measurement_id else f"{measurement_id[:8]}_{name}"

    @cached_property
    def _tables(self) -> dict[str, Table]:
        within, own = self.where("stamp_ns"), f"incident_id = '{self.incident_id}'"
        return run_sqls(
            self.store,
            {
                "verdicts": f"FROM verdicts WHERE {within} ORDER BY frame",
                "own": f"FROM incident_frames WHERE {own} AND {within}",
            },
        )

    def where(self, stamp: str) -> str:
        """A condition of SQL: rows of the measurement within the seconds."""
        margin = round(self.seconds * _NS_PER_S)
        low, high = self.part["from_ns"] - margin, self.part["to_ns"] + margin
        return f"measurement_id = '{self.measurement_id}' AND {stamp} BETWEEN {low} AND {high}"

    def regions(self, frame: int) -> list[Region]:
        """The damaged portions of the attacked sensors in one of its frames; of all sensors where none is named."""
        if frame not in self._inside:
            return []
        regions = self.store.load_regions(self.measurement_id, frame)
        return [region for region in regions if not self.attacked or region.sensor in self.attacked]

    def called(self, sensor: int) -> str:
        """A sensor as people write it."""
        return f"S_{sensor} (LiDAR)" if sensor == LIDAR else f"S_{sensor}"
