"""What a stereo matcher is, and its options beside its name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Protocol, TypeGuard

import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.model.rig import Rig
from auditor.model.settings import MeasureSettings, about, settings_of


class Matcher(Protocol):
    """Finds, for each pixel of the left image, its match in the same row of the right image.

    `name` and `settings` (canonical JSON of all that can change a disparity) bind thresholds to it; `range_px` is the
    largest disparity it can give of any pair, `step` the width in full-resolution pixels of one of its own, `colour`
    whether it wants BGR images instead of grey ones.
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


class PairMatcher(Matcher, Protocol):
    """A matcher that gains from seeing many pairs at once: those of a frame, or of several.

    `pairs_at_once` is how many its device works on together; 1 on the CPU, which has no time to spare beside them.
    """

    @property
    def pairs_at_once(self) -> int: ...  # noqa: D102 - the class docstring says it
    def match_pairs(
        self, images: Sequence[NDArray[np.uint8]], pairs: Sequence[tuple[int, int]]
    ) -> list[NDArray[np.float32]]:
        """What `match` gives for each pair (left, right) of positions in `images`."""
        ...


class RangedMatcher(Matcher, Protocol):
    """A matcher that takes less time where it searches less far, as a pair of near cameras lets it."""

    def reaching(self, disparity_1m_px: float) -> Matcher:
        """This matcher for a pair in which what is 1 m away has that disparity, f b by Eq. 1."""
        ...


def for_pair(matcher: Matcher, rig: Rig, i: int, k: int) -> Matcher:
    """The matcher of cameras (i, k) of a rectified rig: it searches as far as near surfaces have disparities there."""
    return matcher.reaching(rig.camera(k).focal_px * rig.baseline_m(i, k)) if takes_ranges(matcher) else matcher


def takes_ranges(matcher: Matcher) -> TypeGuard[RangedMatcher]:
    """Whether a matcher takes less time where it searches less far; asked of one name: `isinstance` reads all."""
    return hasattr(matcher, "reaching")


def takes_pairs(matcher: Matcher) -> TypeGuard[PairMatcher]:
    """Whether a matcher works on several pairs together."""
    return hasattr(matcher, "pairs_at_once")


def pairs_at_once(matcher: Matcher) -> int:
    """How many pairs a matcher works on together."""
    return matcher.pairs_at_once if takes_pairs(matcher) else 1


def libraries(matcher: Matcher) -> Mapping[str, str]:
    """Versions by name of what a matcher runs on and others do not: what was measured may depend on them."""
    versions: Mapping[str, str] = getattr(matcher, "libraries", {})
    return versions


@dataclass(frozen=True)
class MatcherOptions:
    """Options of matchers that are networks; what is None or left at its default was not given.

    `weights` file of psmnet, which otherwise has those that come with auditor; its `align_corners` convention and
    `max_disparity` in pixels; `device` cpu, cuda or cuda:1; `precision` fp32, tf32, fp16 or bf16; whether it is
    `compiled` for the device; `threads` of the CPU that one process may use.
    """

    weights: Path | None = MeasureSettings.weights
    align_corners: bool | None = MeasureSettings.align_corners
    max_disparity: int | None = MeasureSettings.max_disparity
    device: str = MeasureSettings.device
    precision: str = MeasureSettings.precision
    compiled: bool = MeasureSettings.compiled
    threads: int = 1

    def only(self, matcher: str, *taken: str) -> None:
        """Raises SettingError where an option was given that the matcher does not take."""
        for option in fields(self):
            if option.name not in (*taken, "threads") and getattr(self, option.name) != option.default:
                raise SettingError(f"{matcher} takes no such option", where=_spelt(option.name), remedy="leave it out")


def _spelt(field: str) -> str:
    """What the command line calls it."""
    return f"--{about(settings_of(MeasureSettings)[field]).flag or field.replace('_', '-')}"
