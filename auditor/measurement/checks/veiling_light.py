"""Veiling light: what a beam on the whole lens adds to all of one camera's picture, from its darkest parts on.

A tone curve between two cameras follows it as it follows a gain, so that no residual is left. But gains and tone curves
leave black where it is, and light does not: the darkest of what both cameras see is compared.
"""

from dataclasses import dataclass

import numpy as np

from auditor.measurement.checks.photometric_consistency import matched_samples
from auditor.measurement.frame_views import FrameViews
from auditor.model.arrays import Image, quantile_of
from auditor.model.parameters import BY_HAND, parameter

_DARKEST = "three real drives, 41 real pairs of other cameras and streets, as they are and changed (docs/decisions.md)"


@dataclass(frozen=True)
class VeilingLight:
    """By how much the darkest parts of one camera of a pair are lit."""

    step_px: int = parameter(4, unit="half px each way, of which one is compared", source=BY_HAND)
    fewest: int = parameter(200, unit="half px that both cameras see", source=BY_HAND)
    darkest_share: float = parameter(0.02, unit="share of these that is darker than what is compared", source=_DARKEST)
    offset: float = parameter(10.0, unit="grey levels added before logarithms are taken", source=BY_HAND)
    usual: float = parameter(0.9, unit="logarithm of a level, that is none", source=_DARKEST)


NUMBERS = VeilingLight()


def measure_veiling_light(seen: FrameViews, i: int, k: int) -> tuple[float | None, float | None]:
    """By how much the darkest that both see is lighter in the source, and in the reference, 0 to 1: a logarithm.

    None where they see too little together.
    """
    row, column, there = seen.once(matched_samples, i, k, NUMBERS.step_px)
    if row.size < NUMBERS.fewest:
        return None, None
    lighter = _darkest(seen.half_res[i][row, there]) - _darkest(seen.half_res[k][row, column])
    return _shown(lighter), _shown(-lighter)


def _shown(lighter: float) -> float:
    return min(max(lighter - NUMBERS.usual, 0.0), 1.0)


def _darkest(levels: Image) -> float:
    """The logarithm of the level that so few of the levels (M,) lie below."""
    return float(np.log(quantile_of(np.sort(levels, kind="stable"), NUMBERS.darkest_share) + NUMBERS.offset))
