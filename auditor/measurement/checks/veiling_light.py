"""Light over the whole image of one of two cameras: its darkest levels lie far above those of the other.

No tone curve tells such light from the camera's own levels. But exposures multiply, and leave dark what is dark;
light that a lens scatters over the image is added there as well.
"""

import numpy as np

from auditor.measurement.checks.tone_curve import level_counts
from auditor.measurement.colour_parameters import VEILING_LIGHT
from auditor.model.arrays import Image


def darkest(grey: Image) -> float | None:
    """The level of the darkest part of an image (h, w), what is black left out; None where all is."""
    counts = level_counts(grey)
    counts[0] = 0
    total = int(counts.sum())
    if not total:
        return None
    return float(np.searchsorted(np.cumsum(counts), VEILING_LIGHT.darkest_share * total))


def veiling_light(own: float | None, other: float | None) -> float | None:
    """By how much a camera's darkest level lies above all that exposures make of the other's, 0 to 1.

    None where either is not known.
    """
    if own is None or other is None:
        return None
    above = own - VEILING_LIGHT.largest_gain * other - VEILING_LIGHT.usual
    return min(max(above / VEILING_LIGHT.range, 0.0), 1.0)
