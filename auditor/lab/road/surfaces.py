"""What synthetic drives are built of: flat parallelograms, each wearing a picture.

The world frame is x right, y down, z along the road, in metres; the road is at y = 0.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from auditor.lab.road.atlas import Atlas

Vector = tuple[float, float, float]
Vectors = NDArray[np.float32]
Numbers = NDArray[np.float32]


@dataclass(frozen=True)
class Look:
    """How a surface looks: a picture, repeated `times` along both edges, and rough `detail` over it.

    `detail` is a share of the albedo; its grains repeat every `detail_m` metres. `gloss` weighs the picture's gloss;
    `bend` is by how much the normal turns from edge to edge of a curved panel. One that is `both_sided` has no inside.
    `sunlit` is 0 in the shade of houses.
    """

    picture: str = "plain"
    times: tuple[float, float] = (1.0, 1.0)
    albedo: float = 1.0
    detail: float = 0.1
    detail_m: float = 6.0
    gloss: float = 0.0
    bend: float = 0.0
    both_sided: bool = False
    sunlit: float = 1.0


@dataclass(frozen=True)
class Surface:
    """The parallelogram corner, corner + edge_s, corner + edge_r; its outside is where edge_r x edge_s points."""

    corner: Vector
    edge_s: Vector
    edge_r: Vector
    look: Look = field(default_factory=Look)
    speed_m_s: float = 0.0


@dataclass(frozen=True, eq=False)
class Surfaces:
    """(M, 3) corners and edges in the world frame at time 0, and (M,) columns of how they look."""

    corner: Vectors
    edge_s: Vectors
    edge_r: Vectors
    speed_m_s: Numbers
    picture: NDArray[np.int32]
    times: Numbers
    albedo: Numbers
    detail: Numbers
    detail_m: Numbers
    gloss: Numbers
    bend: Numbers
    both_sided: NDArray[np.bool_]
    sunlit: Numbers

    @property
    def count(self) -> int:
        """How many surfaces there are."""
        return len(self.corner)


def pack(surfaces: Sequence[Surface], atlas: Atlas) -> Surfaces:
    """The surfaces as columns."""

    def column(values: Sequence[float] | Sequence[Vector] | Sequence[tuple[float, float]]) -> Numbers:
        return np.array(values, dtype=np.float32)

    looks = [surface.look for surface in surfaces]
    return Surfaces(
        corner=column([surface.corner for surface in surfaces]),
        edge_s=column([surface.edge_s for surface in surfaces]),
        edge_r=column([surface.edge_r for surface in surfaces]),
        speed_m_s=column([surface.speed_m_s for surface in surfaces]),
        picture=np.array([atlas.number[look.picture] for look in looks], dtype=np.int32),
        times=column([look.times for look in looks]),
        albedo=column([look.albedo for look in looks]),
        detail=column([look.detail for look in looks]),
        detail_m=column([look.detail_m for look in looks]),
        gloss=column([look.gloss for look in looks]),
        bend=column([look.bend for look in looks]),
        both_sided=np.array([look.both_sided for look in looks], dtype=np.bool_),
        sunlit=column([look.sunlit for look in looks]),
    )


def upright(start: tuple[float, float], end: tuple[float, float], bottom_m: float, top_m: float, look: Look) -> Surface:
    """A wall over the ground line from start to end, both (x, z); from outside, `start` is on the left.

    Heights are metres above the road. Pictures stand upright: their first row is at the top.
    """
    (x0, z0), (x1, z1) = start, end
    return Surface((x0, -top_m, z0), (x1 - x0, 0.0, z1 - z0), (0.0, top_m - bottom_m, 0.0), look)


def level(left: float, right: float, near: float, far: float, height_m: float, look: Look) -> Surface:
    """A horizontal rectangle seen from above; its picture's columns run along x, its first row is far."""
    return Surface((left, -height_m, far), (right - left, 0.0, 0.0), (0.0, 0.0, near - far), look)


def prism(x: float, z: float, radius_m: float, bottom_m: float, top_m: float, look: Look, sides: int) -> list[Surface]:
    """A pole or trunk with so many sides."""
    angles = np.linspace(0, 2 * np.pi, sides + 1)
    ring = [(x + radius_m * float(np.cos(angle)), z + radius_m * float(np.sin(angle))) for angle in angles]
    return [upright(start, end, bottom_m, top_m, look) for start, end in pairwise(ring)]


def box(left: float, right: float, near: float, far: float, bottom_m: float, top_m: float, look: Look) -> list[Surface]:
    """The four walls and the lid of a box."""
    corners = [(left, near), (right, near), (right, far), (left, far), (left, near)]
    walls = [upright(start, end, bottom_m, top_m, look) for start, end in pairwise(corners)]
    return [*walls, level(left, right, near, far, top_m, look)]
