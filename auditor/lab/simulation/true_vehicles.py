"""The vehicles of a street as boxes: the truth that detectors of objects are trained on and scored by."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from auditor.lab.simulation.raycasting import cast
from auditor.lab.simulation.rays import Hits, Rays
from auditor.lab.simulation.surfaces import Piece, Surfaces
from auditor.lab.simulation.textures import Atlas, Tile
from auditor.model.arrays import Indices
from auditor.model.optics.geometry import Matrix


@dataclass(frozen=True, eq=False)
class Vehicle3D:
    """A vehicle of a street: (3,) least and greatest corner in the world frame at time 0, its speed, and its pieces."""

    low_m: Matrix
    high_m: Matrix
    speed_m_s: float
    pieces: Indices

    def corners_m(self, rig_SE3_world: Matrix, time_s: float) -> Matrix:
        """(8, 3) corners in the rig frame: its underside first, around the box, then its roof in the same order."""
        low, high = (end + np.array([0, 0, self.speed_m_s * time_s]) for end in (self.low_m, self.high_m))
        around = [(low[0], low[2]), (high[0], low[2]), (high[0], high[2]), (low[0], high[2])]
        world = np.array([(x, y, z) for y in (high[1], low[1]) for x, z in around])
        return np.asarray(world @ rig_SE3_world[:3, :3].T + rig_SE3_world[:3, 3])


def vehicles_among(pieces: Sequence[Piece]) -> tuple[Vehicle3D, ...]:
    """The vehicles that a street's pieces make up: bodies with a rear."""
    by_body: dict[int, list[int]] = {}
    for at, piece in enumerate(pieces):
        by_body.setdefault(piece.body, []).append(at)
    bodies = [at for at in by_body.values() if any(pieces[one].tile is Tile.REAR for one in at)]
    return tuple(_vehicle(pieces, at) for at in bodies)


def seen_share(vehicle: Vehicle3D, surfaces: Surfaces, rays: Rays, hits: Hits, atlas: Atlas) -> float:
    """The share of the rays to a vehicle that nothing else is met by before it; 0 where it is not in the view.

    `surfaces` and `hits` are of the whole street, in the rig frame.
    """
    alone = cast(rays, _chosen(surfaces, vehicle.pieces), atlas)
    whole = int(np.count_nonzero(alone.piece >= 0))
    return int(np.count_nonzero(np.isin(hits.piece, vehicle.pieces))) / whole if whole else 0.0


def _vehicle(pieces: Sequence[Piece], at: Sequence[int]) -> Vehicle3D:
    corners = []
    for piece in (pieces[one] for one in at):
        corner, across, up = (np.array(of) for of in (piece.corner, piece.across, piece.up))
        corners += [corner, corner + across, corner + up, corner + across + up]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    return Vehicle3D(low, high, pieces[at[0]].speed, np.array(at))


def _chosen(surfaces: Surfaces, at: Indices) -> Surfaces:
    return replace(surfaces, **{name: values[at] for name, values in vars(surfaces).items()})
