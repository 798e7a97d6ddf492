"""All checks of one frame, pair by pair."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations

from auditor.measurement.checks.brightness import (
    BrightnessDifference,
    coarse,
    coarse_mask,
    compare_brightness,
    range_mask,
)
from auditor.measurement.checks.count_grid import cells_of_consistency, cells_of_points
from auditor.measurement.checks.lidar_conflict import VerifiedConflicts, verify_conflicts
from auditor.measurement.checks.photometric_consistency import PairConsistency, matchable, photometric_consistency
from auditor.measurement.checks.point_distribution import isolated, isolated_ratio, isolated_shares, point_dropout
from auditor.measurement.disparity.lidar import LidarView, out_of_range
from auditor.measurement.disparity.stereo import StereoMap
from auditor.model.arrays import Image, Mask
from auditor.model.checks import Check, IsolatedShares, Pair, PairCheck, resolves_depth
from auditor.model.measurement import Cells
from auditor.model.rig import LIDAR, Rig


@dataclass(frozen=True, eq=False)
class Unmasked:
    """The results of the checks by camera pair that the LiDAR's range masks changed, as they are without the LiDAR."""

    photometric_inconsistencies: Mapping[Pair, Cells]
    brightness_differences: Mapping[Pair, BrightnessDifference]

    @property
    def cells(self) -> dict[PairCheck, Cells]:
        """The counts on the grid."""
        return _of_check(Check.PHOTOMETRIC_INCONSISTENCY, self.photometric_inconsistencies)

    @property
    def shares(self) -> dict[PairCheck, float]:
        """The statistics of the others."""
        return _brightness_shares(self.brightness_differences)


@dataclass(frozen=True, eq=False)
class FrameChecks:
    """The results of the five checks, the first three by camera pair (i, k), the others by reference camera.

    `lidar_conflicts`: counts of LiDAR points with which both cameras disagree. `photometric_inconsistencies`: counts of
    pixels where the two cameras do not see the same. `brightness_differences`: light or darkness that one of them alone
    sees. `point_dropout`: the share of its points that a strip of the LiDAR's view lacks. `isolated_shares`: how many
    points are isolated. `unmasked` are the second and third without the LiDAR. `verified_conflicts` and `consistencies`
    hold the first two pixel by pixel, for localising: they are not stored.
    """

    lidar_conflicts: Mapping[Pair, Cells]
    photometric_inconsistencies: Mapping[Pair, Cells]
    brightness_differences: Mapping[Pair, BrightnessDifference]
    point_dropout: Mapping[int, float]
    isolated_shares: Mapping[int, IsolatedShares]
    unmasked: Unmasked
    verified_conflicts: Mapping[Pair, VerifiedConflicts]
    consistencies: Mapping[Pair, PairConsistency]

    @property
    def cells(self) -> dict[PairCheck, Cells]:
        """The counts of the checks that are counted on the grid."""
        return _of_check(Check.LIDAR_CONFLICT, self.lidar_conflicts) | _of_check(
            Check.PHOTOMETRIC_INCONSISTENCY, self.photometric_inconsistencies
        )

    @property
    def shares(self) -> dict[PairCheck, float]:
        """The statistics of the other checks."""
        brightness = _brightness_shares(self.brightness_differences)
        dropout = {PairCheck(Check.POINT_DROPOUT, LIDAR, k): share for k, share in self.point_dropout.items()}
        isolated_points = {
            PairCheck(Check.ISOLATED_POINTS, LIDAR, k): isolated_ratio(found)
            for k, found in self.isolated_shares.items()
        }
        known = {pair_check: share for pair_check, share in isolated_points.items() if share is not None}
        return brightness | dropout | known


def _of_check(check: Check, of_pairs: Mapping[Pair, Cells]) -> dict[PairCheck, Cells]:
    return {PairCheck(check, *pair): cells for pair, cells in of_pairs.items()}


def _brightness_shares(of_pairs: Mapping[Pair, BrightnessDifference]) -> dict[PairCheck, float]:
    """The statistic of each pair, which cannot tell light in one camera from darkness in the other."""
    return {
        PairCheck(Check.BRIGHTNESS_DIFFERENCE, *pair): max(found.brighter_i, found.brighter_k)
        for pair, found in of_pairs.items()
    }


def collect_checks(
    half_res: Mapping[int, Image],
    maps: Mapping[Pair, StereoMap],
    views: Mapping[int, LidarView],
    rig: Rig,
) -> FrameChecks:
    """Run all checks of a frame.

    `half_res` are the half-resolution grey images of the cameras present, `maps` the stereo maps by (source,
    reference), `views` the LiDAR's views by reference; all of them as `measure` makes them.
    """
    isolated_masks = {k: isolated(view, rig.camera(k).focal_px) for k, view in views.items()}
    near = {
        (i, k): out_of_range(views[k], isolated_masks[k], i, matchable(stereo.range_px), half_res[k].shape)
        for (i, k), stereo in maps.items()
        if k in views
    }
    consistencies = {
        (i, k): photometric_consistency(half_res[k], half_res[i], stereo) for (i, k), stereo in maps.items()
    }
    verified_conflicts = {
        (j, k): verify_conflicts(views[k], stereo, consistencies[j, k], rig, j, (half_res[k], half_res[j]))
        for (j, k), stereo in maps.items()
        if k in views and resolves_depth(rig, j, k)
    }
    coarse_near = _coarse_range_masks(half_res, views, isolated_masks, rig)
    return FrameChecks(
        lidar_conflicts={
            (j, k): cells_of_points(points, rig.camera(k).height_px, rig.camera(k).width_px)
            for (j, k), points in verified_conflicts.items()
        },
        photometric_inconsistencies={
            pair: cells_of_consistency(map_, near.get(pair)) for pair, map_ in consistencies.items()
        },
        brightness_differences=_brightness_differences(half_res, combinations(sorted(half_res), 2), coarse_near),
        point_dropout={k: point_dropout(view, rig.camera(k).width_px) for k, view in views.items()},
        isolated_shares={
            k: isolated_shares(view, isolated_masks[k], rig.camera(k).width_px) for k, view in views.items()
        },
        unmasked=Unmasked(
            {pair: cells_of_consistency(consistencies[pair]) for pair, mask in near.items() if mask.any()},
            _brightness_differences(half_res, [pair for pair, mask in coarse_near.items() if mask.any()], {}),
        ),
        verified_conflicts=verified_conflicts,
        consistencies=consistencies,
    )


def _coarse_range_masks(
    half_res: Mapping[int, Image], views: Mapping[int, LidarView], isolated_masks: Mapping[int, Mask], rig: Rig
) -> dict[Pair, Mask]:
    """The range mask of each pair of cameras present in whose reference view the LiDAR is, on the coarse grid."""
    return {
        (i, k): coarse_mask(
            out_of_range(views[k], isolated_masks[k], i, range_mask(rig.camera(k).width_px), half_res[k].shape)
        )
        for i, k in combinations(sorted(half_res), 2)
        if k in views
    }


def _brightness_differences(
    half_res: Mapping[int, Image], pairs: Iterable[Pair], near: Mapping[Pair, Mask]
) -> dict[Pair, BrightnessDifference]:
    """The light and darkness that one of two cameras alone sees."""
    grids = {camera: coarse(half) for camera, half in half_res.items()}
    return {(i, k): compare_brightness(grids[i], grids[k], near.get((i, k))) for i, k in pairs}
