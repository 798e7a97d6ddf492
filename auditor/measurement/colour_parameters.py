"""The numbers of the check for light of one colour; `parameters.MEASURING` has them among the others."""

from dataclasses import dataclass

from auditor.model.parameter import BY_HAND, parameter

_COLOURED = "frames of the three real drives under lasers of one colour (docs/attacks.md): chosen on them"


@dataclass(frozen=True)
class ColouredLight:
    """Light of one colour in one of two colour cameras."""

    offset: float = parameter(8.0, unit="grey levels added before gains are taken", source=_COLOURED)
    largest_gain: float = parameter(1.5, unit="of a gain's natural logarithm", source=BY_HAND)
    gain_bins: int = parameter(120, unit="bins from the smallest to the largest gain", source=BY_HAND)
    smoothed_bins: int = parameter(7, unit="bins", source=BY_HAND)
    near: float = parameter(0.1, unit="of the logarithm, about the most frequent gain", source=BY_HAND)
    purity: float = parameter(2.0, unit="times what the other channels have, taken off", source=_COLOURED)


COLOURED_LIGHT = ColouredLight()
