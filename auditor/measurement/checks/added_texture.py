"""Added texture: what light of many fine patches, as laser speckle or a projected picture, adds to smooth surfaces.

The tone curve of two cameras follows its mean, windows average its residuals away, and noise always correlates a little
somewhere. But light adds texture and takes none away: at stereo's matches one camera has contrast where the other one
is smooth, all around the match. Contrast is the norm of a patch, in shares of the strong ones that both see, so that
neither a gain nor a blur is texture.
"""

from dataclasses import dataclass

import cv2
import numpy as np

from auditor.measurement.checks.light import view_of
from auditor.measurement.checks.photometric_consistency import matched_samples, patches_of
from auditor.measurement.count_grid import largest_share
from auditor.measurement.frame_views import FrameViews
from auditor.measurement.parameters import HALF, PATCH_CORRELATION
from auditor.model.arrays import Floats32, Indices, Mask
from auditor.model.parameters import BY_HAND, parameter

_REAL = "three real drives, patterns of light on them, faults, and streets 7000 to 7029 (docs/decisions.md)"


@dataclass(frozen=True)
class AddedTexture:
    """How much of a window of one camera has texture where another one is smooth."""

    step_px: int = parameter(4, unit="half px each way, of which one is compared", source=BY_HAND)
    fewest: int = parameter(200, unit="half px that both cameras see", source=BY_HAND)
    nearby_px: tuple[int, int] = parameter(
        (9, 9), unit="half px around a match that are as smooth, and seen", source=_REAL
    )
    times: float = parameter(2.5, unit="times the other's norm of a patch nearby", source=_REAL)
    strong_share: float = parameter(0.9, unit="share of the norms that strong ones exceed", source=_REAL)
    window_px: tuple[int, int] = parameter((64, 96), unit="half px, rows and columns", source=_REAL)
    pseudo_count: int = parameter(15, unit="compared half px that are added to those of a window", source=_REAL)


NUMBERS = AddedTexture()
_NEARBY = np.ones(NUMBERS.nearby_px, dtype=np.uint8)
_WINDOW = (NUMBERS.window_px[0] // NUMBERS.step_px, NUMBERS.window_px[1] // NUMBERS.step_px)
_FLOOR = np.float32(PATCH_CORRELATION.norm_floor)


@dataclass(frozen=True, eq=False)
class _Contrast:
    """A camera's contrast at the samples (M,) of a pair: the `norm` of a patch, and the `highest` one nearby.

    `row` and `column` are their places in its picture. It is `told` where its picture goes on and saturates nowhere.
    """

    row: Indices
    column: Indices
    norm: Floats32
    highest: Floats32
    told: Mask

    @classmethod
    def of(cls, seen: FrameViews, camera: int, row: Indices, column: Indices) -> "_Contrast":
        norms, highest, told = seen.once(_pictures, camera)
        return cls(row, column, norms[row, column], highest[row, column], told[row, column])

    def strong(self) -> np.float32:
        """The norm that few exceed."""
        place = int(NUMBERS.strong_share * self.norm.size)
        return np.float32(np.partition(self.norm, place)[place] + _FLOOR)

    def added_to(self, other: "_Contrast") -> float:
        """The largest share of a window, 0 to 1, in which it has texture where the other one is smooth."""
        gain = max(self.strong() / other.strong(), np.float32(1))
        smooth = np.float32(NUMBERS.times) * (other.highest * gain + _FLOOR)
        added = (self.norm > smooth) & self.told & other.told
        row, column = self.row // NUMBERS.step_px, self.column // NUMBERS.step_px
        shape = int(row.max()) + 1, int(column.max()) + 1
        return largest_share((row, column), added, shape, _WINDOW, NUMBERS.pseudo_count)


def measure_added_texture(seen: FrameViews, i: int, k: int) -> tuple[float | None, float | None]:
    """How much of a window, 0 to 1, of the source, and of the reference, has texture where the other one is smooth.

    None where they see too little together.
    """
    row, column, there = seen.once(matched_samples, i, k, NUMBERS.step_px)
    if row.size < NUMBERS.fewest:
        return None, None
    source, reference = _Contrast.of(seen, i, row, there), _Contrast.of(seen, k, row, column)
    return source.added_to(reference), reference.added_to(source)


def _pictures(seen: FrameViews, camera: int) -> tuple[Floats32, Floats32, Mask]:
    """(h, w) the norms of a camera's patches, the highest one nearby, and where all nearby is seen and unsaturated."""
    norms, levels, whole = seen.once(patches_of, camera).norm, seen.half_res[camera], seen.valid_masks.get(camera)
    shown = levels < seen.once(view_of, camera).saturation
    if whole is not None:
        shown &= whole[::HALF, ::HALF]
    told = cv2.erode(shown.view(np.uint8), _NEARBY, borderType=cv2.BORDER_CONSTANT, borderValue=(0,))
    return norms, np.asarray(cv2.dilate(norms, _NEARBY), np.float32), np.asarray(told, np.bool_)
