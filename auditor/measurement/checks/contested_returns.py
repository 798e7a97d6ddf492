"""A LiDAR against another one: what stands, by its points, where the other's beams passed at the same moment.

Two LiDARs look from different places, and turn on their own. So what the other does not see, behind something or
outside its beams, says nothing: its beams around a point have to end clearly behind it. What moves may have been
elsewhere when the other looked: nothing of the other may stand near. Posts, wires and boards are missed by beams: what
is contested has to be wide and tall.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auditor.measurement.checks.free_space_conflict import NUMBERS as FREE_SPACE
from auditor.measurement.checks.free_space_conflict import (
    SIDE,
    ScanFromAbove,
    Shift,
    above_ground_m,
    around_thing,
    beams_around,
    cells_from_above,
    ellipse,
    grid_of,
    near,
    widths_m,
    within_reach,
)
from auditor.measurement.checks.scattered_returns import scattered, statistic_in_view
from auditor.model.arrays import Floats32, Image, Indices, Mask, Points
from auditor.model.optics.geometry import Matrix
from auditor.model.parameters import BY_HAND, parameter
from auditor.model.rig import Rig

_CHOSEN = "KITTI's scans split in two, and streets 46000 to 46259, clean and attacked (docs/decisions.md)"


@dataclass(frozen=True)
class ContestedReturns:
    """What stands where the beams of another LiDAR passed, seen from above in cells."""

    nearest_m: float = parameter(4.0, unit="m: nearer is the vehicle itself", source=BY_HAND)
    apart_s: float = parameter(0.15, unit="s between two beams of a frame: half a period and a sweep", source=BY_HAND)
    behind_m: float = parameter(1.5, unit="m behind it at which beams ended, at least", source=_CHOSEN)
    usual_s: float = parameter(0.1, unit="s between two scans, by which the vehicle's way is taken", source=BY_HAND)
    beside_m: float = parameter(1.0, unit="m beside it that what stands still may seem to be", source=BY_HAND)
    places: int = parameter(5, unit="places along its way at which a point is asked about", source=BY_HAND)
    fewest: int = parameter(10, unit="points of an object where beams passed", source=_CHOSEN)
    least_share: float = parameter(0.7, unit="of an object's points that the other looks at", source=_CHOSEN)
    narrowest_m: float = parameter(0.8, unit="m: narrower is a post that beams miss", source=_CHOSEN)
    lowest_m: float = parameter(0.4, unit="m from its lowest to its highest: less is a board or a wire", source=_CHOSEN)
    most_things: int = parameter(
        2,
        unit="things that two LiDARs each contest of the other: beyond it their places do not fit",
        source="3 and more where one is turned by 3 degrees or moved by 1.4 m, 0 of a ghost (docs/decisions.md)",
    )


NUMBERS = ContestedReturns()

_STILL = Shift(0, 0)


class ContestedPoints(NamedTuple):
    """What another LiDAR says of the points (M, 3) of a scan.

    Those that it contests and those that it looks at, both (M,), and how many things it contests, narrow ones as well.
    """

    points: Mask
    looked_at: Mask
    things: int

    def fits(self, other: "ContestedPoints") -> bool:
        """Whether two LiDARs may be where they are said to be, by what each says of the other.

        Whoever attacks one of them makes things that the other contests. Where each contests several of the other the
        same things are seen at two places.
        """
        return min(self.things, other.things) <= NUMBERS.most_things


def contested(now: ScanFromAbove, other_m: Floats32, beside_m: Matrix, way: Shift) -> ContestedPoints:
    """What another LiDAR says of the points of a scan.

    `other_m` (3, N) are its points of the same frame, right, down and ahead of it, and `beside_m` (3,) is where it lies
    beside the first one. `way` is how what stands still moved since the scan before.
    """
    offset = beside_m.astype(np.float32)[:, None]
    asked = np.flatnonzero(now.clearly & (np.hypot(now.xyz_m[0], now.xyz_m[2]) > NUMBERS.nearest_m))
    if not asked.size or not other_m.size:
        return ContestedPoints(_flags(now, asked[:0]), _flags(now, asked[:0]), 0)
    range_m, ended_m, scanned = beams_around(now.xyz_m[:, asked] - offset, other_m)
    seen = asked[scanned & (ended_m > range_m - NUMBERS.behind_m)]
    passed = asked[scanned & (ended_m > range_m + NUMBERS.behind_m)]
    alone = _alone(now, passed, _things(now, other_m + offset), way)
    if alone.size:
        alone = alone[_passed_all_along(now.xyz_m[:, alone] - offset, other_m, way)]
    count, thing = now.objects(now.cells(_flags(now, alone)))
    return ContestedPoints(_objects(now, seen, alone, thing, count), _flags(now, seen), count - 1)


def _alone(now: ScanFromAbove, passed: Indices, there: Image, way: Shift) -> Indices:
    """Those of the points at some places that nothing of the other LiDAR's `there` can be.

    What stands still lies near. What moves lies farther away, where the first LiDAR sees nothing.
    """
    beside = _still(way)
    alone = passed[~near(there, _STILL, beside).take(now.cell[passed])]
    nearby = now.solid.copy()
    nearby[alone] = False
    moved = there * ~near(now.cells(nearby), _STILL, beside)
    return alone[~near(moved, _STILL, around_thing(way, NUMBERS.apart_s)).take(now.cell[alone])]


def _passed_all_along(xyz_m: Floats32, other_m: Floats32, way: Shift) -> Mask:
    """(K,) whether beams went on behind points (3, K) wherever they were when the other looked, if they stand still."""
    moved_m = FREE_SPACE.cell_m * NUMBERS.apart_s / NUMBERS.usual_s * np.array([way.right, 0, way.ahead])
    steps = np.linspace(-1, 1, NUMBERS.places)
    places = np.concatenate([xyz_m + (step * moved_m).astype(np.float32)[:, None] for step in steps], axis=1)
    range_m, ended_m, scanned = beams_around(places, other_m)
    passed = scanned & (ended_m > range_m + NUMBERS.behind_m)
    return np.asarray(passed.reshape(len(steps), -1).all(axis=0))


def _still(way: Shift) -> Image:
    """The cells around a thing in which it can be if it stands still: an ellipse along the vehicle's way."""
    beside = NUMBERS.beside_m / FREE_SPACE.cell_m
    return ellipse(way, float(np.hypot(*way)) * NUMBERS.apart_s / NUMBERS.usual_s + beside, beside)


def measure_contested_returns(points: Points, rig: Rig) -> float:
    """The statistic, 0 to 1, of those of the contested points (K, 3) that do not scatter as in dust."""
    return statistic_in_view(points[~scattered(points, rig)], rig)


def _things(now: ScanFromAbove, xyz_m: Floats32) -> Image:
    """(SIDE, SIDE) 1 where another LiDAR's points (3, M), seen from the first, stand above the ground of both."""
    xyz_m = xyz_m.take(within_reach(xyz_m), axis=1)
    row, column = cells_from_above(np.concatenate([xyz_m, now.xyz_m], axis=1))
    above = above_ground_m(row, column, np.concatenate([xyz_m[1], now.xyz_m[1]]))
    standing = np.flatnonzero(above[: xyz_m.shape[1]] > FREE_SPACE.stands_m)
    return grid_of(row[standing] * SIDE + column[standing])


def _objects(now: ScanFromAbove, seen: Indices, alone: Indices, thing: Indices, count: int) -> Mask:
    """(M,) the points that stand alone of things most of whose points do, and that are wide and tall.

    `thing` (M,) is the number of each point's thing, of `count`; 0 is none.
    """
    every, own = (np.bincount(thing[some], minlength=count) for some in (seen, alone))
    objects = own >= np.maximum(NUMBERS.fewest, NUMBERS.least_share * every)
    objects &= widths_m(thing[alone], now.xyz_m[:, alone], count) >= NUMBERS.narrowest_m
    objects &= _heights_m(thing[alone], now.xyz_m[1, alone], count) >= NUMBERS.lowest_m
    return _flags(now, alone[objects[thing[alone]]])


def _flags(now: ScanFromAbove, places: Indices) -> Mask:
    """(M,) the points of a scan at some places."""
    flags = np.zeros(now.cell.size, dtype=np.bool_)
    flags[places] = True
    return flags


def _heights_m(of: Indices, down_m: Floats32, count: int) -> Floats32:
    """(count,) how tall the points (K,) of each object are."""
    least, most = np.full(count, np.inf, np.float32), np.full(count, -np.inf, np.float32)
    np.minimum.at(least, of, down_m)
    np.maximum.at(most, of, down_m)
    return most - least
