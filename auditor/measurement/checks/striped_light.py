"""Light in rows: what a lamp that is switched faster than a shutter rolls leaves in one of two cameras.

A rolling shutter exposes one row after the other, so that such light lies in some rows, across the whole image, and
not in the next ones. No drop, dirt or glare does, and no exposure. Cameras that stand on one line see the same things
in the same rows: the mean levels of a row, by blocks of columns, are compared with those of the other camera's rows
nearby. Before that each row is compared with those above it and with those below it, so that gains and slow changes
take no part, and neither do edges: light in rows exceeds what is on both of its sides, and what lies beside a part of
the picture that is darker, as that under a display, on one.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.frame_views import FrameViews
from auditor.measurement.tone_curve import saturation_level
from auditor.model.arrays import Floats32, Image, Mask
from auditor.model.parameters import BY_HAND, parameter

_LIT = "two frames of three real drives and of 14 streets, with faults and lights (docs/decisions.md): chosen on them"


@dataclass(frozen=True)
class StripedLight:
    """Light in some rows of one of two cameras."""

    offset: float = parameter(10.0, unit="grey levels added before logarithms are taken", source=BY_HAND)
    blocks: int = parameter(12, unit="blocks of columns, side by side", source=BY_HAND)
    usable_share: float = parameter(0.5, unit="share of a block's row neither black nor saturated", source=BY_HAND)
    blocks_share: float = parameter(0.5, unit="share of the blocks that both cameras know", source=BY_HAND)
    without_share: float = parameter(0.25, unit="share of those blocks in which a lit row may not show", source=BY_HAND)
    rows_around: int = parameter(25, unit="half px, rows that a row is compared with", source=_LIT)
    rows_apart: int = parameter(2, unit="half px that rows of two cameras may lie apart", source=_LIT)
    usual: float = parameter(0.03, unit="logarithm of a level, that is none", source=_LIT)


NUMBERS = StripedLight()

_LEVELS = np.log(np.arange(256, dtype=np.float32) + np.float32(NUMBERS.offset))
_BESIDE = NUMBERS.rows_around // 2
_ABOVE = np.zeros((2 * _BESIDE + 1, 1), dtype=np.float32)
_ABOVE[:_BESIDE] = 1 / _BESIDE
_BELOW = np.ascontiguousarray(_ABOVE[::-1])
_NEARBY = np.ones((2 * NUMBERS.rows_apart + 1, 1), dtype=np.uint8)
_NOTHING = np.float32(-np.inf)
_LEAST = np.float32(np.finfo(np.float32).tiny)


@dataclass(frozen=True, eq=False)
class RowExcess:
    """The rows of an image by blocks of columns, (h, blocks): by how much each exceeds those above and those below it.

    `excess` is of the mean logarithm of levels, where `known`: where enough of the block neither saturates nor is
    black.
    """

    excess: Floats32
    known: Mask

    @classmethod
    def of(cls, grey: Image) -> "RowExcess":
        """The rows of a half-resolution grey image (h, w)."""
        usable = np.zeros(_LEVELS.size, dtype=np.float32)
        usable[1 : saturation_level(grey)] = 1
        upright = cv2.transpose(grey)
        share, total = (_by_block(cv2.LUT(upright, of_level)) for of_level in (usable, _LEVELS * usable))
        compared = share >= np.float32(NUMBERS.usable_share)
        level = np.where(compared, total / np.maximum(share, _LEAST), np.float32(0))
        counts = compared.astype(np.float32)
        sides = [_sums(level, side) / np.maximum(_sums(counts, side), _LEAST) for side in (_ABOVE, _BELOW)]
        return cls(np.asarray(level - np.maximum(*sides), dtype=np.float32), compared)

    def above(self, other: "RowExcess") -> float | None:
        """By how much the most striking row exceeds all rows of the other camera nearby, 0 to 1: in most blocks.

        None where no row has enough blocks that both know.
        """
        nearby = cv2.dilate(np.where(other.known, other.excess, _NOTHING), _NEARBY)
        both = self.known & (cv2.erode(other.known.astype(np.uint8), _NEARBY) > 0)
        counts = both.sum(axis=1)
        enough = counts >= NUMBERS.blocks_share * NUMBERS.blocks
        if not enough.any():
            return None
        above = np.sort(np.where(both, self.excess - nearby, np.inf)[enough], axis=1)
        least = (counts[enough] * NUMBERS.without_share).astype(np.intp)
        shown = float(above[np.arange(len(least)), least].max()) - NUMBERS.usual
        return min(max(shown, 0.0), 1.0)


def rows_of(seen: FrameViews, camera: int) -> RowExcess:
    """The rows of a camera's image."""
    return RowExcess.of(seen.half_res[camera])


def measure_striped_light(seen: FrameViews, i: int, k: int) -> tuple[float | None, float | None]:
    """What the source, and what the reference, has of light in rows that the other has not."""
    of_source, of_reference = seen.once(rows_of, i), seen.once(rows_of, k)
    return of_source.above(of_reference), of_reference.above(of_source)


def _by_block(transposed: cv2.typing.MatLike) -> Floats32:
    """Of a transposed image (w, h) the (h, blocks) means: OpenCV adds up whole rows faster than parts of them."""
    size = (transposed.shape[1], NUMBERS.blocks)
    return np.ascontiguousarray(cv2.resize(transposed, size, interpolation=cv2.INTER_AREA).T, dtype=np.float32)


def _sums(values: Floats32, side: Floats32) -> Floats32:
    """The weighted sums of the rows on one side of each."""
    return np.asarray(cv2.filter2D(values, cv2.CV_32F, side, borderType=cv2.BORDER_REFLECT), dtype=np.float32)
