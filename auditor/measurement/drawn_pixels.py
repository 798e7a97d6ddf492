"""What a recorder drew into a camera's pictures: the same levels at the same places in all of them.

What a camera sees has noise, and so has light that falls into it: while the scene moves no patch of a picture has the
levels that it had a picture before in all of its pixels, unless it saturates. A display, a caption or a logo that
covers the picture does. It says nothing of the scene, so nothing is compared there. What saturates may be light, and
stays; so does what the scene shines through, and what is narrower than a patch.
"""

from collections.abc import Mapping
from dataclasses import replace

import cv2
import numpy as np

from auditor.measurement.parameters import HALF, PATCH_CORRELATION
from auditor.measurement.shared_view import RectifiedFrame
from auditor.measurement.tone_curve import saturation_level
from auditor.model.arrays import Image, Mask
from auditor.model.checks import Pair

_PATCH = np.ones((2 * HALF * PATCH_CORRELATION.radius_px + 1,) * 2, dtype=np.uint8)


class _LastPicture:
    """The last picture (H, W) of a camera, and which of its pixels have not changed since the first one.

    `moved`: whether pictures have changed since.
    """

    def __init__(self, picture: Image) -> None:
        self.last = picture
        self.same: Mask = np.ones(picture.shape, dtype=np.bool_)
        self.moved = False

    def add(self, picture: Image) -> None:
        """Take the next picture; one of which most is as before tells nothing: the vehicle stands."""
        same = picture == self.last
        self.last = picture
        if 2 * np.count_nonzero(same) <= same.size:
            self.same &= same
            self.moved = True

    def drawn(self) -> Mask | None:
        """(H, W) what was drawn, patches around it included; None where nothing was, or only one picture tells."""
        if not self.moved:
            return None
        still = self.same & (self.last < saturation_level(self.last))
        if not still.any():
            return None
        drawn = cv2.morphologyEx(still.view(np.uint8), cv2.MORPH_OPEN, _PATCH)
        return np.asarray(cv2.dilate(drawn, _PATCH), dtype=np.bool_) if drawn.any() else None


class DrawnPixels:
    """Follows the pictures of one recording's cameras, in each view in which they are compared."""

    def __init__(self) -> None:
        self._seen: dict[tuple[Pair | None, int], _LastPicture] = {}

    def hidden(self, prepared: RectifiedFrame, pair: Pair | None = None) -> RectifiedFrame:
        """The next frame, in the common view or in that of a pair, with what was drawn left out of its valid masks."""
        drawn = {camera: self._of((pair, camera), picture) for camera, picture in prepared.greys.items()}
        if all(one is None for one in drawn.values()):
            return prepared
        return replace(prepared, valid_masks=_without(prepared, drawn))

    def _of(self, key: tuple[Pair | None, int], picture: Image) -> Mask | None:
        seen = self._seen.get(key)
        if seen is None or seen.last.shape != picture.shape:
            self._seen[key] = _LastPicture(picture)
            return None
        seen.add(picture)
        return seen.drawn()


def _without(prepared: RectifiedFrame, drawn: Mapping[int, Mask | None]) -> dict[int, Mask]:
    whole = {camera: np.ones(picture.shape, dtype=np.bool_) for camera, picture in prepared.greys.items()}
    seen = {**whole, **prepared.valid_masks}
    return {camera: mask if (hidden := drawn.get(camera)) is None else mask & ~hidden for camera, mask in seen.items()}
