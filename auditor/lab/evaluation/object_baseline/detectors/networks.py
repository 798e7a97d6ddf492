"""The common parts of detectors in ONNX files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from auditor.lab.evaluation.object_baseline.detectors.described import Description
from auditor.lab.evaluation.object_baseline.detectors.outputs import Found, take_apart
from auditor.lab.evaluation.object_baseline.detectors.overlap import suppressed
from auditor.measurement.disparity.matchers.onnx_models import OnnxModel
from auditor.model.arrays import Floats

Box = TypeVar("Box")


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
