"""Geometry of a report's plots: what the templates draw, in pixels of one drawing. No markup is made here.

A plotting library would draw the same with axes of its own. It is not used because a page must be one small file that
opens anywhere without scripts or fonts, in which the templates escape every text of a recording and lines take the
page's own styles. What remains to be worked out is ticks and paths.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median

from auditor.model.rig import Triple

WIDTH_PX = 1020
LEFT_PX = 138
RIGHT_PX = 930
NS_PER_S = 1e9
MINUS = "\u2212"

STRIP_STEP_PX = 19
MOST_DOTS = 240
MOST_POINTS = 800
NARROWEST_LABEL_PX = 24
PX_PER_LETTER = 7
MINUTES_FROM_S = 300.0

SEVERITY = ("", "clean", "0", "not_auditable", "-", "suspect", "unidentified", "attacked", "truth", "1")
"""Where many frames fall on one pixel the strip shows the state that stands last here."""


@dataclass(frozen=True)
class Tick:
    """A mark on an axis."""

    at_px: float
    label: str


@dataclass(frozen=True)
class Cell:
    """A run of equal states on a strip; `label` is empty where it would not fit."""

    x_px: float
    width_px: float
    state: str
    label: str = ""


@dataclass(frozen=True)
class Strip:
    """One row of states over time: a verdict, a ground truth or one element of the e vector."""

    name: str
    triple: Triple | None
    y_px: float
    cells: tuple[Cell, ...]


@dataclass(frozen=True)
class Chart:
    """One value against its theta over time, as an SVG path: E of a triple, or the largest z of a sensor's checks.

    `name` and `indices` are its label, `mark` that of theta; `path` is broken where it was not measured; `above` and
    `below` are dots, each a segment of no length.
    """

    name: str
    indices: tuple[int, ...]
    top_px: float
    bottom_px: float
    path: str
    above: str
    below: str
    theta: float | None
    theta_y_px: float | None
    mark: str
    ticks: tuple[Tick, ...]


@dataclass(frozen=True)
class Figure:
    """Charts and strips over one time axis; `shaded` are the spans to mark behind all of them."""

    height_px: float
    charts: tuple[Chart, ...]
    strips: tuple[Strip, ...]
    shaded: tuple[Cell, ...]
    ticks: tuple[Tick, ...]
    axis_y_px: float
    unit: str


@dataclass(frozen=True)
class StripRow:
    """What one strip shows: a state for each stamp, drawn where the state is not empty. `labels` name the runs."""

    name: str
    stamps_ns: Sequence[int]
    states: Sequence[str]
    labels: Sequence[str] = ()
    triple: Triple | None = None


@dataclass(frozen=True)
class Series:
    """What one chart shows: a value for each stamp, None where not measured, and theta, None where there is none.

    `name` and `indices` say which: E and a triple, or S and a sensor. `mark` is what theta is called.
    """

    name: str
    indices: tuple[int, ...]
    values: Sequence[float | None]
    theta: float | None
    mark: str = "θ"


class TimeAxis:
    """Stamps in ns to pixels; it spans all stamps and half a period more on either side."""

    def __init__(self, stamps_ns: Sequence[int], origin_ns: int) -> None:
        self.period_ns = median_period_ns(stamps_ns)
        self.low_ns = stamps_ns[0] - self.period_ns / 2
        self.high_ns = stamps_ns[-1] + self.period_ns / 2
        self.origin_ns = origin_ns
        self._scale = (RIGHT_PX - LEFT_PX) / max(self.high_ns - self.low_ns, 1.0)

    def px(self, stamp_ns: float) -> float:
        """Horizontal position of a stamp, kept inside the plot."""
        at = LEFT_PX + (stamp_ns - self.low_ns) * self._scale
        return round(min(max(at, LEFT_PX), RIGHT_PX), 1)

    @property
    def unit(self) -> str:
        """The unit of the tick labels."""
        return "min" if self._unit_s() > 1 else "s"

    def ticks(self) -> tuple[Tick, ...]:
        """Ticks at round times after the origin."""
        unit_ns = self._unit_s() * NS_PER_S
        low, high = (self.low_ns - self.origin_ns) / unit_ns, (self.high_ns - self.origin_ns) / unit_ns
        return tuple(
            Tick(self.px(self.origin_ns + value * unit_ns), label) for value, label in round_values(low, high, 9)
        )

    def _unit_s(self) -> float:
        return 60.0 if (self.high_ns - self.low_ns) / NS_PER_S > MINUTES_FROM_S else 1.0


def median_period_ns(stamps_ns: Sequence[int]) -> float:
    """The median distance of ascending stamps; a tenth of a second where there are not two."""
    gaps = [after - before for before, after in pairwise(stamps_ns)]
    return float(median(gaps)) if gaps else 0.1 * NS_PER_S


def round_values(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """At most about `most` round numbers from low to high, each with its label."""
    span = high - low
    if not (math.isfinite(span) and span > 0):
        return []
    power = 10.0 ** math.floor(math.log10(span / most))
    step = next(power * factor for factor in (1, 2, 5, 10) if span / (power * factor) <= most)
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [(index * step, f"{index * step:.{decimals}f}".replace("-", MINUS)) for index in range(first, last + 1)]


def draw(
    stamps_ns: Sequence[int],
    *,
    origin_ns: int,
    series: Sequence[Series] = (),
    rows: Sequence[StripRow] = (),
    shaded: Sequence[tuple[int, int]] = (),
) -> Figure:
    """Lay out charts, then strips, over one time axis. `shaded` are the first and last stamps of spans.

    All charts share one vertical scale, so that they compare at a glance.
    """
    axis = TimeAxis(stamps_ns, origin_ns)
    top = 8.0
    charts: list[Chart] = []
    height = 84.0 if len(series) <= 4 else 52.0 if len(series) <= 10 else 34.0
    highest = _highest(series)
    for curve in series:
        charts.append(_chart(curve, stamps_ns, axis, highest=highest, top=top, bottom=top + height))
        top += height + 12
    strips: list[Strip] = []
    top += 4 if charts else 0
    for row in rows:
        strips.append(_strip(row, axis, top))
        top += STRIP_STEP_PX
    spans = tuple(Cell(*_extent(axis, first, last, axis.period_ns), "shaded") for first, last in shaded)
    return Figure(top + 34, tuple(charts), tuple(strips), spans, axis.ticks(), top, axis.unit)


def _highest(series: Sequence[Series]) -> float:
    values = [E for one in series for E in one.values if E is not None]
    values += [one.theta for one in series if one.theta is not None]
    return max([*values, 0.05]) * 1.06


def _chart(
    series: Series, stamps_ns: Sequence[int], axis: TimeAxis, *, highest: float, top: float, bottom: float
) -> Chart:
    def y_px(E: float) -> float:
        return round(bottom - min(max(E, 0.0), highest) / highest * (bottom - top), 1)

    points = list(zip(stamps_ns, series.values, strict=True))
    dots: dict[bool, list[str]] = {True: [], False: []}
    for stamp, E in points if len(points) <= MOST_DOTS else ():
        if E is not None:
            dots[series.theta is not None and series.theta < E].append(f"M{axis.px(stamp):g} {y_px(E):g}h0")
    return Chart(
        name=series.name,
        indices=series.indices,
        top_px=top,
        bottom_px=bottom,
        path=_path([(axis.px(stamp), None if E is None else y_px(E), stamp) for stamp, E in _thin(points)], axis),
        above="".join(dots[True]),
        below="".join(dots[False]),
        theta=series.theta,
        theta_y_px=y_px(series.theta) if series.theta is not None and series.theta >= 0 else None,
        mark=series.mark,
        ticks=tuple(
            Tick(y_px(value), label) for value, label in round_values(0.0, highest, 3 if bottom - top < 60 else 4)
        ),
    )


def _thin(points: Sequence[tuple[int, float | None]]) -> list[tuple[int, float | None]]:
    """The least and the greatest E of each of many short spans, so that no extreme is lost; few points stay."""
    if len(points) <= MOST_POINTS:
        return list(points)
    size = math.ceil(len(points) / (MOST_POINTS / 2))
    thinned: list[tuple[int, float | None]] = []
    for start in range(0, len(points), size):
        part = points[start : start + size]
        measured = [(E, stamp) for stamp, E in part if E is not None]
        if not measured:
            thinned.append((part[0][0], None))
            continue
        extremes = {min(measured), max(measured)}
        thinned += [(stamp, E) for E, stamp in sorted(extremes, key=lambda pair: pair[1])]
    return thinned


def _path(points: Sequence[tuple[float, float | None, int]], axis: TimeAxis) -> str:
    """SVG path data, broken where a value is missing or two stamps lie further apart than neighbours do."""
    furthest = 2.5 * median_period_ns([stamp for _, _, stamp in points]) if len(points) > 1 else axis.period_ns
    parts: list[str] = []
    before: int | None = None
    for x, y, stamp in points:
        if y is None:
            before = None
            continue
        joined = before is not None and stamp - before <= furthest
        parts.append(f"{'L' if joined else 'M'}{x:g} {y:g}")
        before = stamp
    return "".join(parts)


def _strip(row: StripRow, axis: TimeAxis, top: float) -> Strip:
    frames = _dense(row)
    period_ns = median_period_ns([stamp for stamp, _, _ in frames])
    cells = []
    for run in _runs(frames, 1.6 * period_ns):
        (first_ns, state, label), (last_ns, _, _) = run[0], run[-1]
        x, width = _extent(axis, first_ns, last_ns, period_ns)
        fits = width >= max(NARROWEST_LABEL_PX, PX_PER_LETTER * len(label))
        if state:
            cells.append(Cell(x, width, state, label if fits else ""))
    return Strip(row.name, row.triple, top, tuple(cells))


def _dense(row: StripRow) -> list[tuple[int, str, str]]:
    """(stamp, state, label) of each frame; of each short span its gravest frame, where there are more than pixels."""
    labels = row.labels or [""] * len(row.states)
    frames = list(zip(row.stamps_ns, row.states, labels, strict=True))
    size = math.ceil(len(frames) / MOST_POINTS)
    if size <= 1:
        return frames
    parts = (frames[start : start + size] for start in range(0, len(frames), size))
    return [max(part, key=lambda frame: SEVERITY.index(frame[1])) for part in parts]


def _runs(frames: Sequence[tuple[int, str, str]], reach_ns: float) -> Iterator[list[tuple[int, str, str]]]:
    """Neighbouring frames of one state and label, cut where two lie further apart than `reach_ns`."""
    run: list[tuple[int, str, str]] = []
    for frame in frames:
        if run and (frame[1:] != run[-1][1:] or frame[0] - run[-1][0] > reach_ns):
            yield run
            run = []
        run.append(frame)
    if run:
        yield run


def _extent(axis: TimeAxis, first_ns: int, last_ns: int, period_ns: float) -> tuple[float, float]:
    """Left edge and width of a run of frames, each of which lasts one period."""
    left, right = axis.px(first_ns - period_ns / 2), axis.px(last_ns + period_ns / 2)
    return left, round(max(right - left, 0.75), 1)
