"""Labels for attacks that somebody else made, and for recordings known to be clean.

They are kept in the store, beside those that recordings carry: neither takes the place of the other, and a recording,
which is evidence, is never changed.
"""

import re
from datetime import UTC, datetime
from pathlib import Path

from auditor.errors import SettingError, StoreError
from auditor.model.rig import Rig
from auditor.model.stamps import NANOSECONDS
from auditor.store.files import locked
from auditor.store.records import GivenLabel, RecordingRecord, StoredMeasurement
from auditor.store.store import Store
from auditor.store.tables import read_table

_FRAME = re.compile(r"\d+")
_SECONDS = re.compile(r"(\d+)(?:\.(\d{1,9}))?\s*s")
_FRACTION = re.compile(r"\.(\d{1,9})")
_DIGITS = 9
_HOW = "write a frame's number (120), seconds from the recording's start (12.5s) or a time (2026-01-31T12:00:05.5Z)"


def recording_called(store: Store, text: str) -> RecordingRecord:
    """The recording of a name, of a path, or of an id's beginning. Raises StoreError unless it is just one."""
    recordings = store.recordings_called(text) or store.recordings_called(Path(text).name)
    if len(recordings) == 1:
        return recordings[0]
    if recordings:
        ids = ", ".join(known.recording_id[:12] for known in recordings)
        raise StoreError(f"{len(recordings)} recordings are called so", where=text, remedy=f"name one by its id: {ids}")
    raise StoreError(
        "the store has no such recording", where=text, remedy="scan it first; auditor query summary lists recordings"
    )


def label_attack(
    store: Store,
    recording: RecordingRecord,
    attack: str,
    *,
    sensor: int | None = None,
    topic: str | None = None,
    first: str | None = None,
    last: str | None = None,
) -> None:
    """Say that the data of a sensor, or of a topic, was attacked from `first` to `last`, both included.

    Each is a frame's number, seconds from the recording's start, or a time in the form of ISO 8601; None is the
    recording's start or end. Raises SettingError for what makes no sense, and StoreError.
    """
    measurement, rig = _measured(store, recording, sensor, topic)
    topic = rig.topic(sensor) if sensor is not None else topic
    from_ns = _stamp(store, recording, measurement, first, recording.from_ns, "--from")
    to_ns = _stamp(store, recording, measurement, last, recording.to_ns, "--to")
    if from_ns > to_ns:
        raise SettingError("an attack cannot end before it begins", where="--from, --to", remedy=_HOW)
    sensors = {rig.topic(one): one for one in rig.sensors}
    label = GivenLabel(datetime.now(UTC), topic, sensors.get(topic or ""), attack, from_ns, to_ns)
    with locked(store.folder):
        given = store.given_labels(recording.recording_id)
        if any(one.attack is None for one in given):
            raise SettingError(
                "it was labelled as clean", where=recording.name, remedy="remove that label first: --list shows it"
            )
        store.write_given_labels(recording.recording_id, [*given, label])


def label_clean(store: Store, recording: RecordingRecord) -> None:
    """Say that a recording is known to be clean. Raises SettingError where labels say that it was attacked."""
    with locked(store.folder):
        given = store.given_labels(recording.recording_id)
        if store.labels(recording.recording_id) or any(one.attack is not None for one in given):
            raise SettingError(
                "labels say that it was attacked", where=recording.name, remedy="auditor label --list shows them"
            )
        store.write_given_labels(recording.recording_id, [GivenLabel(datetime.now(UTC))])


def remove_label(store: Store, recording: RecordingRecord, number: int) -> None:
    """Remove one of the labels that were given, counted from 1. Raises SettingError where there is none."""
    with locked(store.folder):
        given = store.given_labels(recording.recording_id)
        if not 1 <= number <= len(given):
            raise SettingError(
                f"it has no given label {number}",
                where=recording.name,
                remedy="--list shows their numbers; what the recording itself carries cannot be removed",
            )
        store.write_given_labels(recording.recording_id, given[: number - 1] + given[number:])


def _measured(
    store: Store, recording: RecordingRecord, sensor: int | None, topic: str | None
) -> tuple[StoredMeasurement, Rig]:
    """The latest measurement with that sensor or topic, and its rig."""
    measurements = [one for one in store.measurements() if one.recording_id == recording.recording_id]
    latest_first = sorted(measurements, key=lambda one: one.measured_at, reverse=True)
    for measurement in latest_first:
        rig = store.rig(measurement.rig_id)
        if sensor in rig.sensors or topic in {rig.topic(one) for one in rig.sensors}:
            return measurement, rig
        if topic in {balance.topic for balance in measurement.balance}:
            return measurement, rig
    sensors = ", ".join(f"S_{one} ({name})" for name, one in sensors_of(store, recording).items())
    raise SettingError(
        f"it has no sensor S_{sensor}" if topic is None else f"it has no topic {topic}",
        where=recording.name,
        remedy=f"its sensors are {sensors or 'not known: it was not measured'}",
    )


def sensors_of(store: Store, recording: RecordingRecord) -> dict[str, int]:
    """The sensors of a recording, by topic."""
    rigs = [store.rig(one.rig_id) for one in store.measurements() if one.recording_id == recording.recording_id]
    return {rig.topic(sensor): sensor for rig in rigs for sensor in rig.sensors}


def _stamp(
    store: Store,
    recording: RecordingRecord,
    measurement: StoredMeasurement,
    text: str | None,
    default_ns: int | None,
    option: str,
) -> int:
    """The stamp that a text means. Raises SettingError."""
    start_ns = recording.from_ns
    if text is None:
        if default_ns is None:
            raise SettingError("it is not known when the recording begins and ends", where=option, remedy=_HOW)
        return default_ns
    if _FRAME.fullmatch(text):
        return _stamp_of_frame(store, measurement, int(text), option)
    if (seconds := _SECONDS.fullmatch(text)) and start_ns is not None:
        return start_ns + int(seconds[1]) * NANOSECONDS + int((seconds[2] or "").ljust(_DIGITS, "0"))
    if recording.clock == "relative":
        problem = f"{text!r} is no frame and no number of seconds, and this recording's clock does not tell the time"
        raise SettingError(problem, where=option, remedy=_HOW)
    return _stamp_of_time(text, option)


def _stamp_of_frame(store: Store, measurement: StoredMeasurement, number: int, option: str) -> int:
    frames = read_table("frames", store.source("frames", measurement.measurement_id), ["frame", "stamp_ns"])
    stamps = dict(zip(frames["frame"].to_pylist(), frames["stamp_ns"].to_pylist(), strict=True))
    if number not in stamps:
        numbers = f"{min(stamps)} to {max(stamps)}" if stamps else "none"
        raise SettingError(f"there is no frame {number}", where=option, remedy=f"its frames are {numbers}")
    return int(stamps[number])


def _stamp_of_time(text: str, option: str) -> int:
    """A time with every digit of its fraction, which Python's own times would cut; without a zone it is UTC."""
    fraction = _FRACTION.search(text)
    try:
        moment = datetime.fromisoformat(_FRACTION.sub("", text, count=1))
    except ValueError:
        raise SettingError(
            f"{text!r} is no frame, no number of seconds and no time", where=option, remedy=_HOW
        ) from None
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    return round(moment.timestamp()) * NANOSECONDS + int((fraction[1] if fraction else "").ljust(_DIGITS, "0"))
