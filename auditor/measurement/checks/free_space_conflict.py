"""The LiDAR against its own last scan: what stands where its beams passed a moment ago, and nothing stood near.

What a LiDAR shows moves, and beams meet something new behind what hid it. But nothing real stands at once where a beam
just passed, with nothing around from which it could have come: only what is spoofed does. What came so is followed for
as long as nothing else is near.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.checks.scattered_returns import scattered, statistic_in_view
from auditor.model.arrays import Floats, Floats32, Image, Indices, Mask, Points, quantile_of
from auditor.model.frames import PointCloud
from auditor.model.parameters import BY_HAND, parameter
from auditor.model.rig import Rig
from auditor.model.stamps import NANOSECONDS

_CHOSEN = "three real drives and streets 42000 to 43023, clean and attacked: chosen on them (docs/decisions.md)"


@dataclass(frozen=True)
class FreeSpaceConflict:
    """What stands where the LiDAR's beams passed a moment ago, seen from above in cells."""

    farthest_m: float = parameter(35.0, unit="m", source=_CHOSEN)
    nearest_m: float = parameter(3.0, unit="m: nearer is the vehicle itself", source=BY_HAND)
    cell_m: float = parameter(0.5, unit="m, side of a cell", source=_CHOSEN)
    ground_cells: int = parameter(4, unit="cells, side of those whose lowest point is the ground's", source=BY_HAND)
    road_quantile: float = parameter(0.95, unit="quantile of how far points lie below the LiDAR", source=BY_HAND)
    sampled: int = parameter(8, unit="points, of which one tells it", source="bounds the work; by hand")
    slope: float = parameter(
        0.1,
        unit="m a metre that the ground beside may lie lower",
        source="KITTI drive 0009, whose road is cambered by as much (docs/decisions.md)",
    )
    under_m: float = parameter(1.0, unit="m below it: deeper is an echo of an echo, not the ground", source=_CHOSEN)
    stands_m: float = parameter(0.3, unit="m above the ground from which on a point is an object's", source=BY_HAND)
    clearly_m: float = parameter(0.5, unit="m above the ground from which on one is asked about", source=_CHOSEN)
    most_s: float = parameter(0.16, unit="s between the two scans", source="scans at 10 Hz; by hand")
    most_shift_cells: int = parameter(12, unit="cells that the vehicle moves in between", source="6 m: 60 m/s; by hand")
    turns_deg: tuple[int, ...] = parameter(tuple(range(-8, 9)), unit="degrees, turns in between", source=_CHOSEN)
    moves_m_s: float = parameter(35.0, unit="m/s of other vehicles, along the way", source=_CHOSEN)
    beside_m: float = parameter(1.5, unit="m, across the way: what turns and crosses", source=_CHOSEN)
    beam_rad: float = parameter(0.0105, unit="radians, side of a cell of beams", source="0.6 degrees; by hand")
    behind_m: float = parameter(3.0, unit="m behind it at which beams ended, at least", source=_CHOSEN)
    scanned_cells: int = parameter(16, unit="cells of beams aside that were scanned too", source="10 degrees; by hand")
    most_alone: float = parameter(
        0.06,
        unit="of the cells with objects that had nothing near: beyond it the scans are of two places",
        source="0.034 at most of clean scans, 0.033 of walls, 0.07 to 0.7 of scans of two places (docs/decisions.md)",
    )
    most_cells: int = parameter(16, unit="such cells, where few hold objects at all", source="walls fill 6 to 14")
    fewest: int = parameter(5, unit="points of an object where beams passed", source=_CHOSEN)
    least_share: float = parameter(0.3, unit="of an object's points that had nothing near", source=_CHOSEN)
    narrowest_m: float = parameter(0.5, unit="m: narrower is a post that beams miss", source="street 43008")


NUMBERS = FreeSpaceConflict()

_REACH_M = NUMBERS.farthest_m + NUMBERS.most_shift_cells * NUMBERS.cell_m
SIDE = -(-int(2 * _REACH_M / NUMBERS.cell_m) // NUMBERS.ground_cells) * NUMBERS.ground_cells
_GROUND_SIDE = SIDE // NUMBERS.ground_cells
_LOWER_M = np.float32(NUMBERS.slope * NUMBERS.ground_cells * NUMBERS.cell_m)
_DOWN, _AROUND = int(np.pi / NUMBERS.beam_rad) + 1, int(2 * np.pi / NUMBERS.beam_rad) + 1
_BESIDE = np.ones((3, 3), dtype=np.uint8)
_NOWHERE_M = np.float32(1e6)
_AZIMUTH = np.arctan2(*(np.indices((SIDE, SIDE))[::-1] - SIDE / 2 + 0.5)).ravel().astype(np.float32)
"""By cell: to the right of ahead, in radians."""


Cells32 = NDArray[np.int32]
"""Rows or columns of cells seen from above: (M,)."""


class Shift(NamedTuple):
    """By how many cells what stands still lay elsewhere a moment ago: ahead and to the right."""

    ahead: int
    right: int


@dataclass(frozen=True, eq=False)
class ScanFromAbove:
    """One scan, its points within reach, seen from above.

    `cloud_m` (N, 3) are all its points, `within` (M,) those within reach. `ended_m` (3, N) is where all its beams
    ended, right, down and ahead of it, and `xyz_m` (3, M) the same of those within reach; `cell` (M,) theirs; `solid`
    those of objects, `clearly` those of them that are asked about, `from_nowhere` those of objects that came from
    nowhere.
    """

    stamp_ns: int
    cloud_m: Points
    within: Indices
    ended_m: Floats32
    xyz_m: Floats32
    cell: Indices
    solid: Mask
    clearly: Mask
    from_nowhere: Mask

    @classmethod
    def of(cls, cloud: PointCloud, rig: Rig) -> "ScanFromAbove":
        """The scan of a cloud, upright as the rig is."""
        ended = _upright(cloud.xyz_m, rig)
        within = within_reach(ended)
        xyz = ended.take(within, axis=1)
        right, down, ahead = xyz
        row, column = cells_from_above(xyz)
        above = above_ground_m(row, column, down)
        away = right * right + ahead * ahead
        solid = (above > NUMBERS.stands_m) & (away > NUMBERS.nearest_m**2)
        clearly = solid & (above > NUMBERS.clearly_m) & (away < NUMBERS.farthest_m**2)
        cell, nothing = (row * SIDE + column).astype(np.intp), np.zeros(within.size, dtype=np.bool_)
        return cls(cloud.stamp_ns, cloud.xyz_m, within, ended, xyz, cell, solid, clearly, nothing)

    def points(self, some: Mask) -> Points:
        """(K, 3) some (M,) of its points within reach, as the LiDAR gave them."""
        return self.cloud_m[self.within[some]]

    @cached_property
    def things(self) -> Image:
        """The cells that hold objects."""
        return self.cells(self.solid)

    def cells(self, some: Mask) -> Image:
        """(SIDE, SIDE) 1 where a cell holds some (M,) of its points."""
        return grid_of(self.cell.take(np.flatnonzero(some)))

    def turned(self, angle: float) -> "ScanFromAbove":
        """The scan as a vehicle sees it that has turned to the right by an angle, in radians."""
        ended = _turned_to(self.ended_m, angle)
        kept = within_reach(ended.take(self.within, axis=1))
        within = self.within[kept]
        xyz = ended.take(within, axis=1)
        row, column = cells_from_above(xyz)
        masks = {name: getattr(self, name)[kept] for name in ("solid", "clearly", "from_nowhere")}
        cell = (row * SIDE + column).astype(np.intp)
        return replace(self, within=within, ended_m=ended, xyz_m=xyz, cell=cell, **masks)

    def objects(self, grid: Image) -> tuple[int, Indices]:
        """The number (M,) of the object that each point is of, by the cells of a grid that touch; 0 is none.

        Before them stands how many numbers there are.
        """
        count, numbers = cv2.connectedComponents(grid)
        return count, np.asarray(numbers, dtype=np.intp).take(self.cell)

    def after_s(self, before: "ScanFromAbove") -> float:
        """The seconds from another scan to this one."""
        return (self.stamp_ns - before.stamp_ns) / NANOSECONDS

    def follows(self, before: "ScanFromAbove") -> bool:
        """Whether the other scan is the one of a moment ago."""
        return 0 < self.after_s(before) <= NUMBERS.most_s

    def passed(self, xyz_m: Floats32) -> Mask:
        """(K,) whether its beams around points (3, K) of the next scan went on behind them, and none ended before."""
        range_m, near_m, scanned = beams_around(xyz_m, self._towards(xyz_m))
        return np.asarray(scanned & (near_m > range_m + NUMBERS.behind_m))

    def _towards(self, xyz_m: Floats32) -> Floats32:
        """(3, M) the scan's points in the directions around points (3, K), and as far aside as `passed` asks."""
        middle = np.arctan2(xyz_m[0].mean(), xyz_m[2].mean())
        widest = np.abs(_turned(np.arctan2(xyz_m[0], xyz_m[2]), middle)).max()
        reached = np.abs(_turned(_AZIMUTH, middle)) <= widest + 2 * NUMBERS.scanned_cells * NUMBERS.beam_rad
        return self.xyz_m.take(np.flatnonzero(reached[self.cell]), axis=1)


class OwnScans:
    """Compares the LiDAR's scans of one recording, in their order, each with the one before.

    `asked_share` is the share of the last cloud's points that would be conflicts, had they come from nowhere: those of
    objects within reach; 0 where it was not compared.
    """

    def __init__(self) -> None:
        self._last: ScanFromAbove | None = None
        self._way: Shift | None = None
        self.asked_share = 0.0

    @property
    def now(self) -> ScanFromAbove | None:
        """The last scan, None where there was none."""
        return self._last

    @property
    def way(self) -> Shift | None:
        """By how many cells what stands still moved since the scan before; None where there was none."""
        return self._way

    def conflicts(self, cloud: PointCloud | None, rig: Rig) -> Points | None:
        """(K, 3) the points of the next cloud that stand where its beams passed; None without a scan just before."""
        before, self._last, self._way = self._last, None, None
        self.asked_share = 0.0
        if cloud is None or rig.lidar is None:
            return None
        now = ScanFromAbove.of(cloud, rig)
        points = None
        if before is not None and now.follows(before):
            self._way, points = _compared(now, before)
        self._last = now if points is None else replace(now, from_nowhere=points)
        if points is None:
            return None
        self.asked_share = int(np.count_nonzero(now.clearly)) / max(len(cloud.xyz_m), 1)
        return now.points(points)


def measure_free_space_conflict(from_nowhere: Points, rig: Rig, *view: int) -> float:
    """The statistic, 0 to 1, of those of the points (K, 3) in the view of a camera that do not scatter as in dust."""
    return statistic_in_view(from_nowhere[~scattered(from_nowhere, rig)], rig, *view)


def measure_surrounding_conflict(from_nowhere: Points, rig: Rig) -> float:
    """The statistic, 0 to 1, of all of the points (K, 3) that do not scatter as in dust."""
    return measure_free_space_conflict(from_nowhere, rig)


def _upright(points: Points, rig: Rig) -> Floats32:
    """(3, N) points (N, 3) of the LiDAR, right, down and ahead of it."""
    assert rig.lidar is not None
    rotation, along = rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32), np.ascontiguousarray(points.T)
    # Row by row: a product of so thin matrices takes several cores longer than this takes one.
    return np.stack([sum(by * axis for by, axis in zip(row, along, strict=True)) for row in rotation])


def within_reach(xyz_m: Floats32) -> Indices:
    """The places of those of points (3, M) that are seen from above."""
    return np.flatnonzero(np.maximum(np.abs(xyz_m[0]), np.abs(xyz_m[2])) < _REACH_M - NUMBERS.cell_m)


def cells_from_above(xyz_m: Floats32) -> tuple[Cells32, Cells32]:
    """The row and the column (M,) of the cells of points (3, M) within reach, seen from above."""
    row, column = (((axis + _REACH_M) * (1 / NUMBERS.cell_m)).astype(np.int32) for axis in (xyz_m[2], xyz_m[0]))
    return row, column


def grid_of(cell: Indices) -> Image:
    """(SIDE, SIDE) 1 in some cells (K,), which are numbered row by row."""
    grid = np.zeros(SIDE * SIDE, dtype=np.uint8)
    grid[cell] = 1
    return grid.reshape(SIDE, SIDE)


def above_ground_m(row: Cells32, column: Cells32, down_m: Floats32) -> Floats32:
    """(M,) how far points are above the lowest one in their cell of ground, or in those around it less a slope."""
    ground = row // NUMBERS.ground_cells * _GROUND_SIDE + column // NUMBERS.ground_cells
    lowest = np.full(_GROUND_SIDE * _GROUND_SIDE, -_NOWHERE_M, dtype=np.float32)
    some = down_m[:: NUMBERS.sampled]
    deepest = quantile_of(np.sort(some), NUMBERS.road_quantile) + NUMBERS.under_m if some.size else 0.0
    np.maximum.at(lowest, ground, np.where(down_m < deepest, down_m, -_NOWHERE_M))
    around = np.asarray(cv2.dilate(lowest.reshape(_GROUND_SIDE, _GROUND_SIDE), _BESIDE)).ravel()
    return np.asarray(np.maximum(lowest, around - _LOWER_M).take(ground) - down_m)


def _compared(now: ScanFromAbove, before: ScanFromAbove) -> tuple[Shift, Mask | None]:
    """How what stands still moved, and what came from nowhere; unless nothing did, whether the vehicle has turned."""
    _, shift = _match(now.things, before.things)
    points = _from_nowhere(now, before, shift)
    if points is not None and not points.any():
        return shift, points
    turns = np.radians(NUMBERS.turns_deg).tolist()
    matches = [_match(now.things, turned_cells(before.things, turn)) for turn in turns]
    turn, (_, shift) = max(zip(turns, matches, strict=True), key=lambda tried: tried[1])
    return shift, _from_nowhere(now, before.turned(turn), shift)


def turned_cells(cells: Image, angle: float) -> Image:
    """The marked cells as a vehicle sees them that has turned to the right by an angle, in radians."""
    ahead, right = ((along + 0.5) * NUMBERS.cell_m - _REACH_M for along in np.nonzero(cells))
    xyz = _turned_to(np.stack([right, np.zeros_like(right), ahead]), angle)
    row, column = cells_from_above(xyz[:, within_reach(xyz)])
    return grid_of((row * SIDE + column).astype(np.intp))


def _turned_to(xyz: Floats32 | Floats, angle: float) -> Floats32:
    right, down, ahead = xyz
    cos, sin = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    return np.asarray([cos * right - sin * ahead, down, sin * right + cos * ahead], dtype=np.float32)


def _from_nowhere(now: ScanFromAbove, before: ScanFromAbove, shift: Shift) -> Mask | None:
    """(M,) the points of objects that came from nowhere, or that did earlier and are still alone.

    None where too much did: a recording that was cut or put together goes on at another place.
    """
    around = around_thing(shift, now.after_s(before))
    alone = ~near(before.cells(before.solid & ~before.from_nowhere), shift, around).take(now.cell)
    unexplained = now.clearly & alone
    asked = np.flatnonzero(unexplained)
    if not asked.size:
        return now.from_nowhere
    here, there = (np.count_nonzero(now.cells(some)) for some in (unexplained, now.clearly))
    if here > max(NUMBERS.most_alone * there, NUMBERS.most_cells):
        return None
    earlier = near(before.cells(before.from_nowhere), shift, around)
    new = asked[before.passed(now.xyz_m[:, asked]) | earlier.take(now.cell[asked])]
    count, of = now.objects(now.things)
    no_other, every = (
        np.bincount(of.take(np.flatnonzero(mask)), minlength=count) for mask in (now.solid & alone, now.solid)
    )
    wide = widths_m(of[new], now.xyz_m[:, new], count) >= NUMBERS.narrowest_m
    objects = (np.bincount(of[new], minlength=count) >= NUMBERS.fewest) & wide
    objects &= no_other >= NUMBERS.least_share * every
    return np.asarray(now.solid & objects.take(of))


def _match(now: Image, before: Image) -> tuple[float, Shift]:
    """How what stands still moved: the shift at which most cells that hold objects now did so before; how many."""
    most = NUMBERS.most_shift_cells
    here, there = (cells.astype(np.float32) for cells in (now, before))
    together = cv2.GaussianBlur(cv2.matchTemplate(there, here[most:-most, most:-most], cv2.TM_CCORR), (3, 3), 0)
    row, column = np.unravel_index(int(np.argmax(together)), together.shape)
    return float(together[row, column]), Shift(int(row) - most, int(column) - most)


def near(there: Image, shift: Shift, around: Image) -> Mask:
    """By cell of now: whether a thing of the marked cells of a moment ago can have come there."""
    row, column = (cells - by for cells, by in zip(np.nonzero(there), shift, strict=True))
    within = (row >= 0) & (row < SIDE) & (column >= 0) & (column < SIDE)
    here = np.zeros_like(there)
    here[row[within], column[within]] = 1
    return np.asarray(cv2.dilate(here, around)) > 0


def around_thing(shift: Shift, seconds: float) -> Image:
    """The cells around a thing that stands still in which it can be if it does not: an ellipse along the way."""
    along = NUMBERS.moves_m_s * seconds / NUMBERS.cell_m
    # Of a vehicle that stands nobody knows the way.
    return ellipse(shift, along, NUMBERS.beside_m / NUMBERS.cell_m if any(shift) else along)


def ellipse(way: Shift, along: float, across: float) -> Image:
    """The cells around one within an ellipse, so many of them along a way and across it; ahead without a way."""
    half = int(along)
    ahead, right = np.mgrid[-half : half + 1, -half : half + 1]
    length = float(np.hypot(*way))
    to_ahead, to_right = (way.ahead / length, way.right / length) if length else (1.0, 0.0)
    along_way, across_way = ahead * to_ahead + right * to_right, right * to_ahead - ahead * to_right
    return np.asarray((along_way / along) ** 2 + (across_way / across) ** 2 <= 1, dtype=np.uint8)


def widths_m(of: Indices, xyz_m: Floats32, count: int) -> Floats:
    """(count,) how wide the points (3, K) of each object are, seen from above: the longer side."""
    sides = []
    for along in (xyz_m[0], xyz_m[2]):
        least, most = np.full(count, _NOWHERE_M), np.full(count, -_NOWHERE_M)
        np.minimum.at(least, of, along)
        np.maximum.at(most, of, along)
        sides.append(most - least)
    return np.asarray(np.maximum(*sides))


def beams_around(xyz_m: Floats32, ended_m: Floats32) -> tuple[Floats32, Floats32, Mask]:
    """(K,) the range of points (3, K), where the first of the beams around each ended, and whether it was scanned.

    The beams are those that ended at (3, M).
    """
    down, around, range_m = _directions(xyz_m)
    its_down, its_around, its_range_m = _directions(ended_m)
    nearest = np.full(_DOWN * _AROUND, _NOWHERE_M, dtype=np.float32)
    np.minimum.at(nearest, its_down * _AROUND + its_around, its_range_m)
    grid = nearest.reshape(_DOWN, _AROUND)
    beside = NUMBERS.scanned_cells
    hit = _ring(np.any(grid < _NOWHERE_M, axis=0, keepdims=True).astype(np.float32), beside)
    closed = np.asarray(cv2.morphologyEx(hit, cv2.MORPH_CLOSE, np.ones((1, 5), np.uint8)), dtype=np.float32)
    scanned = _eroded(closed, np.ones((1, 2 * beside + 1), dtype=np.uint8))[0, beside:-beside]
    near_m = _eroded(_ring(grid, 1), _BESIDE)[:, 1:-1][down, around]
    return range_m, near_m, np.asarray((near_m < _NOWHERE_M) & (scanned[around] > 0))


def _directions(xyz_m: Floats32) -> tuple[Indices, Indices, Floats32]:
    """The cells of direction of points (3, M), down and around, and their ranges in m."""
    right, down, ahead = xyz_m
    level = np.sqrt(right * right + ahead * ahead)
    cells = (
        (angle / NUMBERS.beam_rad).astype(np.intp)
        for angle in (np.arctan2(down, level) + np.float32(np.pi / 2), np.arctan2(right, ahead) + np.float32(np.pi))
    )
    below, around = cells
    return below, np.minimum(around, _AROUND - 1), np.sqrt(level * level + down * down)


def _turned(angle: Floats32, by: float) -> Floats32:
    """Angles as seen from another, within half a turn of it."""
    return np.asarray((angle - by + np.pi) % (2 * np.pi) - np.pi)


def _eroded(grid: Floats32, around: Image) -> Floats32:
    return np.asarray(cv2.erode(grid, around), dtype=np.float32)


def _ring(grid: Floats32, cells: int) -> Floats32:
    """(D, A) cells around, with some of those of the other end on both sides."""
    return np.concatenate([grid[:, -cells:], grid, grid[:, :cells]], axis=1)
