"""Writes the tables of one measurement frame by frame, and the row that makes them finished."""

from array import array
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from auditor.errors import StoreError
from auditor.model.frames import FramePose, SkippedFrame
from auditor.model.measurement import Measurement
from auditor.model.rig import Rig
from auditor.store.files import WrittenFile
from auditor.store.measurement_tables import cell_rows, fault_feature_rows, measured_row, region_rows, skipped_row
from auditor.store.records import MeasurementRecord
from auditor.store.rows import measurement_row, pose_row
from auditor.store.schema import WRITTEN
from auditor.store.tables import Row, TableWriter


class LookedShares:
    """How much of each sensor others were compared with, over the measured frames in which it was there."""

    def __init__(self) -> None:
        self._present: Counter[int] = Counter()
        self._shares: dict[str, dict[int, tuple[float, int]]] = {"compared_share": {}, "compared_by_two_share": {}}

    def add(self, frame: Row) -> None:
        """Take the row of a measured frame."""
        states: Any = frame["state"]
        for place, state in enumerate(states):
            self._present[place] += state == "present"
            for name, sums in self._shares.items() if state == "present" else ():
                shares: Any = frame[name]
                if shares is not None and shares[place] is not None:
                    total, count = sums.get(place, (0.0, 0))
                    sums[place] = total + shares[place], count + 1

    @property
    def row(self) -> Row:
        """The columns that measurements have of it."""
        means = {
            name: [known[place][0] / known[place][1] if place in known else None for place in self._present]
            for name, known in self._shares.items()
        }
        return {"present_frames": list(self._present.values()), **means}


Finish = Callable[[str, Row, Sequence[WrittenFile]], None]
"""Makes a measurement finished: its id, its row, and the files that this row finishes."""


class FramesWriter:
    """Takes the frames of one measurement in their order, and makes them finished with `commit`."""

    def __init__(self, measurement_id: str, rig: Rig, tables: Mapping[str, TableWriter], finish: Finish) -> None:
        self._finish = finish
        self._measurement_id = measurement_id
        self._rig = rig
        self._tables = tables
        self._measured = 0
        self._skipped: Counter[str] = Counter()
        self._looked = LookedShares()
        self._first_stamp_ns: int | None = None
        self._numbers, self._stamps_ns = array("q"), array("q")
        self._last_stamp_ns: int | None = None

    @property
    def measured(self) -> int:
        """How many measured frames were added."""
        return self._measured

    @property
    def frames(self) -> tuple[Sequence[int], Sequence[int]]:
        """The numbers and the stamps of the measured frames."""
        return self._numbers, self._stamps_ns

    def add(
        self,
        frame: Measurement,
        statistics: Sequence[float | None],
        unmasked: Sequence[float | None] | None = None,
        *,
        with_cells: bool = True,
    ) -> None:
        """Take a measured frame and all that goes with it; its statistics in the order of `rig_sensor_checks(rig)`.

        `unmasked` are those that are others without the LiDAR, None elsewhere. Its cells may be left out. Raises
        StoreError where they do not fit the rig.
        """
        measurement_id = self._measurement_id
        of_frame = measured_row(measurement_id, frame, statistics, self._rig, unmasked)
        self._tables["frames"].add(of_frame)
        self._looked.add(of_frame)
        for row in cell_rows(measurement_id, frame.number, frame.cells if with_cells else {}):
            self._tables["cells"].add(row)
        for row in fault_feature_rows(measurement_id, frame.number, frame.fault_features):
            self._tables["fault_features"].add(row)
        for row in region_rows(measurement_id, frame.number, frame.regions):
            self._tables["regions"].add(row)
        self._measured += 1
        self._numbers.append(frame.number)
        self._stamps_ns.append(frame.stamp_ns)
        self._note(frame.stamp_ns)

    def skip(self, tick: SkippedFrame) -> None:
        """Take a tick without a frame."""
        self._tables["frames"].add(skipped_row(self._measurement_id, tick))
        self._skipped[tick.reason] += 1
        self._note(tick.stamp_ns)

    def add_pose(self, placed: FramePose) -> None:
        """Take a pose of a measured frame."""
        self._tables["poses"].add(pose_row(self._measurement_id, placed))

    def commit(self, measurement: MeasurementRecord, pictures: Sequence[WrittenFile] = ()) -> None:
        """Put all tables in their place, then write the row that makes them and the pictures finished.

        Raises StoreError where the record is of another measurement.
        """
        if measurement.measurement_id != self._measurement_id:
            raise StoreError(
                f"the record is of measurement {measurement.measurement_id}",
                where=f"measurement {self._measurement_id}",
            )
        written = [self._tables[table].commit() for table in WRITTEN]
        row = {
            **measurement_row(measurement),
            **self._looked.row,
            "frames": self._measured + self._skipped.total(),
            "measured": self._measured,
            "skipped": dict(sorted(self._skipped.items())),
            "first_stamp_ns": self._first_stamp_ns,
            "last_stamp_ns": self._last_stamp_ns,
        }
        self._finish(self._measurement_id, row, [*written, *pictures])

    def _note(self, stamp_ns: int) -> None:
        stamps = [stamp for stamp in (self._first_stamp_ns, stamp_ns, self._last_stamp_ns) if stamp is not None]
        self._first_stamp_ns, self._last_stamp_ns = min(stamps), max(stamps)
