"""The tables of one measurement, frames, cells, fault features and regions: as rows, and back as arrays."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from itertools import groupby
from math import isnan
from operator import itemgetter
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from auditor.errors import StoreError
from auditor.model.checks import ADDED_LATER, Check, CountedPair, Pair, rig_sensor_checks
from auditor.model.fault_features import COLUMNS, ObservedFeatures, PairFaultFeatures
from auditor.model.frames import SkippedFrame
from auditor.model.measurement import (
    BRIGHTNESS,
    MIN_VALID_PX,
    NO_FINGERPRINT,
    Cells,
    Counts,
    Coverage,
    Measurement,
    Region,
    Solid,
    Statistic,
)
from auditor.model.optics.common_view import view_size_px
from auditor.model.rig import LIDAR, Rig
from auditor.store.records import FrameErrors, FrameStatistics
from auditor.store.schema import table_schema
from auditor.store.tables import Row, Source, read_table, stream_rows

FrameCells = tuple[int, dict[CountedPair, Cells]]
"""The number of a frame, and its counts by what they are of."""


def cell_rows(measurement_id: str, frame: int, cells: Mapping[CountedPair, Cells]) -> Iterator[Row]:
    """The rows of one frame."""
    for counted, grid in cells.items():
        rows, columns = grid.valid.shape
        yield {
            "measurement_id": measurement_id,
            "frame": frame,
            "check_name": counted.check.value,
            "i": counted.i,
            "k": counted.k,
            "sensor": counted.sensor,
            "rows": rows,
            "columns": columns,
            "valid": grid.valid.tobytes(),
            "total": grid.total.tobytes(),
        }


def read_cells(path: Source) -> Iterator[FrameCells]:
    """The cells of a finished file, frame by frame; frames without any are left out. Raises StoreError."""
    for frame, rows in groupby(stream_rows("cells", path), key=itemgetter("frame")):
        yield frame, dict(map(_cells, rows))


def _cells(row: Mapping[str, Any]) -> tuple[CountedPair, Cells]:
    shape = row["rows"], row["columns"]
    valid, total = (np.frombuffer(row[name], dtype) for name, dtype in (("valid", np.uint8), ("total", np.int8)))
    counted = CountedPair(Check(row["check_name"]), row["i"], row["k"], row["sensor"])
    return counted, Cells(valid.reshape(shape), total.reshape(shape))


def fault_feature_rows(
    measurement_id: str, frame: int, fault_features: Mapping[Pair, PairFaultFeatures]
) -> Iterator[Row]:
    """The rows of one frame; NaN becomes NULL."""
    for (i, k), pair in fault_features.items():
        values = {name: None if isnan(x) else x for name, x in zip(COLUMNS, pair.values, strict=True)}
        yield {"measurement_id": measurement_id, "frame": frame, "i": i, "k": k, **values}


def fault_features_of(measured: pa.Table, frames_path: Source, rig: Rig, path: Source) -> ObservedFeatures:
    """The fault features, from a file of their own, of frames that were read from another. Raises StoreError."""
    frames = measured["frame"].to_numpy()
    coverage = {name: where_kept(measured[name], len(rig.sensors), frames_path) for name in BRIGHTNESS}
    places = {pair: place for place, pair in enumerate(rig.pairs)}
    columns = {name: np.full((len(frames), len(rig.pairs)), np.nan) for name in COLUMNS}
    table = read_table("fault_features", path, ["frame", "i", "k", *COLUMNS])
    row = np.searchsorted(frames, table["frame"].to_numpy())
    of_pair = zip(table["i"].to_pylist(), table["k"].to_pylist(), strict=True)
    column = np.array([places[pair] for pair in of_pair], dtype=np.intp)
    for name, values in columns.items():
        values[row, column] = table[name].to_numpy()
    cameras = tuple(camera.number for camera in rig.cameras)
    of_cameras = {name: values[:, len(rig.sensors) - len(cameras) :] for name, values in coverage.items()}
    return ObservedFeatures(rig.pairs, columns, cameras, of_cameras)


_BOX = ("left_px", "top_px", "right_px", "bottom_px")


def region_rows(measurement_id: str, frame: int, regions: Iterable[Region]) -> Iterator[Row]:
    """The rows of one frame."""
    for region in regions:
        solid = region.solid
        yield {
            "measurement_id": measurement_id,
            "frame": frame,
            "sensor": region.sensor,
            "view": region.view,
            **dict(zip(_BOX, region.box_px, strict=True)),
            "share": region.share,
            "mask": region.mask,
            "points": region.points,
            "centre_m": list(solid.centre_m) if solid else None,
            "size_m": list(solid.size_m) if solid else None,
            "yaw_deg": solid.yaw_deg if solid else None,
        }


def read_regions(path: Source, frame: int) -> list[Region]:
    """The regions of one frame. Raises StoreError."""
    return [_region(row) for row in stream_rows("regions", path) if row["frame"] == frame]


def _region(row: Mapping[str, Any]) -> Region:
    solid = None
    if row["centre_m"] is not None:
        solid = Solid(tuple(row["centre_m"]), tuple(row["size_m"]), row["yaw_deg"])
    left, top, right, bottom = (row[name] for name in _BOX)
    box = left, top, right, bottom
    return Region(row["sensor"], row["view"], box, row["share"], row["mask"], row["points"], solid)


_COUNTS = tuple(one.name for one in fields(Counts))
_COVERAGE = tuple(one.name for one in table_schema("frames").columns if hasattr(Coverage, one.name))
"""The columns of frames that are what a triple, or what a sensor, has under their names."""


_ALTERED = "auditor verify says what was altered"

_PIXELS = {
    Statistic.PLAIN: ("valid_px", "inconsistent_px"),
    Statistic.GATED: ("gated_valid_px", "gated_inconsistent_px"),
}

_JUDGED = (
    *("frame", "stamp_ns", "state", "statistics", "unmasked_statistics", "fingerprint", "returns"),
    *(name for names in _PIXELS.values() for name in names),
    *BRIGHTNESS,
)
"""The columns of frames that verdicts and calibrations come from."""


def skipped_row(measurement_id: str, skipped: SkippedFrame) -> Row:
    """The row of a tick without a frame."""
    return {
        "measurement_id": measurement_id,
        "frame": skipped.number,
        "stamp_ns": skipped.stamp_ns,
        "skipped": skipped.reason,
        "skipped_sensor": skipped.sensor,
    }


def measured_row(
    measurement_id: str,
    measurement: Measurement,
    statistics: Sequence[float | None],
    rig: Rig,
    unmasked: Sequence[float | None] | None = None,
) -> Row:
    """The row of a measured frame, with its statistic by sensor check. Raises StoreError if it does not fit."""
    M, T = len(rig_sensor_checks(rig)), len(rig.measured_triples)
    if (len(measurement.counts), len(statistics), set(measurement.presence)) != (T, M, set(rig.sensors)):
        raise StoreError(
            f"frame {measurement.number} does not fit its rig: {len(measurement.counts)} counts for "
            f"{T} triples, {len(statistics)} statistics for {M} sensor checks, "
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
        "statistics": list(statistics),
        "unmasked_statistics": None if unmasked is None else list(unmasked),
        "fingerprint": [measurement.fingerprints.get(sensor) for sensor in rig.sensors],
    }


def read_frames(path: Source) -> pa.Table:
    """What a finished frames file has of its measured frames that judging needs. Raises StoreError."""
    table = read_table("frames", path, ["skipped", *_JUDGED])
    none_skipped = table["skipped"].null_count == len(table)
    return table if none_skipped else table.filter(table["skipped"].is_null())


def errors_of(table: pa.Table, path: Source, rig: Rig, statistic: Statistic) -> FrameErrors:
    """The disparity errors of frames that were read from a file. Raises StoreError."""
    valid, inconsistent = _PIXELS[statistic]
    F, T, S = len(table), len(rig.measured_triples), len(rig.sensors)
    # NULL becomes NaN, which is never >= MIN_VALID_PX.
    pixels, flagged = (_padded(table[name], T, len(rig.triples), path) for name in (valid, inconsistent))
    width, height = view_size_px(rig)
    if ((flagged > pixels) | (flagged < 0) | (pixels > width * height)).any():
        raise StoreError(
            f"it counts more pixels than are in its images of {width} x {height} px", where=path, remedy=_ALTERED
        )
    E = np.full((F, T), np.nan)
    np.divide(flagged, pixels, out=E, where=pixels >= MIN_VALID_PX)
    return FrameErrors(
        frames=table["frame"].to_numpy(),
        stamps_ns=table["stamp_ns"].to_numpy(),
        E=E,
        states=_texts(table["state"], F * S, path).reshape(F, S),
    )


def statistics_of(table: pa.Table, path: Source, rig: Rig) -> FrameStatistics:
    """The statistics of frames that were read from a file. Raises StoreError."""
    F, S, checks = len(table), len(rig.sensors), rig_sensor_checks(rig)
    earlier = [sum(one.check not in ADDED_LATER[n:] for one in checks) for n in range(len(ADDED_LATER))]
    statistics, unmasked = (
        where_kept(table[name], len(checks), path, earlier) for name in ("statistics", "unmasked_statistics")
    )
    fingerprints = list_values(table["fingerprint"], F * S, path).fill_null(NO_FINGERPRINT)
    returns = floats(table["returns"], F * S, path).reshape(F, S)
    return FrameStatistics(
        frames=table["frame"].to_numpy(),
        stamps_ns=table["stamp_ns"].to_numpy(),
        statistics=statistics,
        unmasked=np.where(np.isnan(unmasked), statistics, unmasked),
        states=_texts(table["state"], F * S, path).reshape(F, S),
        fingerprints=fingerprints.to_numpy(zero_copy_only=False).reshape(F, S),
        returns=returns[:, rig.sensors.index(LIDAR)] if LIDAR in rig.sensors else np.full(F, np.nan),
    )


def floats(column: pa.ChunkedArray, count: int, path: Source) -> NDArray[np.float64]:
    """The values of all lists, NaN where NULL."""
    return np.asarray(list_values(column, count, path).cast("float64").to_numpy(zero_copy_only=False))


def _padded(column: pa.ChunkedArray, width: int, before: int, path: Source) -> NDArray[np.float64]:
    """(F, width) values of the lists, NaN where NULL; lists of before there was a fallback lack the last of them."""
    rows = len(column)
    stored = before if len(column.combine_chunks().flatten()) == rows * before else width
    values = floats(column, rows * stored, path).reshape(rows, stored)
    return np.pad(values, ((0, 0), (0, width - stored)), constant_values=np.nan)


def where_kept(column: pa.ChunkedArray, width: int, path: Source, earlier: Sequence[int] = ()) -> NDArray[np.float64]:
    """(F, width) values of the lists, NaN where NULL and where the whole list is; older ones have `earlier` widths."""
    kept = column.is_valid().to_numpy()
    rows, stored = int(kept.sum()), len(column.combine_chunks().flatten())
    width_stored = next((one for one in earlier if stored == rows * one), width)
    values = np.full((len(column), width), np.nan)
    values[kept, :width_stored] = floats(column, rows * width_stored, path).reshape(rows, width_stored)
    return values


def _texts(column: pa.ChunkedArray, count: int, path: Source) -> NDArray[np.str_]:
    return np.asarray(list_values(column, count, path).to_pylist(), dtype=np.str_)


def _count(counts: Counts | None, name: str) -> int | None:
    return None if counts is None else getattr(counts, name)


def list_values(column: pa.ChunkedArray, count: int, path: Source) -> pa.Array:
    """The values of all lists, of which there must be so many. Raises StoreError."""
    values = column.combine_chunks().flatten()
    if len(values) != count:
        raise StoreError(
            "its lists do not have the lengths that its rig demands", where=path, remedy="measure its recording again"
        )
    return values
