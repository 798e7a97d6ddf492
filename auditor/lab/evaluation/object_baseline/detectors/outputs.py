"""The outputs of a network as rows of numbers for boxes, with their scores and names."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.lab.evaluation.object_baseline.detectors.described import COLUMN, Description
from auditor.model.arrays import Floats

MOST_OBJECTS = 300
"""The most objects of one frame; those of the highest scores stay."""


@dataclass(frozen=True, eq=False)
class Found:
    """(M, K) numbers of boxes as the network gives them, (M,) scores, surest first, and the M names."""

    boxes: Floats
    scores: Floats
    names: Sequence[str]


def take_apart(
    outputs: Mapping[str, NDArray[np.generic]], description: Description, columns: int, where: Path
) -> Found:
    """The objects that have a name and a sufficient score, at most MOST_OBJECTS.

    Raises SettingError where the outputs are not as described.
    """
    given = description.output
    boxes = _part(outputs, given.boxes, where)
    if boxes.ndim < 2 or boxes.shape[-1] != columns or boxes.size != boxes.shape[-2] * columns:
        raise _mismatch(given.boxes, boxes, f"(M, {columns})", where)
    boxes = boxes.reshape(-1, columns)
    scores = _part(outputs, given.scores, where)
    if given.labels or scores.size == len(boxes):
        scores = _vector(given.scores, scores, len(boxes), where)
        labels = np.zeros(len(boxes))
        if given.labels:
            labels = _vector(given.labels, _part(outputs, given.labels, where), len(boxes), where) - description.first
    else:
        if scores.ndim < 2 or scores.size != len(boxes) * scores.shape[-1]:
            raise _mismatch(given.scores, scores, f"({len(boxes)}, C)", where)
        by_class = scores.reshape(len(boxes), -1)
        labels, scores = by_class.argmax(axis=1).astype(np.float64), by_class.max(axis=1, initial=-np.inf)
        labels -= description.first
    if given.objectness:
        scores = scores * _vector(given.objectness, _part(outputs, given.objectness, where), len(boxes), where)
    sensible = np.isfinite(boxes).all(axis=1) & (scores >= description.score) & np.isfinite(labels)
    sensible &= (labels >= 0) & (labels < len(description.names))
    positions = np.flatnonzero(sensible)
    names = {int(position): description.names[int(labels[position])] for position in positions}
    kept = [p for p in positions[np.argsort(-scores[positions], kind="stable")] if names[int(p)]][:MOST_OBJECTS]
    return Found(boxes[kept], scores[kept], [names[int(p)] for p in kept])


def _part(outputs: Mapping[str, NDArray[np.generic]], place: str, where: Path) -> Floats:
    """An output, or columns of its last axis."""
    part = COLUMN.fullmatch(place)
    assert part is not None
    try:
        values = np.asarray(outputs[part["name"]], dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SettingError(f"the output {part['name']} holds no numbers", where=where) from error
    if part["first"] is None:
        return values
    first = int(part["first"])
    end = int(part["end"] or first + 1)
    if values.ndim < 2 or not first < end <= values.shape[-1]:
        raise _mismatch(place, values, f"{end} columns at least", where)
    return values[..., first:end]


def _vector(place: str, values: Floats, length: int, where: Path) -> Floats:
    if values.size != length:
        raise _mismatch(place, values, f"({length},)", where)
    return values.reshape(length)


def _mismatch(place: str, values: Floats, meant: str, where: Path) -> SettingError:
    return SettingError(
        f"the model gives {place} as {values.shape} where its description means {meant}",
        where=where,
        remedy="correct the outputs in the TOML file beside it",
    )
