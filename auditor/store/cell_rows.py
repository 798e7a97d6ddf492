"""Cells as rows of the table `cells`, and back as grids."""

from collections.abc import Iterator, Mapping
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from auditor.elements import Element, rig_elements
from auditor.results import Cells
from auditor.rig import Rig
from auditor.store.tables import Row, stream_rows

FrameCells = tuple[int, dict[Element, Cells]]
"""The number of a frame, and its counts by element."""


def cell_rows(measurement_id: str, frame: int, cells: Mapping[Element, Cells], rig: Rig) -> Iterator[Row]:
    """The rows of one frame, in the order of the rig's elements."""
    for position, element in enumerate(rig_elements(rig), start=1):
        if element in cells:
            of_it = cells[element]
            rows, columns = of_it.valid.shape
            yield {
                "measurement_id": measurement_id,
                "frame": frame,
                "position": position,
                "rows": rows,
                "columns": columns,
                "valid": of_it.valid.tobytes(),
                "against": of_it.against.tobytes(),
            }


def read_cells(path: Path, rig: Rig) -> Iterator[FrameCells]:
    """The cells of a finished file, frame by frame; frames without any are left out. Raises StoreError."""
    elements = rig_elements(rig)
    for frame, rows in groupby(stream_rows("cells", path), key=itemgetter("frame")):
        yield frame, {elements[row["position"] - 1]: Cells(_grid(row, "valid"), _grid(row, "against")) for row in rows}


def _grid(row: Mapping[str, Any], name: str) -> NDArray[np.uint8]:
    return np.frombuffer(row[name], dtype=np.uint8).reshape(row["rows"], row["columns"])
