"""Light of one colour that one of two colour cameras alone sees.

All channels of a camera have one tone curve but for their gains, the white balance. So the curve is fitted to all of
them together, and a gain to each, twice: the second time to levels without the gains. Light of one colour is in a third
of the samples, and hardly moves it however large it is. A curve for each channel would follow light that covers half of
the image, and the other camera would seem to be lit outside.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import cv2
import numpy as np

from auditor.measurement.tone_curve import tone_curve
from auditor.model.arrays import Floats32, Image, Mask
from auditor.model.parameters import BY_HAND, parameter

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


NUMBERS = ColouredLight()

_WHITE = 255
_OFFSET = np.float32(NUMBERS.offset)
_EDGES = np.linspace(-NUMBERS.largest_gain, NUMBERS.largest_gain, NUMBERS.gain_bins + 1)
_SMOOTH = np.ones(NUMBERS.smoothed_bins)
_ZERO, _NO_LIMIT = np.float32(0), np.float32(np.inf)
_PURITY = np.float32(NUMBERS.purity)


class ColourChannel(Protocol):
    """One channel of two colour cameras, in the view of the reference."""

    @property
    def other(self) -> Image:
        """(h, w) its levels in the source."""
        ...

    @property
    def saturated(self) -> tuple[Mask, Mask]:
        """(h, w) where it saturates in the reference, and in the source."""
        ...

    def samples(self, seen: Mask) -> tuple[Image, Image]:
        """(M,) levels of the source and of the reference."""
        ...

    def residual(self, predicted: Image) -> Floats32:
        """(h, w) by what share the reference lies above or below what is predicted."""
        ...


def coloured_light(channels: Sequence[ColourChannel], seen: Mask) -> Floats32:
    """(h, w) -1 to 1, + where the reference has light of one colour that the source does not have, - the reverse.

    `channels` are blue, green and red, `seen` (h, w) is where both cameras see.
    """
    samples = [one.samples(seen) for one in channels]
    rough = _common_curve(samples)
    curve = _common_curve([(s, _scaled(t, 1 / _gain(rough, s, t))) for s, t in samples])
    residuals = [
        one.residual(np.asarray(cv2.LUT(one.other, _scaled(curve, _gain(curve, s, t))), dtype=np.uint8))
        for one, (s, t) in zip(channels, samples, strict=True)
    ]
    own = of_one_channel(*residuals)
    own *= ~_white([one.saturated for one in channels])
    return own


def _white(saturated: Sequence[tuple[Mask, Mask]]) -> Mask:
    """(h, w) where two channels of a camera saturate: what more light of one colour there is does not show."""
    reference, source = zip(*saturated, strict=True)
    return np.asarray(_two_of(*reference) | _two_of(*source))


def _two_of(a: Mask, b: Mask, c: Mask) -> Mask:
    return np.asarray((a & b) | ((a | b) & c))


def of_one_channel(blue: Floats32, green: Floats32, red: Floats32) -> Floats32:
    """What one of three residuals has beyond the two others, -1 to 1 of any shape.

    Light of one colour leaves the others as they are, or brightens them a little. White light brightens all three, and
    a match that shows another surface brightens one and darkens another: neither is light of one colour.
    """
    lower, upper = cv2.min(blue, green), cv2.max(blue, green)
    highest, lowest, middle = (
        np.asarray(one, dtype=np.float32)
        for one in (cv2.max(upper, red), cv2.min(lower, red), cv2.max(lower, cv2.min(upper, red)))
    )
    added, lacking = _positive(highest), _positive(-lowest)
    others_lacking, others_added = _positive(-middle), _positive(middle)
    own = _beyond(added, others_added, lacking)
    own -= _beyond(lacking, others_lacking, added)
    return np.clip(own, -1, 1, out=own)


def _beyond(amount: Floats32, others: Floats32, opposite: Floats32) -> Floats32:
    """What of an amount others and its opposite do not explain; `others` are overwritten: arrays are large."""
    others += opposite
    others *= _PURITY
    np.subtract(amount, others, out=others)
    return _positive(others)


def _positive(values: Floats32) -> Floats32:
    """The values, zero where they are negative, in place: a clip is several times as fast as `np.maximum`."""
    return np.clip(values, _ZERO, _NO_LIMIT, out=values)


def _common_curve(samples: Sequence[tuple[Image, Image]]) -> Image:
    """(256,) the curve of the channels' samples, (M,) levels of the source and of the reference each."""
    return tone_curve(*(np.concatenate(levels) for levels in zip(*samples, strict=True)))


def _gain(curve: Image, source: Image, target: Image) -> float:
    """The gain of a channel beyond the curve: the most frequent one, of which light is no part."""
    gains = np.sort(np.log((target + _OFFSET) / (curve[source] + _OFFSET)))
    counts = np.convolve(np.diff(np.searchsorted(gains, _EDGES)), _SMOOTH, mode="same")
    usual = (_EDGES[:-1] + _EDGES[1:])[int(np.argmax(counts))] / 2
    near = gains[np.abs(gains - usual) < NUMBERS.near]
    return float(np.exp(near[(near.size - 1) // 2 : near.size // 2 + 1].mean())) if near.size else 1.0


def _scaled(levels: Image, gain: float) -> Image:
    """The levels with a gain, of any shape."""
    return np.asarray(np.clip(np.rint((levels + _OFFSET) * np.float32(gain) - _OFFSET), 0, _WHITE), dtype=np.uint8)
