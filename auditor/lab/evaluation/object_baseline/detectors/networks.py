"""What detectors in ONNX files have in common: a model, its description, and what becomes of its outputs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.lab.evaluation.object_baseline.detectors.described import COLUMN, Description
from auditor.lab.evaluation.object_baseline.detectors.overlap import suppressed
from auditor.measurement.disparity.matchers.onnx_models import OnnxModel
from auditor.model.arrays import Floats

Box = TypeVar("Box")


MOST_OBJECTS = 300
"""The most objects of one frame; those of the highest scores stay."""


@dataclass(frozen=True, eq=False)
class Found:
    """(M, K) numbers of boxes as the network gives them, (M,) scores, surest first, and the M names."""

    boxes: Floats
    scores: Floats
    names: Sequence[str]


@dataclass(frozen=True, eq=False)
class Network:
    """A model and its description. Raises SettingError where they disagree."""

    path: Path
    model: OnnxModel
    description: Description

    def __post_init__(self) -> None:
        self.model.check_names([self.description.input.name], self.description.output.named)

    @property
    def name(self) -> str:
        """The name of its file."""
        return self.path.name

    @property
    def settings(self) -> str:
        """Canonical JSON of the model's hash and its description."""
        return self.description.settings(self.model.sha256)

    @property
    def labels(self) -> frozenset[str]:
        """The kinds of object that it can name."""
        return frozenset(filter(None, self.description.names))

    @property
    def libraries(self) -> Mapping[str, str]:
        """Versions of the libraries that run it, by name."""
        return self.model.libraries

    def find(self, shown: NDArray[np.generic], columns: int) -> Found:
        """The objects that the model finds. Raises SettingError where it fails or its output is not as described."""
        named = self.description.output.named
        values = self.model.run(named, {self.description.input.name: shown})
        return take_apart(dict(zip(named, values, strict=True)), self.description, columns, self.path)

    def surest(
        self, found: Found, boxes: Sequence[Box | None], agreement: Callable[[list[Box], list[Box]], Floats]
    ) -> list[tuple[Box, float, str]]:
        """Box, score and name of the objects that stay: one of those of a class that overlap, none without a box."""
        kept: list[tuple[Box, float, str]] = []
        for name in sorted(set(found.names)):
            of_it = [
                (box, float(score))
                for box, score, other in zip(boxes, found.scores, found.names, strict=True)
                if other == name and box is not None
            ]
            here = [box for box, _ in of_it]
            scores = np.array([score for _, score in of_it])
            positions = suppressed(scores, agreement(here, here), self.description.overlap)
            kept += [(*of_it[position], name) for position in positions]
        return kept


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
