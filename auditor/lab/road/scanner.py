"""From what laser rays meet to the points of a scan."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.lab.road.casting import NOTHING, Hits, View
from auditor.lab.road.rays import SpinningRays, spinning
from auditor.lab.road.shading import Scenery

_MAX_RANGE_M = 100.0
_REACH = np.deg2rad(47.0)
"""Only what lies before the vehicle is scanned: no camera sees the rest."""

_STEP = np.deg2rad(0.17)


@dataclass(frozen=True)
class LidarCharacter:
    """How one LiDAR departs from the ideal one.

    Ranges have a deviation of `range_m`; a share of `dropouts` is lost at random, and returns about as weak as
    `weakest` (the albedo of a wall 20 m away that the ray meets squarely) always; of those from behind glass a share
    `through_glass` is left. The mounting is off by `shift_m` and `turn` (radians about x, y, z), the stamps by `late_s`
    at most.
    """

    range_m: float = 0.0
    dropouts: float = 0.0
    weakest: float = 0.0
    through_glass: float = 1.0
    shift_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    late_s: float = 0.0


def draw_lidar(rng: np.random.Generator) -> LidarCharacter:
    """A LiDAR as it may be mounted."""
    sx, sy, sz = (float(value) for value in rng.normal(0, 0.008, 3))
    tx, ty, tz = (float(value) for value in rng.normal(0, np.deg2rad(0.05), 3))
    return LidarCharacter(
        range_m=0.02,
        dropouts=0.03,
        weakest=0.006,
        through_glass=0.3,
        shift_m=(sx, sy, sz),
        turn=(tx, ty, tz),
        late_s=0.004,
    )


def hdl64() -> SpinningRays:
    """64 beams from +2 to -24.8 degrees: a dense upper and a sparser lower block."""
    elevation = np.concatenate([np.linspace(2.0, -8.33, 32), np.linspace(-8.83, -24.8, 32)])
    return spinning(np.deg2rad(elevation).astype(np.float32), float(_REACH), float(_STEP))


def scan(
    scenery: Scenery, seen: View, hits: Hits, rays: SpinningRays, character: LidarCharacter, rng: np.random.Generator
) -> NDArray[np.float32]:
    """(N, 3) points in the LiDAR frame: x forward, y left, z up."""
    row, column = np.nonzero((hits.surface != NOTHING) & (hits.t < _MAX_RANGE_M))
    surface, distance = hits.surface[row, column], hits.t[row, column]
    direction = np.stack([rays.p[row] * rays.x[column], rays.q[row], rays.p[row] * rays.z[column]], axis=1)
    facing = np.abs(np.einsum("ij,ij->i", direction, seen.normal[surface]))
    strength = scenery.surfaces.albedo[surface] * facing / np.maximum(distance / 20, 0.5)
    returned = strength > character.weakest * rng.uniform(0.3, 1.7, strength.shape)
    returned &= rng.random(strength.shape) >= character.dropouts
    behind_glass = hits.pane_t[row, column] < distance
    returned &= ~behind_glass | (rng.random(strength.shape) < character.through_glass)
    distance = distance + np.float32(character.range_m) * rng.standard_normal(distance.shape, dtype=np.float32)
    points = (direction * distance[:, None])[returned]
    return np.stack([points[:, 2], -points[:, 0], -points[:, 1]], axis=1).astype(np.float32)
