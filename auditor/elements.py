"""The elements of the robust method: what one witness says of one camera pair of a rig."""

from collections.abc import Iterable
from enum import StrEnum
from itertools import combinations
from typing import NamedTuple

from auditor.rig import LIDAR, Rig
from auditor.shared_parameters import PAIR_DEPTH


class Witness(StrEnum):
    """Who says something.

    CONTRADICTED: both cameras of a pair deny the LiDAR. UNLIKE, LIGHT: the two cameras do not see the same. EMPTY: a
    strip of the LiDAR's view has no points. SCATTERED: points stand alone here and there.
    """

    CONTRADICTED = "contradicted"
    UNLIKE = "unlike"
    LIGHT = "light"
    EMPTY = "empty"
    SCATTERED = "scattered"


OF_THE_LIDAR = frozenset({Witness.EMPTY, Witness.SCATTERED})
"""Of the LiDAR's view in a camera, whatever the cameras see."""


class Element(NamedTuple):
    """One witness's statistic of the camera pair i < k; of OF_THE_LIDAR, whose i is the LiDAR, of the view of k."""

    witness: Witness
    i: int
    k: int

    @property
    def needed(self) -> tuple[int, ...]:
        """The sensors without which it cannot be measured."""
        return (LIDAR, self.i, self.k) if self.witness is Witness.CONTRADICTED else (self.i, self.k)

    @property
    def accusable(self) -> tuple[int, ...]:
        """The sensors one of which must be attacked where the element is raised."""
        return (LIDAR,) if self.witness in OF_THE_LIDAR else self.needed


def elements_of(
    cameras: int,
    matched: Iterable[tuple[int, int]],
    contradicting: Iterable[tuple[int, int]],
    views: Iterable[int],
) -> tuple[Element, ...]:
    """All elements in fixed order: pairs that may deny the LiDAR, pairs matched, every pair's light, the LiDAR's views.

    `views` are the reference cameras that the LiDAR is projected into; none without one.
    """
    return (
        *(Element(Witness.CONTRADICTED, i, k) for i, k in contradicting),
        *(Element(Witness.UNLIKE, i, k) for i, k in matched),
        *(Element(Witness.LIGHT, i, k) for i, k in combinations(range(1, cameras + 1), 2)),
        *(Element(Witness.EMPTY, LIDAR, k) for k in views),
        *(Element(Witness.SCATTERED, LIDAR, k) for k in views),
    )


def rig_elements(rig: Rig) -> tuple[Element, ...]:
    """The elements that frames of a rig are judged by."""
    contradicting = [pair for pair in rig.pairs if rig.lidar and resolves_depth(rig, *pair)]
    return elements_of(rig.n, rig.pairs, contradicting, rig.references if rig.lidar else ())


def resolves_depth(rig: Rig, j: int, k: int) -> bool:
    """Whether the pair's disparities say enough about depth to deny what the LiDAR says.

    A pair that resolves less cannot tell a surface from one half as far again.
    """
    # Cameras of different focal lengths are compared at the shortest of those that share a view.
    cameras = rig.cameras if rig.shares_view else (rig.camera(j), rig.camera(k))
    focal_px = min(camera.focal_px for camera in cameras)
    return focal_px * rig.baseline_m(j, k) / PAIR_DEPTH.distance_m >= PAIR_DEPTH.fewest_px
