"""Wet ground by a model of its own, made otherwise than that of `benign_clouds`: no choice was made by it.

Water lies in patches. At its surface light is mirrored as Fresnel's equations say, the more the more grazing the beam,
so that less of it comes back from the road below; what is mirrored meets what stands beyond, and its echo seems to lie
as far below the road as that stands above it. And wheels throw water up.
"""

import numpy as np

from auditor.lab.attacks.paper import road_below_m
from auditor.model.arrays import Floats, Mask, Points

_WATER = 1.33
_WAVES, _WAVES_M = 24, (1.5, 6.0)
_DARKER = 0.4
"""What a wet road under no mirror returns of what a dry one does."""
_REACH_M = 70.0
"""How far away a dry road's echo is the faintest that is detected."""
_FEWER = 0.6
"""Of the mirrored beams, that meet something bright enough."""
_CELL = np.deg2rad(0.3)
_STEPS = 64
_TRACK_M, _HIGH_M = 0.8, 0.4


def fresnel(cosine: Floats) -> Floats:
    """The share of unpolarised light that water mirrors, by the cosine of its angle to the upright."""
    inside = np.sqrt(1 - (1 - cosine**2) / _WATER**2)
    across = (cosine - _WATER * inside) / (cosine + _WATER * inside)
    along = (_WATER * cosine - inside) / (_WATER * cosine + inside)
    return np.asarray((across**2 + along**2) / 2)


def film(right_m: Floats, ahead_m: Floats, wet: float, rng: np.random.Generator) -> Mask:
    """Which places of the road water covers: a share of about `wet`, in patches."""
    total = np.zeros(len(right_m))
    for _ in range(_WAVES):
        angle, phase = rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi)
        wave = 2 * np.pi / rng.uniform(*_WAVES_M)
        total += np.cos(wave * (right_m * np.cos(angle) + ahead_m * np.sin(angle)) + phase)
    return np.asarray(total > np.quantile(total, 1 - wet)) if len(total) else np.zeros(0, dtype=np.bool_)


def wet_ground(points: Points, rng: np.random.Generator, place: np.random.Generator) -> Points:
    """Water covers two to nine tenths of the road: it returns less, and mirrors what stands beyond."""
    down_m, range_m = road_below_m(points), np.maximum(np.linalg.norm(points, axis=1), 0.1)
    on_road = np.flatnonzero(np.abs(down_m - points[:, 1]) < 0.15)
    far = range_m[on_road]
    mirrored = fresnel(np.clip(down_m / far, 0, 1))
    water = film(points[on_road, 0], points[on_road, 2], place.uniform(0.2, 0.9), rng)
    echo = np.maximum(rng.lognormal(0, 0.7, far.size) * (_REACH_M / far) ** 3, 1)
    below = echo * np.where(water, _DARKER * (1 - mirrored) ** 2, 1) >= 1
    image_m = _images_m(points, down_m, on_road)
    shown = water & (image_m > far + 0.3) & (rng.random(far.size) < _FEWER * mirrored**2)
    seen_m = range_m.copy()
    seen_m[on_road] = np.where(shown, image_m + rng.normal(0, 0.03, far.size), far)
    kept = np.ones(len(points), dtype=np.bool_)
    kept[on_road] = below | shown
    return np.asarray(points * (seen_m / range_m)[:, None], dtype=np.float32)[kept]


def _images_m(points: Points, down_m: float, asked: np.ndarray) -> Floats:
    """How far the mirror image of something lies in the directions of the points asked about; 0 where none does."""
    standing = points[(down_m - points[:, 1] > 0.3) & (points[:, 2] > 1)]
    images = standing * np.array([1, -1, 1]) + np.array([0, 2 * down_m, 0])
    order = np.argsort(-np.linalg.norm(images, axis=1), kind="stable")  # the nearest one is written last
    images = images[order]
    nearest = dict(zip(_cells(images), np.linalg.norm(images, axis=1).tolist(), strict=True))
    return np.array([nearest.get(cell, 0.0) for cell in _cells(points[asked])])


def _cells(points: Points) -> list[int]:
    right, down, ahead = points.T
    around, below = np.arctan2(right, ahead), np.arctan2(down, np.hypot(right, ahead))
    return (np.floor(around / _CELL).astype(int) * 10000 + np.floor(below / _CELL).astype(int)).tolist()


def spray(points: Points, rng: np.random.Generator, place: np.random.Generator) -> Points:
    """Spray behind the wheels of a car 12 to 30 m ahead, 4 to 10 m long: the lower, the denser."""
    down_m, range_m = road_below_m(points), np.maximum(np.linalg.norm(points, axis=1), 0.1)
    car_m, aside_m, long_m = place.uniform(12, 30), place.uniform(-3, 3), place.uniform(4, 10)
    denser = place.uniform(0.05, 0.4)
    direction = points / range_m[:, None]
    near = np.flatnonzero(np.abs(points[:, 0] / np.maximum(points[:, 2], 0.1) - aside_m / car_m) < 0.4)
    near = near[points[near, 2] > 1]
    at_m = np.linspace(max(car_m - long_m, 2), car_m, _STEPS)
    step_m = at_m[1] - at_m[0]
    depth, ends_m = rng.exponential(1, near.size), np.full(near.size, np.inf)
    passed = np.zeros(near.size)
    for away_m in at_m:
        right, down, ahead = direction[near].T * away_m
        behind = np.clip((car_m - ahead) / long_m, 0, 1)
        wide_m = 0.25 + 0.6 * behind
        tracks = sum(np.exp(-0.5 * ((right - aside_m - side) / wide_m) ** 2) for side in (-_TRACK_M, _TRACK_M))
        low = np.exp(-np.clip(down_m - down, 0, None) / _HIGH_M)
        clumps = rng.gamma(0.5, 2, near.size)
        passed += denser * tracks * low * (1 - behind) * clumps * step_m
        ends_m = np.where((passed > depth) & np.isinf(ends_m), away_m + rng.uniform(0, step_m, near.size), ends_m)
    found_m = range_m.copy()
    found_m[near] = np.minimum(range_m[near], ends_m)
    return np.asarray(points * (found_m / range_m)[:, None], dtype=np.float32)
