"""A matcher that does not know how far apart the cameras of a pair are, as networks do not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.matchers import SgbmMatcher

_SGBM = SgbmMatcher()


@dataclass(frozen=True)
class WholeRange:
    """SGBM that searches the same range in every pair."""

    name: str = _SGBM.name
    settings: str = _SGBM.settings
    range_px: int = _SGBM.range_px
    step: int = _SGBM.step
    colour: bool = _SGBM.colour

    def match(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
        """As SGBM matches them."""
        return _SGBM.match(left, right)
