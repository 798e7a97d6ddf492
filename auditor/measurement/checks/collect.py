"""All checks of one frame, pair by pair."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple, TypeVar

import numpy as np

from auditor.measurement.checks.false_ranges import PairRanges, directed, false_ranges, pair_ranges
from auditor.measurement.checks.found import measuring
from auditor.measurement.checks.in_time.still_light import OfThePast
from auditor.measurement.checks.lidar_conflict import VerifiedConflicts, verified
from auditor.measurement.checks.light import LightDifference, difference_of
from auditor.measurement.checks.photometric_consistency import PairConsistency, consistency_of, matchable
from auditor.measurement.checks.point_distribution import isolated_of, shares_of_isolated, thinned
from auditor.measurement.count_grid import (
    ImageGrid,
    PairCells,
    PairPlaces,
    PairSums,
    opposite,
    places_of,
    sums_of_pair,
    sums_of_some,
)
from auditor.measurement.disparity.lidar import LidarView, out_of_range
from auditor.measurement.disparity.stereo import StereoMap
from auditor.measurement.frame_views import FrameViews
from auditor.model.arrays import Image, Indices, Mask, Points
from auditor.model.checks import DIRECTION_CHECKS, SHARE_CHECKS, Check, CountedPair, Pair, SensorCheck, resolves_depth
from auditor.model.checks.kind import Of
from auditor.model.fault_features import IsolatedShares
from auditor.model.measurement import LIGHT_STEPS, Cells
from auditor.model.rig import LIDAR, Rig

Subject = TypeVar("Subject", bound=tuple[int, ...])

_BY_PAIRS = tuple(one for one in Check if one in DIRECTION_CHECKS and one.kind.of in (Of.PAIRS, Of.SEVERAL_PAIRS))
_MEASURED = tuple(one for one in Check if one in SHARE_CHECKS and one.kind.of is Of.CAMERAS)
_OF_CAMERAS = tuple(one for one in _MEASURED if not one.kind.by_two_others)
_OF_A_THIRD = tuple(one for one in _MEASURED if one.kind.by_two_others)
_IN_VIEWS = tuple(one for one in Check if one.kind.of is Of.VIEW)
BY_SCANS = tuple(one for one in Check if one.kind.of is Of.OWN_SCANS)
_ALL_AROUND = tuple(one for one in Check if one.kind.of is Of.SURROUNDINGS)
"""The checks measured by their names: of pairs that check the LiDAR, of matched pairs, of views, of its last scan."""


@dataclass(frozen=True, eq=False)
class PairCounts:
    """What one pair of cameras counts: the pixels where it does not see the same, and sums of light differences.

    `coloured` are those of light of one colour, of two colour cameras.
    """

    inconsistencies: PairCells
    light: PairCells
    coloured: PairCells | None = None


class DisputedPoints(NamedTuple):
    """Points (K, 3) of a LiDAR that cannot be there by another one, or by its own last scan, and how many it has."""

    points: Points
    returns: int


@dataclass(frozen=True, eq=False)
class FrameChecks:
    """The results of all checks, by camera pair (i, k), where (k, k) is a camera and its own past, or by camera.

    `by_direction` are counts of the LiDAR's points, or of surfaces, by its directions, `counts` what cameras see
    otherwise than each other. The other statistics are measured as they are: `of_pairs` what the source, and what the
    reference, has that the other has not; `of_views` what is said of the LiDAR in the view of a reference camera, as
    (k,); `of_pasts` what its own past says of a camera, and `unmatched` which share of its points lies where the past
    shows something else; None where it cannot be told.
    `from_nowhere` (K, 3) are the LiDAR's points that conflict with its last scan, None where there was none.
    `isolated_shares`: how many points are isolated; `thinned`: whether the cloud is. `ranges`: what pairs say of the
    LiDAR's ranges. `unmasked` are those of `counts` that the LiDAR's range masks changed, without it.
    `of_lidars` are the statistics of LiDARs wherever no camera looks. `disputed` is what LiDAR k says is not there of
    what LiDAR i has, by (i, k), where there are no cameras; (i, i) is its own last scan.
    `verified_conflicts`, `consistencies` and `lights` hold pixel by pixel what is counted: they are not stored.
    """

    by_direction: Mapping[Check, Mapping[Pair, Cells]]
    counts: Mapping[Pair, PairCounts]
    of_pairs: Mapping[Check, Mapping[Pair, tuple[float | None, float | None]]]
    of_views: Mapping[Check, Mapping[tuple[int], float | None]]
    isolated_shares: Mapping[int, IsolatedShares]
    thinned: Mapping[int, bool]
    ranges: Mapping[Pair, PairRanges]
    unmasked: Mapping[Pair, PairCounts]
    verified_conflicts: Mapping[Pair, VerifiedConflicts]
    consistencies: Mapping[Pair, PairConsistency]
    lights: Mapping[Pair, LightDifference]
    of_pasts: Mapping[Check, Mapping[int, OfThePast]] = field(default_factory=dict)
    unmatched: Mapping[int, float | None] = field(default_factory=dict)
    from_nowhere: Points | None = None
    of_lidars: Mapping[SensorCheck, float | None] = field(default_factory=dict)
    of_a_third: Mapping[SensorCheck, float] = field(default_factory=dict)
    disputed: Mapping[Pair, DisputedPoints] = field(default_factory=dict)

    @property
    def cells(self) -> dict[CountedPair, Cells]:
        """The counts of the checks that are counted on grids."""
        by_direction = self.by_direction.items()
        counted = {CountedPair(check, *p, LIDAR): cells for check, of in by_direction for p, cells in of.items()}
        return counted | _by_camera(self.counts)

    @property
    def unmasked_cells(self) -> dict[CountedPair, Cells]:
        """Those that are others without the LiDAR."""
        return _by_camera(self.unmasked)

    @property
    def shares(self) -> dict[SensorCheck, float]:
        """The statistics of the other checks."""
        in_views = {
            SensorCheck(check, LIDAR, view): share for check, of in self.of_views.items() for view, share in of.items()
        }
        by_past = {
            SensorCheck(check, k, (LIDAR,)): one.statistic
            for check, of in self.of_pasts.items()
            for k, one in of.items()
        }
        by_cameras = {
            SensorCheck(check, camera, (other,)): share
            for check, of in self.of_pairs.items()
            for (i, k), (of_source, of_reference) in of.items()
            for camera, other, share in ((i, k, of_source), (k, i, of_reference))
        }
        every = in_views | by_cameras | dict(self.of_a_third) | by_past | dict(self.of_lidars)
        return {check: share for check, share in every.items() if share is not None} | shares_of_ranges(self.ranges)


def shares_of_a_third(seen: FrameViews) -> dict[SensorCheck, float]:
    """What matched pairs of cameras say together of each other camera."""
    return {
        SensorCheck(check, camera, pair): share
        for check in _OF_A_THIRD
        for pair in seen.maps
        for camera, share in measuring(check)(seen, *pair).items()
    }


def shares_of_ranges(ranges: Mapping[Pair, PairRanges]) -> dict[SensorCheck, float]:
    """The statistics of false and of scattered ranges, by what pairs say of the LiDAR's ranges."""
    return {
        SensorCheck(check, LIDAR, cameras): share
        for cameras, found in false_ranges(ranges).items()
        for check, share in zip((Check.FALSE_RANGES, Check.SCATTERED_RANGES), found, strict=True)
    }


def _by_camera(of_pairs: Mapping[Pair, PairCounts]) -> dict[CountedPair, Cells]:
    grids: dict[CountedPair, Cells] = {}
    for (i, k), counts in of_pairs.items():
        for check, cells in (
            (Check.ADDED_LIGHT, counts.light),
            (Check.PHOTOMETRIC_INCONSISTENCY, counts.inconsistencies),
            (Check.COLOURED_LIGHT, counts.coloured),
        ):
            if cells is not None:
                grids[CountedPair(check, i, k, i)] = cells.source
                grids[CountedPair(check, i, k, k)] = cells.reference
    return grids


def collect_checks(
    half_res: Mapping[int, Image],
    colours: Mapping[int, Image],
    maps: Mapping[Pair, StereoMap],
    views: Mapping[int, LidarView],
    rig: Rig,
    grid: ImageGrid | None = None,
    valid_masks: Mapping[int, Mask] | None = None,
) -> FrameChecks:
    """Run all checks of a frame.

    `half_res` are the half-resolution grey images (h, w) of the cameras present, `colours` (h, w, 3) those of colour
    cameras, `maps` the stereo maps by (source, reference), `views` the LiDAR's views by reference; all of them as
    `measure` makes them. `grid` is that of the cameras' images where they are not in this view, of which they see only
    their `valid_masks` (H, W) at full resolution.
    """
    seen = FrameViews(half_res, colours, maps, views, rig, valid_masks or {})
    near = {
        (i, k): out_of_range(views[k], seen.once(isolated_of, k), i, matchable(stereo.range_px), half_res[k].shape)
        for (i, k), stereo in maps.items()
        if k in views
    }
    consistencies = {pair: seen.once(consistency_of, *pair) for pair in maps}
    lights = {pair: seen.once(difference_of, *pair) for pair in maps}
    verified_conflicts = {
        (j, k): seen.once(verified, j, k) for j, k in maps if k in views and resolves_depth(rig, j, k)
    }
    places = {pair: places_of(one.matches, grid or ImageGrid.of(*one.ncc.shape)) for pair, one in consistencies.items()}

    sums = {pair: _sums(one, lights[pair], places[pair]) for pair, one in consistencies.items()}
    # There something is nearer than the matcher's range, or occludes what the reference sees (`lidar.out_of_range`).
    hidden = {pair: np.flatnonzero(mask) for pair, mask in near.items() if mask.any()}
    without = {
        pair: sums[pair].without(_sums(consistencies[pair], lights[pair], places[pair], some))
        for pair, some in hidden.items()
    }

    return FrameChecks(
        by_direction={check: _of_each(check, seen, verified_conflicts) for check in _BY_PAIRS},
        counts={pair: one.counts for pair, one in (sums | without).items()},
        of_pairs={check: _of_each(check, seen, maps) for check in _OF_CAMERAS},
        of_a_third=shares_of_a_third(seen),
        of_views={check: _of_each(check, seen, [(k,) for k in views]) for check in _IN_VIEWS},
        isolated_shares={k: seen.once(shares_of_isolated, k) for k in views},
        thinned={k: seen.once(thinned, k) for k in views},
        ranges={
            (j, k): pair_ranges(seen.once(directed, k), views[k], maps[j, k], conflicts.votes, j)
            for (j, k), conflicts in verified_conflicts.items()
            if conflicts.votes is not None
        },
        unmasked={pair: sums[pair].counts for pair in hidden},
        verified_conflicts=verified_conflicts,
        consistencies=consistencies,
        lights=lights,
    )


def _of_each(check: Check, seen: FrameViews, subjects: Iterable[Subject]) -> dict[Subject, Any]:
    """What a check measures of each of its subjects: pairs of cameras, or cameras."""
    return {subject: measuring(check)(seen, *subject) for subject in subjects}


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


def with_scans(frame_checks: FrameChecks, from_nowhere: Points | None, views: Iterable[int], rig: Rig) -> FrameChecks:
    """The checks of a frame and of what conflicts with the LiDAR's last scan, (K, 3) points; None where none was."""
    if from_nowhere is None:
        return frame_checks
    said = {check: {(k,): measuring(check)(from_nowhere, rig, k) for k in views} for check in BY_SCANS}
    around = {SensorCheck(check, LIDAR, ()): measuring(check)(from_nowhere, rig) for check in _ALL_AROUND}
    return replace(
        frame_checks, of_views={**frame_checks.of_views, **said}, of_lidars=around, from_nowhere=from_nowhere
    )


def with_pairs(in_common: FrameChecks, of_pairs: Mapping[Pair, FrameChecks], own: Pair) -> FrameChecks:
    """The checks of a frame whose pairs have views of their own, in which their cameras are `own`."""

    def of_own(results: Mapping[Pair, Mapping[Pair, Any]]) -> dict[Pair, Any]:
        return {pair: of[own] for pair, of in results.items() if own in of}

    same: dict[str, Any] = {
        name: of_own({pair: getattr(one, name) for pair, one in of_pairs.items()}) for name in _OF_PAIRS
    }
    return replace(
        in_common,
        by_direction={c: of_own({p: one.by_direction[c] for p, one in of_pairs.items()}) for c in _BY_PAIRS},
        of_pairs={c: of_own({p: one.of_pairs[c] for p, one in of_pairs.items()}) for c in _OF_CAMERAS},
        **same,
    )


_OF_PAIRS = ("counts", "ranges", "unmasked", "verified_conflicts", "consistencies", "lights")
"""The results that are by pair."""
