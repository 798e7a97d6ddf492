"""The checks of the robust method: which of them exist for a rig."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cache, lru_cache
from itertools import combinations, groupby
from typing import NamedTuple

from auditor.model.checks.kind import CellUnit, Of
from auditor.model.checks.kinds import Check as Check
from auditor.model.parameters import PAIR_DEPTH
from auditor.model.rig import LIDAR, Rig

LIDAR_CHECKS = frozenset(one for one in Check if one.kind.of is Of.VIEW)
"""The checks of the LiDAR alone, in the view of a camera."""

_BY_VIEW = frozenset(one for one in Check if one.kind.of in (Of.VIEW, Of.OWN_SCANS))
"""Those that are measured in every view by itself: no view stands for the others."""

DIRECTION_CHECKS = frozenset(one for one in Check if one.kind.counted in (CellUnit.POINTS, CellUnit.SURFACES))
"""The checks of the LiDAR by pairs of cameras, or of a camera and its own past, counted by its directions."""

IMAGE_CHECKS = tuple(one for one in Check if one.kind.counted in (CellUnit.PIXELS, CellUnit.LIGHT))
"""All checks that are counted in the images of camera pairs."""

CAMERA_CHECKS = tuple(one for one in IMAGE_CHECKS if not one.kind.of_colours)
"""Those of them that look at grey levels."""

ADDED_LATER = tuple(Check)[tuple(Check).index(Check.COLOURED_LIGHT) :]
"""Those at the end of every list of sensor checks, in their order: measurements of earlier versions lack the last."""

SHARE_CHECKS = frozenset(one for one in Check if one.kind.counted is CellUnit.NOTHING)
"""Those that are not counted on grids: what is measured is the statistic itself, of a camera by each other one."""

SIGNED_CHECKS = frozenset(one for one in Check if one.kind.counted is CellUnit.LIGHT and one is one.counted_as)
"""Those whose grids hold sums of residuals: light that is added to one camera of a pair, the other lacks."""

OF_ALIKE = frozenset({Of.CAMERAS, Of.OTHER_SCANS})
"""The sorts of checks of a sensor by others of its own sort."""

FEWEST_VOTERS = 2
"""Cameras that must say the same of a camera before it can be named: one alone may be wrong itself."""

MOST_LEFT_OUT = 2
"""Voters of a camera that may be missing or attacked at once: what its other voters say is measured as well."""


class SensorCheck(NamedTuple):
    """One check of a sensor by `others`, ascending: by whom its kind is `of`."""

    check: Check
    sensor: int
    others: tuple[int, ...]

    @property
    def needed(self) -> tuple[int, ...]:
        """The sensors without which it cannot be measured."""
        return (self.sensor, *self.others)

    @property
    def nameable(self) -> tuple[int, ...]:
        """The sensors one of which must be attacked where it fires: two cameras, or LiDARs, alone cannot tell which.

        Of light of one colour they can: light only adds, and no dirt or exposure takes away one colour of a place.
        """
        return _nameable(self)


@cache
def _nameable(check: SensorCheck) -> tuple[int, ...]:
    kind = check.check.kind
    alone = len(check.others) < FEWEST_VOTERS and kind.of in OF_ALIKE and not kind.of_colours
    return check.needed if alone else (check.sensor,)


class CountedPair(NamedTuple):
    """What is counted on one grid: a check of the camera pair i < k, in the image of one of them.

    `sensor` is that camera; of DIRECTION_CHECKS it is the LiDAR, and the grid is one of its directions. ADDED_LIGHT
    counts removed light as well, with the other sign. i = k is a camera with its own past.
    """

    check: Check
    i: int
    k: int
    sensor: int

    @property
    def other(self) -> int:
        """The pair's other camera."""
        return self.i if self.sensor == self.k else self.k


def rig_sensor_checks(rig: Rig) -> tuple[SensorCheck, ...]:
    """The checks that frames of a rig are judged by, in their fixed order."""
    if not rig.cameras:
        return _of_scans(rig.sensors)
    if rig.by_time:  # of a camera that looks anywhere nobody knows where its view has points
        return sensor_checks_of((), (), (), rig.references)
    views = dict.fromkeys((*rig.references, *(rig.fallback[2:] if rig.fallback else ()))) if rig.lidar else {}
    return sensor_checks_of(rig.pairs, conflict_pairs(rig), tuple(views))


@cache
def _of_scans(lidars: tuple[int, ...]) -> tuple[SensorCheck, ...]:
    """The checks of LiDARs without cameras: each by its own last scan, and by the others."""
    subjects: Mapping[Of, Sequence[tuple[int, tuple[int, ...]]]] = {
        Of.OWN_SCANS: [(one, ()) for one in lidars],
        Of.OTHER_SCANS: [(one, others) for one in lidars for others in _voters(tuple(k for k in lidars if k != one))],
    }
    return tuple(SensorCheck(check, *subject) for check in Check for subject in subjects.get(check.kind.of, ()))


def conflict_pairs(rig: Rig) -> tuple[tuple[int, int], ...]:
    """The matched pairs (i, k) of a rig that check its LiDAR."""
    return tuple(pair for pair in rig.pairs if rig.lidar and resolves_depth(rig, *pair))


def lies_too_close(rig: Rig) -> bool:
    """Whether the cameras of a rig with a LiDAR lie too close together to check it."""
    return rig.lidar is not None and rig.n > 1 and not conflict_pairs(rig)


def pasts_of(rig: Rig) -> tuple[Rig, ...]:
    """The cameras of a rig that names no sensor, each alone with the LiDAR: its own past tells which is attacked."""
    names_none = rig.lidar is not None and rig.n == 2
    return tuple(rig.lone(camera.number) for camera in rig.cameras) if names_none or lies_too_close(rig) else ()


@lru_cache(maxsize=64)
def sensor_checks_of(
    matched: Sequence[tuple[int, int]],
    conflicts: Sequence[tuple[int, int]],
    views: Sequence[int],
    pasts: Sequence[int] = (),
) -> tuple[SensorCheck, ...]:
    """All sensor checks of these matched pairs, LiDAR conflicts, views of the LiDAR, and pasts, in their fixed order.

    A camera is checked by all cameras that it is matched with, by all but one or two of them, and by each alone; the
    LiDAR's conflicts, lost returns and false ranges by the pairs of all cameras, and of all but one or two; the latter
    two never by one pair alone. What two others say together they say where they are matched.
    """
    partners: dict[int, list[int]] = {}
    for i, k in sorted(matched):
        partners.setdefault(i, []).append(k)
        partners.setdefault(k, []).append(i)
    by_pairs = conflict_cameras(conflicts)
    subjects: Mapping[Of, Sequence[tuple[int, tuple[int, ...]]]] = {
        Of.PAIRS: [(LIDAR, cameras) for cameras in by_pairs],
        Of.SEVERAL_PAIRS: [(LIDAR, cameras) for cameras in by_pairs if len(cameras) > FEWEST_VOTERS],
        Of.VIEW: [(LIDAR, (k,)) for k in views],
        Of.OWN_SCANS: [(LIDAR, (k,)) for k in (*views, *pasts)],
        Of.SURROUNDINGS: [(LIDAR, ())] if views or pasts else [],
        Of.OTHER_SCANS: [],
        Of.LONE_CAMERA: [(LIDAR, (k,)) for k in pasts],
        Of.CAMERAS: [(one, others) for one in sorted(partners) for others in _voters(tuple(sorted(partners[one])))],
        Of.LIDAR: [(k, (LIDAR,)) for k in pasts],
    }

    def is_told(check: Check, others: tuple[int, ...]) -> bool:
        return not check.kind.by_two_others or any(set(pair) <= set(others) for pair in matched)

    every = (SensorCheck(check, *subject) for check in Check for subject in subjects[check.kind.of])
    return tuple(one for one in every if is_told(one.check, one.others))


@lru_cache(maxsize=512)
def counting_checks(sensor_checks: Sequence[SensorCheck], absent: frozenset[int]) -> tuple[int, ...]:
    """The places of the checks that count in a frame without these sensors: each of the most voters that are there."""

    def subject(place: int) -> tuple[Check, int]:
        return sensor_checks[place].check, sensor_checks[place].sensor

    there = [place for place, one in enumerate(sensor_checks) if absent.isdisjoint(one.needed)]
    columns: list[int] = []
    for (check, _), group in groupby(sorted(there, key=subject), key=subject):
        places = list(group)
        most = max(len(sensor_checks[place].others) for place in places)
        columns += [place for place in places if check in _BY_VIEW or len(sensor_checks[place].others) == most]
    return tuple(sorted(columns))


def cameras_of(pairs: Iterable[tuple[int, int]]) -> tuple[int, ...]:
    """The cameras of some pairs, ascending."""
    return tuple(sorted({camera for pair in pairs for camera in pair}))


def conflict_cameras(conflicts: Sequence[tuple[int, int]]) -> list[tuple[int, ...]]:
    """The cameras by whose pairs the LiDAR is checked: all of these pairs', and all but one or two of them."""
    cameras = cameras_of(conflicts)
    left_out = (absent for number in range(MOST_LEFT_OUT + 1) for absent in combinations(cameras, number))
    remaining = (cameras_of(pair for pair in conflicts if set(pair).isdisjoint(absent)) for absent in left_out)
    return [found for found in dict.fromkeys(remaining) if found]


def _voters(partners: tuple[int, ...]) -> list[tuple[int, ...]]:
    fewest = max(len(partners) - MOST_LEFT_OUT, FEWEST_VOTERS)
    several = (others for number in range(len(partners), fewest - 1, -1) for others in combinations(partners, number))
    return [*several, *((one,) for one in partners)]


def resolves_depth(rig: Rig, j: int, k: int) -> bool:
    """Whether the pair's disparities resolve depth well enough to check the LiDAR.

    A pair that resolves less cannot tell a surface from one half as far again.
    """
    # Cameras of different focal lengths are compared at the shortest of those that share a view.
    cameras = rig.cameras if rig.shares_view else (rig.camera(j), rig.camera(k))
    focal_px = min(camera.focal_px for camera in cameras)
    return focal_px * rig.baseline_m(j, k) / PAIR_DEPTH.distance_m >= PAIR_DEPTH.fewest_px


Pair = tuple[int, int]
