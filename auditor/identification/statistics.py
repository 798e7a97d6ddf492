"""The statistics of the sensor checks, from counts on grids; and means of scores over the temporal window."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations, islice
from math import ceil, inf

import numpy as np
from numpy.typing import NDArray

from auditor.identification.evidence_parameters import STRETCHES
from auditor.identification.parameters import HIERARCHY, TEMPORAL_WINDOW, WINDOWED_MEAN
from auditor.model.arrays import Flags, Floats, Floats32, Indices, Integers, Mask, quantile_of
from auditor.model.checks import (
    DIRECTION_CHECKS,
    FEWEST_VOTERS,
    OF_ALIKE,
    SHARE_CHECKS,
    SIGNED_CHECKS,
    Check,
    CountedPair,
    SensorCheck,
)
from auditor.model.checks.kind import CellUnit, Vote
from auditor.model.measurement import LIGHT_STEPS, NO_FINGERPRINT, Cells
from auditor.model.parameters import IMAGE_WINDOW
from auditor.model.stamps import NANOSECONDS

_STRETCH_STEP = 0.2  # of a stretch, after which the next begins: most of one is the next one's as well


Grid = NDArray[np.integer]
"""Counts of pixels or points a cell: (..., rows, columns)."""

MIN_FRAMES = 2
"""Frames that must be equal to the one before them: one repeat alone occurs where frames are faster than a sensor."""

_VALUES_AT_ONCE = 65_536
"""Values of which medians are taken in one call, of several columns where they are short: memory stays bounded."""

_HIGHEST = np.float32(1)
"""No mean is larger."""


@dataclass(frozen=True)
class Window:
    """A window of `rows` x `columns` cells, to whose pixels `pseudo_count` consistent ones are added.

    So a window with few pixels has a small mean; with fewer than `fewest` it has none.
    """

    rows: int
    columns: int
    pseudo_count: int
    fewest: int


@dataclass(frozen=True, eq=False)
class WindowMeans:
    """The means of all windows of V grids, (V, rows, columns), and which of them have enough pixels to be known."""

    means: Floats32
    known: Mask

    def of(self, places: Sequence[int]) -> "WindowMeans":
        """Those of some of the grids."""
        return WindowMeans(self.means.take(places, axis=0), self.known.take(places, axis=0))

    @property
    def opposite(self) -> "WindowMeans":
        """The same with the other sign."""
        return WindowMeans(-self.means, self.known)


CONFLICT_WINDOW = Window(
    *WINDOWED_MEAN.directions, WINDOWED_MEAN.conflict_pseudo_count, WINDOWED_MEAN.conflict_pseudo_count // 2
)
"""Of cells of the LiDAR's directions. 40 points are half of what 64 beams usually give; for fewer see `fitted`."""

LOST_WINDOW = Window(*WINDOWED_MEAN.directions, WINDOWED_MEAN.lost_pseudo_count, WINDOWED_MEAN.lost_pseudo_count // 2)
"""Of cells of the LiDAR's directions: a window is as wide as a car 25 m away."""

CAMERA_WINDOW = Window(*IMAGE_WINDOW.cells, IMAGE_WINDOW.pseudo_count, IMAGE_WINDOW.pseudo_count)
"""Of cells of 8 x 8 px: 48 x 64 px of half-resolution pixels."""

_WINDOWS = {CellUnit.POINTS: CONFLICT_WINDOW, CellUnit.SURFACES: LOST_WINDOW}


def sensor_statistics(
    sensor_checks: Sequence[SensorCheck],
    cells: Mapping[CountedPair, Cells],
    shares: Mapping[SensorCheck, float],
) -> tuple[float | None, ...]:
    """The statistic of each sensor check in a frame, 0 to 1, None where it was not measured.

    `cells` holds the counts of the checks that are counted on grids, `shares` the statistics of the others.
    """
    of_subjects = _by_subject(cells)
    means_of = cache(lambda *subject: window_means_of(of_subjects[subject], cells))  # of those that are asked for
    coloured = {camera for one in cells if one.check.kind.of_colours for camera in (one.i, one.k)}

    def statistic(sensor_check: SensorCheck) -> float | None:
        """What the voters of a check say together; None where one that it needs says nothing."""
        kind = sensor_check.check.kind
        if sensor_check.check in SHARE_CHECKS:
            return _least_share(sensor_check, shares) if kind.of in OF_ALIKE else shares.get(sensor_check)
        if sensor_check.check in DIRECTION_CHECKS:
            grids = of_subjects.get((sensor_check.check, sensor_check.sensor), [])
            pairs = [place for place, pair in enumerate(grids) if {pair.i, pair.k} <= set(sensor_check.others)]
            return (
                vote(sensor_check.check, means_of(sensor_check.check, sensor_check.sensor).of(pairs)) if pairs else None
            )
        counted = sensor_check.check.counted_as
        others = [grid.other for grid in of_subjects.get((counted, sensor_check.sensor), [])]
        able = [other for other in sensor_check.others if other in others]
        if not able or (len(able) < len(sensor_check.others) and not kind.of_colours):
            return None
        voters = means_of(counted, sensor_check.sensor).of([others.index(other) for other in able])
        alike = np.array([(other in coloured) == (sensor_check.sensor in coloured) for other in able], dtype=np.bool_)
        return vote(sensor_check.check, voters.opposite if kind.opposite_of else voters, alike)

    return tuple(statistic(one) for one in sensor_checks)


def _least_share(sensor_check: SensorCheck, shares: Mapping[SensorCheck, float]) -> float | None:
    """The least of what each voter alone says of a sensor; None where one of them says nothing.

    Where two say it together it is the least of each two of the voters that can.
    """
    if sensor_check.check.kind.by_two_others:
        pairs = (sensor_check._replace(others=pair) for pair in combinations(sensor_check.others, FEWEST_VOTERS))
        return min((shares[pair] for pair in pairs if pair in shares), default=None)
    said = [shares.get(sensor_check._replace(others=(other,))) for other in sensor_check.others]
    measured = [share for share in said if share is not None]
    return min(measured) if len(measured) == len(said) else None


def _by_subject(cells: Mapping[CountedPair, Cells]) -> dict[tuple[Check, int], list[CountedPair]]:
    """The grids of each check and sensor."""
    grids: dict[tuple[Check, int], list[CountedPair]] = {}
    for counted in cells:
        grids.setdefault((counted.check, counted.sensor), []).append(counted)
    return grids


def window_means_of(grids: Sequence[CountedPair], cells: Mapping[CountedPair, Cells]) -> WindowMeans:
    """The mean residual, or the share of inconsistent pixels or points, of each window of some grids of one check."""
    [check] = {counted.check for counted in grids}
    valid, total = (np.stack([getattr(cells[counted], name) for counted in grids]) for name in ("valid", "total"))
    window = _WINDOWS.get(check.kind.counted, CAMERA_WINDOW)
    steps = LIGHT_STEPS if check in SIGNED_CHECKS else 1
    N, B = window_sums(valid, window), window_sums(total, window)
    windows = [fitted(window, one) for one in N] if check.kind.counted is CellUnit.POINTS else [window] * len(N)
    pseudo_count, fewest = (
        np.array([getattr(one, name) for one in windows], dtype=N.dtype)[:, None, None]
        for name in ("pseudo_count", "fewest")
    )
    # Whole numbers of 24 bits: the quotient is that of double precision, rounded.
    return WindowMeans(np.divide(B, (N + pseudo_count) * steps, dtype=np.float32), fewest <= N)


def vote(check: Check, voters: WindowMeans, alike: Flags | None = None) -> float | None:
    """The largest over all windows of what a sensor's voters say of it there; None where no window has enough voters.

    A camera's voters are other cameras, the LiDAR's are pairs. Two at least must have compared the window, where there
    are two; and where some of a camera's voters have colours as it has, or are grey as it is, and others are not, one
    of those `alike` (V,) at least: plants are brighter in near infrared, so that all others share one error.

    Of conflicts and of light of one colour it is the voters' mean. Light only adds, and a voter that is attacked
    itself says the opposite or nothing: so added light is the mean of two voters, and of more the geometric mean of
    their mean and of the smallest. For removed light and inconsistencies, which an attacked voter shows as well, and
    for lost returns, it is the smallest.
    """
    if len(voters.means) == 1:  # whatever is made of one voter's means is what it says
        return _largest(voters.means[0], voters.known[0])
    enough = _enough(voters, alike)
    how = check.kind.vote
    if how is Vote.MEAN or (how is Vote.LIGHT and len(voters.means) <= FEWEST_VOTERS):
        return _largest(_mean(voters), enough)
    smallest = np.minimum.reduce(np.where(voters.known, voters.means, _HIGHEST))
    if how is Vote.LIGHT:
        smallest = np.sqrt(np.maximum(_mean(voters), 0) * np.maximum(smallest, 0))
    return _largest(smallest, enough)


def _mean(voters: WindowMeans) -> Floats:
    """(rows, columns) the mean of what is known, 0 where nothing is."""
    total = np.add.reduce(np.where(voters.known, voters.means, np.float32(0)))
    return np.divide(total, np.maximum(_count(voters), 1), dtype=np.float64)


def _enough(voters: WindowMeans, alike: Flags | None) -> Mask:
    """(rows, columns) the windows that two voters compared, and of those alike one at least, where there are any."""
    enough = _count(voters) >= FEWEST_VOTERS
    return enough & voters.known[alike].any(axis=0) if alike is not None and alike.any() else enough


def _largest(said: NDArray[np.floating], enough: Mask) -> float | None:
    """The largest of (rows, columns) where enough voters compared a window; 0 at least."""
    compared = said[enough]
    return max(float(compared.max()), 0.0) if compared.size else None


def _count(voters: WindowMeans) -> Integers:
    return np.asarray(np.add.reduce(voters.known, dtype=np.uint8))


def fitted(window: Window, sums: Integers) -> Window:
    """The window for LiDARs of fewer beams: its pseudo-count is half of a dense window's count, 15 points at least.

    `sums` are the valid points of the frame's own windows; dense is the 90th percentile of those that hold any: neither
    the sky nor an attacked part of the view moves it much. It is never larger than that of `window`, and the fewest
    points shrink with it.
    """
    held = np.sort(sums[sums > 0])
    dense = quantile_of(held, WINDOWED_MEAN.dense_quantile) if held.size else 0.0
    pseudo_count = max(round(WINDOWED_MEAN.share_of_dense * dense), WINDOWED_MEAN.smallest_pseudo_count)
    pseudo_count = min(pseudo_count, window.pseudo_count)
    return replace(window, pseudo_count=pseudo_count, fewest=window.fewest * pseudo_count // window.pseudo_count)


def window_sums(grids: Grid, window: Window) -> Integers:
    """The sums of every whole window of (..., rows, columns) counts; none where a grid is smaller than a window."""
    *many, rows, columns = grids.shape
    table = np.zeros((*many, rows + 1, columns + 1), dtype=np.int32)
    np.cumsum(np.cumsum(grids, axis=-2, dtype=np.int32), axis=-1, out=table[..., 1:, 1:])
    r, c = window.rows, window.columns
    return np.asarray(table[..., r:, c:] - table[..., :-r, c:] - table[..., r:, :-c] + table[..., :-r, :-c])


def runs_of(stamp_ns: Integers) -> Integers:
    """(F,) the number of the run that each successive frame belongs to: runs end at gaps.

    A gap is a step of more than 2.5 times the median step, or one back: there the clock was set.
    """
    step = np.diff(stamp_ns, prepend=stamp_ns[:1])
    usual = np.median(step[1:]) if step.size > 1 else 0
    return np.asarray(np.cumsum((step < 0) | (step > TEMPORAL_WINDOW.gap_periods * usual)))


def stretch_medians(columns: Iterable[Floats], stamp_ns: Integers) -> Iterator[Floats]:
    """Of each column (F,) of values the (P,) medians of what was measured in stretches of a drive, with F stamps.

    A stretch has as many frames as are usual in its seconds, a few at least or all, and most of it is the next one's as
    well. Those in which nothing was measured have none.
    """
    F = len(stamp_ns)
    if not F:
        yield from columns
        return
    period = float(np.median(np.diff(stamp_ns))) if F > 1 else 0.0
    usual = HIERARCHY.stretch_s * NANOSECONDS / period if period > 0 else inf
    W = int(min(max(usual, STRETCHES.fewest_frames), F))
    step = max(W * _STRETCH_STEP, 1)
    first = np.rint(np.linspace(0, F - W, ceil((F - W) / step) + 1)).astype(np.int64)
    places = first[:, None] + np.arange(W)
    together = max(_VALUES_AT_ONCE // places.size, 1)  # NumPy takes as long for a few values as for thousands
    left = iter(columns)
    while several := [values[places] for values in islice(left, together)]:
        for medians, measured in zip(*measured_medians(np.stack(several)), strict=True):
            yield medians[measured > 0]


def measured_medians(values: Floats) -> tuple[Floats, Integers]:
    """The medians along the last axis of what was measured, NaN where nothing was, and how many values that were."""
    ordered, W = np.sort(values, axis=-1), values.shape[-1]  # NaN last
    if not np.isnan(ordered[..., -1]).any():
        measured = np.full(values.shape[:-1], W)
        lower, upper = ordered[..., (W - 1) // 2], ordered[..., W // 2]
    else:
        measured = np.count_nonzero(~np.isnan(ordered), axis=-1)
        lower, upper = (
            np.take_along_axis(ordered, place[..., None], axis=-1)[..., 0]
            for place in (np.maximum(measured - 1, 0) // 2, measured // 2)
        )
    return np.asarray((lower + upper) / 2), np.asarray(measured)


def window_bounds(stamp_ns: Integers, seconds: float, runs: Integers) -> tuple[Indices, Indices]:
    """(F,) the first frame within `seconds` / 2 of each frame of its run, and the frame after the last."""
    half = int(seconds * NANOSECONDS / 2)
    step = np.diff(stamp_ns, prepend=stamp_ns[:1])
    time_ns = np.cumsum(step * (np.diff(runs, prepend=runs[:1]) == 0))  # a gap takes no time: no window reaches across
    first = np.maximum(np.searchsorted(time_ns, time_ns - half, side="left"), np.searchsorted(runs, runs, side="left"))
    end = np.minimum(np.searchsorted(time_ns, time_ns + half, side="right"), np.searchsorted(runs, runs, side="right"))
    return first, end


def window_maxima(values: Floats, stamp_ns: Integers, seconds: float, runs: Integers | None = None) -> Floats:
    """(F,) the largest measured of values (F,) in the windows of `window_means`; NaN where nothing was."""
    first, end = window_bounds(stamp_ns, seconds, runs_of(stamp_ns) if runs is None else runs)
    measured = np.where(np.isnan(values), -np.inf, values)
    largest = np.array([measured[one:after].max() for one, after in zip(first.tolist(), end.tolist(), strict=True)])
    return np.where(np.isfinite(largest), largest, np.nan)


def window_means(z: Floats, stamp_ns: Integers, seconds: float, runs: Integers | None = None) -> Floats:
    """(F, M) means of the measured scores within `seconds` / 2 of each frame, never across two runs.

    `z` is (F, M), NaN where not measured, of successive frames with their stamps (F,); `runs` (F,) numbers their runs
    in ascending order where they are known, else they are `runs_of` the stamps. Where nothing in the window was
    measured the mean is NaN.
    """
    first, end = window_bounds(stamp_ns, seconds, runs_of(stamp_ns) if runs is None else runs)
    measured = ~np.isnan(z)
    total = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(np.where(measured, z, 0), axis=0)])
    count = np.vstack([np.zeros((1, z.shape[1])), np.cumsum(measured, axis=0)])
    number = count[end] - count[first]
    return np.where(number > 0, (total[end] - total[first]) / np.maximum(number, 1), np.nan)


def frozen(prints: Integers, present: Flags, *, replayed: bool = False) -> Flags:
    """(F, S) whether a sensor's data are frozen in a frame, from the fingerprints (F, S) of F successive frames.

    They are where they equal those of the frame before, at two successive steps or more, while another sensor's data
    changed at each of these steps. Where no sensor's data change no sensor is frozen, but the frame is `repeated`. A
    sensor that is not `present` (F, S), or has no fingerprint, is not frozen. With `replayed` data of any earlier frame
    count as those of the frame before: no sensor shows the same twice.
    """
    still, changed = _steps(prints, present)
    if replayed:
        again = _again(prints, present)
        still, changed = still | again, changed & ~again
    return np.asarray(_in_long_runs(still & changed.any(axis=1, keepdims=True), MIN_FRAMES))


def repeated(prints: Integers, present: Flags) -> Flags:
    """(F,) whether a frame has nothing new: at least one sensor repeats its data of the frame before, and none changes.

    `prints` and `present` are those of `frozen`.
    """
    still, changed = _steps(prints, present)
    return np.asarray(still.any(axis=1) & ~changed.any(axis=1))


def _steps(prints: Integers, present: Flags) -> tuple[Flags, Flags]:
    """(F, S) whether a sensor's data are those of the frame before, and (F, S) whether they are others."""
    printed = present & (prints != NO_FINGERPRINT)
    both, same = printed[1:] & printed[:-1], prints[1:] == prints[:-1]
    still, changed = np.zeros((2, *present.shape), dtype=np.bool_)
    still[1:], changed[1:] = both & same, both & ~same
    return still, changed


def _again(prints: Integers, present: Flags) -> Flags:
    """(F, S) whether a sensor had the same data in an earlier frame."""
    printed, again = present & (prints != NO_FINGERPRINT), np.zeros_like(present)
    for column, places in enumerate(map(np.flatnonzero, printed.T)):
        _, first, which = np.unique(prints[places, column], return_index=True, return_inverse=True)
        again[places, column] = first[which] < np.arange(len(places))
    return again


def _in_long_runs(still: Flags, length: int) -> Flags:
    """The entries that belong to a run of at least `length` down a column."""
    starts = np.ones((max(len(still) - length + 1, 0), still.shape[1]), dtype=np.bool_)
    for step in range(length):
        starts &= still[step : step + len(starts)]
    result = np.zeros_like(still)
    for step in range(length):
        result[step : step + len(starts)] |= starts
    return result
