"""The plots of the evaluation page."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from auditor.model.rig import Triple
from auditor.reporting.evaluation import published
from auditor.reporting.evaluation.answers import CURVE_RATES, ROLES, Answers, Sensors, names, subsets
from auditor.reporting.evaluation.page import Rate, Sheet
from auditor.reporting.evaluation.plots import Axes, Panel, Point, histogram_panel, rate_panel

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
    axes = Axes(0.0, 1.0)
    lines = []
    for mode, dashes in (("nothing", ""), ("block", " dashed")):
        for s in answers.strengths:
            points = [
                Point(float(r), rate.share, rate.low, rate.high)
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
    found = _histograms(answers, triple)
    panels = [
        histogram_panel(names(attacked), _against(found, attacked, answers.strengths)) for attacked in subsets(triple)
    ]
    title = f"Distributions of E, Scenario {number}: {names(triple)}"
    return Sheet(title, published.DISTRIBUTIONS[number], tuple(panels), _BARS_LEGEND)


def _panel(answers: Answers) -> Iterator[Sheet]:
    """Fig. 9: each triple of the n = 3 system, while none and while each one of its sensors is attacked."""
    for system in answers.systems[:1]:
        triples = [t for t in answers.rig.triples if t.k == answers.rig.n and set(t) <= set(system)]
        panels = []
        for triple in triples:
            found = _histograms(answers, triple)
            for attacked in ((), *((sensor,) for sensor in system)):
                title = f"E of {names(triple)}; {names(attacked) or 'none'} attacked"
                panels.append(histogram_panel(title, _against(found, attacked, answers.strengths)))
        yield Sheet("Distributions by triple and attacked sensor", published.PANEL, tuple(panels), _BARS_LEGEND)


def _sensitivity_curves(answers: Answers) -> Iterator[Sheet]:
    rows = answers.rows["sensitivity"]
    if not rows:
        return
    walls = [(width, f"{width:g}") for width in (0.5, 1.0, 1.5, 2.0, 2.5)]
    radii = [(radius, f"{radius:g}") for radius in (37.5, 112.5, 187.5)]
    panels = []
    for sensor, x_label, ticks, axes in (
        ("lidar", "width of the wall / m", walls, Axes(0.3, 2.7)),
        ("reference", "R / px", radii, Axes(20.0, 240.0)),
        ("source", "R / px", radii, Axes(20.0, 240.0)),
    ):
        lines = []
        for mode, dashes in (("nothing", ""), ("block", " dashed")):
            of_it = [row for row in rows if row["sensor"] == sensor and row["left_out"] == mode]
            for strength in dict.fromkeys(row["strength"] for row in of_it):
                points = [
                    Point(row["size"], row["rate"], row["low"], row["high"])
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
    found: Mapping[tuple[Sensors, str | None], list[int]], attacked: Sensors, strengths: Sequence[str]
) -> list[tuple[str, list[int]]]:
    """Clean frames below, the weakest and the strongest attack over them."""
    drawn = [("bar clean", found[(), None])]
    ends = dict.fromkeys((*strengths[:1], *strengths[-1:]))
    drawn += [(f"bar {s}", found[attacked, s]) for s in ends if (attacked, s) in found]
    return drawn
