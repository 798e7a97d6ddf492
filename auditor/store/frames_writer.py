"""The frames of one measurement on their way into the store, one at a time."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from auditor.errors import StoreError
from auditor.frames import Skipped
from auditor.results import Measurement
from auditor.rig import Rig
from auditor.store.cell_rows import cell_rows
from auditor.store.frame_rows import measured_row, skipped_row
from auditor.store.records import MeasurementRecord
from auditor.store.region_rows import region_rows
from auditor.store.rows import measurement_row
from auditor.store.symptom_rows import symptom_rows
from auditor.store.tables import TableWriter, write_rows

WRITTEN = ("cells", "symptoms", "regions", "frames")
"""The tables that a measurement fills, in the order in which they are finished."""


class FramesWriter:
    """Takes the frames of one measurement in their order, and makes them finished with `commit`."""

    def __init__(self, measurement_id: str, rig: Rig, tables: Mapping[str, TableWriter], manifest: Path) -> None:
        self._manifest = manifest
        self._measurement_id = measurement_id
        self._rig = rig
        self._tables = tables
        self._measured = 0
        self._skipped: Counter[str] = Counter()
        self._first_stamp_ns: int | None = None
        self._last_stamp_ns: int | None = None

    @property
    def measured(self) -> int:
        """How many measured frames were added."""
        return self._measured

    def add(self, frame: Measurement, ratios: Sequence[float | None]) -> None:
        """Take a measured frame and all that goes with it; its local ratios in the order of `rig_elements(rig)`.

        Raises StoreError where they do not fit the rig.
        """
        measurement_id = self._measurement_id
        self._tables["frames"].add(measured_row(measurement_id, frame, ratios, self._rig))
        for row in cell_rows(measurement_id, frame.number, frame.cells, self._rig):
            self._tables["cells"].add(row)
        for row in symptom_rows(measurement_id, frame.number, frame.symptoms):
            self._tables["symptoms"].add(row)
        for row in region_rows(measurement_id, frame.number, frame.regions):
            self._tables["regions"].add(row)
        self._measured += 1
        self._note(frame.stamp_ns)

    def skip(self, tick: Skipped) -> None:
        """Take a tick without a frame."""
        self._tables["frames"].add(skipped_row(self._measurement_id, tick))
        self._skipped[tick.reason] += 1
        self._note(tick.stamp_ns)

    def commit(self, measurement: MeasurementRecord) -> None:
        """Put all tables in their place, then write the row that makes the measurement finished.

        Raises StoreError where the record is of another measurement.
        """
        if measurement.measurement_id != self._measurement_id:
            raise StoreError(
                f"the record is of measurement {measurement.measurement_id}",
                where=f"measurement {self._measurement_id}",
            )
        for table in WRITTEN:
            self._tables[table].commit()
        row = {
            **measurement_row(measurement),
            "frames": self._measured + self._skipped.total(),
            "measured": self._measured,
            "skipped": dict(sorted(self._skipped.items())),
            "first_stamp_ns": self._first_stamp_ns,
            "last_stamp_ns": self._last_stamp_ns,
        }
        write_rows("measurements", self._manifest, [row])

    def _note(self, stamp_ns: int) -> None:
        stamps = [stamp for stamp in (self._first_stamp_ns, stamp_ns, self._last_stamp_ns) if stamp is not None]
        self._first_stamp_ns, self._last_stamp_ns = min(stamps), max(stamps)
