"""Symptoms as rows of the table `symptoms`, and back as arrays."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import isnan
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auditor.elements import Witness, rig_elements
from auditor.rig import LIDAR, Rig
from auditor.store.frame_rows import read_coverage
from auditor.store.tables import Row, read_table
from auditor.symptoms import COLUMNS, Pair, PairSymptoms


@dataclass(frozen=True, eq=False)
class FrameSymptoms:
    """The symptoms of a measurement's F measured frames, skipped ticks left out.

    `frames` and `stamps_ns` are (F,) int64; `columns` holds (F, P) values by the names of `symptoms.COLUMNS` for the
    matched `pairs`; `level` and `saturated` are (F, C) by camera. NaN where not measured.
    """

    frames: NDArray[np.int64]
    stamps_ns: NDArray[np.int64]
    pairs: tuple[Pair, ...]
    columns: Mapping[str, NDArray[np.float64]]
    cameras: tuple[int, ...]
    level: NDArray[np.float64]
    saturated: NDArray[np.float64]


def symptom_rows(measurement_id: str, frame: int, symptoms: Mapping[Pair, PairSymptoms]) -> Iterator[Row]:
    """The rows of one frame; NaN becomes NULL."""
    for (i, k), pair in symptoms.items():
        values = {name: None if isnan(x) else x for name, x in zip(COLUMNS, pair.values, strict=True)}
        yield {"measurement_id": measurement_id, "frame": frame, "i": i, "k": k, **values}


def matched_pairs(rig: Rig) -> tuple[Pair, ...]:
    """The pairs (i, k) that symptoms are of, in the order of the rig's elements."""
    return tuple((e.i, e.k) for e in rig_elements(rig) if e.witness is Witness.UNLIKE)


def read_symptoms(frames_path: Path, path: Path, rig: Rig) -> FrameSymptoms:
    """The symptoms of the measured frames of a finished measurement, all NaN where it is older than they are.

    Raises StoreError.
    """
    frames, stamps_ns, coverage = read_coverage(frames_path, rig, ("level", "saturated_share"))
    pairs = matched_pairs(rig)
    places = {pair: place for place, pair in enumerate(pairs)}
    columns = {name: np.full((len(frames), len(pairs)), np.nan) for name in COLUMNS}
    if path.is_file():
        table = read_table("symptoms", path, ["frame", "i", "k", *COLUMNS])
        row = np.searchsorted(frames, table["frame"].to_numpy())
        of_pair = zip(table["i"].to_pylist(), table["k"].to_pylist(), strict=True)
        column = np.array([places[pair] for pair in of_pair], dtype=np.intp)
        for name, values in columns.items():
            values[row, column] = table[name].to_numpy()
    cameras = tuple(sensor for sensor in rig.sensors if sensor != LIDAR)
    level, saturated = (coverage[name][:, -len(cameras) :] for name in ("level", "saturated_share"))
    return FrameSymptoms(frames, stamps_ns, pairs, columns, cameras, level, saturated)
