"""A store: one folder of Parquet files, named by ids only, that holds what was measured and what was judged."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pyarrow as pa

from auditor.errors import StoreError
from auditor.model.calibration import Calibration
from auditor.model.fault_features import ObservedFeatures
from auditor.model.measurement import Region, Statistic
from auditor.model.pictures import FramePicture, Picture
from auditor.model.rig import Rig
from auditor.model.text import storable
from auditor.model.verdict import FINDINGS, AttackLabel, Method, Verdict, VerdictKind
from auditor.store.calibrations import OutdatedCalibrationError, read_calibration, write_calibration
from auditor.store.files import WrittenFile, write_whole
from auditor.store.folder import StoreFolder
from auditor.store.frames_writer import FramesWriter
from auditor.store.log.entry import OutputFile
from auditor.store.log.runs import logged
from auditor.store.measurement_tables import (
    FrameCells,
    errors_of,
    fault_features_of,
    read_cells,
    read_frames,
    read_regions,
    statistics_of,
)
from auditor.store.pictures import (
    pictured_frames,
    read_frame_pictures,
    read_picture,
    write_frame_pictures,
    write_picture,
)
from auditor.store.records import (
    FrameErrors,
    FrameStatistics,
    GivenLabel,
    JudgementRecord,
    RecordingRecord,
    StoredJudgement,
    StoredMeasurement,
)
from auditor.store.rows import (
    JUDGEMENT_COLUMNS,
    MEASUREMENT_COLUMNS,
    given_label_rows,
    judgement_row,
    label_rows,
    recording_row,
    rig_row,
    sensor_check_rows,
    stored_given_label,
    stored_judgement,
    stored_label,
    stored_measurement,
    stored_recording,
    triple_rows,
    verdict_columns,
)
from auditor.store.schema import WRITTEN
from auditor.store.tables import Row, Source, StoredRows, read_rows, read_table, rows_of_files, write_rows, writing


class Store(StoreFolder):
    """One store. Every method raises StoreError where a file cannot be read or written, or an id is none.

    Rigs and finished measurements are read once: their ids are hashes of what decides them, and they are never changed.
    """

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self._rigs: dict[str, Rig] = {}
        self._measurements: dict[str, StoredMeasurement] = {}
        self._read: tuple[str, pa.Table] | None = None

    def source(self, table: str, row_id: str) -> StoredRows:
        """Where the rows of an id are read: in a file of its own, or in a pack."""
        path = self.path(table, row_id)
        return StoredRows(path, lambda: path if path.is_file() else self.packs.part(table, row_id) or path)

    def write(self, table: str, row_id: str, rows: Iterable[Row]) -> None:
        """Put a file of a table in its place; the log says so. Raises StoreError."""
        with logged(self.folder) as entry:
            write_rows(table, self.path(table, row_id), rows, entry.announce)

    def write_page(self, path: Path, text: str) -> Path:
        """Put a page in its place, and give that; the log says so where it is in the store. Raises StoreError."""
        if path.resolve().is_relative_to(self.folder):
            with logged(self.folder) as entry:
                write_whole(path.resolve(), text.encode(), entry.announce)
        else:
            write_whole(path, text.encode())
        return path

    def _outputs(self, written: Iterable[WrittenFile]) -> list[Row]:
        """Files as the column `outputs` has them."""
        return [OutputFile.of_written(one, self.folder).fields for one in written]

    # Recordings, rigs, labels

    def write_recording(self, recording: RecordingRecord) -> None:
        """Keep what is known of a recording."""
        self.write("recordings", recording.recording_id, [recording_row(recording)])

    def recordings(self) -> list[RecordingRecord]:
        """All recordings, by id."""
        return [stored_recording(row) for row in self._rows("recordings")]

    def recordings_called(self, wanted: str) -> list[RecordingRecord]:
        """Those that were read under this name, or whose ids begin so."""
        text, every = storable(wanted), self.recordings() if wanted else []
        return [one for one in every if text in (one.name, *one.other_names) or one.recording_id.startswith(wanted)]

    def has_recording(self, recording_id: str) -> bool:
        """True where a recording was kept."""
        return self.has("recordings", recording_id)

    def recording(self, recording_id: str) -> RecordingRecord:
        """The recording of an id."""
        return stored_recording(self._row("recordings", recording_id))

    def counted_by(self) -> dict[str, str]:
        """By each recording whose frames a later one holds, the recording that counts in its place."""
        rows = self._rows("recordings", ("recording_id", "superseded_by"))
        later = {row["recording_id"]: row["superseded_by"] for row in rows if row["superseded_by"] is not None}

        def last(recording: str) -> str:
            return last(later[recording]) if recording in later else recording

        return {known: last(known) for known in later}

    def write_rig(self, rig: Rig) -> None:
        """Keep a rig, its triples and its sensor checks."""
        with logged(self.folder):
            self.write("sensor_checks", rig.rig_id, sensor_check_rows(rig))
            self.write("triples", rig.rig_id, triple_rows(rig))
            self.write("rigs", rig.rig_id, [rig_row(rig)])

    def rig(self, rig_id: str) -> Rig:
        """The rig of an id."""
        if rig_id not in self._rigs:
            row = self._row("rigs", rig_id)
            self._rigs[rig_id] = Rig.from_dict(json.loads(row["description"]))
        return self._rigs[rig_id]

    def write_labels(self, recording_id: str, labels: Iterable[AttackLabel], rig: Rig | None = None) -> None:
        """Keep the ground truth of a recording. A recording without a label is not known to be clean."""
        self.write("labels", recording_id, label_rows(recording_id, labels, rig))

    def labels(self, recording_id: str) -> list[AttackLabel]:
        """The ground truth that a recording carries; none where it carries none."""
        if not self.has("labels", recording_id):
            return []
        return [stored_label(row) for row in read_rows("labels", self.source("labels", recording_id))]

    def write_given_labels(self, recording_id: str, labels: Iterable[GivenLabel]) -> None:
        """Keep all labels that persons gave to a recording, in place of those of before."""
        self.write("given_labels", recording_id, given_label_rows(recording_id, labels))

    def given_labels(self, recording_id: str) -> list[GivenLabel]:
        """The labels that persons gave to a recording."""
        path = self.path("given_labels", recording_id)
        return [stored_given_label(row) for row in read_rows("given_labels", path)] if path.is_file() else []

    # Measurements

    @contextmanager
    def frames_writer(self, measurement_id: str, rig: Rig) -> Iterator[FramesWriter]:
        """Write the frames of a measurement; without a `commit` inside the block, nothing of them stays."""
        with ExitStack() as stack:
            tables = {table: stack.enter_context(writing(table, self.path(table, measurement_id))) for table in WRITTEN}
            yield FramesWriter(measurement_id, rig, tables, self._finish_measurement)

    def _finish_measurement(self, measurement_id: str, row: Row, written: Sequence[WrittenFile]) -> None:
        self.write("measurements", measurement_id, [{**row, "outputs": self._outputs(written)}])

    def has_measurement(self, measurement_id: str) -> bool:
        """True where a measurement was finished."""
        return self.has("measurements", measurement_id)

    def measurements(self) -> list[StoredMeasurement]:
        """All finished measurements, by id."""
        ids = self.ids("measurements")
        if new := {one for one in ids if one not in self._measurements}:
            rows = self.only(measurements=new)._rows("measurements", MEASUREMENT_COLUMNS)
            self._measurements |= {row["measurement_id"]: stored_measurement(row) for row in rows}
        return [self._measurements[one] for one in ids]

    def measurement(self, measurement_id: str) -> StoredMeasurement:
        """One finished measurement."""
        if measurement_id not in self._measurements:
            self._measurements[measurement_id] = stored_measurement(self._row("measurements", measurement_id))
        return self._measurements[measurement_id]

    def forget(self, measurement_id: str) -> None:
        """Read a measurement anew when it is asked for next: it was removed, and may be measured again."""
        self._measurements.pop(measurement_id, None)
        self._read = None

    def load_errors(self, measurement_id: str, statistic: Statistic) -> FrameErrors:
        """The disparity errors of a finished measurement."""
        return errors_of(*self._frames(measurement_id), statistic)

    def load_statistics(self, measurement_id: str) -> FrameStatistics:
        """The statistics of the sensor checks and the fingerprints of a finished measurement."""
        return statistics_of(*self._frames(measurement_id))

    def load_cells(self, measurement_id: str) -> Iterator[FrameCells]:
        """The counts of a finished measurement on their grids, frame by frame: enough to recount its statistics."""
        self.measurement(measurement_id)
        return read_cells(self.source("cells", measurement_id))

    def load_fault_features(self, measurement_id: str) -> ObservedFeatures:
        """The fault features of a finished measurement's frames."""
        return fault_features_of(*self._frames(measurement_id), self.source("fault_features", measurement_id))

    def _frames(self, measurement_id: str) -> tuple[pa.Table, Source, Rig]:
        """The measured frames of a measurement, kept until another is asked for, where they come from, and its rig."""
        source, rig = self.source("frames", measurement_id), self.rig(self.measurement(measurement_id).rig_id)
        if self._read is None or self._read[0] != measurement_id:
            self._read = measurement_id, read_frames(source)
        return self._read[1], source, rig

    def load_regions(self, measurement_id: str, frame: int) -> list[Region]:
        """The portions of a frame's sensors that would be damaged, were they attacked."""
        return read_regions(self.source("regions", measurement_id), frame)

    # Calibrations and judgements

    def write_calibration(self, calibration: Calibration) -> None:
        """Keep a calibration."""
        with logged(self.folder) as entry:
            write_calibration(calibration, self.path("calibrations", calibration.calibration_id), entry.announce)

    def keep_calibration(self, calibration: Calibration) -> None:
        """Keep a calibration that is not kept yet."""
        if calibration.calibration_id not in self.ids("calibrations"):
            self.write_calibration(calibration)

    def calibration(self, calibration_id: str) -> Calibration:
        """The calibration of an id. Raises ThresholdsError where there is none."""
        return read_calibration(self.path("calibrations", calibration_id))

    def calibrations(self) -> list[Calibration]:
        """All calibrations, by id; those of older versions that nothing can be judged by any more are left out."""
        calibrations = []
        for calibration_id in self.ids("calibrations"):
            with suppress(OutdatedCalibrationError):
                calibrations.append(self.calibration(calibration_id))
        return calibrations

    def calibrations_called(self, beginning: str) -> list[str]:
        """The ids of calibrations that begin so."""
        return [known for known in self.ids("calibrations") if beginning and known.startswith(beginning)]

    def calibration_recordings(self) -> dict[str, tuple[str, ...]]:
        """The recordings that each calibration was made from, by its id: also those of older versions."""
        recordings = {}
        for calibration_id in self.ids("calibrations"):
            column = read_table("calibrations", self.path("calibrations", calibration_id), ["recordings"])["recordings"]
            named = column.drop_null().slice(0, 1).to_pylist()  # of all rows, or of the first alone
            recordings[calibration_id] = tuple(name for names in named for name in names)
        return recordings

    def write_judgement(
        self, judgement: JudgementRecord, verdicts: Iterable[tuple[int, int, Verdict]]
    ) -> StoredJudgement:
        """Keep a judgement and its verdicts, each with its frame number and stamp, and return what was kept.

        The verdicts are written first, the judgement last: it is current then, unless another is dated later.
        """
        rig = self.rig(self.measurement(judgement.measurement_id).rig_id)
        judgement_id, row = judgement.judgement_id, judgement_row(judgement, rig)
        robust, judged = judgement.method == Method.ROBUST, list(verdicts)
        counts = Counter(verdict.kind for _, _, verdict in judged)
        # Weak evidence that lasts makes an incident of frames none of which is a finding by itself.
        in_incidents = sum(verdict.in_incident if robust else verdict.kind in FINDINGS for _, _, verdict in judged)
        in_alerts = sum(verdict.in_alert for _, _, verdict in judged)
        with writing("verdicts", self.path("verdicts", judgement_id)) as table:
            table.add_columns(verdict_columns(judgement_id, judgement.measurement_id, judged))
            written = table.commit()
        row = {**row, **{kind.value: counts[kind] for kind in VerdictKind}, "outputs": self._outputs([written])}
        row |= {"in_incidents": in_incidents, "in_alerts": in_alerts}
        self.write("judgements", judgement_id, [row])
        return stored_judgement(row)

    def judgements(self) -> list[StoredJudgement]:
        """All finished judgements, oldest first."""
        judgements = map(stored_judgement, self._rows("judgements", JUDGEMENT_COLUMNS))
        return sorted(judgements, key=lambda j: (j.judged_at, j.judgement_id))

    def current_judgements(self) -> dict[str, StoredJudgement]:
        """The latest judgement of each measurement that was ever judged, by the measurement's id.

        Every judgement of the store is read: ask once, not for each measurement.
        """
        return {judgement.measurement_id: judgement for judgement in self.judgements()}

    # Pictures

    def write_picture(self, measurement_id: str, picture: Picture) -> tuple[WrittenFile, ...]:
        """Keep what the cameras saw in a frame, and its mask: files that the row of the measurement is to name."""
        return write_picture(self.folder / "pictures", measurement_id, picture)

    def picture(self, measurement_id: str, frame: int) -> Picture | None:
        """The picture of a frame; None where none was kept."""
        return read_picture(self.folder / "pictures", measurement_id, frame)

    def pictured_frames(self, measurement_id: str) -> list[int]:
        """The frames of a measurement whose pictures were kept, ascending."""
        return pictured_frames(self.folder / "pictures", measurement_id)

    def write_frame_pictures(self, measurement_id: str, pictures: Sequence[FramePicture]) -> None:
        """Keep pictures of frames at full resolution beside those of its measurement; the log says so."""
        with logged(self.folder) as entry:
            write_frame_pictures(entry, measurement_id, pictures)

    def frame_pictures(self, measurement_id: str, frame: int) -> list[FramePicture]:
        """The pictures of a frame at full resolution, by sensor; none where none were kept."""
        return read_frame_pictures(self.folder / "pictures", measurement_id, frame)

    def _rows(self, table: str, columns: Sequence[str] | None = None) -> list[dict[str, Any]]:
        """The rows of all finished ids, by id, or some columns of them."""
        return rows_of_files(table, self.files(table), columns)

    def _row(self, table: str, row_id: str) -> dict[str, Any]:
        rows = read_rows(table, self.source(table, row_id))
        if len(rows) != 1:
            raise StoreError(f"it has {len(rows)} rows in place of one", where=self.path(table, row_id))
        return rows[0]
