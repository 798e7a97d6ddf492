"""Calibrations: the thresholds artefact, inside a store or as a single file anywhere."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.errors import StoreError, ThresholdsError
from auditor.model.calibration import Calibration, CleanFrames
from auditor.model.checks import COLUMNS, Check, Pair, PairCheck
from auditor.model.measurement import Procedure, Statistic
from auditor.model.rig import Triple
from auditor.model.rig_kind import RigKind
from auditor.model.verdict import Cause, CauseIn
from auditor.store.records import content_id, to_utc
from auditor.store.tables import Row, read_rows, write_rows

_AGAIN = "make one with auditor calibrate"
_NONE = -1
_UNMASKED = "_unmasked"
"""What the name of a check ends with whose statistics are those without the LiDAR."""

_BRIGHTNESS = ("level", "saturated_share")
_MISSING, _FROZEN = "missing", "standing_still"
"""Names of the flags of sensors in a calibration's file; flags that are never set are not kept."""


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


def write_calibration(calibration: Calibration, path: Path) -> None:
    """Write a calibration to a file of its own. Raises StoreError."""
    if calibration.calibration_id != calibration_id(calibration):
        raise StoreError("its id is not that of its content", where=f"calibration {calibration.calibration_id}")
    write_rows("calibrations", path, _rows(calibration))


def read_calibration(path: Path) -> Calibration:
    """Read a calibration from its file.

    Raises ThresholdsError where it is none or one of a newer version, OutdatedCalibrationError where it is of an older
    one that did not keep clean recordings apart, or what they show of causes.
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


def _columns(clean: CleanFrames) -> Iterator[tuple[tuple[str, int, int, int], NDArray[np.float64]]]:
    """The columns of a recording with what they are of: a statistic's triple, a pair check, or something in a sensor.

    The last is a cause, or that the sensor is missing or frozen: these have no j and no k, and no i where they are of
    all cameras: -1.
    """
    yield from _columns_for_parts(clean)
    for (statistic, triple), errors in clean.errors.items():
        yield (statistic.value, *triple), errors
    for pair_check, ratios in clean.ratios.items():
        yield (pair_check.check.value, pair_check.i, _NONE, pair_check.k), ratios
    for (cause, sensor), scores in clean.strengths.items():
        yield (cause.value, _NONE if sensor is None else sensor, _NONE, _NONE), scores
    for name, of_sensor in ((_MISSING, clean.missing), (_FROZEN, clean.frozen)):
        for sensor, flags in of_sensor.items():
            yield (name, sensor, _NONE, _NONE), flags.astype(np.float64)


def _columns_for_parts(clean: CleanFrames) -> Iterator[tuple[tuple[str, int, int, int], NDArray[np.float64]]]:
    """The columns that serve rigs with fewer sensors; those in which nothing was measured are left out."""
    columns = {(e.check.value + _UNMASKED, e.i, _NONE, e.k): ratios for e, ratios in clean.unmasked.items()}
    columns |= {(name, i, _NONE, k): values for (name, (i, k)), values in clean.features.items()}
    columns |= {(name, camera, _NONE, _NONE): values for (name, camera), values in clean.brightness.items()}
    return ((key, values) for key, values in columns.items() if not np.isnan(values).all())


def _digest(column: NDArray[Any]) -> str:
    """Hash of the numbers of a column, in which every NaN is the same."""
    values = np.where(np.isnan(column), np.nan, column) if column.dtype.kind == "f" else column
    return hashlib.sha256(values.astype(values.dtype.newbyteorder("<")).tobytes()).hexdigest()


def _rows(calibration: Calibration) -> Iterator[Row]:
    for number, clean in enumerate(calibration.clean):
        for_parts = {key for key, _ in _columns_for_parts(clean)}
        for (statistic, i, j, k), column in sorted(_columns(clean), key=_order):
            yield {
                "calibration_id": calibration.calibration_id,
                "kind": str(calibration.rig_kind),
                "rig_kind": rig_kind_fields(calibration.rig_kind),
                "matcher": calibration.procedure.matcher,
                "settings": calibration.procedure.settings,
                "counting_version": calibration.procedure.counting_version,
                "recordings": list(calibration.recordings),
                "calibrated_at": calibration.calibrated_at and to_utc(calibration.calibrated_at),
                "statistic": statistic,
                **{name: None if number == _NONE else number for name, number in (("i", i), ("j", j), ("k", k))},
                "part": number,
                "recording_id": clean.recording_id,
                "stamps_ns": clean.stamps_ns.tolist(),
                "for_parts": (statistic, i, j, k) in for_parts,
                "clean": [None if np.isnan(value) else value for value in column.tolist()],
            }


def _order(item: tuple[tuple[str, int, int, int], object]) -> tuple[str, int, int, int]:
    """The order of every list: by statistic, then k downwards, then i, then j."""
    (statistic, i, j, k), _ = item
    return statistic, -k, i, j


def calibration_of(rows: list[dict[str, Any]]) -> Calibration:
    """The calibration of the rows of its file, unchecked. Raises TypeError and ValueError where they are none."""
    first = rows[0]
    kind = first["rig_kind"]
    return Calibration(
        calibration_id=first["calibration_id"],
        rig_kind=RigKind(
            lidar=kind["lidar"],
            sizes_px=tuple(zip(kind["widths_px"], kind["heights_px"], strict=True)),
            focals_px=tuple(kind["focals_px"]),
            baselines_m=tuple(kind["baselines_m"]),
        ),
        procedure=Procedure(first["matcher"], first["settings"], first["counting_version"]),
        clean=tuple(_clean(list(part)) for _, part in groupby(rows, key=lambda row: row["part"])),
        calibrated_at=first["calibrated_at"] and first["calibrated_at"].replace(tzinfo=UTC),
    )


def _clean(rows: list[dict[str, Any]]) -> CleanFrames:
    errors: dict[tuple[Statistic, Triple], NDArray[np.float64]] = {}
    ratios: dict[PairCheck, NDArray[np.float64]] = {}
    fault_scores: dict[CauseIn, NDArray[np.float64]] = {}
    flags: dict[str, dict[int, NDArray[np.bool_]]] = {_MISSING: {}, _FROZEN: {}}
    unmasked: dict[PairCheck, NDArray[np.float64]] = {}
    features: dict[tuple[str, Pair], NDArray[np.float64]] = {}
    brightness: dict[tuple[str, int], NDArray[np.float64]] = {}
    for row in rows:
        what, i, k, column = row["statistic"], row["i"], row["k"], _column(row)
        if what in set(Statistic):
            errors[Statistic(what), Triple(i, row["j"], k)] = column
        elif what in set(Cause):
            fault_scores[Cause(what), i] = column
        elif what in flags:
            flags[what][i] = column > 0
        elif what in _BRIGHTNESS:
            brightness[what, i] = column
        elif what in COLUMNS:
            features[what, (i, k)] = column
        elif what.endswith(_UNMASKED):
            unmasked[PairCheck(Check(what.removesuffix(_UNMASKED)), i, k)] = column
        else:
            ratios[PairCheck(Check(what), i, k)] = column
    stamps_ns = np.array(rows[0]["stamps_ns"], dtype=np.int64)
    return CleanFrames(
        rows[0]["recording_id"],
        stamps_ns,
        errors,
        ratios,
        fault_scores,
        flags[_MISSING],
        flags[_FROZEN],
        unmasked,
        features,
        brightness,
    )


def _column(row: Mapping[str, Any]) -> NDArray[np.float64]:
    return np.array([np.nan if value is None else value for value in row["clean"]], dtype=np.float64)
