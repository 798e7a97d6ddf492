"""Counts that no measurement can give: more pixels than the image has, shares above one, boxes outside the image."""

from collections.abc import Iterator

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from auditor.model.checks import SIGNED_CHECKS, Check
from auditor.model.optics.common_view import view_size_px
from auditor.store.store import Store
from auditor.store.tables import read_table, stream_rows

_WITHIN = (
    ("inconsistent_px", "valid_px"),
    ("gated_valid_px", "valid_px"),
    ("gated_inconsistent_px", "gated_valid_px"),
    ("gated_inconsistent_px", "inconsistent_px"),
    ("out_of_range_px", "valid_px"),
)
"""Counts that are parts of others."""

_SHARES = ("saturated_share", "textureless_share", "unmatched_share", "compared_share", "compared_by_two_share")
_MOST_IN_CELL = 127
_BRIGHTEST = 255.0
_EDGES = ("left_px", "top_px", "right_px", "bottom_px")


def implausible(store: Store, measurement_id: str) -> Iterator[tuple[str, str]]:
    """Tables of a measurement, each with a sentence on what in it cannot be. Raises StoreError."""
    rig = store.rig(store.measurement(measurement_id).rig_id)
    width, height = view_size_px(rig)
    names = [*{name for pair in _WITHIN for name in pair}, *_SHARES, "level", "returns", "frame"]
    frames = read_table("frames", store.source("frames", measurement_id), names)
    yield from (("frames", what) for what in _of_frames(frames, width * height))
    yield from (("cells", what) for what in _of_cells(store, measurement_id))
    regions = read_table("regions", store.source("regions", measurement_id), ["frame", *_EDGES, "share"])
    yield from (("regions", what) for what in _of_regions(regions, width, height))


def _of_frames(frames: pa.Table, area_px: int) -> Iterator[str]:
    values = {name: _flat(frames, name) for name in frames.column_names}
    for part, whole in _WITHIN:
        if len(values[part]) == len(values[whole]) and (values[part] > values[whole]).any():
            yield f"{part} is larger than {whole}, of which it is a part"
    for name in {name for pair in _WITHIN for name in pair}:
        if _outside(values[name], 0, area_px):
            yield f"{name} is not within 0 and the {area_px} pixels of the image"
    for name, most in (*((name, 1.0) for name in _SHARES), ("level", _BRIGHTEST), ("returns", np.inf)):
        if _outside(values[name], 0, most):
            yield f"{name} is not within 0 and {most:g}"
    if (np.diff(values["frame"]) <= 0).any():
        yield "its frames are not in their order"


def _of_cells(store: Store, measurement_id: str) -> Iterator[str]:
    for row in stream_rows("cells", store.source("cells", measurement_id)):
        valid, total = np.frombuffer(row["valid"], np.uint8), np.frombuffer(row["total"], np.int8)
        size = row["rows"] * row["columns"]
        if len(valid) != size or len(total) != size:
            yield f"frame {row['frame']}: a grid does not have its {row['rows']} x {row['columns']} cells"
            return
        counted = Check(row["check_name"]) not in SIGNED_CHECKS
        if (valid > _MOST_IN_CELL).any() or (counted and ((total < 0) | (total > valid)).any()):
            yield f"frame {row['frame']}: a cell counts more than it can hold"
            return


def _of_regions(regions: pa.Table, width: int, height: int) -> Iterator[str]:
    left, top, right, bottom = (_flat(regions, name) for name in _EDGES)
    if ((left < 0) | (top < 0) | (left >= right) | (top >= bottom) | (right > width) | (bottom > height)).any():
        yield f"a region lies outside the image of {width} x {height} px"
    if _outside(_flat(regions, "share"), 0, 1):
        yield "share is not within 0 and 1"


def _outside(values: NDArray[np.float64], least: float, most: float) -> bool:
    return bool(((values < least) | (values > most)).any())  # NaN, which is NULL, is neither


def _flat(table: pa.Table, name: str) -> NDArray[np.float64]:
    """The values of a column, of all lists, as floats; NULL is NaN."""
    column = table[name].combine_chunks()
    values = column.flatten() if pa.types.is_list(column.type) else column
    return np.asarray(values.cast("float64").to_numpy(zero_copy_only=False), dtype=np.float64)
