"""The numbers of the checks for light of one colour and for light in rows, among those of `parameters.MEASURING`."""

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


COLOURED_LIGHT = ColouredLight()
STRIPED_LIGHT = StripedLight()
