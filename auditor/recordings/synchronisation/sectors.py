"""The parts of a LiDAR's sweep: drivers that write a cloud a packet, or two a revolution, each of another sector.

A topic comes in parts where successive clouds look next to each other. A sweep ends where the sectors begin anew: at a
seam behind the cameras, so that what the cameras see is of one sweep.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import median
from typing import NamedTuple

import numpy as np

from auditor.model.arrays import Floats, Points
from auditor.model.rig import Sweep
from auditor.recordings.parameters import SWEEPS

_TURN = 2 * np.pi
_CUT_AND_WHOLE = 3


class Sector(NamedTuple):
    """Where the points of a cloud lie around the z axis of the LiDAR: their middle and their width, in radians.

    `turn_rad` is by how much, on average, a point lies further from x to y than the one written before it.
    """

    azimuth_rad: float
    width_rad: float
    turn_rad: float = 0.0


def sector_of(xyz_m: Points) -> Sector | None:
    """The sector of (N, 3) points; None where there are none. A few points elsewhere change little."""
    x, y = xyz_m[:, 0].astype(np.float64), xyz_m[:, 1].astype(np.float64)
    away = (x != 0) | (y != 0)  # missing returns may be written as zeros
    if not away.any():
        return None
    azimuth = np.arctan2(y[away], x[away])
    middle = float(np.arctan2(np.sin(azimuth).mean(), np.cos(azimuth).mean()))
    half = float(np.quantile(np.abs(_wrapped(azimuth - middle)), SWEEPS.points_quantile)) / SWEEPS.points_quantile
    steps = _wrapped(np.diff(azimuth))
    near = steps[np.abs(steps) < SWEEPS.neighbours_rad]
    return Sector(middle, 2 * half, float(near.mean()) if near.size else 0.0)


def in_parts(sectors: Sequence[Sector | None]) -> bool:
    """Whether successive clouds look next to each other, and not the same way."""
    parts = [sector for sector in sectors if sector is not None]
    if len(parts) < SWEEPS.fewest_clouds:
        return False
    return bool(_step(parts) > SWEEPS.least_step * median(sector.width_rad for sector in parts))


def show_whole_sweeps(sectors: Sequence[Sector | None]) -> bool:
    """Whether parts go on long enough for a whole sweep between two that the edges cut; true where none are parts."""
    if not in_parts(sectors):
        return True
    parts = [sector for sector in sectors if sector is not None]
    return len(parts) * _step(parts) >= _CUT_AND_WHOLE * _TURN


def sweep_of(sectors: Sequence[Sector | None], ahead_rad: float) -> Sweep | None:
    """The sweep that successive clouds are parts of, beginning opposite of `ahead_rad`; None where each is whole."""
    if not in_parts(sectors):
        return None
    parts = [sector for sector in sectors if sector is not None]
    step_rad = _step(parts)
    direction = _direction(parts, step_rad)
    behind_rad = ahead_rad + np.pi
    # Where parts repeat their sectors the seam lies between two of them: through the middle of one it would cut at
    # random. For the same reason the sweep has the time of a certain part.
    within = [direction * (sector.azimuth_rad - behind_rad) / step_rad * _TURN for sector in parts]
    middle = float(np.arctan2(np.sin(within).mean(), np.cos(within).mean())) / _TURN * step_rad
    edge = middle - np.sign(middle or 1.0) * step_rad / 2
    ahead = middle + round((np.pi - middle) / step_rad) * step_rad
    seam_rad, time_rad = (round(float(_wrapped(behind_rad + direction * angle)), 6) for angle in (edge, ahead))
    sweep = Sweep(seam_rad, round(step_rad, 6), time_rad, direction, parts=1)
    return replace(sweep, parts=_parts(sectors, sweep))


def _direction(sectors: Sequence[Sector], step_rad: float) -> int:
    """Which way the LiDAR turns; of two halves a sweep only the order of their points shows it."""
    if step_rad > SWEEPS.half_turn_rad:
        turn = sum(sector.turn_rad for sector in sectors)
    else:
        turn = median(float(_wrapped(b.azimuth_rad - a.azimuth_rad)) for a, b in pairwise(sectors))
    return -1 if turn < 0 else 1


def _parts(sectors: Sequence[Sector | None], sweep: Sweep) -> int:
    """Of how many parts a sweep has at least, but for rare ones that lack some."""
    starts = SweepStarts(sweep)
    sizes = [0]
    for sector in sectors:
        if starts.begins(sector):
            sizes.append(0)
        sizes[-1] += 1
    whole = Counter(sizes[1:-1] or sizes)
    rare = max(1, SWEEPS.rare_sweeps * whole.total())
    return min((size for size, times in whole.items() if times > rare), default=max(whole))


class SweepStarts:
    """Tells where the next sweep begins, from the sectors of successive clouds."""

    def __init__(self, sweep: Sweep) -> None:
        self._sweep = sweep
        self._last: float | None = None

    def begins(self, sector: Sector | None) -> bool:
        """Whether a cloud is the first of a sweep; one without points belongs to the sweep before."""
        if sector is None:
            return False
        turned, last = self._sweep.direction * (sector.azimuth_rad - self._sweep.seam_rad) % _TURN, self._last
        self._last = turned
        return last is not None and turned < last - self._sweep.step_rad / 2


def whole_sweeps(sweep: Sweep, sectors: Sequence[Sector | None]) -> list[int]:
    """The places of the parts whose time is that of their sweep."""
    starts = SweepStarts(sweep)
    first = [place for place, sector in enumerate(sectors) if starts.begins(sector)]
    bounds = pairwise([0, *first, len(sectors)])
    return [begin + timed_part(sweep, sectors[begin:end]) for begin, end in bounds if end > begin]


def timed_part(sweep: Sweep, sectors: Sequence[Sector | None]) -> int:
    """The place of the part whose time is that of the sweep."""
    away = [np.inf if one is None else abs(float(_wrapped(one.azimuth_rad - sweep.time_rad))) for one in sectors]
    return int(np.argmin(away))


def _step(sectors: Sequence[Sector]) -> float:
    return median(abs(float(_wrapped(b.azimuth_rad - a.azimuth_rad))) for a, b in pairwise(sectors))


def _wrapped(angle: Floats | float) -> Floats:
    """Angles in -pi to pi."""
    return np.asarray((np.asarray(angle) + np.pi) % _TURN - np.pi, dtype=np.float64)
