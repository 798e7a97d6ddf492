"""Scans with far fewer returns than those just before: a drive takes so many away only bit by bit.

Returns are counted all around, in sectors, in bands of beams and by range. The fewest of some scans are compared with
the most of as many that follow, so that what drives by loses nothing. A part of the cloud that vanishes at once outside
the cameras' view contradicts nobody: it is not audited, and nothing is said of why.
"""

from collections import Counter, deque
from collections.abc import Generator, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from auditor.measurement.warning_parameters import FEWER_RETURNS
from auditor.model.arrays import Floats, Integers, Mask, Points
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.stamps import NANOSECONDS

_TURN, _UP = 360, 90
_STEP_DEG = FEWER_RETURNS.sector_deg // FEWER_RETURNS.steps
_SECTORS = _TURN // _STEP_DEG
_BANDS = 2 * _UP - 1
_LEFT = np.repeat(
    [FEWER_RETURNS.left_of_all, FEWER_RETURNS.left_of_part, FEWER_RETURNS.left_beyond],
    [1, _SECTORS + _BANDS, len(FEWER_RETURNS.beyond_m)],
)


class _Scan(NamedTuple):
    """The stamp of a scan, and its returns in each cell (C,), see `counted_returns`."""

    stamp_ns: int
    returns: Integers


@dataclass(frozen=True)
class _Loss:
    """Since when the cells (C,) of a mask have far fewer returns than the `before` (C,), and which `share` is left."""

    stamp_ns: int
    cells: Mask
    before: Floats
    share: float


class FewerReturns:
    """The scans of each LiDAR that have far fewer returns than those just before, over the frames of a recording."""

    def __init__(self) -> None:
        self.counts: Counter[int] = Counter()
        self._begin_ns: int | None = None
        self._first: dict[int, _Loss] = {}
        self._lost: dict[int, _Loss] = {}
        self._scans: dict[int, deque[_Scan]] = {}

    def watch(self, frames: Iterable[Frame | SkippedFrame]) -> Generator[Frame | SkippedFrame]:
        """The same frames, whose clouds are counted."""
        for item in frames:
            if isinstance(item, Frame):
                for sensor, cloud in item.clouds.items():
                    self._add(sensor, _Scan(cloud.stamp_ns, counted_returns(cloud.xyz_m)))
            yield item

    @property
    def first(self) -> dict[int, str]:
        """By LiDAR, from which second on it first has fewer returns, and how many are left where."""
        return {
            sensor: f"from {(loss.stamp_ns - (self._begin_ns or 0)) / NANOSECONDS:.1f} s on {100 * loss.share:.0f} % "
            f"of the returns of just before are left {_where(loss.cells)}"
            for sensor, loss in self._first.items()
        }

    def _add(self, sensor: int, scan: _Scan) -> None:
        self._begin_ns = scan.stamp_ns if self._begin_ns is None else self._begin_ns
        scans = self._scans.setdefault(sensor, deque(maxlen=2 * FEWER_RETURNS.scans))
        if scans and not 0 < scan.stamp_ns - scans[-1].stamp_ns <= FEWER_RETURNS.most_apart_s * NANOSECONDS:
            scans.clear()
        if sensor in self._lost:
            loss = self._lost[sensor]
            if scan.returns[loss.cells].sum() < FEWER_RETURNS.again * loss.before[loss.cells].sum():
                self.counts[sensor] += 1
                return
            del self._lost[sensor]
            scans.clear()
        scans.append(scan)
        begins = _loss(scans) if len(scans) == scans.maxlen else None
        if begins is not None:
            self._first.setdefault(sensor, begins)
            self._lost[sensor] = begins
            self.counts[sensor] += FEWER_RETURNS.scans


def counted_returns(xyz_m: Points) -> Integers:
    """(C,) the returns of a cloud (N, 3) in all, in sectors, in bands of beams, and beyond ranges; some of many."""
    some_m = xyz_m[:: FEWER_RETURNS.every]
    x, y, z = some_m[np.isfinite(some_m).all(axis=1) & some_m.any(axis=1)].T
    across_m = np.hypot(x, y)
    azimuth, elevation = np.degrees(np.arctan2(y, x)) % _TURN, np.degrees(np.arctan2(z, across_m))
    sectors = np.bincount((azimuth / _STEP_DEG).astype(np.intp) % _SECTORS, minlength=_SECTORS)
    bands = np.bincount((elevation + _UP).astype(np.intp), minlength=_BANDS + 1)[: _BANDS + 1]
    away_m = np.hypot(across_m, z)
    beyond = [np.count_nonzero(away_m > limit_m) for limit_m in FEWER_RETURNS.beyond_m]
    around = np.sum([np.roll(sectors, -shift) for shift in range(FEWER_RETURNS.steps)], axis=0)
    return np.concatenate([[x.size], around, bands[:-1] + bands[1:], beyond]).astype(np.int64)


def _loss(scans: Iterable[_Scan]) -> _Loss | None:
    """What the later half of some scans lost against the earlier one.

    What only lies elsewhere, as a wall that comes nearer, is missing in no part of all.
    """
    returns = np.stack([scan.returns for scan in scans]).astype(np.float64)
    before, after = returns[: FEWER_RETURNS.scans].min(axis=0), returns[FEWER_RETURNS.scans :].max(axis=0)
    enough = before >= max(FEWER_RETURNS.fewest, FEWER_RETURNS.least_share * before[0])
    missing = float(np.median(returns[: FEWER_RETURNS.scans, 0]) - np.median(returns[FEWER_RETURNS.scans :, 0]))
    cells = np.asarray(enough & (after < _LEFT * before) & (missing > FEWER_RETURNS.missing * (before - after)))
    if not cells.any():
        return None
    cells[0] &= not cells[1:].any()  # a part says more than all
    stamp_ns = [scan.stamp_ns for scan in scans][FEWER_RETURNS.scans]
    return _Loss(stamp_ns, cells, before, float(after[cells].sum() / before[cells].sum()))


def _where(cells: Mask) -> str:
    """The cells in words."""
    sectors, bands, beyond = np.split(cells[1:], [_SECTORS, _SECTORS + _BANDS])
    if beyond.any():
        return f"beyond {FEWER_RETURNS.beyond_m[int(beyond.argmax())]:g} m"
    if sectors.any() and not sectors.all():
        begins, ends = (np.flatnonzero(sectors & ~np.roll(sectors, shift)) for shift in (1, -1))
        width = int(((ends - begins[0]) % _SECTORS).min()) + FEWER_RETURNS.steps
        more = " and elsewhere" if begins.size > 1 else ""
        from_deg, to_deg = (place * _STEP_DEG % _TURN for place in (int(begins[0]), int(begins[0]) + width))
        return f"from about {from_deg} to {to_deg} degrees, counted from ahead to the left{more}"
    if bands.any():
        lowest, highest = np.flatnonzero(bands)[[0, -1]]
        return f"{lowest - _UP} to {highest + 2 - _UP} degrees above the horizon"
    return "in all"
