"""Geometry of the evaluation page's small panels: curves, bars and whiskers in pixels. No markup is made here."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from auditor.reporting.plots import Tick

WIDTH_PX, HEIGHT_PX = 248, 168
LEFT_PX, RIGHT_PX, TOP_PX, BOTTOM_PX = 34, 240, 8, 140


@dataclass(frozen=True)
class Line:
    """A curve as SVG path data, with its style; `whiskers` are the intervals of its points, `dots` its points."""

    path: str
    style: str
    whiskers: str = ""
    dots: str = ""


@dataclass(frozen=True)
class Bar:
    """One bar of a histogram."""

    x_px: float
    y_px: float
    width_px: float
    height_px: float
    style: str


@dataclass(frozen=True)
class Panel:
    """One small plot: what it shows in words, what lies on its axes, and its marks."""

    title: str
    x_label: str
    x_ticks: tuple[Tick, ...]
    y_ticks: tuple[Tick, ...]
    lines: tuple[Line, ...] = ()
    bars: tuple[Bar, ...] = ()


@dataclass(frozen=True)
class RatePoint:
    """One rate with its interval, at x."""

    x: float
    y: float
    low: float
    high: float


class PlotAxes:
    """x from `first` to `last` and shares from 0 to 1, in pixels."""

    def __init__(self, first: float, last: float) -> None:
        self._first, self._span = first, last - first

    def x(self, value: float) -> float:
        """Pixels from the left."""
        return round(LEFT_PX + (value - self._first) / self._span * (RIGHT_PX - LEFT_PX), 2)

    @staticmethod
    def y(share: float) -> float:
        """Pixels from the top."""
        return round(BOTTOM_PX - share * (BOTTOM_PX - TOP_PX), 2)

    def line(self, points: Sequence[RatePoint], style: str, *, marked: bool = False) -> Line:
        """A curve through the points; `marked` with a dot and its interval at each."""
        path = "".join(f"{'L' if at else 'M'}{self.x(p.x)} {self.y(p.y)}" for at, p in enumerate(points))
        if not marked:
            return Line(path, style)
        whiskers = "".join(f"M{self.x(p.x)} {self.y(p.low)}V{self.y(p.high)}" for p in points)
        dots = "".join(f"M{self.x(p.x)} {self.y(p.y)}h0" for p in points)
        return Line(path, style, whiskers, dots)

    def bars(self, counts: Sequence[int], style: str, highest: float) -> Iterable[Bar]:
        """A histogram of shares of all counts, over bins of equal width between 0 and 1; `highest` fills the panel."""
        total = sum(counts)
        for at, count in enumerate(counts):
            if count:
                left, right = self.x(at / len(counts)), self.x((at + 1) / len(counts))
                top = self.y(count / total / highest)
                yield Bar(left, top, round(right - left, 2), round(BOTTOM_PX - top, 2), style)


SHARES = tuple(Tick(PlotAxes.y(share), f"{share:.0%}") for share in (0.0, 0.5, 1.0))


def rate_panel(
    title: str, x_label: str, ticks: Sequence[tuple[float, str]], lines: Iterable[Line], axes: PlotAxes
) -> Panel:
    """A panel of rates between 0 and 100 %."""
    return Panel(title, x_label, tuple(Tick(axes.x(at), text) for at, text in ticks), SHARES, tuple(lines))


def histogram_panel(title: str, groups: Sequence[tuple[str, Sequence[int]]]) -> Panel:
    """Histograms of E between 0 and 1, drawn over each other; all reach as high as the highest bar needs."""
    axes = PlotAxes(0.0, 1.0)
    shares = [count / sum(counts) for _, counts in groups for count in counts if count]
    highest = max(shares, default=1.0)
    bars = tuple(bar for style, counts in groups for bar in axes.bars(counts, style, highest))
    ticks = tuple(Tick(axes.x(at), f"{at:g}") for at in (0.0, 0.25, 0.5, 0.75, 1.0))
    return Panel(title, "E", ticks, (Tick(PlotAxes.y(0.0), "0"), Tick(PlotAxes.y(1.0), f"{highest:.0%}")), bars=bars)
