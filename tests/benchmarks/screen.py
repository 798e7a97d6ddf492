"""A screen as it was tried: a quick look at a frame at quarter resolution, to tell where a full look is worth its time.

No scan uses it: `python -m tests.benchmarks.screening` says what it costs and loses. Each camera is matched once, with
one reference, and compared by its light; the LiDAR's points are verified against the same maps, and looked at alone.
Light and walls show at quarter resolution as they do at half. Texture does not, and is left to the full look. What a
screen gives is no measurement: its statistics are of fewer votes and other pixels, and no verdict comes from them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from auditor.measurement.checks.count_grid import ImageGrid, cells_of_points, opposite, places_of, sums_of_pair
from auditor.measurement.checks.lidar_conflict import verify_conflicts
from auditor.measurement.checks.light import light_difference, views_of
from auditor.measurement.checks.photometric_consistency import Patches, photometric_consistency
from auditor.measurement.checks.point_distribution import (
    isolated,
    isolated_ratio,
    isolated_shares,
    point_dropout,
    rough_ranges,
)
from auditor.measurement.checks.striped_light import Rows
from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.disparity.lidar import LidarView, lidar_view
from auditor.measurement.disparity.matchers.interface import Matcher, for_pair
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.measurement.disparity.rectification import rectification
from auditor.measurement.disparity.stereo import stereo_map
from auditor.measurement.parameters import SGBM
from auditor.measurement.shared_view import RectifiedFrame, matched, prepare, present
from auditor.model.checks import LIDAR_CHECKS, Check, CountedPair, Pair, SensorCheck, resolves_depth, sensor_checks_of
from auditor.model.frames import Frame
from auditor.model.measurement import LIGHT_STEPS, Cells
from auditor.model.optics.common_view import resized
from auditor.model.rig import LIDAR, Rig

SCALE = 0.5
"""Pixels a pixel of the view, each way."""

_HALF_PX = np.float32(0.5)  # pixel 0 is centred half a pixel from the edge
_MATCHER: Matcher = SgbmMatcher(range_px=round(SGBM.range_px * SCALE))


@dataclass(frozen=True, eq=False)
class Screened:
    """What a screen counts of a frame whose `pairs` it matched: the counts on grids, and the statistics of the rest."""

    pairs: Sequence[Pair]
    cells: Mapping[CountedPair, Cells]
    shares: Mapping[SensorCheck, float]


def screen(frame: Frame, rig: Rig) -> Screened:
    """Compare each camera that is there with the leftmost one, and the LiDAR with these pairs."""
    small = _small(rig)
    seen = rectification(rig).frame(frame)
    images = {number: replace(image, pixels=halve(image.pixels)) for number, image in seen.images.items()}
    shrunk = replace(seen, images=images)
    triples = present(small.triples, shrunk) or present(small.measured_triples, shrunk)
    every = matched(triples)
    reference = max((k for _, k in every), default=None)
    pairs = [pair for pair in every if pair[1] == reference]
    prepared = prepare(shrunk, small, triples, pairs, colour=False)
    view = None
    if seen.cloud is not None and small.lidar is not None and reference is not None:
        view = lidar_view(seen.cloud, rectification(rig).rig, reference)
    counts = _Counts(prepared, None if view is None else _shrunk(view, small))
    for i, k in pairs:
        counts.add(i, k)
    if view is not None:
        counts.add_lidar(view)
    return Screened(tuple(pairs), counts.cells, counts.shares)


@lru_cache(maxsize=8)
def _small(rig: Rig) -> Rig:
    return resized(rectification(rig).rig, SCALE)


class _Counts:
    """What is counted of one frame, pair by pair."""

    def __init__(self, prepared: RectifiedFrame, view: LidarView | None) -> None:
        self._prepared = prepared
        self._view = view
        self._lit = views_of(prepared.half_res, prepared.colours)
        cameras = {camera for pair in prepared.pairs for camera in pair}
        self._rows = {camera: Rows.of(prepared.half_res[camera]) for camera in cameras}
        self._still = {k: Patches.of(prepared.half_res[k]) for k in {k for _, k in prepared.pairs}}
        self.cells: dict[CountedPair, Cells] = {}
        self.shares: dict[SensorCheck, float] = {}

    def add(self, i: int, k: int) -> None:
        """Count one pair."""
        prepared, half_res, texture = self._prepared, self._prepared.half_res, self._prepared.texture
        matcher = for_pair(_MATCHER, prepared.rig, i, k)
        stereo = stereo_map(matcher, prepared.inputs[k], prepared.inputs[i], texture[k], texture[i])
        seen = photometric_consistency(self._still[k], half_res[i], stereo)
        light = light_difference(self._lit[k], self._lit[i], seen.matches.column, seen.matches.seen)
        places = places_of(seen.matches, ImageGrid.of(*seen.ncc.shape))
        residuals = {Check.ADDED_LIGHT: light.residual}
        if light.coloured is not None:
            residuals[Check.COLOURED_LIGHT] = light.coloured
        sums = sums_of_pair(places, light.comparable, list(residuals.values()), LIGHT_STEPS)
        for check, summed in zip(residuals, sums, strict=True):
            counts = opposite(summed.cells)
            self.cells[CountedPair(check, i, k, i)] = counts.source
            self.cells[CountedPair(check, i, k, k)] = counts.reference
        for camera, other in ((i, k), (k, i)):
            self._say(Check.STRIPED_LIGHT, camera, other, self._rows[camera].above(self._rows[other]))
        if self._view is not None and resolves_depth(prepared.rig, i, k):
            verified = verify_conflicts(self._view, stereo, seen, prepared.rig, i, (half_res[k], half_res[i]))
            self.cells[CountedPair(Check.LIDAR_CONFLICT, i, k, LIDAR)] = cells_of_points(verified, self._view)

    def add_lidar(self, view: LidarView) -> None:
        """Look at the LiDAR alone, in the view of a camera."""
        camera, k = view.rig.camera(view.reference), view.reference
        alone = isolated_ratio(isolated_shares(view, isolated(view, camera.focal_px), camera.width_px))
        self._say(Check.POINT_DROPOUT, LIDAR, k, point_dropout(view, camera.width_px))
        self._say(Check.ISOLATED_POINTS, LIDAR, k, alone)
        self._say(Check.ROUGH_RANGES, LIDAR, k, rough_ranges(view, camera.focal_px))

    def _say(self, check: Check, sensor: int, other: int, share: float | None) -> None:
        if share is not None:
            self.shares[SensorCheck(check, sensor, (other,))] = share


def _shrunk(view: LidarView, small: Rig) -> LidarView:
    """The view as the shrunk camera has it: its points, several a pixel where they are dense."""
    scale = np.float32(SCALE)
    u, row = (view.u_px + _HALF_PX) * scale - _HALF_PX, (view.row + _HALF_PX) * scale - _HALF_PX
    camera = small.camera(view.reference)
    column = np.clip(np.rint(u), 0, camera.width_px - 1).astype(np.int32)
    row = np.clip(np.rint(row), 0, camera.height_px - 1).astype(np.int32)
    first, last = ((one + _HALF_PX) * SCALE - _HALF_PX for one in view.span_px)
    return LidarView(view.reference, column, row, u, view.point_m, view.returns, small, view.in_view_m, (first, last))


_CHECKS = frozenset(
    {Check.ADDED_LIGHT, Check.REMOVED_LIGHT, Check.COLOURED_LIGHT, Check.STRIPED_LIGHT, Check.LIDAR_CONFLICT}
    | LIDAR_CHECKS
)


def screened_checks(rig: Rig) -> tuple[SensorCheck, ...]:
    """The checks of a screen where all sensors are there, in their fixed order."""
    pairs = tuple((i, rig.n) for i in range(1, rig.n))
    of_lidar = tuple(pair for pair in pairs if rig.lidar is not None and resolves_depth(rig, *pair))
    every = sensor_checks_of(pairs, of_lidar, (rig.n,) if rig.lidar is not None else ())
    return tuple(one for one in every if one.check in _CHECKS)
