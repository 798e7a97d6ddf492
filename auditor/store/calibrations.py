"""Calibrations: the thresholds artefact, inside a store or as a single file anywhere."""

import hashlib
import json
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import cached_property, lru_cache, partial
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from threading import get_ident
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from auditor.errors import StoreError, ThresholdsError
from auditor.model.calibration import Calibration, CleanFrames, read_later
from auditor.model.canonical import canonical_json
from auditor.model.checks import Check, Pair, SensorCheck
from auditor.model.measurement import COUNTING_VERSIONS, Procedure, Statistic
from auditor.model.rig import LIDAR, Triple
from auditor.model.rig_kind import RigKind
from auditor.model.verdict import Cause, CauseIn
from auditor.store.files import Announce
from auditor.store.records import id_of_json, rig_kind_fields, rig_kind_of, to_utc
from auditor.store.tables import Row, listed, read_table, row_groups, writing

KEPT_CALIBRATIONS = 4
"""Calibrations that stay in memory once they were read: a command reads those in force several times."""

_AGAIN = "make one with auditor calibrate"
_NONE = -1
_UNMASKED = "_unmasked"
"""What the name of a check ends with whose statistics are those without the LiDAR."""

_MISSING, _FROZEN = "missing", "standing_still"
"""Names of the flags of sensors in a calibration's file; flags that are never set are not kept."""

_RETURNS = "returns"


class _Column(NamedTuple):
    """What a column of a clean recording is of; _NONE and () are NULL in the file."""

    statistic: str
    i: int = _NONE
    j: int = _NONE
    k: int = _NONE
    sensor: int = _NONE
    others: tuple[int, ...] = ()

    @classmethod
    def of_check(cls, sensor_check: SensorCheck, suffix: str = "") -> "_Column":
        return cls(sensor_check.check.value + suffix, sensor=sensor_check.sensor, others=sensor_check.others)

    @property
    def order(self) -> tuple[object, ...]:
        """The order of every list: by statistic, then k downwards, then i, then j."""
        return self.statistic, -self.k, self.i, self.j, self.sensor, self.others

    @property
    def row(self) -> Row:
        numbers = {name: getattr(self, name) for name in ("i", "j", "k", "sensor")}
        return {
            "statistic": self.statistic,
            **{name: None if number == _NONE else number for name, number in numbers.items()},
            "others": list(self.others) or None,
        }


class OutdatedCalibrationError(ThresholdsError):
    """A calibration that an older auditor has made and that can no longer be judged by."""


def calibration_id(calibration: Calibration) -> str:
    """Hash of everything in a calibration but its id: equal content has equal ids."""
    return _id_of(calibration, [content_of(one) for one in calibration.clean])


class RecordingContent(NamedTuple):
    """Of a clean recording: its id, the hash of its stamps, and all that a calibration's hash has of it.

    The last is JSON; it is packed, since there may be ten thousand of them.
    """

    recording_id: str
    stamps: str
    packed: bytes

    @property
    def text(self) -> str:
        """The JSON."""
        return zlib.decompress(self.packed).decode()


def content_of(clean: CleanFrames) -> RecordingContent:
    """What the id of a calibration has of a clean recording."""
    stamps = _digest(clean.stamps_ns)
    columns = sorted([*key, _digest(column)] for key, column in _columns(clean))
    text = canonical_json([clean.recording_id, stamps, *columns])
    return RecordingContent(clean.recording_id, stamps, zlib.compress(text.encode(), 1))


def _id_of(calibration: Calibration, contents: Sequence[RecordingContent]) -> str:
    """The id of a calibration of these contents, in any order."""
    procedure = calibration.procedure
    groups = groupby(sorted(contents), key=itemgetter(0, 1))
    ordered = (text for _, group in groups for text in sorted((one.text for one in group), key=json.loads))
    head = rig_kind_fields(calibration.rig_kind), [procedure.matcher, procedure.settings, procedure.counting_version]
    return id_of_json(["calibration", *head], f"[{','.join(ordered)}]")


def make_calibration(
    rig_kind: RigKind,
    procedure: Procedure,
    clean: Iterable[CleanFrames],
    contents: Sequence[RecordingContent] | None = None,
) -> Calibration:
    """A calibration made now, under the id of its content, which is looked for where it is not known."""
    unnamed = Calibration("", rig_kind, procedure, tuple(clean), datetime.now(UTC))
    identity = calibration_id(unnamed) if contents is None else _id_of(unnamed, contents)
    return replace(unnamed, calibration_id=identity)


def write_calibration(calibration: Calibration, path: Path, announce: Announce | None = None) -> None:
    """Write a calibration to a file of its own; `announce` tells of it. Raises StoreError."""
    with writing_calibration(calibration, path, announce) as add:
        for clean in calibration.clean:
            add(clean)


@contextmanager
def writing_calibration(
    calibration: Calibration, path: Path, announce: Announce | None = None
) -> Iterator[Callable[[CleanFrames], None]]:
    """Write a calibration's file by its clean recordings, which the block adds in their order.

    Raises StoreError where it cannot be written, or where the recordings were others than those that it has its id of.
    """
    contents: list[RecordingContent] = []
    same = _same_in_all_rows(calibration)
    with writing("calibrations", path) as table:

        def add(clean: CleanFrames) -> None:
            for place, row in enumerate(_rows(len(contents), clean)):
                first = not contents and place == 0
                table.add({**same, "recordings": list(calibration.recordings) if first else None, **row})
            contents.append(content_of(clean))

        yield add
        if calibration.calibration_id != _id_of(calibration, contents):
            raise StoreError("its id is not that of its content", where=f"calibration {calibration.calibration_id}")
        table.commit(announce)


def read_calibration(path: Path) -> Calibration:
    """Read a calibration from its file; of many recordings few are in memory at a time.

    A file that has not changed is read and hashed once in each thread of a process, while KEPT_CALIBRATIONS others are
    not. Raises ThresholdsError where it is none or one of a newer version, OutdatedCalibrationError where it is of an
    older one that counted otherwise.
    """
    try:
        status = path.stat()
    except OSError:
        return _read_from(path)  # it says what is wrong
    identity = status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns
    return _read_once(path.absolute(), identity, get_ident())


@lru_cache(maxsize=KEPT_CALIBRATIONS)
def _read_once(path: Path, _identity: tuple[int, ...], _thread: int) -> Calibration:
    """Threads share nothing, as the recordings that a calibration keeps in memory are read and dropped unlocked."""
    return _read_from(path)


def _read_from(path: Path) -> Calibration:
    parts = _Parts(path)
    try:
        calibration = _read(parts)
    except StoreError as error:
        raise ThresholdsError(
            f"it is no calibration: {error.what}", where=path, remedy=error.remedy or _AGAIN
        ) from error
    except (TypeError, ValueError) as error:
        raise ThresholdsError(f"it is no calibration ({error})", where=path, remedy=_AGAIN) from error
    return calibration


def _read(parts: "_Parts") -> Calibration:
    path, groups = parts.path, parts.groups
    first = next((row for group in range(groups) for row in parts.rows(group, _HEAD, most=1)), None)
    if first is None:
        raise ThresholdsError("the calibration has no samples", where=path, remedy=_AGAIN)
    kind = rig_kind_of(first["rig_kind"])
    if first["counting_version"] < COUNTING_VERSIONS[kind.compared_to]:
        raise OutdatedCalibrationError(
            "its clean recordings were measured by an earlier way of counting",
            where=path,
            remedy="measure them again with auditor calibrate --measure-again",
        )
    by_part: dict[int, tuple[str, list[int]]] = {}
    for group in range(groups):
        for row in parts.rows(group, ["part", "recording_id"]):
            by_part.setdefault(row["part"], (row["recording_id"], []))[1].append(group)
    calibration = Calibration(
        calibration_id=first["calibration_id"],
        rig_kind=kind,
        procedure=Procedure(first["matcher"], first["settings"], first["counting_version"]),
        clean=read_later((known, partial(parts.clean, part, sorted(set(of)))) for part, (known, of) in by_part.items()),
        calibrated_at=first["calibrated_at"] and first["calibrated_at"].replace(tzinfo=UTC),
    )
    if calibration.calibration_id != calibration_id(calibration):
        raise ThresholdsError(
            "the calibration was changed after it was made", where=path, remedy="make it again with auditor calibrate"
        )
    return calibration


_HEAD = ("calibration_id", "rig_kind", "matcher", "settings", "counting_version", "calibrated_at")
_PART = (
    *("part", "recording_id", "stamps_ns", "statistic", "i", "j", "k"),
    *("sensor", "others", "versions", "for_parts", "clean"),
)
_CAUSES = frozenset(Cause)
_ERRORS = frozenset(Statistic)


class _Parts:
    """The clean recordings in a calibration's file, read one by one. All raise StoreError."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._last: tuple[int, pa.Table] | None = None

    @cached_property
    def groups(self) -> int:
        """How many row groups the file has."""
        return row_groups(self.path)

    def rows(self, group: int, columns: Sequence[str], most: int | None = None) -> list[dict[str, Any]]:
        """Some columns of the rows of a row group, or of its first ones."""
        return listed(read_table("calibrations", self.path, columns, group=group).slice(0, most), self.path)

    def clean(self, part: int, groups: Sequence[int]) -> CleanFrames:
        """A recording, whose rows these row groups have."""
        tables = [self._group(group) for group in groups]
        rows = pa.concat_tables(table.filter(pc.equal(table["part"], part)) for table in tables)
        return _clean(rows, self.path)

    def _group(self, group: int) -> pa.Table:
        """A row group; recordings that follow each other are often of one."""
        if self._last is None or self._last[0] != group:
            self._last = group, read_table("calibrations", self.path, _PART, group=group)
        return self._last[1]


def _columns(clean: CleanFrames) -> Iterator[tuple[_Column, NDArray[np.float64]]]:
    """The columns of a recording with what they are of: a statistic's triple, a sensor check, or something in a sensor.

    The last is a cause, or that the sensor is missing or frozen; it has no i where it is of all cameras.
    """
    yield from _columns_for_parts(clean)
    for (error, triple), errors in clean.errors.items():
        yield _Column(error.value, *triple), errors
    for check, statistics in clean.statistics.items():
        yield _Column.of_check(check), statistics
    for (cause, sensor), scores in clean.strengths.items():
        yield _Column(cause.value, _NONE if sensor is None else sensor), scores
    for name, of_sensor in ((_MISSING, clean.missing), (_FROZEN, clean.frozen)):
        for sensor, flags in of_sensor.items():
            yield _Column(name, sensor), flags.astype(np.float64)
    if clean.returns.size:
        yield _Column(_RETURNS, LIDAR), clean.returns


def _columns_for_parts(clean: CleanFrames) -> Iterator[tuple[_Column, NDArray[np.float64]]]:
    """The columns that serve rigs with fewer sensors; those in which nothing was measured are left out."""
    columns = {_Column.of_check(check, _UNMASKED): values for check, values in clean.unmasked.items()}
    columns |= {_Column(name, i, k=k): values for (name, (i, k)), values in clean.features.items()}
    columns |= {_Column(name, camera): values for (name, camera), values in clean.brightness.items()}
    return ((column, values) for column, values in columns.items() if not np.isnan(values).all())


def _digest(column: NDArray[Any]) -> str:
    """Hash of the numbers of a column, in which every NaN is the same."""
    values = np.where(np.isnan(column), np.nan, column) if column.dtype.kind == "f" else column
    return hashlib.sha256(values.astype(values.dtype.newbyteorder("<")).tobytes()).hexdigest()


def _same_in_all_rows(calibration: Calibration) -> Row:
    return {
        "calibration_id": calibration.calibration_id,
        "kind": str(calibration.rig_kind),
        "rig_kind": rig_kind_fields(calibration.rig_kind),
        "matcher": calibration.procedure.matcher,
        "settings": calibration.procedure.settings,
        "counting_version": calibration.procedure.counting_version,
        "calibrated_at": calibration.calibrated_at and to_utc(calibration.calibrated_at),
    }


def _rows(number: int, clean: CleanFrames) -> Iterator[Row]:
    """What is of one clean recording in its rows. What is the same in all of them, and long, stands in the first."""
    for_parts = {column for column, _ in _columns_for_parts(clean)}
    versions = dict(sorted(clean.versions.items()))
    for place, (column, values) in enumerate(sorted(_columns(clean), key=lambda one: one[0].order)):
        yield {
            **column.row,
            "part": number,
            "recording_id": clean.recording_id,
            "stamps_ns": clean.stamps_ns if place == 0 else None,
            "versions": versions,
            "for_parts": column in for_parts,
            "clean": _without_nan(values),
        }


def _without_nan(values: NDArray[np.float64]) -> NDArray[Any]:
    """The values, None for NaN. Arrow takes numbers of an array at once, so most columns stay as they are."""
    missing = np.isnan(values)
    if not missing.any():
        return values
    objects = values.astype(object)
    objects[missing] = None
    return objects


def _clean(content: pa.Table, path: Path) -> CleanFrames:
    errors: dict[tuple[Statistic, Triple], NDArray[np.float64]] = {}
    statistics: dict[SensorCheck, NDArray[np.float64]] = {}
    fault_scores: dict[CauseIn, NDArray[np.float64]] = {}
    flags: dict[str, dict[int, NDArray[np.bool_]]] = {_MISSING: {}, _FROZEN: {}}
    unmasked: dict[SensorCheck, NDArray[np.float64]] = {}
    features: dict[tuple[str, Pair], NDArray[np.float64]] = {}
    brightness: dict[tuple[str, int], NDArray[np.float64]] = {}
    returns = np.zeros(0)
    # Whole lists and maps would become Python's in every row; what is the same in all of them is read once.
    rows = listed(content.drop_columns(["clean", "stamps_ns", "versions"]), path)
    [same] = listed(content.select(["stamps_ns", "versions"]).slice(0, 1), path)
    for row, values in zip(rows, content["clean"], strict=True):
        statistic, i, k, column = row["statistic"], row["i"], row["k"], _column(values)
        if statistic in _ERRORS:
            errors[Statistic(statistic), Triple(i, row["j"], k)] = column
        elif statistic in _CAUSES:
            fault_scores[Cause(statistic), i] = column
        elif statistic in flags:
            flags[statistic][i] = column > 0
        elif statistic == _RETURNS:
            returns = column
        elif statistic.endswith(_UNMASKED):
            unmasked[_sensor_check(row, statistic.removesuffix(_UNMASKED))] = column
        elif row["for_parts"] and k is not None:  # also what is not measured any more: the id has it
            features[statistic, (i, k)] = column
        elif row["for_parts"]:
            brightness[statistic, i] = column
        else:
            statistics[_sensor_check(row, statistic)] = column
    return CleanFrames(
        rows[0]["recording_id"],
        np.array(same["stamps_ns"], dtype=np.int64),
        errors,
        statistics,
        fault_scores,
        flags[_MISSING],
        flags[_FROZEN],
        unmasked,
        features,
        brightness,
        returns,
        dict(same["versions"] or {}),
    )


def _sensor_check(row: Mapping[str, Any], check: str) -> SensorCheck:
    return SensorCheck(Check(check), row["sensor"], tuple(row["others"] or ()))


def _column(values: pa.ListScalar) -> NDArray[np.float64]:
    """The values of a list, NaN for NULL."""
    if values.values is None:
        raise ValueError("a clean recording lacks its values")
    return np.asarray(values.values.to_numpy(zero_copy_only=False), dtype=np.float64)
