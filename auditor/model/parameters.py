"""Numbers that decide a count or a verdict: each has a name, a value, a unit and a source.

Numbers of one subject are the fields of one frozen dataclass, and its only instance is the group that code reads:

    @dataclass(frozen=True)
    class DisparityError:
        absolute_px: float = parameter(3.0, unit="px", source="paper, Eq. 2")

    DISPARITY_ERROR = DisparityError()

Here are those that shared modules need: no room may import another, so they cannot lie in one. Each group is part of
`measurement.parameters`, of `identification.parameters`, or of both, by what it can change.
"""

import dataclasses
import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal
from functools import cache
from typing import TYPE_CHECKING, TypeVar

from auditor.model.canonical import canonical_json

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Number = int | float | Decimal
Value = TypeVar("Value", bound=Number | tuple[Number, ...])

BY_HAND = "chosen by hand; no experiment recorded"
"""The source of a number of which nothing else is known."""

_DIGEST_LENGTH = 12


@dataclass(frozen=True)
class Parameter:
    """One number, or a few that belong together, of a group."""

    group: str
    name: str
    value: Number | tuple[Number, ...]
    unit: str
    source: str


def parameter(value: Value, *, unit: str, source: str) -> Value:
    """A field of a group. `source` says who gives the value or which experiment chose it.

    Raises ValueError where unit or source is empty.
    """
    if not unit or not source:
        raise ValueError(f"a parameter of value {value} has no unit or no source")
    made: Value = dataclasses.field(default=value, metadata={"unit": unit, "source": source})
    return made


def list_parameters(*groups: "DataclassInstance") -> tuple[Parameter, ...]:
    """All parameters of some groups, in the order of the groups and of their fields."""
    return tuple(found for group in groups for found in _parameters(group))


def canonical_values(*groups: "DataclassInstance") -> str:
    """All values as canonical JSON: what is equal here measures or judges alike."""
    return _canonical_values(groups)


@cache
def _canonical_values(groups: tuple["DataclassInstance", ...]) -> str:
    values = {f"{one.group}.{one.name}": one.value for one in list_parameters(*groups)}
    return canonical_json({name: str(one) if isinstance(one, Decimal) else one for name, one in values.items()})


def digest(*groups: "DataclassInstance") -> str:
    """The beginning of the SHA-256 of `canonical_values`, 12 hexadecimal digits."""
    return hashlib.sha256(canonical_values(*groups).encode()).hexdigest()[:_DIGEST_LENGTH]


def _parameters(group: "DataclassInstance") -> Iterator[Parameter]:
    name = re.sub(r"(?<!^)(?=[A-Z])", "_", type(group).__name__).lower()
    for field in dataclasses.fields(group):
        # Every field is made by `parameter`: one without a unit or a source raises KeyError.
        yield Parameter(name, field.name, getattr(group, field.name), field.metadata["unit"], field.metadata["source"])


_WINDOWS = "chosen on KITTI drives 0009 and 0001 and 18 streets (docs/method.md)"
_LIT = "frames of three real drives and streets 2000 to 2011, under faculas, patterns, drops, glare"
_SIMILAR = "KITTI's calibrations of two days differ by 2 %; no experiment recorded"
_ENLARGED = "docs/figures.md, cameras of fewer pixels: real drives at half size"
_COMMON_VIEW = "docs/decisions.md, the common view is the largest rectangle"


@dataclass(frozen=True)
class RigGeometry:
    """Which cameras share one rectified view."""

    most_off_line_px: float = parameter(
        1.0,
        unit="rows, at PAIR_DEPTH.distance_m",
        source="docs/decisions.md, one common view: 1, 2 and 4 px tried, mean E compared",
    )
    same_intrinsics: float = parameter(1e-3, unit="share of the focal length", source=BY_HAND)


@dataclass(frozen=True)
class PairDepth:
    """Which camera pairs resolve depth well enough for LiDAR conflicts."""

    fewest_px: float = parameter(
        9.0,
        unit="px of disparity, at distance_m",
        source="leaves out KITTI's 6 cm pair (docs/method.md); no experiment recorded",
    )
    distance_m: float = parameter(10.0, unit="m", source=BY_HAND)


@dataclass(frozen=True)
class CommonView:
    """The view that all cameras of a rig share once rectified: towards the edges of a wide lens it would be blurred."""

    widest: float = parameter(1.2, unit="tangent of the angle off the axis (50 degrees)", source=BY_HAND)
    finest: float = parameter(
        0.6,
        unit="recorded px a rectified px",
        source=f"{_COMMON_VIEW}: no limit, 0.5, 0.6 and 0.7 tried, mean E compared",
    )
    usual_focal_px: float = parameter(720.0, unit="px, to which shorter ones are enlarged", source=_ENLARGED)
    usual_width_px: int = parameter(1400, unit="px, to which pictures are enlarged at most", source=_ENLARGED)
    most_enlarged: float = parameter(2.0, unit="px of the view a recorded px", source=_ENLARGED)
    fewest_enlarged_px: int = parameter(480, unit="px: narrower pictures are measured as they are", source=_ENLARGED)


@dataclass(frozen=True)
class DisparityErrorSamples:
    """When a disparity error E is measured at all."""

    fewest_valid_px: int = parameter(200, unit="valid px", source=BY_HAND)


@dataclass(frozen=True)
class PointExcess:
    """By what share of both one number of points exceeds another: (a - b) / (a + b + pseudo_count)."""

    pseudo_count: int = parameter(10, unit="LiDAR points", source="described in docs/method.md; no experiment recorded")


@dataclass(frozen=True)
class ImageWindow:
    """Windows of an image's count grids, to each of which consistent pixels are added as a pseudo-count."""

    cells: tuple[int, int] = parameter((6, 8), unit="cells, rows and columns", source=_WINDOWS)
    pseudo_count: int = parameter(200, unit="half px, which are the fewest of a pair as well", source=_WINDOWS)


@dataclass(frozen=True)
class AddedLight:
    """What saturates near most of a camera's added light: no count follows from it."""

    near_px: tuple[int, int] = parameter((60, 80), unit="half px up and down, and to both sides", source=_LIT)
    beside_px: tuple[int, int] = parameter((9, 25), unit="half px, rows and columns", source=_LIT)


@dataclass(frozen=True)
class RigKindTolerance:
    """How far two rigs of one kind may differ, or of a similar one, so that thresholds of one hold for the other."""

    share: float = parameter(0.02, unit="share of a focal length or baseline", source="docs/decisions.md, a rig kind")
    baseline_m: float = parameter(0.005, unit="m", source="docs/decisions.md, a rig kind")
    similar_share: float = parameter(
        0.05, unit="share of a size, focal length or baseline: a similar kind", source=_SIMILAR
    )
    similar_baseline_m: float = parameter(0.02, unit="m: a similar kind", source=_SIMILAR)


RIG_GEOMETRY = RigGeometry()
PAIR_DEPTH = PairDepth()
COMMON_VIEW = CommonView()
DISPARITY_ERROR_SAMPLES = DisparityErrorSamples()
POINT_EXCESS = PointExcess()
IMAGE_WINDOW = ImageWindow()
ADDED_LIGHT = AddedLight()
RIG_KIND_TOLERANCE = RigKindTolerance()
