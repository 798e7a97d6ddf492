"""Trees, bushes and hedges: many ragged cards in all directions, that leave gaps."""

import numpy as np

from auditor.lab.road.surfaces import Look, Surface, Vector, box, prism

_UP = np.array([0.0, -1.0, 0.0])


def tree(rng: np.random.Generator, x: float, z: float, height_m: float, crown_m: float) -> list[Surface]:
    """A trunk with a few boughs and a crown of so many metres in radius."""
    trunk = height_m - 1.5 * crown_m
    bark = Look("bark", (1.0, 4.0), albedo=float(rng.uniform(0.12, 0.25)), detail=0.2, detail_m=2.0)
    surfaces = prism(x, z, float(rng.uniform(0.12, 0.26)), 0.0, trunk + 0.5 * crown_m, bark, sides=6)
    middle = np.array([x, -(height_m - crown_m), z])
    for _ in range(int(10 + 3.5 * crown_m * crown_m)):
        direction = rng.standard_normal(3)
        direction *= rng.uniform(0.35, 0.85) * crown_m / np.linalg.norm(direction)
        leaf = Look(
            "foliage" if rng.random() < 0.7 else "sparse",
            (1.0, 1.0),
            albedo=float(rng.uniform(0.25, 0.55)),
            detail=0.25,
            detail_m=3.0,
            both_sided=True,
        )
        surfaces.append(_card(rng, middle + direction, float(rng.uniform(1.1, 2.0)), leaf))
    twigs = Look("twigs", albedo=0.7, detail=0.1, both_sided=True)
    surfaces.extend(_card(rng, middle - 0.8 * crown_m * _UP, crown_m * 1.2, twigs) for _ in range(2))
    return surfaces


def hedge(
    rng: np.random.Generator, left: float, right: float, near: float, far: float, height_m: float
) -> list[Surface]:
    """A dense core that is lower and narrower than the leaves over it."""
    core = Look("hedge", ((far - near) / 1.6, height_m / 1.6), albedo=0.28, detail=0.3, detail_m=3.0)
    surfaces = box(left + 0.15, right - 0.15, near + 0.15, far - 0.15, 0.0, height_m - 0.2, core)
    for _ in range(int((far - near) * 2.2)):
        place = np.array([rng.uniform(left, right), -height_m * rng.uniform(0.3, 0.95), rng.uniform(near, far)])
        leaf = Look("foliage", albedo=float(rng.uniform(0.2, 0.4)), detail=0.25, detail_m=3.0, both_sided=True)
        surfaces.append(_card(rng, place, float(rng.uniform(0.6, 1.0)), leaf))
    return surfaces


def bush(rng: np.random.Generator, x: float, z: float, size_m: float) -> list[Surface]:
    """A round heap of leaves."""
    surfaces = []
    for _ in range(int(8 + 6 * size_m)):
        place = (
            np.array([x, 0.0, z])
            + rng.uniform(-0.5, 0.5, 3) * [size_m, 0, size_m]
            - [0, rng.uniform(0.2, 0.7) * size_m, 0]
        )
        leaf = Look("foliage", albedo=float(rng.uniform(0.2, 0.45)), detail=0.25, detail_m=3.0, both_sided=True)
        surfaces.append(_card(rng, place, float(rng.uniform(0.6, 1.1)) * size_m, leaf))
    return surfaces


def _card(
    rng: np.random.Generator, middle: "np.ndarray[tuple[int], np.dtype[np.float64]]", size_m: float, look: Look
) -> Surface:
    """A square card around a point, turned at random but not lying flat."""
    turn = rng.uniform(0, np.pi)
    lean = rng.uniform(-0.6, 0.6)
    across = np.array([np.cos(turn), 0.0, np.sin(turn)])
    down = np.cos(lean) * -_UP + np.sin(lean) * np.array([-np.sin(turn), 0.0, np.cos(turn)])
    corner = middle - 0.5 * size_m * (across + down)
    return Surface(_vector(corner), _vector(size_m * across), _vector(size_m * down), look)


def _vector(values: "np.ndarray[tuple[int], np.dtype[np.float64]]") -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
