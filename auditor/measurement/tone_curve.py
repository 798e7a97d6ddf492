"""Tone curves: which level of one camera goes with which level of another, fitted to the pixels that both see.

Cameras differ in gain, offset, knee and spectrum. A curve of medians that only has to rise follows all but the last.
A grey camera's spectrum is wider than that of a colour camera's channels: materials of one luma have many grey levels,
and those of one hue and luma nearly one. So grey levels are predicted from colours, with one curve for each class of
chroma; colours cannot be predicted from grey levels.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.parameters import CHROMA, SATURATION, TONE_CURVE
from auditor.model.arrays import Floats, Image, Mask

_LEVELS = 256
_WHITE = 255
_FEWEST_BINS = 2  # a curve has two points
_BINS = TONE_CURVE.bins
_WIDTH = _LEVELS // _BINS
_OF_BINS = np.arange(_LEVELS).reshape(_BINS, _WIDTH)
_CLASSES = len(CHROMA.edges) + 1  # of red over green, and as many of blue

Classes = NDArray[np.uint8]
"""(h, w) the class of chroma of each pixel."""


@dataclass(frozen=True, eq=False)
class Prediction:
    """(C, 256) predicted levels by class and level of the source."""

    table: Image

    def of(self, source: Image, classes: Classes | None = None) -> Image:
        """The levels predicted from the source's (h, w) levels, and its classes where there are several."""
        if classes is None:
            return np.asarray(cv2.LUT(source, self.table[0]), dtype=np.uint8)
        return np.asarray(self.table.take(classes * np.uint16(_LEVELS) + source), dtype=np.uint8)

    def saturated_from(self, level: int) -> "Prediction":
        """From a level of the source on the least that any class predicts: colours turn white where they saturate."""
        table = self.table.copy()
        table[:, level:] = table[:, level:].min(axis=0)
        return Prediction(table)


def predict(source: Image, target: Image, usable: Mask, classes: Classes | None = None) -> Prediction:
    """Fit the target's levels to the source's, (M,) each where `usable`; by class where classes (M,) are given.

    A class of few samples has the curve of all of them.
    """
    source, target = source[usable], target[usable]
    common = tone_curve(source, target)
    if classes is None:
        return Prediction(common[None])
    classes = classes[usable]
    tables = np.repeat(common[None], _CLASSES**2, axis=0)
    counts = np.bincount(classes, minlength=len(tables))
    for number in np.flatnonzero(counts >= CHROMA.fewest).tolist():
        own = classes == number
        tables[number] = tone_curve(source[own], target[own])
    return Prediction(tables)


def chroma_classes(blue: Image, green: Image, red: Image) -> Classes:
    """(h, w) the class of each pixel: how much red and blue exceed green, as shares of the whole."""
    b, g, r = (channel.astype(np.float32) for channel in (blue, green, red))
    whole = b + g + r + np.float32(CHROMA.dark)
    classes = np.zeros(g.shape, dtype=np.uint8)
    for colour in (r, b):
        classes *= np.uint8(_CLASSES)
        share = (colour - g) / whole
        for edge in CHROMA.edges:
            classes += (share > np.float32(edge)).view(np.uint8)
    return classes


def saturation_level(image: Image) -> int:
    """The level from which on an (h, w) image saturates: below its top level where many pixels lie there."""
    top = int(image.max())
    crowded = np.count_nonzero(image >= top - 1) > SATURATION.crowded_share * image.size
    return min(SATURATION.level, top - SATURATION.below_top) if crowded else SATURATION.level


def saturates_from(source: Image, target: Image, source_end: int, target_end: int) -> int:
    """The source's level from which on the target saturates, of samples (M,) of both; 255 if there is none.

    `source_end` and `target_end` are the levels from which on each saturates. Most samples there are saturated, and so
    nearly is what the curve of those that are not predicts: light that only the target sees saturates darker ones too.
    """
    bins = source // np.uint8(_WIDTH)
    every, saturated = (np.bincount(some, minlength=_BINS) for some in (bins, bins[target >= target_end]))
    used = np.flatnonzero(every >= TONE_CURVE.fewest)
    mostly = np.flatnonzero(_monotone(2 * saturated[used] / every[used]) >= 1)
    if not mostly.size:
        return _WHITE
    apart = (source < source_end) & (target < target_end)
    nearly = tone_curve(source[apart], target[apart]) >= TONE_CURVE.nearly_saturated * target_end
    return max(int(used[mostly[0]]) * _WIDTH, int(nearly.argmax()) if nearly.any() else _WHITE)


def tone_curve(source: Image, target: Image) -> Image:
    """(256,) levels of the target by level of the source: monotone medians by bin, a gain beyond both ends."""
    middle, level = _medians(source, target)
    levels = np.arange(_LEVELS, dtype=np.float64)
    if len(middle) < _FEWEST_BINS:
        return levels.astype(np.uint8)
    level = _monotone(level)
    curve = np.interp(levels, middle, level)
    below, above = levels < middle[0], levels > middle[-1]
    curve[below] = level[0] * levels[below] / max(middle[0], 1.0)
    curve[above] = level[-1] * levels[above] / max(middle[-1], 1.0)
    return np.clip(np.rint(curve), 0, _WHITE).astype(np.uint8)


def _medians(source: Image, target: Image) -> tuple[Floats, Floats]:
    """By bin with enough samples: the mean of the source's levels, and the median of the target's."""
    levels = np.bincount(source, minlength=_LEVELS).reshape(_BINS, _WIDTH)
    counts, sums = levels.sum(axis=1), (levels * _OF_BINS).sum(axis=1)
    used = np.flatnonzero(counts >= TONE_CURVE.fewest)
    ordered = np.sort(source // np.uint8(_WIDTH) * np.uint16(_LEVELS) + target)
    start = (counts.cumsum() - counts)[used]
    low, high = (ordered[start + (counts[used] - odd) // 2] % np.uint16(_LEVELS) for odd in (1, 0))
    return np.asarray(sums[used] / counts[used]), np.asarray((low + high) / 2)


def _monotone(levels: Floats) -> Floats:
    """The nearest levels that never fall, all weighing alike (pool adjacent violators)."""
    pools: list[tuple[float, int]] = []
    for level in levels.tolist():
        mean, number = level, 1
        while pools and pools[-1][0] > mean:
            before, many = pools.pop()
            mean, number = (before * many + mean * number) / (many + number), many + number
        pools.append((mean, number))
    return np.repeat([mean for mean, _ in pools], [number for _, number in pools])
