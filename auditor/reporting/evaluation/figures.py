"""The plots of the evaluation page."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from auditor.model.rig import Triple
from auditor.reporting.evaluation import published
from auditor.reporting.evaluation.answers import (
    CURVE_RATES,
    R_SHOWN,
    ROLES,
    SHORT_ROLES,
    Answers,
    Rows,
    Sensors,
    names,
    percent,
    rate_of,
    size_of,
    subsets,
)
from auditor.reporting.evaluation.page import LEFT_OUT, Cell, Grid, PageRow, Rate, Sheet
from auditor.reporting.evaluation.plots import Panel, PlotAxes, RatePoint, histogram_panel, rate_panel
from auditor.reporting.evaluation.tables import described

_STRENGTH_LEGEND = (("line mild", "mild"), ("line strong", "strong"), ("line opaque", "opaque"))


def sheets(answers: Answers) -> dict[str, list[Sheet]]:
    """All plots, by the part of the page that they belong to."""
    return {
        "detection": [_detection_curves(answers, number) for number in answers.scenarios],
        "distribution": [*(_distributions(answers, number) for number in answers.scenarios), *_panel(answers)],
        "identification": [_identification_curves(answers, system) for system in answers.systems[:1]],
        "sensitivity": list(_sensitivity_curves(answers)),
    }


def _curve(answers: Answers, title: str, key: Sensors, source: Mapping[Any, Rate], which: object) -> Panel:
    axes = PlotAxes(0.0, 1.0)
    lines = []
    for mode, dashes in (("nothing", ""), ("block", " dashed")):
        for s in answers.strengths:
            points = [
                RatePoint(float(r), rate.share, rate.low, rate.high)
                for r in CURVE_RATES
                if (rate := source.get((mode, which, s, key, float(r)))) is not None
            ]
            lines.append(axes.line(points, f"line {s}{dashes}"))
    return rate_panel(title, "r", [(0.0, "0"), (0.25, ""), (0.5, "0.5"), (0.75, ""), (1.0, "1")], lines, axes)


def _detection_curves(answers: Answers, number: int) -> Sheet:
    triple = answers.scenarios[number]
    panels = [_curve(answers, names(attacked), attacked, answers.detection, triple) for attacked in subsets(triple)]
    title = f"Detection rate against r, Scenario {number}: E of {names(triple)}"
    return Sheet(title, published.CURVES[number], tuple(panels), _STRENGTH_LEGEND)


def _identification_curves(answers: Answers, system: Sensors) -> Sheet:
    panels = [_curve(answers, f"S_{s}", (s,), answers.identification, len(system)) for s in system]
    title = f"Identification rate against r: {names(system)}"
    return Sheet(title, published.IDENTIFICATION_CURVES, tuple(panels), _STRENGTH_LEGEND)


def _histograms(answers: Answers, triple: Triple) -> dict[tuple[Sensors, str | None], list[int]]:
    rows = [r for r in answers.rows["distribution"] if (r["i"], r["j"], r["k"]) == triple]
    return {(tuple(row["attacked"]), row["strength"]): row["histogram"] for row in rows}


def _distributions(answers: Answers, number: int) -> Sheet:
    triple = answers.scenarios[number]
    histograms = _histograms(answers, triple)
    panels = [
        histogram_panel(names(attacked), _against(histograms, attacked, answers.strengths))
        for attacked in subsets(triple)
    ]
    title = f"Distributions of E, Scenario {number}: {names(triple)}"
    return Sheet(title, published.DISTRIBUTIONS[number], tuple(panels), _BARS_LEGEND)


def _panel(answers: Answers) -> Iterator[Sheet]:
    """Fig. 9: each triple of the n = 3 system, while none and while each one of its sensors is attacked."""
    for system in answers.systems[:1]:
        triples = [t for t in answers.rig.triples if t.k == answers.rig.n and set(t) <= set(system)]
        panels = []
        for triple in triples:
            histograms = _histograms(answers, triple)
            for attacked in ((), *((sensor,) for sensor in system)):
                title = f"E of {names(triple)}; {names(attacked) or 'none'} attacked"
                panels.append(histogram_panel(title, _against(histograms, attacked, answers.strengths)))
        yield Sheet("Distributions by triple and attacked sensor", published.PANEL, tuple(panels), _BARS_LEGEND)


def _sensitivity_curves(answers: Answers) -> Iterator[Sheet]:
    rows = answers.rows["sensitivity"]
    if not rows:
        return
    walls = [(width, f"{width:g}") for width in (0.5, 1.0, 1.5, 2.0, 2.5)]
    radii = [(radius, f"{radius:g}") for radius in (37.5, 112.5, 187.5)]
    panels = []
    for sensor, x_label, ticks, axes in (
        ("lidar", "width of the wall / m", walls, PlotAxes(0.3, 2.7)),
        ("reference", "R / px", radii, PlotAxes(20.0, 240.0)),
        ("source", "R / px", radii, PlotAxes(20.0, 240.0)),
    ):
        lines = []
        for mode, dashes in (("nothing", ""), ("block", " dashed")):
            of_it = [row for row in rows if row["sensor"] == sensor and row["left_out"] == mode]
            for strength in dict.fromkeys(row["strength"] for row in of_it):
                points = [
                    RatePoint(row["size"], row["rate"], row["low"], row["high"])
                    for row in of_it
                    if row["strength"] == strength
                ]
                style = f"line {strength or 'wall'}{dashes}"
                lines.append(axes.line(points, style, marked=mode == "nothing"))
        panels.append(rate_panel(ROLES[sensor], x_label, ticks, lines, axes))
    legend = (("line wall", "wall"), ("line mild", "mild"), ("line opaque", "opaque"))
    yield Sheet(
        "Detection rate at r = 1 % by size of the attack",
        f"{published.WALLS} {published.FACULAS}",
        tuple(panels),
        legend,
    )


_BARS_LEGEND = (("bar clean", "clean"), ("bar mild", "mild"), ("bar opaque", "opaque"))


def _against(
    histograms: Mapping[tuple[Sensors, str | None], list[int]], attacked: Sensors, strengths: Sequence[str]
) -> list[tuple[str, list[int]]]:
    """Clean frames below, the weakest and the strongest attack over them."""
    drawn = [("bar clean", histograms[(), None])]
    ends = dict.fromkeys((*strengths[:1], *strengths[-1:]))
    drawn += [(f"bar {s}", histograms[attacked, s]) for s in ends if (attacked, s) in histograms]
    return drawn


METHODS = ("paper", "robust")

Lookup = Callable[[Answers, str], Cell]
"""One method's answers in one way of leaving frames out."""


def by_method(rows: Mapping[str, Rows], method: str) -> dict[str, Rows]:
    """The answers of one method; those that know no methods are the paper's."""
    return {name: [row for row in of_it if row.get("method", METHODS[0]) == method] for name, of_it in rows.items()}


_INTERVAL_OF = {
    ("false_alarms", "not_clean"): "not_clean_",
    ("identification", "misnamed"): "misnaming_",
    ("further", "named"): "naming_",
}
"""What the ends of a count's interval begin with, where it is not the query's first count."""


def method_grids(paper: Answers, robust: Answers) -> dict[str, list[Grid]]:
    """The tables that compare them, all at r = 1 %; none where the robust method has judged nothing."""
    if not robust.modes:
        return {"methods": []}
    parts = {
        "Attacks of the paper": [*_not_clean(paper), *_detection(paper), *_identification(paper), *_misnamed(paper)],
        "How small an attack is detected": list(_sensitivity(paper)),
        "Attacks and faults beyond those of the paper": list(_further(paper)),
    }
    return {"methods": [_grid(f"{t}, r = {percent(str(R_SHOWN))}", r, (paper, robust)) for t, r in parts.items() if r]}


def _grid(title: str, rows: list[tuple[str, Lookup]], methods: tuple[Answers, Answers]) -> Grid:
    modes = [mode for mode in LEFT_OUT if any(mode in one.modes for one in methods)]
    return Grid(
        title=title,
        groups=tuple((LEFT_OUT[mode], len(methods)) for mode in modes),
        columns=("E", "robust") * len(modes),
        rows=tuple(PageRow(label, tuple(look(one, mode) for mode in modes for one in methods)) for label, look in rows),
    )


def _not_clean(answers: Answers) -> Iterator[tuple[str, Lookup]]:
    systems = dict.fromkeys(tuple(row["system"]) for row in answers.rows["false_alarms"])
    for system in sorted(systems, key=len):
        if system in answers.systems or len(system) == len(answers.rig.sensors):
            where = {"r": R_SHOWN, "system": list(system)}
            yield f"clean frames that are not clean, {names(system)}", _looking("false_alarms", "not_clean", **where)


def _detection(answers: Answers) -> Iterator[tuple[str, Lookup]]:
    for number, triple in answers.scenarios.items():
        for strength in answers.strengths:
            where = {"r": R_SHOWN, "strength": strength, "attacked": None, **triple._asdict()}
            yield f"detected in Scenario {number}, {strength}", _looking("detection", "detected", **where)


def _identification(answers: Answers) -> Iterator[tuple[str, Lookup]]:
    for label, where in _attacked(answers):
        yield f"{label}: exactly named", _looking("identification", "named", **where)


def _misnamed(answers: Answers) -> Iterator[tuple[str, Lookup]]:
    for label, where in _attacked(answers):
        yield f"{label}: a sensor named that was not", _looking("identification", "misnamed", **where)


def _attacked(answers: Answers) -> Iterator[tuple[str, dict[str, object]]]:
    """One or two attacked sensors of each system, by strength, in words and as what the query tells them apart by."""
    for system in answers.systems:
        for size in (1, 2)[: len(system) - 3]:
            for strength in answers.strengths:
                where = {"r": R_SHOWN, "strength": strength, "attacked": None, "attacked_sensors": size}
                yield (
                    f"{('one', 'two')[size - 1]} of {len(system)} sensors attacked, {strength}",
                    {"system": list(system), **where},
                )


def _sensitivity(answers: Answers) -> Iterator[tuple[str, Lookup]]:
    kinds = {(row["sensor"], row["strength"] or "", row["size"]): row for row in answers.rows["sensitivity"]}
    for (sensor, strength, size), row in sorted(kinds.items()):
        attack = f"{strength} facula on the {SHORT_ROLES[sensor]}" if strength else "wall"
        where = {"sensor": sensor, "strength": strength or None, "size": size}
        yield f"{attack}, {size_of(row)}", _looking("sensitivity", "detected", **where)


def _further(answers: Answers) -> Iterator[tuple[str, Lookup]]:
    everyone = [row for row in answers.rows["further"] if len(row["system"]) == len(answers.rig.sensors)]
    kinds = {(described(row), tuple(row["attacked"])): row for row in everyone}
    for (kind, attacked), row in kinds.items():
        where = {name: row[name] for name in ("system", "attack", "variant", "size", "attacked")}
        yield f"{kind} on {names(attacked)}: detected", _looking("further", "detected", **where)
        if answers.rig.max_attacked:
            yield f"{kind} on {names(attacked)}: named", _looking("further", "named", **where)


def _looking(query: str, counted: str, **where: object) -> Lookup:
    """The rate of the one row of a query that has these values."""

    def look(answers: Answers, mode: str) -> Cell:
        for row in answers.rows[query]:
            if row["left_out"] == mode and all(row[name] == value for name, value in where.items()):
                prefix = _INTERVAL_OF.get((query, counted), "")
                return rate_of({**row, "low": row[f"{prefix}low"], "high": row[f"{prefix}high"]}, counted)
        return None

    return look
