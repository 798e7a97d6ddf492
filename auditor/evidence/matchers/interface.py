"""What a stereo matcher is."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Matcher(Protocol):
    """Finds, for each pixel of the left image, its match in the same row of the right image.

    `name` and `settings` (canonical JSON of all that can change a disparity) bind thresholds to it; `range_px` is the
    largest disparity it can give, `step` the width in full-resolution pixels of one of its own, `colour` whether it
    wants BGR images instead of grey ones.
    """

    @property
    def name(self) -> str: ...  # noqa: D102 - the class docstring says it
    @property
    def settings(self) -> str: ...  # noqa: D102
    @property
    def range_px(self) -> int: ...  # noqa: D102
    @property
    def step(self) -> int: ...  # noqa: D102
    @property
    def colour(self) -> bool: ...  # noqa: D102

    def match(self, left: NDArray[np.uint8], right: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Disparities (ceil(H / step), ceil(W / step)) in full-resolution pixels, NaN where none was found."""
        ...
