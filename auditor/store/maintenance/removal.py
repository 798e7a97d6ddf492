"""Removing recordings from a store, with all that was measured and judged of them.

The rows that make other files finished go first: a removal that is killed leaves files that nobody reads.
"""

import shutil
from collections.abc import Collection, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from auditor.errors import StoreError
from auditor.store.files import locked
from auditor.store.log.entry import place_in
from auditor.store.log.runs import logged
from auditor.store.pictures import full_pictures
from auditor.store.records import RecordingRecord
from auditor.store.schema import MANIFESTS
from auditor.store.store import Store
from auditor.store.tables import read_table, rows_of_files

_EVALUATIONS = ("evaluations", "object_evaluations")
_OF_RECORDINGS = ("labels", "given_labels", "recordings")


@dataclass(frozen=True)
class RemovalResult:
    """What went with some recordings, and the calibrations that were made of them, which stay."""

    measurements: int
    judgements: int
    parts: int
    calibrations: tuple[str, ...]


def find_removable(store: Store, wanted: Collection[str]) -> list[RecordingRecord]:
    """The recordings of some names or ids, or their beginnings, each once.

    Raises StoreError where one names no recording, or several.
    """
    records: dict[str, RecordingRecord] = {}
    for name in wanted:
        called = store.recordings_called(name)
        if len(called) != 1:
            problem = f"{len(called)} recordings are called" if called else "no recording is called"
            ids = ", ".join(record.recording_id[:12] for record in called)
            remedy = f"name one by its id: {ids}" if called else "auditor store list shows them"
            raise StoreError(f"{problem} {name!r}", where=store.folder, remedy=remedy)
        records[called[0].recording_id] = called[0]
    return list(records.values())


def remove_recordings(store: Store, recording_ids: Collection[str]) -> RemovalResult:
    """Remove recordings; those that they superseded count again. Raises StoreError."""
    gone = set(recording_ids)
    with locked(store.folder), logged(store.folder) as entry:
        calibrations = [known for known, used in store.calibration_recordings().items() if gone & set(used)]
        measurements = [one.measurement_id for one in store.measurements() if one.recording_id in gone]
        judgements = _remove_measurements(store, measurements)
        parts = [(table, known) for table in _EVALUATIONS for known in _parts_of(store, table, gone)]
        for table, row_id in parts:
            _remove(store, table, row_id)
        store.packs.hide(dict.fromkeys(_OF_RECORDINGS, gone), entry)
        for recording in gone:
            paths = [store.path(table, recording) for table in _OF_RECORDINGS]
            with entry.removing(_places(store, paths), f"recording {recording} was removed"):
                for path in paths:
                    _unlink(path)
        for record in store.recordings():
            if gone & {record.superseded_by, *(record.conflicts or ())}:
                # It is compared anew: another recording may hold its frames, too.
                store.write_recording(replace(record, superseded_by=None, conflicts=None))
    return RemovalResult(len(measurements), judgements, len(parts), tuple(calibrations))


def remove_measurement(store: Store, measurement_id: str) -> int:
    """Remove a measurement, where there is one, its judgements and pictures; returns how many judgements it had."""
    return _remove_measurements(store, [measurement_id])


def _remove_measurements(store: Store, measurement_ids: Collection[str]) -> int:
    """Every judgement of the store is looked at once, however many measurements go."""
    rows = rows_of_files("judgements", store.files("judgements"), ["judgement_id", "measurement_id"])
    judgements = [row["judgement_id"] for row in rows if row["measurement_id"] in measurement_ids]
    for judgement in judgements:
        _remove(store, "judgements", judgement)
    for measurement in measurement_ids:
        if store.has_measurement(measurement):
            _remove(store, "measurements", measurement)
        _remove_pictures(store, measurement)
        store.forget(measurement)
    return len(judgements)


def _remove_pictures(store: Store, measurement_id: str) -> None:
    """The log has written those of incidents; the row of the measurement finished the others."""
    folder = store.folder / "pictures"
    of_incidents = _places(store, full_pictures(folder, measurement_id))
    with ExitStack() as stack:
        if of_incidents:
            entry = stack.enter_context(logged(store.folder))
            stack.enter_context(entry.removing(of_incidents, f"measurements {measurement_id} was removed"))
        shutil.rmtree(folder / measurement_id, ignore_errors=True)


def _parts_of(store: Store, table: str, recording_ids: Collection[str]) -> list[str]:
    """The parts of evaluations that were made of some recordings."""
    return [
        known
        for known in store.ids(table)
        if read_table(table, store.path(table, known), ["recording_id"])[0].to_pylist()[0] in recording_ids
    ]


def _remove(store: Store, manifest: str, row_id: str) -> None:
    """Remove the row that makes files finished, then those files."""
    dependent = [table for table, of in MANIFESTS.items() if of == manifest]
    if manifest == "evaluations":
        dependent += ["case_verdicts", "missed_pictures"]
    logged_ones = [store.path(table, row_id) for table in (manifest, *dependent) if table not in MANIFESTS]
    with logged(store.folder) as entry:
        places = _places(store, logged_ones)
        store.packs.hide({table: {row_id} for table in (manifest, *dependent)}, entry)
        with entry.removing(places, f"{manifest} {row_id} was removed"):
            for table in (manifest, *dependent):
                _unlink(store.path(table, row_id))


def _places(store: Store, paths: Iterable[Path]) -> list[str]:
    return [place_in(store.folder, path) for path in paths if path.exists()]


def _unlink(path: Path) -> None:
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise StoreError(f"it cannot be removed ({error.strerror or error})", where=path) from error


def remove_counted_earlier(store: Store, measurement: str) -> None:
    """Remove what was measured of the same recording by the same rig and matcher in an earlier way of counting."""
    if not store.has_measurement(measurement):
        return

    def measured(candidate: str) -> tuple[str, str, str]:
        record = store.measurement(candidate)
        return record.recording_id, record.rig_id, record.procedure.matcher

    version = store.measurement(measurement).procedure.counting_version
    for candidate in store.ids("measurements"):
        earlier = store.measurement(candidate).procedure.counting_version < version
        if earlier and measured(candidate) == measured(measurement):
            remove_measurement(store, candidate)
