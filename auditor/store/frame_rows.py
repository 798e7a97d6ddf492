"""Frames as rows of the table `frames`, and back as arrays of disparity errors."""

from pathlib import Path

import numpy as np
import pyarrow as pa

from auditor.errors import StoreError
from auditor.frames import Skipped
from auditor.results import MIN_VALID_PX, Counts, Coverage, Measurement, Statistic
from auditor.rig import Rig
from auditor.store.records import FrameErrors
from auditor.store.tables import Row, read_table

_COUNTS = ("valid_px", "inconsistent_px", "gated_valid_px", "gated_inconsistent_px", "out_of_range_px")
_COVERAGE = ("saturated_share", "textureless_share", "unmatched_share", "returns")
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


def measured_row(measurement_id: str, measurement: Measurement, rig: Rig) -> Row:
    """The row of a measured frame. Raises StoreError where it does not fit the rig."""
    if len(measurement.counts) != len(rig.triples) or set(measurement.presence) != set(rig.sensors):
        raise StoreError(
            f"frame {measurement.number} does not fit its rig: {len(measurement.counts)} counts for "
            f"{len(rig.triples)} triples, sensors {sorted(measurement.presence)} for {list(rig.sensors)}",
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
    }


def read_errors(path: Path, rig: Rig, statistic: Statistic) -> FrameErrors:
    """The disparity errors of a finished frames file, its skipped ticks left out. Raises StoreError."""
    valid, inconsistent = _PIXELS[statistic]
    table = read_table("frames", path, ["frame", "stamp_ns", "skipped", "state", valid, inconsistent])
    table = table.filter(table["skipped"].is_null())
    F, T, S = len(table), len(rig.triples), len(rig.sensors)
    # NULL becomes NaN, which is never >= MIN_VALID_PX.
    pixels = _elements(table[valid], F * T, path).cast("float64").to_numpy(zero_copy_only=False).reshape(F, T)
    flagged = _elements(table[inconsistent], F * T, path).cast("float64").to_numpy(zero_copy_only=False).reshape(F, T)
    E = np.full((F, T), np.nan)
    np.divide(flagged, pixels, out=E, where=pixels >= MIN_VALID_PX)
    return FrameErrors(
        frames=table["frame"].to_numpy(),
        stamps_ns=table["stamp_ns"].to_numpy(),
        E=E,
        states=np.asarray(_elements(table["state"], F * S, path).to_pylist(), dtype=np.str_).reshape(F, S),
    )


def _count(counts: Counts | None, name: str) -> int | None:
    return None if counts is None else getattr(counts, name)


def _elements(column: pa.ChunkedArray, count: int, path: Path) -> pa.Array:
    values = column.combine_chunks().flatten()
    if len(values) != count:
        raise StoreError("its lists do not have the lengths that its rig demands", where=path)
    return values
