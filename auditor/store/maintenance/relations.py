"""Recordings of the same moments: one that holds every frame of another, and twins whose data differ.

A recording that grew, or that was copied, re-indexed, recovered or converted, has another content and the same frames.
It supersedes the earlier one, whose frames would else be counted twice. Where one vehicle would have measured two
different things at one moment, one of the recordings was changed: both stay, and both count.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import datetime
from functools import lru_cache
from math import isclose
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.model.frames import SensorState
from auditor.model.measurement import NO_FINGERPRINT
from auditor.model.rig import LIDAR, Rig
from auditor.store.files import locked
from auditor.store.log.entry import EntryKind
from auditor.store.log.runs import logged
from auditor.store.records import RecordingRecord, StoredMeasurement
from auditor.store.store import Store
from auditor.store.tables import read_table

MIN_CHANGED_FRAMES = 2
"""Frames with other data at the same stamps that make a conflict: one may be an error of copying."""

SAME_STAMPS_SHARE = 0.5
"""Share of stamps in common from which on recordings of unknown vehicles are taken to be of one vehicle.

The stamps of two vehicles agree by accident, where they are rounded to milliseconds, and hardly ever half of them.
"""

_RIG_TOLERANCE = 1e-6
"""Conversions turn rotations into quaternions and back, which changes the seventh digit at most."""

_ABSENT = -2
_NOWHERE = -1
_KEPT_MEASUREMENTS = 64


@dataclass(frozen=True)
class SupersededRecording:
    """A recording, and the one that holds every frame of it."""

    earlier: RecordingRecord
    later: RecordingRecord

    def __str__(self) -> str:
        later, earlier = self.later, self.earlier
        if later.path == earlier.path:
            had = "it has changed and holds every frame that it had before; what was scanned of it then"
            return f"{later.name}: {had} counts no longer"
        other = earlier.name if later.name != earlier.name else f"another {earlier.name} ({earlier.recording_id[:12]})"
        return f"{later.name}: it holds every frame of {other}, which counts no longer"


@dataclass(frozen=True, eq=False)
class _Messages:
    """The messages in a measurement's F frames, by the topics of its S sensors.

    `stamps_ns` (F, S) are those of the sensors; `data` (F, S) are fingerprints, NO_FINGERPRINT where a sensor was there
    without one, and _ABSENT where it was not there.
    """

    topics: tuple[str, ...]
    stamps_ns: NDArray[np.int64]
    data: NDArray[np.int64]


@dataclass(frozen=True)
class _RecordingMeasurements:
    """A recording with its measurements, and whether it carries the ground truth of an attack."""

    record: RecordingRecord
    measurements: tuple[StoredMeasurement, ...]
    labelled: bool

    @property
    def rank(self) -> tuple[int, bool, datetime, str]:
        """Of two that hold each other's frames the higher one counts."""
        return (
            max(one.measured for one in self.measurements),
            self.labelled,
            min(one.measured_at for one in self.measurements),
            self.record.recording_id,
        )


def relate(store: Store) -> tuple[SupersededRecording, ...]:
    """Compare what was not compared yet with all that the store has of the same time, and keep what was found.

    Returns the recordings that are superseded since. Raises StoreError.
    """
    with locked(store.folder):
        records = {record.recording_id: record for record in store.recordings()}
        new = {known for known, record in records.items() if record.conflicts is None}
        if not new:
            return ()
        comparison = _Comparison(store, records)
        updates: dict[str, RecordingRecord] = {known: replace(records[known], conflicts=()) for known in new}
        for first, other in _of_one_time(records, new):
            for changed in comparison.compare(updates.get(first, records[first]), updates.get(other, records[other])):
                updates[changed.recording_id] = changed
        with logged(store.folder) as entry:
            for recording_id, changed in updates.items():
                store.write_recording(changed)
                if changed.superseded_by is not None and changed.superseded_by != records[recording_id].superseded_by:
                    entry.say(EntryKind.SUPERSEDED, {"earlier": recording_id, "later": changed.superseded_by})
    return tuple(
        SupersededRecording(changed, updates.get(changed.superseded_by, records[changed.superseded_by]))
        for known, changed in sorted(updates.items())
        if changed.superseded_by is not None and changed.superseded_by != records[known].superseded_by
    )


def _of_one_time(records: Mapping[str, RecordingRecord], new: set[str]) -> Iterator[tuple[str, str]]:
    """The pairs of recordings, one of them new, that overlap in time and may be of one vehicle."""
    timed = sorted(
        (record for record in records.values() if record.from_ns is not None and record.to_ns is not None),
        key=lambda record: (record.from_ns, record.recording_id),
    )
    open_ones: list[RecordingRecord] = []
    for record in timed:
        open_ones = [one for one in open_ones if (one.to_ns or 0) >= (record.from_ns or 0)]
        for earlier in open_ones:
            other_vehicle = earlier.vehicle and record.vehicle and earlier.vehicle != record.vehicle
            if not other_vehicle and (earlier.recording_id in new or record.recording_id in new):
                yield earlier.recording_id, record.recording_id
        open_ones.append(record)


class _Comparison:
    """Compares recordings of one store; what was read of a measurement is kept for a while."""

    def __init__(self, store: Store, records: Mapping[str, RecordingRecord]) -> None:
        self._store = store
        self._records = records
        self._labelled = {known for known in store.ids("labels") if store.labels(known)}
        self._measurements: dict[str, list[StoredMeasurement]] = {}
        for measurement in store.measurements():
            self._measurements.setdefault(measurement.recording_id, []).append(measurement)
        self._messages = lru_cache(maxsize=_KEPT_MEASUREMENTS)(self._read)

    def compare(self, a: RecordingRecord, b: RecordingRecord) -> Iterator[RecordingRecord]:
        """The recordings of which something is known now."""
        first, other = self._known(a), self._known(b)
        if not first.measurements or not other.measurements:
            return
        holders = [(low, high) for low, high in ((first, other), (other, first)) if self._holds(high, low)]
        if len(holders) == 2:
            holders = [(low, high) for low, high in holders if low.rank < high.rank]
        for low, high in holders:
            before = self._records.get(low.record.superseded_by or "")
            if before is None or self._known(before).rank < high.rank:
                yield replace(low.record, superseded_by=high.record.recording_id)
        if not holders and not first.labelled and not other.labelled and self._conflict(first, other):
            yield replace(a, conflicts=_with(a.conflicts, b.recording_id))
            yield replace(b, conflicts=_with(b.conflicts, a.recording_id))

    def _known(self, record: RecordingRecord) -> _RecordingMeasurements:
        measurements = tuple(self._measurements.get(record.recording_id, ()))
        return _RecordingMeasurements(record, measurements, record.recording_id in self._labelled)

    def _holds(self, later: _RecordingMeasurements, earlier: _RecordingMeasurements) -> bool:
        """Whether one holds every frame of another, in each way of measuring that they have in common.

        A part of a drive without its calibration is measured as a LiDAR alone, which the whole need not be.
        """
        measured_again = {
            one.measurement_id: [other for other in later.measurements if self._measures_again(other, one)]
            for one in earlier.measurements
        }
        procedures = {one.procedure for one in later.measurements}
        common = [
            one for one in earlier.measurements if one.procedure in procedures or measured_again[one.measurement_id]
        ]
        return bool(common) and all(
            any(
                _all_held(self._messages(one.measurement_id), self._messages(other.measurement_id))
                for other in measured_again[one.measurement_id]
            )
            for one in common
        )

    def _measures_again(self, later: StoredMeasurement, earlier: StoredMeasurement) -> bool:
        """Whether one measures all that another does: with the same rig, or with one that has a LiDAR or cameras more.

        What has more and is withheld would hide what was found without it.
        """
        rig, whole = self._rig(earlier), self._rig(later)
        if later.procedure == earlier.procedure and _alike(rig.to_dict(), whole.to_dict()):
            return True
        if later.withheld or not (whole.cameras and whole.lidar):
            return False
        if rig.sensors == (LIDAR,):
            return later.procedure.matcher == earlier.procedure.matcher and rig.topic(LIDAR) == whole.topic(LIDAR)
        without = replace(whole, lidar=None)
        return later.procedure == earlier.procedure and _alike(rig.to_dict(), without.to_dict())

    def _conflict(self, first: _RecordingMeasurements, other: _RecordingMeasurements) -> bool:
        if not _of_one_clock(first.record, other.record):
            return False
        same_vehicle = first.record.vehicle is not None and first.record.vehicle == other.record.vehicle
        return any(
            _differ(self._messages(a.measurement_id), self._messages(b.measurement_id), same_vehicle=same_vehicle)
            for a in first.measurements
            for b in other.measurements
            if a.procedure.matcher == b.procedure.matcher  # which decides whether images are read with their colours
        )

    def _rig(self, measurement: StoredMeasurement) -> Rig:
        return self._store.rig(measurement.rig_id)

    def _read(self, measurement_id: str) -> _Messages | None:
        """The messages of a measurement; None where it was made before fingerprints were kept."""
        store = self._store
        rig = store.rig(store.measurement(measurement_id).rig_id)
        columns = ["stamp_ns", "skipped", "state", "skew_ns", "fingerprint"]
        table = read_table("frames", store.source("frames", measurement_id), columns)
        table = table.filter(table["skipped"].is_null())
        if table["fingerprint"].null_count or not len(table):
            return None
        shape = len(table), len(rig.sensors)

        def values(name: str, otherwise: object) -> NDArray[Any]:
            flat = table[name].combine_chunks().flatten().fill_null(otherwise)
            return np.asarray(flat.to_numpy(zero_copy_only=False)).reshape(shape)

        [offsets] = read_table("measurements", store.source("measurements", measurement_id), ["offsets_ns"])[
            "offsets_ns"
        ].to_pylist()
        frame_ns = table["stamp_ns"].to_numpy()[:, None]
        there = values("state", "") == SensorState.PRESENT.value
        return _Messages(
            tuple(rig.topic(sensor) for sensor in rig.sensors),
            frame_ns + values("skew_ns", 0) + np.array(offsets or [0] * shape[1], dtype=np.int64),
            np.where(there, values("fingerprint", NO_FINGERPRINT), _ABSENT),
        )


def _of_one_clock(a: RecordingRecord, b: RecordingRecord) -> bool:
    """Whether equal stamps are one moment: by UTC, or within one drive of a vehicle that is known."""
    origins = [(one.vehicle, one.date, one.drive) for one in (a, b)]
    return (a.clock == b.clock == "utc") or (origins[0] == origins[1] and None not in origins[0])


def _all_held(earlier: _Messages | None, later: _Messages | None) -> bool:
    """Whether each frame is part of one frame of the later; an incomplete one at either edge may be missing."""
    if earlier is None or later is None:
        return False
    places, _, _ = _found(earlier, later)
    there = earlier.data != _ABSENT
    first = np.where(there, places, np.iinfo(np.int64).max).min(axis=1)
    last = np.where(there, places, np.iinfo(np.int64).min).max(axis=1)
    held = there.any(axis=1) & (first == last) & (first != _NOWHERE)
    excused = ~there.all(axis=1)
    excused[1:-1] = False
    return bool(held.any() and (held | excused).all())


def _differ(a: _Messages | None, b: _Messages | None, *, same_vehicle: bool) -> bool:
    """Whether sensors measured different things at the same stamps."""
    if a is None or b is None:
        return False
    places, common, overlapping = _found(a, b)
    if not same_vehicle and common.sum() < SAME_STAMPS_SHARE * overlapping.sum():
        return False
    changed = common & (places == _NOWHERE)
    return int(changed.any(axis=1).sum()) >= MIN_CHANGED_FRAMES


def _found(a: _Messages, b: _Messages) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]:
    """What b has of a's messages, each (F, S).

    The number of b's frame with the same stamp and data, _NOWHERE where there is none; whether b has a message with
    that stamp at all; and whether it lies in the time of b's messages of that topic.
    """
    places = np.full(a.data.shape, _NOWHERE, dtype=np.int64)
    common, overlapping = np.zeros(a.data.shape, dtype=np.bool_), np.zeros(a.data.shape, dtype=np.bool_)
    for column, topic in enumerate(a.topics):
        if topic not in b.topics:
            continue
        stamps, data = (values[:, b.topics.index(topic)] for values in (b.stamps_ns, b.data))
        rows = np.flatnonzero(data != _ABSENT)
        rows = rows[np.argsort(stamps[rows], kind="stable")]
        if not len(rows):
            continue
        wanted, there = a.stamps_ns[:, column], a.data[:, column] != _ABSENT
        begin, end = (np.searchsorted(stamps[rows], wanted, side) for side in ("left", "right"))
        common[:, column] = there & (end > begin)
        overlapping[:, column] = there & (wanted >= stamps[rows[0]]) & (wanted <= stamps[rows[-1]])
        first = rows[np.minimum(begin, len(rows) - 1)]
        same = common[:, column] & (data[first] == a.data[:, column])
        places[same, column] = first[same]
        for row in np.flatnonzero(common[:, column] & ~same & (end > begin + 1)):  # several messages of one stamp
            others = rows[begin[row] : end[row]]
            others = others[data[others] == a.data[row, column]]
            places[row, column] = others[0] if len(others) else _NOWHERE
    return places, common, overlapping


def _alike(a: object, b: object) -> bool:
    """Whether two descriptions of rigs are the same but for the last digits of their numbers."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_alike(a[name], b[name]) for name in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(map(_alike, a, b))
    if isinstance(a, float) and isinstance(b, float):
        return isclose(a, b, rel_tol=_RIG_TOLERANCE, abs_tol=_RIG_TOLERANCE)
    return a == b


def _with(conflicts: tuple[str, ...] | None, other: str) -> tuple[str, ...]:
    return tuple(sorted({*(conflicts or ()), other}))
