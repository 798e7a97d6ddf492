"""Cars and vans: an outline seen from the side, drawn out to the vehicle's width."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from auditor.lab.road.atlas import Picture
from auditor.lab.road.surfaces import Look, Surface, level

_SIDE_TEXELS = (128, 512)
_WHEEL_M = 0.33
_SILL_M = 0.24
_BELT_M = 0.08
_BODY_GLOSS = 0.35


@dataclass(frozen=True)
class Shape:
    """A vehicle's outline: (metres from the rear, height) from the rear's foot over the roof to the front's.

    `glass` are the numbers of the outline's stretches that are windows; `belt_m` is the lower edge of the side windows,
    which reach from `windows_m[0]` to `windows_m[1]` there.
    """

    outline: tuple[tuple[float, float], ...]
    glass: tuple[int, ...]
    belt_m: float
    windows_m: tuple[float, float]
    wheels_m: tuple[float, float]
    width_m: float

    @property
    def length_m(self) -> float:
        """From bumper to bumper."""
        return max(point[0] for point in self.outline)

    @property
    def height_m(self) -> float:
        """Of the roof above the road."""
        return max(point[1] for point in self.outline)


_HATCHBACK = ((0.0, 0.3), (0.0, 0.86), (0.1, 0.95), (0.5, 1.4), (2.1, 1.47), (3.0, 1.0), (3.75, 0.82), (3.9, 0.6))
_SALOON = ((0.0, 0.3), (0.0, 0.92), (0.75, 1.02), (1.45, 1.4), (2.7, 1.43), (3.45, 0.98), (4.5, 0.8), (4.65, 0.55))
_ESTATE = ((0.0, 0.3), (0.0, 0.95), (0.2, 1.05), (0.55, 1.45), (2.6, 1.5), (3.4, 1.0), (4.4, 0.8), (4.55, 0.6))
_VAN = ((0.0, 0.35), (0.0, 1.1), (0.1, 1.95), (3.5, 2.0), (4.3, 1.2), (4.9, 1.0), (5.0, 0.6))

SHAPES = {
    "hatchback": Shape((*_HATCHBACK, (3.9, 0.24)), (2, 4), 0.95, (0.35, 2.95), (0.75, 3.15), 1.68),
    "saloon": Shape((*_SALOON, (4.65, 0.24)), (2, 4), 0.97, (1.0, 3.4), (0.95, 3.75), 1.8),
    "estate": Shape((*_ESTATE, (4.55, 0.24)), (2, 4), 0.97, (0.4, 3.35), (0.9, 3.6), 1.78),
    "van": Shape((*_VAN, (5.0, 0.3)), (3,), 1.2, (3.0, 4.2), (1.0, 4.0), 1.95),
}


def vehicle_pictures() -> dict[str, Picture]:
    """One picture of the side for each shape, and those of fronts, rears and panes."""
    sides = {f"side of {name}": _side(shape) for name, shape in SHAPES.items()}
    return {**sides, "front": _end(front=True), "rear": _end(front=False), "pane": _pane()}


def vehicle(
    name: str, x: float, z: float, *, towards_us: bool, paint: float, speed_m_s: float = 0.0, sunlit: float = 1.0
) -> list[Surface]:
    """A vehicle whose middle stands at (x, z), along the street; `paint` is its albedo."""
    shape = SHAPES[name]
    turn = -1.0 if towards_us else 1.0
    rear = z - turn * shape.length_m / 2
    left, right = x - shape.width_m / 2, x + shape.width_m / 2
    body = Look(albedo=paint, detail=0.03, detail_m=2.0, gloss=_BODY_GLOSS, bend=0.35, sunlit=sunlit)
    surfaces = []
    for number, ((l0, h0), (l1, h1)) in enumerate(pairwise(shape.outline)):
        z0, z1 = rear + turn * l0, rear + turn * l1
        # The picture's first row is the higher or, on level stretches, the farther edge.
        upward = h1 > h0 or (h1 == h0 and z1 > z0)
        (z_first, h_first), (z_last, h_last) = ((z1, h1), (z0, h0)) if upward else ((z0, h0), (z1, h1))
        across = turn if upward else -turn
        start = left if across > 0 else right
        surfaces.append(
            Surface(
                (start, -h_first, z_first),
                (across * shape.width_m, 0.0, 0.0),
                (0.0, h_first - h_last, z_last - z_first),
                _stretch(shape, number, body),
            )
        )
    side = replace(body, picture=f"side of {name}", bend=0.25, both_sided=True)
    along, down = (0.0, 0.0, turn * shape.length_m), (0.0, shape.height_m, 0.0)
    surfaces += [Surface((at, -shape.height_m, rear), along, down, side) for at in (left, right)]
    near, far = sorted((rear, rear + turn * shape.length_m))
    surfaces.append(level(left, right, near, far, 0.02, Look(albedo=0.05, detail=0.05, sunlit=0.0)))
    return [replace(surface, speed_m_s=speed_m_s) for surface in surfaces]


def _stretch(shape: Shape, number: int, body: Look) -> Look:
    if number in shape.glass:
        return replace(body, picture="pane", albedo=1.0, gloss=1.0, bend=0.5)
    if number == 0:
        return replace(body, picture="rear")
    if number == len(shape.outline) - 2:
        return replace(body, picture="front")
    return body


def _side(shape: Shape) -> Picture:
    high, wide = _SIDE_TEXELS
    along, height = np.meshgrid(
        (np.arange(wide) + 0.5) / wide * shape.length_m, (1 - (np.arange(high) + 0.5) / high) * shape.height_m
    )
    lengths, heights = zip(*shape.outline, strict=True)
    top = np.interp(along, lengths[1:], heights[1:])
    body = (height < top) & (height > _SILL_M)
    albedo = np.where(height < 0.42, 0.75, 1.0).astype(np.float32)
    gloss = np.full(albedo.shape, 1.0, np.float32)
    glass = _side_windows(shape, along, height, top)
    albedo[glass], gloss[glass] = 0.12, 1.6
    for door in np.linspace(*shape.windows_m, 4)[1:3]:
        albedo[(np.abs(along - door) < 0.012) & body] *= 0.35
    for at in shape.wheels_m:
        away = np.hypot(along - at, height - _WHEEL_M)
        albedo[away < _WHEEL_M + 0.06] = 0.05
        gloss[away < _WHEEL_M + 0.06] = 0.0
        albedo[(away < 0.22) & (away > 0.04)] = 0.5
        body |= away < _WHEEL_M
    return Picture(albedo, gloss, hole=~body, glass=glass)


def _side_windows(
    shape: Shape, along: NDArray[np.float64], height: NDArray[np.float64], top: NDArray[np.float64]
) -> NDArray[np.bool_]:
    start, end = shape.windows_m
    inside = (height > shape.belt_m) & (height < top - _BELT_M) & (along > start) & (along < end)
    for pillar in np.linspace(start, end, 4)[1:3]:
        inside &= np.abs(along - pillar) > 0.05
    return np.asarray(inside)


def _end(*, front: bool) -> Picture:
    """Lamps, plate, and a grille in front."""
    albedo = np.full((64, 128), 1.0, np.float32)
    gloss = np.full((64, 128), 1.0, np.float32)
    for left in (4, 98):
        albedo[6:24, left : left + 26] = 1.6 if front else 0.5
    if front:
        albedo[12:30:3, 36:92] = 0.15
    albedo[44:64] *= 0.5
    albedo[34:46, 44:84] = 1.8
    letters = np.random.default_rng(7).random((6, 36)) < 0.5
    albedo[37:43, 46:82][letters] = 0.1
    return Picture(albedo, gloss)


def _pane() -> Picture:
    """A window with its frame and dark seats behind."""
    albedo = np.full((64, 128), 0.03, np.float32)
    for left in (22, 76):
        albedo[20:60, left : left + 30] = 0.07
    gloss = np.ones((64, 128), np.float32)
    frame = np.ones((64, 128), bool)
    frame[4:60, 5:123] = False
    albedo[frame], gloss[frame] = 0.05, 0.2
    return Picture(albedo, gloss, glass=~frame)
