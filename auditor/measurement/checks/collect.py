"""All checks of one frame, pair by pair."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from auditor.measurement.checks.count_grid import (
    ImageGrid,
    PairCells,
    PairPlaces,
    PairSums,
    cells_of_points,
    opposite,
    places_of,
    sums_of_pair,
    sums_of_some,
)
from auditor.measurement.checks.false_ranges import PairRanges, directed_points, false_ranges, pair_ranges
from auditor.measurement.checks.lidar_conflict import VerifiedConflicts, verify_conflicts
from auditor.measurement.checks.light import LightDifference, light_difference, views_of
from auditor.measurement.checks.lost_returns import count_lost_returns, scanned_view
from auditor.measurement.checks.photometric_consistency import (
    PairConsistency,
    Patches,
    matchable,
    photometric_consistency,
)
from auditor.measurement.checks.point_distribution import (
    isolated,
    isolated_ratio,
    isolated_shares,
    point_dropout,
    rough_ranges,
)
from auditor.measurement.checks.still_light import StillLight
from auditor.measurement.checks.striped_light import Rows
from auditor.measurement.disparity.lidar import LidarView, out_of_range
from auditor.measurement.disparity.stereo import StereoMap
from auditor.model.arrays import Image, Indices
from auditor.model.checks import Check, CountedPair, IsolatedShares, Pair, SensorCheck, resolves_depth
from auditor.model.measurement import LIGHT_STEPS, Cells
from auditor.model.rig import LIDAR, Rig


@dataclass(frozen=True, eq=False)
class PairCounts:
    """What one pair of cameras counts: the pixels where it does not see the same, and sums of light differences.

    `coloured` are those of light of one colour, of two colour cameras.
    """

    inconsistencies: PairCells
    light: PairCells
    coloured: PairCells | None = None


@dataclass(frozen=True, eq=False)
class FrameChecks:
    """The results of all checks, by camera pair (i, k) or by reference camera.

    `lidar_conflicts`: counts of LiDAR points with which both cameras disagree. `lost_returns`: counts of surfaces that
    both cameras see, and of those where the LiDAR has no return. `counts`: what cameras see otherwise than each other.
    `parallax_conflicts`: counts of LiDAR points with which a camera and its own past (k, k) disagree.
    `still_light`: by camera, what its own past says of light that stays in its picture.
    `striped_light`: what the source, and what the reference, has of light in rows that the other has not.
    `point_dropout`: the share of its points that a strip of the LiDAR's view lacks. `isolated_shares`: how many points
    are isolated. `ranges`: what pairs say of the LiDAR's ranges; `rough_ranges`: how rough those of a sector are, None
    where too few points are in view. `unmasked` are those of `counts` that the LiDAR's range masks changed, without it.
    `verified_conflicts`, `consistencies` and `lights` hold the first two pixel by pixel: they are not stored.
    """

    lidar_conflicts: Mapping[Pair, Cells]
    lost_returns: Mapping[Pair, Cells]
    counts: Mapping[Pair, PairCounts]
    striped_light: Mapping[Pair, tuple[float | None, float | None]]
    point_dropout: Mapping[int, float]
    isolated_shares: Mapping[int, IsolatedShares]
    ranges: Mapping[Pair, PairRanges]
    rough_ranges: Mapping[int, float | None]
    unmasked: Mapping[Pair, PairCounts]
    verified_conflicts: Mapping[Pair, VerifiedConflicts]
    consistencies: Mapping[Pair, PairConsistency]
    lights: Mapping[Pair, LightDifference]
    parallax_conflicts: Mapping[Pair, Cells] = field(default_factory=dict)
    still_light: Mapping[int, StillLight] = field(default_factory=dict)

    @property
    def cells(self) -> dict[CountedPair, Cells]:
        """The counts of the checks that are counted on grids."""
        of_lidar = {
            Check.LIDAR_CONFLICT: self.lidar_conflicts,
            Check.LOST_RETURNS: self.lost_returns,
            Check.PARALLAX_CONFLICT: self.parallax_conflicts,
        }
        counted = {CountedPair(check, *p, LIDAR): cells for check, of in of_lidar.items() for p, cells in of.items()}
        return counted | _by_camera(self.counts)

    @property
    def unmasked_cells(self) -> dict[CountedPair, Cells]:
        """Those that are others without the LiDAR."""
        return _by_camera(self.unmasked)

    @property
    def shares(self) -> dict[SensorCheck, float]:
        """The statistics of the other checks."""
        dropout = {SensorCheck(Check.POINT_DROPOUT, LIDAR, (k,)): share for k, share in self.point_dropout.items()}
        isolated_points = {
            SensorCheck(Check.ISOLATED_POINTS, LIDAR, (k,)): isolated_ratio(found)
            for k, found in self.isolated_shares.items()
        }
        of_light = {
            SensorCheck(Check.STRIPED_LIGHT, camera, (other,)): share
            for (i, k), (of_source, of_reference) in self.striped_light.items()
            for camera, other, share in ((i, k, of_source), (k, i, of_reference))
        }
        rough = {SensorCheck(Check.ROUGH_RANGES, LIDAR, (k,)): share for k, share in self.rough_ranges.items()}
        still = {SensorCheck(Check.STILL_LIGHT, k, (LIDAR,)): one.statistic for k, one in self.still_light.items()}
        others = isolated_points | of_light | rough | still
        return (
            dropout
            | shares_of_ranges(self.ranges)
            | {check: share for check, share in others.items() if share is not None}
        )


def shares_of_ranges(ranges: Mapping[Pair, PairRanges]) -> dict[SensorCheck, float]:
    """The statistics of false ranges, by what pairs say of the LiDAR's ranges."""
    return {SensorCheck(Check.FALSE_RANGES, LIDAR, them): share for them, share in false_ranges(ranges).items()}


def _by_camera(of_pairs: Mapping[Pair, PairCounts]) -> dict[CountedPair, Cells]:
    found: dict[CountedPair, Cells] = {}
    for (i, k), counts in of_pairs.items():
        for check, cells in (
            (Check.ADDED_LIGHT, counts.light),
            (Check.PHOTOMETRIC_INCONSISTENCY, counts.inconsistencies),
            (Check.COLOURED_LIGHT, counts.coloured),
        ):
            if cells is not None:
                found[CountedPair(check, i, k, i)] = cells.source
                found[CountedPair(check, i, k, k)] = cells.reference
    return found


def collect_checks(
    half_res: Mapping[int, Image],
    colours: Mapping[int, Image],
    maps: Mapping[Pair, StereoMap],
    views: Mapping[int, LidarView],
    rig: Rig,
    grid: ImageGrid | None = None,
) -> FrameChecks:
    """Run all checks of a frame.

    `half_res` are the half-resolution grey images (h, w) of the cameras present, `colours` (h, w, 3) those of colour
    cameras, `maps` the stereo maps by (source, reference), `views` the LiDAR's views by reference; all of them as
    `measure` makes them. `grid` is that of the cameras' images where they are not in this view.
    """
    lit = views_of(half_res, colours)
    matched = {camera: half_res[camera] for pair in maps for camera in pair}
    rows = {camera: Rows.of(half) for camera, half in matched.items()}
    isolated_masks = {k: isolated(view, rig.camera(k).focal_px) for k, view in views.items()}
    near = {
        (i, k): out_of_range(views[k], isolated_masks[k], i, matchable(stereo.range_px), half_res[k].shape)
        for (i, k), stereo in maps.items()
        if k in views
    }
    patches = {k: Patches.of(half_res[k]) for k in dict.fromkeys(k for _, k in maps)}
    consistencies = {
        (i, k): photometric_consistency(patches[k], half_res[i], stereo) for (i, k), stereo in maps.items()
    }
    lights = {
        (i, k): light_difference(lit[k], lit[i], seen.matches.column, seen.matches.seen)
        for (i, k), seen in consistencies.items()
    }
    verified_conflicts = {
        (j, k): verify_conflicts(views[k], stereo, consistencies[j, k], rig, j, (half_res[k], half_res[j]))
        for (j, k), stereo in maps.items()
        if k in views and resolves_depth(rig, j, k)
    }
    scanned = {k: scanned_view(views[k]) for k in dict.fromkeys(k for _, k in verified_conflicts)}
    directed = {k: directed_points(views[k], scanned[k].road_m) for k in scanned}
    places = {
        pair: places_of(seen.matches, grid or ImageGrid.of(*seen.ncc.shape)) for pair, seen in consistencies.items()
    }

    sums = {pair: _sums(seen, lights[pair], places[pair]) for pair, seen in consistencies.items()}
    # There something is nearer than the matcher's range, or occludes what the reference sees (`lidar.out_of_range`).
    hidden = {pair: np.flatnonzero(mask) for pair, mask in near.items() if mask.any()}
    without = {
        pair: sums[pair].without(_sums(consistencies[pair], lights[pair], places[pair], some))
        for pair, some in hidden.items()
    }

    return FrameChecks(
        lidar_conflicts={(j, k): cells_of_points(points, views[k]) for (j, k), points in verified_conflicts.items()},
        lost_returns={
            (j, k): count_lost_returns(
                views[k], scanned[k], maps[j, k], consistencies[j, k], j, (half_res[k], half_res[j])
            )
            for j, k in verified_conflicts
        },
        counts={pair: one.counts for pair, one in (sums | without).items()},
        striped_light={(i, k): (rows[i].above(rows[k]), rows[k].above(rows[i])) for i, k in maps},
        point_dropout={k: point_dropout(view, rig.camera(k).width_px) for k, view in views.items()},
        isolated_shares={
            k: isolated_shares(view, isolated_masks[k], rig.camera(k).width_px) for k, view in views.items()
        },
        ranges={
            (j, k): pair_ranges(directed[k], views[k], maps[j, k], conflicts.votes, j)
            for (j, k), conflicts in verified_conflicts.items()
            if conflicts.votes is not None
        },
        rough_ranges={k: rough_ranges(view, rig.camera(k).focal_px) for k, view in views.items()},
        unmasked={pair: sums[pair].counts for pair in hidden},
        verified_conflicts=verified_conflicts,
        consistencies=consistencies,
        lights=lights,
    )


class _PairSums(NamedTuple):
    """What a pair counts before it is rounded, as PairCounts."""

    inconsistencies: PairSums
    light: PairSums
    coloured: PairSums | None

    def without(self, some: "_PairSums") -> "_PairSums":
        coloured = None if self.coloured is None or some.coloured is None else self.coloured.without(some.coloured)
        return _PairSums(self.inconsistencies.without(some.inconsistencies), self.light.without(some.light), coloured)

    @property
    def counts(self) -> PairCounts:
        coloured = None if self.coloured is None else opposite(self.coloured.cells)
        return PairCounts(self.inconsistencies.cells, opposite(self.light.cells), coloured)


def _sums(seen: PairConsistency, light: LightDifference, places: PairPlaces, some: Indices | None = None) -> _PairSums:
    """What all half-resolution pixels of a pair count, or some (M,) of them, numbered row by row."""
    summed = partial(sums_of_pair, places) if some is None else partial(sums_of_some, places, some)
    [inconsistencies] = summed(seen.comparable, [seen.inconsistent])
    residuals = [light.residual] if light.coloured is None else [light.residual, light.coloured]
    of_light, *coloured = summed(light.comparable, residuals, LIGHT_STEPS)
    return _PairSums(inconsistencies, of_light, coloured[0] if coloured else None)


def with_pairs(in_common: FrameChecks, of_pairs: Mapping[Pair, FrameChecks], own: Pair) -> FrameChecks:
    """The checks of a frame whose pairs have views of their own, in which their cameras are `own`."""
    return replace(
        in_common,
        lidar_conflicts={
            pair: one.lidar_conflicts[own] for pair, one in of_pairs.items() if own in one.lidar_conflicts
        },
        lost_returns={pair: one.lost_returns[own] for pair, one in of_pairs.items() if own in one.lost_returns},
        counts={pair: one.counts[own] for pair, one in of_pairs.items() if own in one.counts},
        striped_light={pair: one.striped_light[own] for pair, one in of_pairs.items() if own in one.striped_light},
        ranges={pair: one.ranges[own] for pair, one in of_pairs.items() if own in one.ranges},
        unmasked={pair: one.unmasked[own] for pair, one in of_pairs.items() if own in one.unmasked},
        verified_conflicts={
            pair: one.verified_conflicts[own] for pair, one in of_pairs.items() if own in one.verified_conflicts
        },
        consistencies={pair: one.consistencies[own] for pair, one in of_pairs.items() if own in one.consistencies},
        lights={pair: one.lights[own] for pair, one in of_pairs.items() if own in one.lights},
    )
