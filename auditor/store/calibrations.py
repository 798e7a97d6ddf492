"""Calibrations: the thresholds artefact, inside a store or as a single file anywhere."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from auditor.errors import StoreError, ThresholdsError
from auditor.model.calibration import Calibration, CleanFrames
from auditor.model.checks import COLUMNS, Check, Pair, SensorCheck
from auditor.model.measurement import BRIGHTNESS, COUNTING_VERSION, Procedure, Statistic
from auditor.model.rig import LIDAR, Triple
from auditor.model.rig_kind import RigKind
from auditor.model.verdict import Cause, CauseIn
from auditor.store.files import Announce
from auditor.store.records import content_id, to_utc
from auditor.store.tables import Row, read_rows, write_rows

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
    def of_check(cls, one: SensorCheck, suffix: str = "") -> "_Column":
        return cls(one.check.value + suffix, sensor=one.sensor, others=one.others)

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
    procedure = calibration.procedure
    return content_id(
        "calibration",
        rig_kind_fields(calibration.rig_kind),
        [procedure.matcher, procedure.settings, procedure.counting_version],
        sorted(
            [
                one.recording_id,
                _digest(one.stamps_ns),
                *(sorted([*key, _digest(column)] for key, column in _columns(one))),
            ]
            for one in calibration.clean
        ),
    )


def make_calibration(rig_kind: RigKind, procedure: Procedure, clean: Iterable[CleanFrames]) -> Calibration:
    """A calibration made now, under the id of its content."""
    unnamed = Calibration("", rig_kind, procedure, tuple(clean), datetime.now(UTC))
    return replace(unnamed, calibration_id=calibration_id(unnamed))


def write_calibration(calibration: Calibration, path: Path, announce: Announce | None = None) -> None:
    """Write a calibration to a file of its own; `announce` tells of it. Raises StoreError."""
    if calibration.calibration_id != calibration_id(calibration):
        raise StoreError("its id is not that of its content", where=f"calibration {calibration.calibration_id}")
    write_rows("calibrations", path, _rows(calibration), announce)


def read_calibration(path: Path) -> Calibration:
    """Read a calibration from its file.

    Raises ThresholdsError where it is none or one of a newer version, OutdatedCalibrationError where it is of an older
    one that did not keep clean recordings apart, or what they show of causes, or that counted otherwise.
    """
    try:
        rows = read_rows("calibrations", path)
    except StoreError as error:
        raise ThresholdsError(
            f"it is no calibration: {error.what}", where=path, remedy=error.remedy or _AGAIN
        ) from error
    if not rows:
        raise ThresholdsError("the calibration has no samples", where=path, remedy=_AGAIN)
    if any(row["recording_id"] is None for row in rows):
        raise OutdatedCalibrationError(
            "it was made by an older auditor, which did not keep clean recordings apart", where=path, remedy=_AGAIN
        )
    if not any(row["statistic"] in set(Cause) for row in rows):
        raise OutdatedCalibrationError(
            "it was made by an older auditor, which did not keep what clean recordings show of causes",
            where=path,
            remedy=_AGAIN,
        )
    if rows[0]["counting_version"] < COUNTING_VERSION:
        raise OutdatedCalibrationError(
            "its clean recordings were measured by an earlier way of counting",
            where=path,
            remedy="measure them again with auditor calibrate --measure-again",
        )
    try:
        calibration = calibration_of(rows)
    except (TypeError, ValueError) as error:
        raise ThresholdsError(f"it is no calibration ({error})", where=path, remedy=_AGAIN) from error
    if calibration.calibration_id != calibration_id(calibration):
        raise ThresholdsError(
            "the calibration was changed after it was made", where=path, remedy="make it again with auditor calibrate"
        )
    return calibration


def rig_kind_fields(kind: RigKind) -> dict[str, object]:
    """A rig kind as the STRUCT that `rigs` and `calibrations` hold."""
    return {
        "lidar": kind.lidar,
        "widths_px": [width for width, _ in kind.sizes_px],
        "heights_px": [height for _, height in kind.sizes_px],
        "focals_px": list(kind.focals_px),
        "baselines_m": list(kind.baselines_m),
    }


def rig_kind_of(fields: Mapping[str, Any]) -> RigKind:
    """The rig kind of such a STRUCT."""
    return RigKind(
        lidar=fields["lidar"],
        sizes_px=tuple(zip(fields["widths_px"], fields["heights_px"], strict=True)),
        focals_px=tuple(fields["focals_px"]),
        baselines_m=tuple(fields["baselines_m"]),
    )


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


def _rows(calibration: Calibration) -> Iterator[Row]:
    for number, clean in enumerate(calibration.clean):
        for_parts = {column for column, _ in _columns_for_parts(clean)}
        for column, values in sorted(_columns(clean), key=lambda one: one[0].order):
            yield {
                "calibration_id": calibration.calibration_id,
                "kind": str(calibration.rig_kind),
                "rig_kind": rig_kind_fields(calibration.rig_kind),
                "matcher": calibration.procedure.matcher,
                "settings": calibration.procedure.settings,
                "counting_version": calibration.procedure.counting_version,
                "recordings": list(calibration.recordings),
                "calibrated_at": calibration.calibrated_at and to_utc(calibration.calibrated_at),
                **column.row,
                "part": number,
                "recording_id": clean.recording_id,
                "stamps_ns": clean.stamps_ns.tolist(),
                "versions": dict(sorted(clean.versions.items())),
                "for_parts": column in for_parts,
                "clean": _without_nan(values),
            }


def _without_nan(values: NDArray[np.float64]) -> list[float | None]:
    """The values, None for NaN: most columns have none, and each is long."""
    listed: list[float | None] = values.tolist()
    for place in np.flatnonzero(np.isnan(values)).tolist():
        listed[place] = None
    return listed


def calibration_of(rows: list[dict[str, Any]]) -> Calibration:
    """The calibration of the rows of its file, unchecked. Raises TypeError and ValueError where they are none."""
    first = rows[0]
    return Calibration(
        calibration_id=first["calibration_id"],
        rig_kind=rig_kind_of(first["rig_kind"]),
        procedure=Procedure(first["matcher"], first["settings"], first["counting_version"]),
        clean=tuple(_clean(list(part)) for _, part in groupby(rows, key=lambda row: row["part"])),
        calibrated_at=first["calibrated_at"] and first["calibrated_at"].replace(tzinfo=UTC),
    )


def _clean(rows: list[dict[str, Any]]) -> CleanFrames:
    errors: dict[tuple[Statistic, Triple], NDArray[np.float64]] = {}
    statistics: dict[SensorCheck, NDArray[np.float64]] = {}
    fault_scores: dict[CauseIn, NDArray[np.float64]] = {}
    flags: dict[str, dict[int, NDArray[np.bool_]]] = {_MISSING: {}, _FROZEN: {}}
    unmasked: dict[SensorCheck, NDArray[np.float64]] = {}
    features: dict[tuple[str, Pair], NDArray[np.float64]] = {}
    brightness: dict[tuple[str, int], NDArray[np.float64]] = {}
    returns = np.zeros(0)
    for row in rows:
        what, i, k, column = row["statistic"], row["i"], row["k"], _column(row)
        if what in set(Statistic):
            errors[Statistic(what), Triple(i, row["j"], k)] = column
        elif what in set(Cause):
            fault_scores[Cause(what), i] = column
        elif what in flags:
            flags[what][i] = column > 0
        elif what in BRIGHTNESS:
            brightness[what, i] = column
        elif what == _RETURNS:
            returns = column
        elif what in COLUMNS:
            features[what, (i, k)] = column
        elif what.endswith(_UNMASKED):
            unmasked[_sensor_check(row, what.removesuffix(_UNMASKED))] = column
        else:
            statistics[_sensor_check(row, what)] = column
    stamps_ns = np.array(rows[0]["stamps_ns"], dtype=np.int64)
    return CleanFrames(
        rows[0]["recording_id"],
        stamps_ns,
        errors,
        statistics,
        fault_scores,
        flags[_MISSING],
        flags[_FROZEN],
        unmasked,
        features,
        brightness,
        returns,
        dict(rows[0]["versions"] or {}),
    )


def _sensor_check(row: Mapping[str, Any], check: str) -> SensorCheck:
    return SensorCheck(Check(check), row["sensor"], tuple(row["others"]))


def _column(row: Mapping[str, Any]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in row["clean"]], dtype=np.float64)
