"""Frames as rows of the table `frames`, and back as arrays of disparity errors and local ratios."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from auditor.elements import rig_elements
from auditor.errors import StoreError
from auditor.frames import Skipped
from auditor.results import MIN_VALID_PX, NO_FINGERPRINT, Counts, Coverage, Measurement, Statistic
from auditor.rig import Rig
from auditor.store.records import FrameErrors, FrameRatios
from auditor.store.tables import Row, read_table

_COUNTS = ("valid_px", "inconsistent_px", "gated_valid_px", "gated_inconsistent_px", "out_of_range_px")
_COVERAGE = ("saturated_share", "textureless_share", "unmatched_share", "level", "returns")
_PIXELS = {
    Statistic.PLAIN: ("valid_px", "inconsistent_px"),
    Statistic.GATED: ("gated_valid_px", "gated_inconsistent_px"),
}


def skipped_row(measurement_id: str, skipped: Skipped) -> Row:
    """The row of a tick without a frame."""
    return {
        "measurement_id": measurement_id,
        "frame": skipped.number,
        "stamp_ns": skipped.stamp_ns,
        "skipped": skipped.reason,
        "skipped_sensor": skipped.sensor,
    }


def measured_row(measurement_id: str, measurement: Measurement, ratios: Sequence[float | None], rig: Rig) -> Row:
    """The row of a measured frame, with its local ratio by element. Raises StoreError where it does not fit the rig."""
    M = len(rig_elements(rig))
    if (len(measurement.counts), len(ratios), set(measurement.presence)) != (len(rig.triples), M, set(rig.sensors)):
        raise StoreError(
            f"frame {measurement.number} does not fit its rig: {len(measurement.counts)} counts for "
            f"{len(rig.triples)} triples, {len(ratios)} ratios for {M} elements, "
            f"sensors {sorted(measurement.presence)} for {list(rig.sensors)}",
            where=f"measurement {measurement_id}",
        )
    presence = [measurement.presence[sensor] for sensor in rig.sensors]
    coverage = [measurement.coverage.get(sensor, Coverage()) for sensor in rig.sensors]
    return {
        "measurement_id": measurement_id,
        "frame": measurement.number,
        "stamp_ns": measurement.stamp_ns,
        "state": [sensor.state.value for sensor in presence],
        "state_reason": [sensor.reason or None for sensor in presence],
        "skew_ns": [sensor.skew_ns for sensor in presence],
        **{name: [getattr(sensor, name) for sensor in coverage] for name in _COVERAGE},
        **{name: [_count(counts, name) for counts in measurement.counts] for name in _COUNTS},
        "ratios": list(ratios),
        "fingerprint": [measurement.fingerprints.get(sensor) for sensor in rig.sensors],
    }


def read_errors(path: Path, rig: Rig, statistic: Statistic) -> FrameErrors:
    """The disparity errors of a finished frames file, its skipped ticks left out. Raises StoreError."""
    valid, inconsistent = _PIXELS[statistic]
    table = _measured(path, ["frame", "stamp_ns", "state", valid, inconsistent])
    F, T, S = len(table), len(rig.triples), len(rig.sensors)
    # NULL becomes NaN, which is never >= MIN_VALID_PX.
    pixels, flagged = (_floats(table[name], F * T, path).reshape(F, T) for name in (valid, inconsistent))
    E = np.full((F, T), np.nan)
    np.divide(flagged, pixels, out=E, where=pixels >= MIN_VALID_PX)
    return FrameErrors(
        frames=table["frame"].to_numpy(),
        stamps_ns=table["stamp_ns"].to_numpy(),
        E=E,
        states=_texts(table["state"], F * S, path).reshape(F, S),
    )


def read_ratios(path: Path, rig: Rig) -> FrameRatios:
    """The local ratios of a finished frames file, its skipped ticks left out.

    Raises StoreError, also where the file is older than local ratios.
    """
    table = _measured(path, ["frame", "stamp_ns", "state", "ratios", "fingerprint"])
    if table["ratios"].null_count:
        raise StoreError("it was measured before there were local ratios", where=path, remedy="measure it again")
    F, M, S = len(table), len(rig_elements(rig)), len(rig.sensors)
    fingerprints = _elements(table["fingerprint"], F * S, path).fill_null(NO_FINGERPRINT)
    return FrameRatios(
        frames=table["frame"].to_numpy(),
        stamps_ns=table["stamp_ns"].to_numpy(),
        ratios=_floats(table["ratios"], F * M, path).reshape(F, M),
        states=_texts(table["state"], F * S, path).reshape(F, S),
        fingerprints=fingerprints.to_numpy(zero_copy_only=False).reshape(F, S),
    )


def read_coverage(
    path: Path, rig: Rig, names: Sequence[str]
) -> tuple[NDArray[np.int64], NDArray[np.int64], dict[str, NDArray[np.float64]]]:
    """Numbers and stamps (F,) of the measured frames, and (F, S) values of these columns, NaN where NULL or not there.

    Raises StoreError.
    """
    table = _measured(path, ["frame", "stamp_ns", *names])
    shape = len(table), len(rig.sensors)
    values = {
        name: np.full(shape, np.nan)
        if table[name].null_count
        else _floats(table[name], shape[0] * shape[1], path).reshape(shape)
        for name in names
    }
    return table["frame"].to_numpy(), table["stamp_ns"].to_numpy(), values


def _measured(path: Path, columns: Sequence[str]) -> pa.Table:
    """These columns of the measured frames."""
    table = read_table("frames", path, ["skipped", *columns])
    return table.filter(table["skipped"].is_null())


def _floats(column: pa.ChunkedArray, count: int, path: Path) -> NDArray[np.float64]:
    """The elements of all lists, NaN where NULL."""
    return np.asarray(_elements(column, count, path).cast("float64").to_numpy(zero_copy_only=False))


def _texts(column: pa.ChunkedArray, count: int, path: Path) -> NDArray[np.str_]:
    return np.asarray(_elements(column, count, path).to_pylist(), dtype=np.str_)


def _count(counts: Counts | None, name: str) -> int | None:
    return None if counts is None else getattr(counts, name)


def _elements(column: pa.ChunkedArray, count: int, path: Path) -> pa.Array:
    values = column.combine_chunks().flatten()
    if len(values) != count:
        raise StoreError(
            "its lists do not have the lengths that its rig demands", where=path, remedy="measure its recording again"
        )
    return values
