"""Drift: whether what a vehicle's sensor measures changes over the days, and since when.

A series has one level a day. It is cut into stretches of days, in each of which the level lies on a line: a drive in a
workshop ends one stretch and begins another, a camera that turns slowly has a line that is not level. How much levels
differ from day to day by chance is learnt from the fleet itself, and what all vehicles share (a season, an update) is
subtracted before. All chances are corrected for the number of series.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from itertools import chain, groupby
from math import erfc, exp, sqrt
from operator import attrgetter
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from auditor.identification.parameters import FAULT_SCORES
from auditor.identification.refresh_parameters import DRIFT
from auditor.model.arrays import Floats, Integers

_OF_A_DEVIATION = 0.6744897501960817
"""The median absolute deviation of a standard normal variable; its square is the median of a chi-squared one."""
_PARTS = 5  # of the vehicles, each of which has the tails of the others
_TAILS = (0.01, 0.05, 0.16, 0.5, 0.84, 0.95, 0.99)
"""Shares of a fleet's days, whose levels are made normal: quantiles out to two deviations and more."""
_FEWEST_OF_STRETCH = 3
"""Days of a stretch, of which a series has two: a line has two points, and one more shows its noise."""
_FEWEST_VEHICLES = 3  # of a day whose median is the fleet's: one vehicle alone does not move that of three

RAISED_FROM: Mapping[str, float] = {"row_offset": FAULT_SCORES.tilted_by_px, "depth_bias": FAULT_SCORES.biased_by_px}
"""By check the level, in px, from which a frame's own verdict says that a camera is displaced."""


class SeriesName(NamedTuple):
    """What a series is of. `kind` is what vehicles share that are compared: rig kind and way of measuring."""

    kind: str
    check: str
    sensors: tuple[int, ...]
    vehicle: str


@dataclass(frozen=True, eq=False)
class DailyLevels:
    """The levels of a comparison of sensors: `day` (K,) ascending, in days since 1970, and `level` (K,), finite.

    Where it is `signed` the level is that of the first of two sensors minus that of the second.
    """

    name: SeriesName
    signed: bool
    day: Integers
    level: Floats


@dataclass(frozen=True)
class LevelShift:
    """A level that changed: it was `before` until the day `after_day`, and is `now` from `on_day`, the next with data.

    `chance` is how likely as large a change is somewhere in a fleet without drift.
    """

    after_day: int
    on_day: int
    before: float
    now: float
    chance: float


@dataclass(frozen=True)
class Drift:
    """What became of a check of a sensor, which is the one of `name.sensors`.

    `level` is the median of the last days, `deviation` how much a day's level differs by chance, `per_day` the slope
    since the last change beyond that of the fleet, `chance` how likely as steep a slope is somewhere in a fleet without
    drift, `changes` are in order of time.
    """

    name: SeriesName
    levels: DailyLevels = field(compare=False, repr=False)
    level: float
    deviation: float
    per_day: float
    chance: float
    changes: tuple[LevelShift, ...]

    @property
    def trending(self) -> bool:
        """Whether it drifts now."""
        return self.chance < DRIFT.false_alarms

    @property
    def named(self) -> bool:
        """Whether it drifts or has changed."""
        return self.trending or bool(self.changes)

    @property
    def days_left(self) -> float | None:
        """Days at this slope until frames are raised as those of a displaced camera; None where that is not known."""
        limit = RAISED_FROM.get(self.name.check)
        if limit is None or not self.trending or self.level * self.per_day <= 0:
            return None
        return max(limit - abs(self.level), 0.0) / abs(self.per_day)


@dataclass(frozen=True, eq=False)
class _AdjustedLevels:
    """Levels without what the fleet shares: `own` (K,) about 0, with the `deviation` of a day by chance.

    `score` (K,) is as unusual as the same number of a standard normal variable, extremes drawn in.
    """

    levels: DailyLevels
    own: Floats
    score: Floats
    deviation: float = 0.0


def drifts(comparisons: Sequence[DailyLevels], least: Callable[[str], float]) -> list[Drift]:
    """What became of each check of each sensor, by name; those of fewer days than two stretches are left out.

    `least` gives by check the smallest deviation that is believed: less is not worth a visit to a workshop.
    """
    measured = [
        _AdjustedLevels(one, one.level, one.level) for one in comparisons if len(one.day) >= 2 * _FEWEST_OF_STRETCH
    ]
    own = _each(measured, attrgetter("kind", "check", "sensors"), _without_the_fleet)
    noisy = _each(own, attrgetter("kind", "check"), lambda some: _noisy(some, least(some[0].levels.name.check)))
    ready = _each(noisy, attrgetter("kind", "check", "vehicle"), _of_sensors)
    tests = DRIFT.rougher * 2 * max(len(ready), 1)
    return [_drift(one, tests) for one in ready]


def _each(
    series: Sequence[_AdjustedLevels],
    parts: Callable[[SeriesName], Any],
    change: Callable[[Sequence[_AdjustedLevels]], Iterator[_AdjustedLevels]],
) -> list[_AdjustedLevels]:
    """What becomes of series in groups that share parts of their names."""
    ordered = sorted(series, key=lambda one: (parts(one.levels.name), one.levels.name))
    groups = groupby(ordered, lambda one: parts(one.levels.name))
    return [found for _, group in groups for found in change(list(group))]


def _without_the_fleet(series: Sequence[_AdjustedLevels]) -> Iterator[_AdjustedLevels]:
    """Each series about its own median, less the median of the fleet on days on which enough vehicles drove."""
    days = np.unique(np.concatenate([one.levels.day for one in series]))
    centred = np.full((len(series), len(days)), np.nan)
    for row, levels in enumerate(series):
        centred[row, np.searchsorted(days, levels.levels.day)] = levels.own - np.median(levels.own)
    shared = np.zeros(len(days))
    many = np.count_nonzero(~np.isnan(centred), axis=0) >= _FEWEST_VEHICLES
    if many.any():
        shared[many] = np.nanmedian(centred[:, many], axis=0)
    for row, levels in enumerate(series):
        residual = (centred[row] - shared)[np.searchsorted(days, levels.levels.day)]
        yield replace(levels, own=residual - np.median(residual))


def _of_sensors(comparisons: Sequence[_AdjustedLevels]) -> Iterator[_AdjustedLevels]:
    """The series of each sensor: its own level moves as far as all of its comparisons do, the same way.

    Where a camera turns, its pairs with all others change; of another camera one pair does, and the rest do not. Two
    sensors that are compared with each other alone drift together: which of them it is cannot be told.
    """
    for sensor in sorted({sensor for one in comparisons for sensor in one.levels.name.sensors}):
        mine = [one for one in comparisons if sensor in one.levels.name.sensors]
        day = reduce(np.intersect1d, [one.levels.day for one in mine])
        if len(day) < 2 * _FEWEST_OF_STRETCH:
            continue
        signs = [-1.0 if one.levels.signed and one.levels.name.sensors[0] != sensor else 1.0 for one in mine]
        places = [np.searchsorted(one.levels.day, day) for one in mine]
        level = np.mean([s * one.levels.level[p] for s, one, p in zip(signs, mine, places, strict=True)], axis=0)
        own, score = (
            _least(np.array([s * values[p] for s, values, p in zip(signs, parts, places, strict=True)]))
            for parts in ([one.own for one in mine], [one.score for one in mine])
        )
        name = mine[0].levels.name._replace(sensors=(sensor,))
        # What moves as little as the least of several differs by chance no more than any of them.
        deviation = min(one.deviation for one in mine)
        yield _AdjustedLevels(DailyLevels(name, signed=False, day=day, level=level), own, score, deviation)


def _least(values: Floats) -> Floats:
    """(K,) of (C, K) values the least where all have one sign, else 0."""
    alike = np.abs(np.sum(np.sign(values), axis=0)) == len(values)
    return np.asarray(np.where(alike, np.sign(values[0]) * np.min(np.abs(values), axis=0), 0.0))


def _noisy(series: Sequence[_AdjustedLevels], least: float) -> Iterator[_AdjustedLevels]:
    """The series of a check with the deviation of a day, which they learn from each other.

    Sensors differ: days that have two levels in one of them are rough, and those of the others are not. So the tails
    are those of the check or of the same sensors in the other vehicles, whichever are longer; and so is the deviation,
    of all vehicles.
    """
    tiny = float(np.finfo(np.float64).tiny)
    typical = _typical(series)
    by_sensors: dict[tuple[int, ...], list[_AdjustedLevels]] = defaultdict(list)
    for levels in series:
        by_sensors[levels.levels.name.sensors].append(levels)
    alike = {sensors: some for sensors, some in by_sensors.items() if len(some) >= _FEWEST_VEHICLES}
    of_sensors = {sensors: _typical(some) for sensors, some in alike.items()}
    deviations = [
        max(typical, of_sensors.get(one.levels.name.sensors, 0.0), _spread_of_steps(one.own), least, tiny)
        for one in series
    ]
    standard = {one.levels.name: one.own / deviation for one, deviation in zip(series, deviations, strict=True)}
    of_others = dict(chain.from_iterable(_tails_of_others(some, standard) for some in alike.values()))
    of_all = _tails(list(standard.values()))
    scores = [
        _drawn_in(_as_normal(values, of_all, of_others.get(name, of_all)), DRIFT.extreme)
        for name, values in standard.items()
    ]
    wider = _widening(scores)
    for levels, score, deviation in zip(series, scores, deviations, strict=True):
        yield replace(levels, score=score / wider, deviation=deviation * wider)


def _typical(series: Sequence[_AdjustedLevels]) -> float:
    """The deviation of a day in these series together."""
    pooled = np.concatenate([one.own for one in series])
    return _spread(pooled) * (1 + DRIFT.margin / sqrt(len(pooled)))


def _tails(standard: Sequence[Floats]) -> Floats:
    """The quantiles of `_TAILS` in the middle one of these series: one that drifts does not move them."""
    return np.asarray(np.median([np.quantile(values, _TAILS) for values in standard], axis=0))


def _tails_of_others(
    series: Sequence[_AdjustedLevels], standard: Mapping[SeriesName, Floats]
) -> Iterator[tuple[SeriesName, Floats]]:
    """By series the quantiles of all days of the others together, in so many parts of the vehicles.

    Days of few levels that hardly ever differ have no tails of their own where there are few of them.
    """
    values = [standard[one.levels.name] for one in series]
    parts = range(min(_PARTS, len(series)))
    tails = [
        np.quantile(np.concatenate([one for place, one in enumerate(values) if place % len(parts) != part]), _TAILS)
        for part in parts
    ]
    return ((one.levels.name, tails[place % len(parts)]) for place, one in enumerate(series))


def _as_normal(values: Floats, *tails: Floats) -> Floats:
    """Values that are as unusual as these, by the `tails` of the fleet's days, were they normal: never further off.

    Days whose tails are rough, or long on one side, would else give more alarms than is said.
    """
    normal = np.array([NormalDist().inv_cdf(share) for share in _TAILS])
    knots = np.sign(normal) * np.maximum(np.abs(normal), np.max(np.sign(normal) * tails, axis=0))
    inside = np.interp(values, knots, normal)
    beyond = np.where(values < knots[0], values * normal[0] / knots[0], values * normal[-1] / knots[-1])
    return np.asarray(np.where((values < knots[0]) | (values > knots[-1]), beyond, inside))


def _spread(values: Floats) -> float:
    """The standard deviation by the median absolute deviation."""
    return float(np.median(np.abs(values - np.median(values)))) / _OF_A_DEVIATION


def _spread_of_steps(values: Floats) -> float:
    """The standard deviation of a day by the steps from day to day, which neither drift nor a change widens much."""
    return float(np.median(np.abs(np.diff(values)))) / _OF_A_DEVIATION / sqrt(2)


def _widening(scores: Sequence[Floats]) -> float:
    """By how much means of the fleet's days are wider than those of normal days without memory, at least 1.

    A vehicle that drives one road for a week has days that resemble each other; snow has days that are far off.
    """
    rough = float(np.median([sqrt(float(np.mean(one**2))) for one in scores]))
    alike = float(np.clip(np.median([_likeness(one) for one in scores]), 0.0, DRIFT.most_alike))
    return max(rough, 1.0) * sqrt((1 + alike) / (1 - alike))


def _likeness(values: Floats) -> float:
    """The correlation of a day with the next one, without the bias of few days; 0 where all days are the same."""
    count, square = len(values), float(values @ values)
    correlation = float(values[1:] @ values[:-1]) / square if square > 0 else 0.0
    return (count * correlation + 1) / (count - 4)


def _drawn_in(values: Floats, most: float) -> Floats:
    """The values, none further than `most` from the median of the days around it: one odd day is no change."""
    half = DRIFT.days_around // 2
    around = np.median(sliding_window_view(np.pad(values, half, mode="reflect"), DRIFT.days_around), axis=1)
    return np.clip(values, around - most, around + most)


def _slope_score(day: Integers, scores: Floats) -> float:
    """The slope of a line through scores over its standard deviation."""
    apart = day - np.mean(day)
    return float(apart @ scores) / sqrt(float(apart @ apart))


def _drift(levels: _AdjustedLevels, tests: float) -> Drift:
    day, level = levels.levels.day, levels.levels.level
    cuts = _cuts(levels, 0, len(day), tests)
    places = sorted(cuts)
    starts, ends = [0, *places], [*places, len(day)]
    last = slice(starts[-1], None)
    searched = len(day) if cuts else 1
    steep = abs(_slope_score(day[last], levels.score[last]))
    return Drift(
        name=levels.levels.name,
        levels=levels.levels,
        level=float(np.median(level[last][-_FEWEST_OF_STRETCH:])),
        deviation=levels.deviation,
        per_day=_slope(day[last], levels.own[last]),
        chance=min(erfc(steep / sqrt(2)) * tests * searched, 1.0),
        changes=tuple(
            LevelShift(
                after_day=int(day[cut - 1]),
                on_day=int(day[cut]),
                before=float(np.median(level[start:cut][-DRIFT.days_beside :])),
                now=float(np.median(level[cut:end][: DRIFT.days_beside])),
                chance=cuts[cut],
            )
            for start, cut, end in zip(starts, places, ends[1:], strict=False)
        ),
    )


def _cuts(levels: _AdjustedLevels, start: int, end: int, tests: float) -> dict[int, float]:
    """Where a stretch is cut in two, and these again, each with its chance: two lines fit far better than one.

    Where no line changes, the squared error that a cut saves is chi-squared with two degrees of freedom.
    """
    least = _FEWEST_OF_STRETCH
    cuts = np.arange(start + least, end - least + 1)
    if len(cuts) == 0:
        return {}
    day, score = levels.levels.day[start:end].astype(np.float64), levels.score[start:end]
    before, after = _squared_errors(day, score), _squared_errors(day[::-1], score[::-1])[::-1]
    saved = before[-1] - before[cuts - start - 1] - after[cuts - start]
    best = int(np.argmax(saved))
    chance = len(levels.score) * tests * exp(-max(float(saved[best]), 0.0) / 2)
    if chance >= DRIFT.false_alarms:
        return {}
    cut = int(cuts[best])
    return {cut: chance} | _cuts(levels, start, cut, tests) | _cuts(levels, cut, end, tests)


def _squared_errors(day: Floats, values: Floats) -> Floats:
    """(K,) the squared error of the line through the first one, two, ... of the values."""
    count = np.arange(1, len(day) + 1)
    x, y = day - day[0], values - values[0]
    sums = {name: np.cumsum(one) for name, one in (("x", x), ("y", y), ("xx", x * x), ("xy", x * y), ("yy", y * y))}
    xx = sums["xx"] - sums["x"] ** 2 / count
    xy = sums["xy"] - sums["x"] * sums["y"] / count
    yy = sums["yy"] - sums["y"] ** 2 / count
    return np.asarray(yy - np.divide(xy**2, xx, out=np.zeros_like(xx), where=xx > 0))


def _slope(day: Integers, values: Floats) -> float:
    """The median of the slopes between all pairs of days (Theil and Sen)."""
    first, second = np.triu_indices(len(day), k=1)
    return float(np.median((values[second] - values[first]) / (day[second] - day[first])))
