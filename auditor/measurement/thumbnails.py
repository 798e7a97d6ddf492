"""Thumbnails: small images of the strongest frames, so that a report needs no recording."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.parameters import HALF
from auditor.measurement.shared_view import FrameArrays
from auditor.model.measurement import Measurement, Statistic
from auditor.model.pictures import Picture, Pictures, Sampling
from auditor.model.rig import LIDAR, Triple
from auditor.model.stamps import NANOSECONDS

_JPEG_QUALITY = 80
_LIDAR_COLOUR = (255, 200, 0, 255)  # BGRA: light blue, drawn as dots over the cameras' areas
_CAMERA_COLOUR = (0, 110, 255, 150)  # orange, half transparent
_DOT_PX = 3

_MOST_PICTURES = 60


def draw(arrays: FrameArrays, frame: int) -> Picture | None:
    """Encode the views and the inconsistent pixels of a frame of this number; None where no triple was measured.

    Views are half-resolution grey images; pixels are those of the leftmost reference camera's triples.
    """
    if not arrays.comparisons:
        return None
    reference = max(triple.k for triple in arrays.comparisons)
    views = {
        number: _encoded(".jpg", half, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
        for number, half in arrays.views.items()
    }
    mask = np.zeros((*arrays.views[reference].shape, 4), dtype=np.uint8)
    triples = [triple for triple in arrays.comparisons if triple.k == reference]
    _paint(mask, arrays, [triple for triple in triples if triple.i != LIDAR], _CAMERA_COLOUR, size=1)
    _paint(mask, arrays, [triple for triple in triples if triple.i == LIDAR], _LIDAR_COLOUR, size=_DOT_PX)
    return Picture(frame, reference, views, _encoded(".png", mask, [cv2.IMWRITE_PNG_COMPRESSION, 6]))


def _paint(
    mask: NDArray[np.uint8], arrays: FrameArrays, triples: list[Triple], colour: tuple[int, ...], size: int
) -> None:
    marked = np.zeros(mask.shape[:2], dtype=np.uint8)
    for triple in triples:
        comparison = arrays.comparisons[triple]
        row, column = (index * comparison.step // HALF for index in (comparison.row, comparison.column))
        marked[row, column] = 1
    mask[cv2.dilate(marked, np.ones((size, size), np.uint8)) > 0] = colour


def _encoded(form: str, pixels: NDArray[np.uint8], options: list[int]) -> bytes:
    _, data = cv2.imencode(form, pixels, options)
    return data.tobytes()


class PictureBook:
    """Keeps the pictures of the strongest frames of one recording, at most one a second and sixty in all.

    They are chosen among all frames, those in which a statistic is unusually large (`incidents`), or none; where
    nothing is unusual, one in five seconds. Only the strongest frame of a second is drawn, once the second is over:
    encoding costs as much as matching.
    """

    def __init__(self, pictures: Pictures = Pictures.ALL) -> None:
        self._pictures = pictures
        self._candidate: _Candidate | None = None
        self._kept: list[tuple[tuple[bool, float], Picture]] = []
        self._sampling = Sampling()

    def offer(self, measurement: Measurement, arrays: FrameArrays, *, unusual: bool = True) -> None:
        """Consider a frame; `unusual` says that a statistic of it is. Frames come in the order of their stamps."""
        if self._pictures == Pictures.NONE or (self._pictures == Pictures.INCIDENTS and not unusual):
            return
        errors = [c.disparity_error(Statistic.GATED) for c in measurement.counts if c is not None]
        strength = unusual, sum(E for E in errors if E is not None)
        second = measurement.stamp_ns // NANOSECONDS
        if self._candidate is None or self._candidate.second != second:
            self._settle()
        elif self._candidate.strength >= strength:
            return
        self._candidate = _Candidate(second, strength, measurement.number, arrays)

    def pages(self) -> list[Picture]:
        """The pictures kept, in the order of the frames."""
        self._settle()
        return sorted((picture for _, picture in self._kept), key=lambda one: one.frame)

    def _settle(self) -> None:
        """Draw the candidate if it is among the strongest so far."""
        candidate, self._candidate = self._candidate, None
        if candidate is None:
            return
        unusual, _ = candidate.strength
        if not unusual and not self._sampling.takes(candidate.second * NANOSECONDS):
            return
        if len(self._kept) >= _MOST_PICTURES:
            weakest = min(self._kept, key=lambda kept: kept[0])
            if weakest[0] >= candidate.strength:
                return
            self._kept.remove(weakest)
        picture = draw(candidate.arrays, candidate.number)
        if picture is not None:
            self._kept.append((candidate.strength, picture))


@dataclass(frozen=True, eq=False)
class _Candidate:
    """The strongest frame of the current second: one in which something is unusual goes before others."""

    second: int
    strength: tuple[bool, float]
    number: int
    arrays: FrameArrays
