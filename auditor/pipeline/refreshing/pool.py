"""The recordings that a refresh may learn from: by rig kind, and what bars some of them before anything is judged."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field

from auditor.identification.refresh_parameters import CLEAN_DRIVE
from auditor.model.rig import Rig
from auditor.pipeline.judge import counted_earlier
from auditor.pipeline.many import attacked_by_labels, conflicts_of, reading_of, superseded_by
from auditor.store import RecordingRecord, Store, StoredMeasurement
from auditor.store.versions.history import History, histories, history_for

NAMED = "named clean"


@dataclass(frozen=True)
class Log:
    """A measured recording. `named` says that a person called it clean; `barred` why it is not learnt from, if so.

    `doubt` is why it is not learnt from unless a person called it clean. `look_at` is of either of both.
    """

    store: Store
    measurement: StoredMeasurement
    recording: RecordingRecord
    rig: Rig
    named: bool
    barred: str
    doubt: str
    look_at: bool


@dataclass(frozen=True)
class Group:
    """The logs of one rig kind and procedure, with the history of its versions."""

    history: History
    logs: list[Log] = field(default_factory=list)


def groups_of(stores: Sequence[Store], named: Collection[str]) -> list[Group]:
    """The logs of some stores by rig kind and procedure; the versions are those of the first.

    `named` are the measurements that this call names clean. Measurements of an earlier way of counting are left out.
    """
    groups = [Group(history) for history in histories(stores[0])]
    seen: set[str] = set()
    for store in stores:
        for known in store.ids("measurements"):
            if known not in seen and not counted_earlier(store, known):
                seen.add(known)
                log = _log(store, known, named)
                _group(groups, log).logs.append(log)
    return [group for group in groups if group.logs]


def _group(groups: list[Group], log: Log) -> Group:
    """The group of a log, which is added where there is none yet."""
    history = history_for([one.history for one in groups], log.rig.kind, log.measurement.procedure)
    found = next((one for one in groups if one.history is history), None)
    if found is None:
        found = Group(history)
        groups.append(found)
    return found


def _log(store: Store, measurement: str, named: Collection[str]) -> Log:
    stored = store.measurement(measurement)
    recording = store.recording(stored.recording_id)
    called = measurement in named or any(one.attack is None for one in store.given_labels(stored.recording_id))
    barred, look_at = _barred(store, stored, recording)
    doubt, look_at = ("", look_at) if barred else _doubtful(stored)
    return Log(store, stored, recording, store.rig(stored.rig_id), called, barred, doubt, look_at)


def _barred(store: Store, stored: StoredMeasurement, recording: RecordingRecord) -> tuple[str, bool]:
    """Why a log is not learnt from, whoever calls it clean, and whether a person should look at it."""
    known = stored.measurement_id
    if reason := attacked_by_labels(store, known) or superseded_by(store, known):
        return reason, False
    if conflict := conflicts_of(store, recording):
        return conflict[0], True
    return "", False


def _doubtful(stored: StoredMeasurement) -> tuple[str, bool]:
    """Why a log that nobody calls clean is not learnt from, and whether a person should look at it."""
    if stored.measured < CLEAN_DRIVE.fewest_frames:
        return f"{stored.measured} frames, fewer than {CLEAN_DRIVE.fewest_frames}", False
    reading = reading_of(stored)
    if not reading.complete:
        return "; ".join(reading.remarks) or "it was not read whole", False
    if stored.calibration_warnings:
        return f"its calibration is in doubt: {stored.calibration_warnings[0]}", True
    return "", False
