"""Both methods side by side on the evaluation page."""

from collections.abc import Callable, Iterator, Mapping

from auditor.reporting.evaluation.answers import R_SHOWN, SHORT_ROLES, Answers, Rows, names, percent, rate_of, size_of
from auditor.reporting.evaluation.page import LEFT_OUT, Cell, Grid, Row
from auditor.reporting.evaluation.tables import described

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
        rows=tuple(Row(label, tuple(look(one, mode) for mode in modes for one in methods)) for label, look in rows),
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
        what = f"{strength} facula on the {SHORT_ROLES[sensor]}" if strength else "wall"
        where = {"sensor": sensor, "strength": strength or None, "size": size}
        yield f"{what}, {size_of(row)}", _looking("sensitivity", "detected", **where)


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
