"""One frame of a recording, for people to look at: what its sensors recorded, and what a store says of it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from auditor.errors import RecordingError
from auditor.identification.scores import standing_out
from auditor.identification.statistics import sensor_statistics
from auditor.measurement import localise, measure, use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.drawing import draw_frame
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import Frame, Skipped
from auditor.model.measurement import Region
from auditor.model.pictures import FramePicture
from auditor.model.rig import Rig
from auditor.pipeline.geometry import rigs_through
from auditor.recordings import Location, Recording, open_recording, survey, synchronise
from auditor.store import Store, rows_of, run_sql


@dataclass(frozen=True)
class ShownFrame:
    """A frame with its pictures, or the reason why it was skipped.

    `measurement_id` is that of the store, `verdict` its row of `verdicts`; None where the store has none. Without a
    measurement the `regions` were measured now, with sgbm.
    """

    rig: Rig
    frame: Frame | Skipped
    clock: str
    regions: tuple[Region, ...] = ()
    pictures: tuple[FramePicture, ...] = ()
    measurement_id: str | None = None
    verdict: dict[str, Any] | None = None


def show_frame(where: Location, number: int, store: Path | None, rig_file: Path | None = None) -> ShownFrame:
    """The frame of a number. Raises RecordingError, also where there is none, RigError and StoreError."""
    use_one_thread()
    with open_recording(where) as recording:
        rig, frame = _frame(recording, number, rig_file)
        shown = ShownFrame(rig, frame, recording.clock)
        if isinstance(frame, Skipped):
            return shown
        kept = Store.open(store) if store is not None else None
        known = _measurement(kept, recording.recording_id, rig.rig_id) if kept is not None else None
        if kept is None or known is None:
            regions = _measured_now(frame, rig)
        else:
            regions = tuple(kept.load_regions(known, number))
    verdict = _verdict(kept, known, number) if kept is not None and known is not None else None
    pictures = tuple(draw_frame(frame, rig, regions, "png"))
    return ShownFrame(rig, frame, shown.clock, regions, pictures, known, verdict)


def _frame(recording: Recording, number: int, rig_file: Path | None) -> tuple[Rig, Frame | Skipped]:
    """The frame by the rig that is in force then."""
    for one in rigs_through(recording, survey(recording), rig_file).rigs:
        for item in synchronise(recording, one.rig, one.survey, colour=True, stretches=one.stretches).chosen([number]):
            return one.rig, item
    raise RecordingError(
        f"it has no frame {number}", where=recording.path, remedy="frames are numbered from 0, skipped ones included"
    )


def _measurement(store: Store, recording_id: str, rig_id: str) -> str | None:
    """The latest measurement of a recording with a rig."""
    of_both = [one for one in store.measurements() if (one.recording_id, one.rig_id) == (recording_id, rig_id)]
    return max(of_both, key=lambda one: one.measured_at).measurement_id if of_both else None


def _verdict(store: Store, measurement_id: str, frame: int) -> dict[str, Any] | None:
    rows = rows_of(run_sql(store, f"FROM verdicts WHERE measurement_id = '{measurement_id}' AND frame = {frame}"))
    return rows[0] if rows else None


def _measured_now(frame: Frame, rig: Rig) -> tuple[Region, ...]:
    checks = rig_sensor_checks(rig)
    counted, arrays = measure(frame, rig, find_matcher("sgbm"))
    return localise(arrays, standing_out(checks, sensor_statistics(checks, counted.cells, counted.shares)).sensors, rig)
