"""The tables of the evaluation page."""

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Any

from auditor.model.rig import LIDAR
from auditor.reporting.evaluation import published
from auditor.reporting.evaluation.answers import (
    R_SHOWN,
    ROLES,
    Answers,
    Sensors,
    names,
    percent,
    rate_of,
    size_of,
    subsets,
)
from auditor.reporting.evaluation.page import LEFT_OUT, Cell, Grid, PageRow

_UNITS = {
    "hidden sector": "°",
    "turned LiDAR": "°",
    "shifted camera": " row(s)",
    "delay": " frame(s)",
    "stripes": " grey levels",
    "scattered points": " points",
}


def grids(answers: Answers) -> dict[str, list[Grid]]:
    """All tables, by the part of the page that they belong to."""
    return {
        "detection": [_detection(answers, mode) for mode in answers.modes],
        "combinations": [_combinations(answers, number) for number in answers.scenarios],
        "identification": [
            _identification(answers, mode, system) for system in answers.systems for mode in answers.modes
        ],
        "sensitivity": list(_sensitivity(answers)),
        "further": list(_further(answers)),
        "false_alarms": [_false_alarms(answers, mode) for mode in answers.modes],
        "confusion": [_confusion(answers, system) for system in answers.systems[:1]],
    }


def _detection(answers: Answers, mode: str) -> Grid:
    def cells(r: str) -> Iterator[Cell]:
        for number, triple in answers.scenarios.items():
            yield published.DETECTION[number][r]
            yield from (answers.detection.get((mode, triple, s, None, float(r))) for s in answers.strengths)

    return Grid(
        title=LEFT_OUT[mode],
        groups=tuple((f"Scenario {n}: {names(t)}", 1 + len(answers.strengths)) for n, t in answers.scenarios.items()),
        columns=("paper", *answers.strengths) * len(answers.scenarios),
        rows=tuple(PageRow(f"r = {percent(r)}", tuple(cells(r))) for r in published.TABLE_RATES),
    )


def _combinations(answers: Answers, number: int) -> Grid:
    triple = answers.scenarios[number]
    return Grid(
        title=f"Scenario {number}: {names(triple)}",
        groups=tuple((LEFT_OUT[mode], len(answers.strengths)) for mode in answers.modes),
        columns=tuple(answers.strengths) * len(answers.modes),
        rows=tuple(
            PageRow(
                names(attacked),
                tuple(
                    answers.detection.get((mode, triple, s, attacked, R_SHOWN))
                    for mode in answers.modes
                    for s in answers.strengths
                ),
            )
            for attacked in subsets(triple)
        ),
    )


def _identification(answers: Answers, mode: str, system: Sensors) -> Grid:
    """Of four sensors the paper's Table II with its figures, of more the average of one and of two attacked."""

    def cell(strength: str, key: Sensors | int, r: str) -> Cell:
        return answers.identification.get((mode, len(system), strength, key, float(r)))

    title = f"{names(system)}; {LEFT_OUT[mode]}"
    if len(system) > 4:
        sizes = [size for size in (1, 2) if size <= len(system) - 3]
        return Grid(
            title,
            tuple((f"{size} attacked", len(answers.strengths)) for size in sizes),
            tuple(answers.strengths) * len(sizes),
            tuple(
                PageRow(f"r = {percent(r)}", tuple(cell(s, size, r) for size in sizes for s in answers.strengths))
                for r in published.TABLE_RATES
            ),
        )
    columns: list[Sensors | int] = [*((sensor,) for sensor in system), 1]
    return Grid(
        title,
        (("Strength", 1), *((f"S_{sensor}", 1) for sensor in system), ("average", 1)),
        (),
        tuple(
            PageRow(f"r = {percent(r)}" if s == "paper" else "", (s, *of_r))
            for r in published.TABLE_RATES
            for s, of_r in [
                ("paper", published.IDENTIFICATION[r]),
                *((s, tuple(cell(s, key, r) for key in columns)) for s in answers.strengths),
            ]
        ),
    )


def _sensitivity(answers: Answers) -> Iterator[Grid]:
    rows = answers.rows["sensitivity"]
    for sensor in ("lidar", "reference", "source"):
        of_it = [row for row in rows if row["sensor"] == sensor]
        columns = list(dict.fromkeys((row["left_out"], row["strength"]) for row in of_it))
        columns.sort(key=lambda column: (answers.modes.index(column[0]), column[1] or ""))
        rates = {(row["left_out"], row["strength"], row["size"]): rate_of(row, "detected") for row in of_it}
        sizes = {row["size"]: row for row in of_it}
        if of_it:
            strengths = len(columns) // len(answers.modes)
            yield Grid(
                title=ROLES[sensor],
                groups=tuple((LEFT_OUT[mode], strengths) for mode in answers.modes),
                columns=tuple(strength or "wall" for _, strength in columns),
                rows=tuple(
                    PageRow(size_of(row), tuple(rates.get((*column, size)) for column in columns))
                    for size, row in sorted(sizes.items())
                ),
            )


def _further(answers: Answers) -> Iterator[Grid]:
    """One table for each sensor's attacks beyond the paper's, by the largest system."""
    rows = [row for row in answers.rows["further"] if len(row["system"]) == len(answers.rig.sensors)]
    row_of = {(row["left_out"], tuple(row["attacked"]), described(row)): row for row in rows}
    for attacked in dict.fromkeys(attacked for _, attacked, _ in row_of):
        kinds = list(dict.fromkeys(kind for _, of_it, kind in row_of if of_it == attacked))

        def cells(kind: str, attacked: Sensors = attacked) -> Iterator[Cell]:
            for mode in answers.modes:
                row = row_of.get((mode, attacked, kind))
                yield rate_of(row, "detected") if row else None
                if answers.rig.max_attacked:
                    interval = {"low": row["naming_low"], "high": row["naming_high"]} if row else {}
                    yield rate_of({**row, **interval}, "named") if row else None

        columns = ("detected", "named") if answers.rig.max_attacked else ("detected",)
        yield Grid(
            title=f"On {names(attacked)}",
            groups=tuple((LEFT_OUT[mode], len(columns)) for mode in answers.modes),
            columns=columns * len(answers.modes),
            rows=tuple(PageRow(kind, tuple(cells(kind))) for kind in kinds),
        )


def described(row: Mapping[str, Any]) -> str:
    """An attack in words, with its size in its own unit."""
    words = f"{row['variant']} {row['attack']}" if row["attack"] == "stripes" else row["attack"]
    if row["attack"] == "pattern":
        words = f"pattern {row['variant']}"
    return words if row["size"] is None else f"{words}, {row['size']:g}{_UNITS.get(row['attack'], '')}"


def _false_alarms(answers: Answers, mode: str) -> Grid:
    rows = [row for row in answers.rows["false_alarms"] if row["left_out"] == mode]
    systems = list(dict.fromkeys(tuple(row["system"]) for row in rows))
    row_of = {(tuple(row["system"]), row["r"]): row for row in rows}

    def cells(system: Sensors) -> Iterator[Cell]:
        for r in published.TABLE_RATES:
            row = row_of[system, float(r)]
            yield rate_of(row, "raised")
        hourly = row_of[system, R_SHOWN]["raised_an_hour"]
        yield None if hourly is None else f"{hourly:,.0f}"

    return Grid(
        title=LEFT_OUT[mode],
        groups=(("frames raised", len(published.TABLE_RATES)), ("frames an hour", 1)),
        columns=(*(f"r = {percent(r)}" for r in published.TABLE_RATES), f"r = {percent(str(R_SHOWN))}"),
        rows=tuple(PageRow(names(system), tuple(cells(system))) for system in systems),
    )


def _confusion(answers: Answers, system: Sensors) -> Grid:
    """Truth against verdict, left out by blocks where that could be done, for faculas of all strengths."""
    mode = "block" if "block" in answers.modes else answers.modes[0]
    rows = [r for r in answers.rows["confusion"] if r["left_out"] == mode and tuple(r["system"]) == system]
    counts: dict[tuple[Sensors, str], int] = defaultdict(int)
    for row in rows:
        if row["attacked"] == [LIDAR] and row["strength"] != answers.strengths[0]:
            continue  # a wall has no strength: it is repeated under each
        counts[tuple(row["attacked"]), names(row["identified"]) or row["verdict"]] += row["cases"]
    kinds = ["clean", *(f"S_{s}" for s in system), "unidentified", "not_auditable"]
    return Grid(
        title=f"{names(system)}; r = {percent(str(R_SHOWN))}; {LEFT_OUT[mode]}; faculas of all strengths",
        groups=(("verdict", len(kinds)),),
        columns=tuple(name.replace("_a", " a") for name in kinds),
        rows=tuple(
            PageRow(names(truth) + " attacked" if truth else "clean", tuple(f"{counts[truth, s]:,}" for s in kinds))
            for truth in sorted({tuple(row["attacked"]) for row in rows}, key=lambda t: (len(t), t))
        ),
    )
