"""The evaluation page's tables and plots of the object-level baseline."""

from collections.abc import Iterator, Sequence
from typing import Any

from auditor.model.rig import Triple
from auditor.reporting.evaluation import published
from auditor.reporting.evaluation.answers import R_SHOWN, Answers, Rows, names, percent, rate_of, size_of, subsets
from auditor.reporting.evaluation.page import LEFT_OUT, Cell, Grid, PageRow, Rate, Sheet
from auditor.reporting.evaluation.plots import Panel, PlotAxes, RatePoint, rate_panel

OBJECT_RATES = ("0.01", "0.05")
"""The designated false-alarm rates that the page shows of the baseline."""

_LEARNT_NOTHING = "any object without a partner raises a frame"
_WALL_TICKS = tuple((width, f"{width:g}") for width in (0.5, 1.0, 1.5, 2.0, 2.5))
_RADIUS_TICKS = tuple((radius, f"{radius:g}") for radius in (37.5, 112.5, 187.5))


def object_grids(answers: Answers) -> dict[str, list[Grid]]:
    """The tables, by the part of the page that they belong to."""
    detectors = _detectors(answers.rows["objects"])
    return {
        "objects": [
            grid
            for name, rows in detectors
            for mode in (None, *answers.modes)
            for grid in _average(answers, name, rows, mode)
        ],
        "object_combinations": [
            _combinations(answers, number, name, rows) for name, rows in detectors for number in answers.scenarios
        ],
        "precision": [_precisions(name, rows) for name, rows in _kinds(answers.rows["average_precision"])],
    }


def object_sheets(answers: Answers) -> dict[str, list[Sheet]]:
    """The plots, by the part of the page that they belong to."""
    panels = [_panel(name, rows) for name, rows in _kinds(answers.rows["average_precision"])]
    legend = (("line any", "clean frames"), ("line wall", "wall"), ("line mild", "mild"), ("line opaque", "opaque"))
    sheet = Sheet("Average precision by size of the attack", published.PRECISION, tuple(panels), legend, left_out=False)
    return {"precision": [sheet] if panels else []}


def _detectors(rows: Rows) -> list[tuple[str, Rows]]:
    """Rows by detector; those of one name are distinguished by their id."""
    rows_of: dict[tuple[str, str], Rows] = {}
    for row in rows:
        rows_of.setdefault((row["detector"], row["detector_id"]), []).append(row)
    alone = [name for name, _ in rows_of]
    return [
        (name if alone.count(name) == 1 else f"{name} ({known})", of_it) for (name, known), of_it in rows_of.items()
    ]


def _average(answers: Answers, detector: str, rows: Rows, mode: str | None) -> Iterator[Grid]:
    """Detection averaged over the seven combinations, with the clean frames that are raised as well."""
    row_of = {
        (row["iou"], row["r"], row["i"], row["j"], row["strength"]): row
        for row in rows
        if row["left_out"] == mode and row["attacked"] is None
    }
    rates = [None] if mode is None else [float(r) for r in OBJECT_RATES]

    def cells(iou: str, r: float | None) -> Iterator[Cell]:
        for number, (i, j, _) in answers.scenarios.items():
            of_it = [row_of.get((float(iou), r, i, j, strength)) for strength in answers.strengths]
            calm = next((row for row in of_it if row), None)
            yield published.BASELINE[iou][number - 1]
            yield from (_detected(row) if row else None for row in of_it)
            yield _raised(calm) if calm else None

    if row_of:
        width = 2 + len(answers.strengths)
        yield Grid(
            title=f"{detector}; {LEFT_OUT[mode] if mode else _LEARNT_NOTHING}",
            groups=tuple((f"Scenario {n}: {names(t)}", width) for n, t in answers.scenarios.items()),
            columns=("paper", *answers.strengths, "clean") * len(answers.scenarios),
            rows=tuple(
                PageRow(f"IoU {iou}" + ("" if r is None else f", r = {percent(str(r))}"), tuple(cells(iou, r)))
                for iou in published.BASELINE
                for r in rates
            ),
        )


def _detected(row: dict[str, Any]) -> Rate:
    """Attacked frames that are raised; a rule that learns nothing has no r to resolve."""
    return rate_of({**row, "resolvable": row["resolvable"] is not False}, "detected")


def _raised(row: dict[str, Any]) -> Rate:
    """Clean frames that are raised."""
    resolvable = row["resolvable"] is not False
    return Rate(row["raised"], row["frames"], row["false_alarm_low"], row["false_alarm_high"], resolvable)


def _combinations(answers: Answers, number: int, detector: str, rows: Rows) -> Grid:
    """By attacked sensors at one r, left out by blocks where that could be done."""
    triple: Triple = answers.scenarios[number]
    mode = "block" if "block" in answers.modes else answers.modes[0]
    row_of = {
        (row["iou"], row["strength"], tuple(row["attacked"])): rate_of(row, "detected")
        for row in rows
        if (row["left_out"], row["r"], row["i"], row["j"]) == (mode, R_SHOWN, triple.i, triple.j) and row["attacked"]
    }
    return Grid(
        title=f"Scenario {number}: {names(triple)}; {detector}; {LEFT_OUT[mode]}",
        groups=tuple((f"IoU {iou}", len(answers.strengths)) for iou in published.BASELINE),
        columns=tuple(answers.strengths) * len(published.BASELINE),
        rows=tuple(
            PageRow(
                names(attacked),
                tuple(row_of.get((float(iou), s, attacked)) for iou in published.BASELINE for s in answers.strengths),
            )
            for attacked in subsets(triple)
        ),
    )


def _kinds(rows: Rows) -> list[tuple[str, Rows]]:
    """Rows of average precision by detector, sensor and kind of object, named; kinds without a label are left out."""
    rows_of: dict[str, Rows] = {}
    for detector, of_it in _detectors(rows):
        for row in of_it:
            objects = f"{row['label']} by {detector} in the {'point cloud' if row['sensor'] == 'lidar' else 'image'}"
            rows_of.setdefault(f"{objects}, IoU {row['iou']:g}", []).append(row)
    return [(name, of_it) for name, of_it in rows_of.items() if any(row["truths"] for row in of_it)]


def _precisions(title: str, rows: Rows) -> Grid:
    strengths = list(dict.fromkeys(row["strength"] for row in rows if row["size"] is not None))
    row_of = {(row["size"], row["strength"]): row for row in rows}
    sizes = {row["size"]: row for row in rows if row["size"] is not None}

    def cell(size: float | None, strength: str | None) -> Cell:
        row = row_of.get((size, strength))
        return None if row is None or row["average_precision"] is None else f"{row['average_precision']:.3f}"

    truths = max((row["truths"] for row in rows), default=0)
    return Grid(
        title=f"{title}; {truths:,} to be found in clean frames",
        groups=(("average precision", max(len(strengths), 1)),),
        columns=tuple(strength or "wall" for strength in strengths) or ("clean",),
        rows=(
            PageRow("clean", tuple(cell(None, None) for _ in strengths) or (cell(None, None),)),
            *(PageRow(size_of(row), tuple(cell(size, s) for s in strengths)) for size, row in sorted(sizes.items())),
        ),
    )


def _panel(title: str, rows: Rows) -> Panel:
    walls = rows[0]["sensor"] == "lidar"
    axes = PlotAxes(0.3, 2.7) if walls else PlotAxes(20.0, 240.0)
    ends = (0.5, 2.5) if walls else (37.5, 225.0)
    lines = []
    for strength in dict.fromkeys(row["strength"] for row in rows if row["size"] is not None):
        of_it = [row for row in rows if row["size"] is not None and row["strength"] == strength]
        points = [
            _point(row["size"], row["average_precision"]) for row in of_it if row["average_precision"] is not None
        ]
        lines.append(axes.line(points, f"line {strength or 'wall'}", marked=True))
    clean = [row["average_precision"] for row in rows if row["size"] is None and row["average_precision"] is not None]
    if clean:
        lines.append(axes.line([_point(x, clean[0]) for x in ends], "line any"))
    ticks: Sequence[tuple[float, str]] = _WALL_TICKS if walls else _RADIUS_TICKS
    return rate_panel(title, "width of the wall / m" if walls else "R / px", ticks, lines, axes)


def _point(x: float, y: float) -> RatePoint:
    return RatePoint(x, y, y, y)
