"""What the robust method is told about one frame: who contradicts whom, pair by pair."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.brightness import Light, coarse, coarse_mask, compare_light, reach
from auditor.measurement.checks.count_grid import cells_of_likeness, cells_of_points
from auditor.measurement.checks.lidar_conflict import Adjudication, adjudicate
from auditor.measurement.checks.photometric_consistency import Likeness, likeness, matchable
from auditor.measurement.checks.point_distribution import emptiness, isolated, scatter, specks
from auditor.measurement.disparity.lidar import LidarView, too_near
from auditor.measurement.disparity.stereo import StereoMap
from auditor.model.checks import Element, Pair, Specks, Witness, resolves_depth
from auditor.model.measurement import Cells
from auditor.model.rig import LIDAR, Rig

Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Testimony:
    """Five witnesses, the first three by camera pair (i, k), the others by reference camera.

    `contradicted`: cells of LiDAR points that both cameras deny. `unlike`: cells where the two cameras do not see the
    same thing. `light`: brightness that one of them alone sees. `emptiness`: what the emptiest strip of the
    LiDAR's view lacks. `specks`: how many of its points stand alone. `adjudications` and `likenesses` hold the first
    two pixel by pixel, for localising: they are not stored.
    """

    contradicted: Mapping[Pair, Cells]
    unlike: Mapping[Pair, Cells]
    light: Mapping[Pair, Light]
    emptiness: Mapping[int, float]
    specks: Mapping[int, Specks]
    adjudications: Mapping[Pair, Adjudication]
    likenesses: Mapping[Pair, Likeness]

    @property
    def cells(self) -> dict[Element, Cells]:
        """The counts of the elements that have them."""
        return {Element(Witness.CONTRADICTED, *pair): cells for pair, cells in self.contradicted.items()} | {
            Element(Witness.UNLIKE, *pair): cells for pair, cells in self.unlike.items()
        }

    @property
    def shares(self) -> dict[Element, float]:
        """The statistics of the others; a pair cannot tell light in one camera from darkness in the other."""
        light = {Element(Witness.LIGHT, *pair): max(s.brighter_i, s.brighter_k) for pair, s in self.light.items()}
        empty = {Element(Witness.EMPTY, LIDAR, k): share for k, share in self.emptiness.items()}
        scattered = {Element(Witness.SCATTERED, LIDAR, k): scatter(found) for k, found in self.specks.items()}
        return light | empty | {element: share for element, share in scattered.items() if share is not None}


def testify(
    halves: Mapping[int, NDArray[np.uint8]],
    maps: Mapping[Pair, StereoMap],
    views: Mapping[int, LidarView],
    rig: Rig,
) -> Testimony:
    """Hear all witnesses of a frame.

    `halves` are the half-resolution grey images of the cameras present, `maps` the stereo maps by (witness, reference),
    `views` the LiDAR's views by reference; all of them as `measure` makes them.
    """
    alone = {k: isolated(view, rig.camera(k).focal_px) for k, view in views.items()}
    near = {
        (i, k): too_near(views[k], alone[k], i, matchable(stereo.range_px), halves[k].shape)
        for (i, k), stereo in maps.items()
        if k in views
    }
    likenesses = {(i, k): likeness(halves[k], halves[i], stereo) for (i, k), stereo in maps.items()}
    adjudications = {
        (j, k): adjudicate(views[k], stereo, likenesses[j, k], rig, j, (halves[k], halves[j]))
        for (j, k), stereo in maps.items()
        if k in views and resolves_depth(rig, j, k)
    }
    return Testimony(
        contradicted={
            (j, k): cells_of_points(points, rig.camera(k).height_px, rig.camera(k).width_px)
            for (j, k), points in adjudications.items()
        },
        unlike={pair: cells_of_likeness(map_, near.get(pair)) for pair, map_ in likenesses.items()},
        light=_lights(halves, views, alone, rig),
        emptiness={k: emptiness(view, rig.camera(k).width_px) for k, view in views.items()},
        specks={k: specks(view, alone[k], rig.camera(k).width_px) for k, view in views.items()},
        adjudications=adjudications,
        likenesses=likenesses,
    )


def _lights(
    halves: Mapping[int, NDArray[np.uint8]], views: Mapping[int, LidarView], alone: Mapping[int, Mask], rig: Rig
) -> dict[Pair, Light]:
    """The light that one of two cameras alone sees, for all pairs."""
    grids = {camera: coarse(half) for camera, half in halves.items()}
    pairs = list(combinations(sorted(grids), 2))
    near = {
        (i, k): coarse_mask(too_near(views[k], alone[k], i, reach(rig.camera(k).width_px), halves[k].shape))
        for i, k in pairs
        if k in views
    }
    return {(i, k): compare_light(grids[i], grids[k], near.get((i, k))) for i, k in pairs}
