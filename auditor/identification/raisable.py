"""Which elements of a frame some threshold could raise: what is worth a closer look while its images are at hand."""

from collections.abc import Sequence

from auditor.elements import Element
from auditor.identification.margins import FLOORS


def raisable(elements: Sequence[Element], ratios: Sequence[float | None]) -> list[Element]:
    """The elements whose local ratio lies above the floor of their witness's thresholds; None is not measured."""
    pairs = zip(elements, ratios, strict=True)
    return [element for element, ratio in pairs if ratio is not None and ratio > FLOORS[element.witness]]
