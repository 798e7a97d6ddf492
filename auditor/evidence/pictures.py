"""Small pictures of one frame, so that a report needs no recording."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.evidence.measuring import Evidence
from auditor.rig import LIDAR, Triple

_JPEG_QUALITY = 80
_LIDAR_COLOUR = (255, 200, 0, 255)  # BGRA: light blue, drawn as dots over the cameras' areas
_CAMERA_COLOUR = (0, 110, 255, 150)  # orange, half transparent
_DOT_PX = 3
_VIEW_STEP = 2


@dataclass(frozen=True)
class Picture:
    """`views`: the half-resolution grey image of each camera as JPEG.

    `mask`: the inconsistent pixels of the leftmost reference camera's triples as a transparent PNG of the same size.
    """

    reference: int
    views: Mapping[int, bytes]
    mask: bytes


def draw(evidence: Evidence) -> Picture | None:
    """Encode the views and the inconsistent pixels of a frame; None where no triple was measured."""
    if not evidence.comparisons:
        return None
    reference = max(triple.k for triple in evidence.comparisons)
    views = {
        number: _encoded(".jpg", half, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        for number, half in evidence.views.items()
    }
    mask = np.zeros((*evidence.views[reference].shape, 4), dtype=np.uint8)
    triples = [triple for triple in evidence.comparisons if triple.k == reference]
    _paint(mask, evidence, [triple for triple in triples if triple.i != LIDAR], _CAMERA_COLOUR, size=1)
    _paint(mask, evidence, [triple for triple in triples if triple.i == LIDAR], _LIDAR_COLOUR, size=_DOT_PX)
    return Picture(reference, views, _encoded(".png", mask, [cv2.IMWRITE_PNG_COMPRESSION, 9]))


def _paint(
    mask: NDArray[np.uint8], evidence: Evidence, triples: list[Triple], colour: tuple[int, ...], size: int
) -> None:
    marked = np.zeros(mask.shape[:2], dtype=np.uint8)
    for triple in triples:
        comparison = evidence.comparisons[triple]
        row, column = (index * comparison.step // _VIEW_STEP for index in (comparison.row, comparison.column))
        marked[row, column] = 1
    mask[cv2.dilate(marked, np.ones((size, size), np.uint8)) > 0] = colour


def _encoded(form: str, pixels: NDArray[np.uint8], options: list[int]) -> bytes:
    _, data = cv2.imencode(form, pixels, options)
    return data.tobytes()
