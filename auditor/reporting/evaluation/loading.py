"""From an evaluation's cases to its page: every figure comes from the queries."""

import base64
import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import auditor
from auditor.errors import StoreError
from auditor.model.rig import Rig
from auditor.reporting.evaluation.answers import (
    CURVE_RATES,
    R_SHOWN,
    SHORT_ROLES,
    Answers,
    Rows,
    names,
    size_of,
    subsets,
)
from auditor.reporting.evaluation.figures import METHODS, by_method, method_grids, sheets
from auditor.reporting.evaluation.objects import OBJECT_RATES, object_grids, object_sheets
from auditor.reporting.evaluation.page import (
    LEFT_OUT,
    Cell,
    EvaluatedRecording,
    EvaluationPage,
    Grid,
    MissedAttack,
    PageRow,
    Rate,
    Setup,
)
from auditor.reporting.evaluation.plots import BOTTOM_PX, HEIGHT_PX, LEFT_PX, RIGHT_PX, TOP_PX, WIDTH_PX
from auditor.reporting.evaluation.tables import described, grids
from auditor.reporting.templates import fill
from auditor.store.evaluation_tables import case_key, missed_pictures
from auditor.store.export import rows_of
from auditor.store.queries import run_queries, run_query, run_sql
from auditor.store.store import Store

_METHODS = {"paper": "E and Algorithm 2", "robust": "robust"}


def incident_grids(methods: Mapping[str, Answers]) -> dict[str, list[Grid]]:
    """False incidents of clean drives, then attacked intervals by each method."""
    shown = {method: answers for method, answers in methods.items() if answers.rows["incidents"]}
    window_kind = [_intervals(method, answers) for method, answers in shown.items()]
    return {
        "false_incidents": [_false(shown)] if shown else [],
        "intervals": [table for table in window_kind if table.rows],
    }


def _false(shown: Mapping[str, Answers]) -> Grid:
    modes = _modes(shown)

    def cells(answers: Answers) -> Iterator[Cell]:
        for mode in modes:
            row = _clean(answers, mode)
            if row is None:
                yield from (None, None, None)
            elif row["hours"] is None:  # no two frames, so no time between them
                yield from (f"{row['incidents']:,}", None, None)
            else:
                yield f"{row['incidents']:,} in {row['hours']:.3f} h"
                yield from (f"{row[name]:,.0f}" for name in ("incidents_an_hour", "at_most_an_hour"))

    return Grid(
        title="False incidents of clean driving, all sensors, r = 1 %",
        groups=tuple((LEFT_OUT[mode], 3) for mode in modes),
        columns=("incidents", "an hour", "at most") * len(modes),
        rows=tuple(PageRow(_METHODS[method], tuple(cells(answers))) for method, answers in shown.items()),
    )


def _intervals(method: str, answers: Answers) -> Grid:
    modes = _modes({method: answers})
    rows = [row for row in answers.rows["incidents"] if row["attacked"]]
    row_of = {(row["left_out"], tuple(row["attacked"]), row["variant"]): row for row in rows}
    kinds = list(dict.fromkeys((attacked, variant) for _, attacked, variant in row_of))

    def cells(kind: tuple[tuple[int, ...], str]) -> Iterator[Cell]:
        for mode in modes:
            row = row_of.get((mode, *kind))
            yield _rate(row, "found", "low", "high") if row else None
            yield _rate(row, "named", "naming_low", "naming_high") if row else None
            yield f"{row['delay_s']:.1f} s" if row and row["delay_s"] is not None else None

    return Grid(
        title=f"Attacks of one second, and lasting ones, {_METHODS[method]}, all sensors, r = 1 %",
        groups=tuple((LEFT_OUT[mode], 3) for mode in modes),
        columns=("found", "named", "after") * len(modes),
        rows=tuple(
            PageRow(f"{names(attacked)}, {variant}", tuple(cells((attacked, variant)))) for attacked, variant in kinds
        ),
    )


def _modes(shown: Mapping[str, Answers]) -> list[str]:
    return [mode for mode in LEFT_OUT if any(_clean(answers, mode) for answers in shown.values())]


def _clean(answers: Answers, mode: str) -> Mapping[str, Any] | None:
    rows = (row for row in answers.rows["incidents"] if row["left_out"] == mode and not row["attacked"])
    return next(rows, None)


def _rate(row: Mapping[str, Any], counted: str, low: str, high: str) -> Rate:
    return Rate(row[counted], row["intervals"], row[low], row[high], row["resolvable"])


_UNSEEN_COLUMNS = ("tried", "sizes", "knows nothing", "knows the thresholds")
NOT_KEPT = "none was kept, evaluate its recording again"
_PAPER_SIZES = {"facula": ("radius_px", "R = {:.0f} px"), "bogus wall": ("width_m", "{:g} m wide")}
"""By kind of the paper's attacks: the parameter that is its size, and how it is written."""

CLEARLY_SEEN = 0.9
"""An attack that is detected less often than this is listed among what the audit cannot see reliably."""


def load_evaluation(store: Store) -> EvaluationPage:
    """The page of everything that was evaluated into a store. Raises StoreError where nothing was."""
    parts = rows_of(run_sql(store, "SELECT * FROM evaluations ORDER BY name, chunk"))
    if not parts:
        raise StoreError(
            "nothing has been evaluated", where=store.folder, remedy="attack clean recordings with auditor evaluate"
        )
    wanted: dict[str, dict[str, object]] = {
        "detection": {"r": list(CURVE_RATES)},
        "identification": {"r": list(CURVE_RATES)},
        "false_alarms": {},
        "sensitivity": {},
        "distribution": {},
        "confusion": {},
        "further": {},
        "incidents": {},
        "unseen": {},
        "objects": {"r": list(OBJECT_RATES)},
        "average_precision": {},
    }
    tables = run_queries(store, {f"evaluation_{name}": parameters for name, parameters in wanted.items()})
    answers = {name: rows_of(tables[f"evaluation_{name}"]) for name in wanted}
    by_setup: dict[str, Rows] = defaultdict(list)
    for part in parts:
        by_setup[part["setup"]].append(part)
    return EvaluationPage(
        made_at=f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        auditor_version=auditor.__version__,
        store=str(store.folder),
        setups=tuple(
            _setup(
                of_it,
                store.rig(of_it[0]["rig_id"]),
                {n: [r for r in a if r["setup"] == key] for n, a in answers.items()},
            )
            for key, of_it in by_setup.items()
        ),
        missed=tuple(missed_attacks(store)),
        judged=any(row["method"] == "robust" for row in answers["false_alarms"]),
    )


def _setup(parts: Rows, rig: Rig, answers: Mapping[str, Rows]) -> Setup:
    paper, robust = (Answers(rig, by_method(answers, method)) for method in METHODS)
    first = parts[0]
    clean = [part for part in parts if part["experiment"] == "clean"]
    drawn = [part for part in parts if part["draws"] is not None]
    return Setup(
        kind=first["kind"],
        synthetic=first["synthetic"],
        matcher=first["matcher"],
        settings=", ".join(f"{name} = {value}" for name, value in json.loads(first["settings"]).items()),
        counting_version=first["counting_version"],
        recordings=tuple(_recordings(clean)),
        sensors=tuple((sensor, rig.name(sensor)) for sensor in rig.sensors),
        cases=sum(part["cases"] for part in parts),
        seconds=sum(part["seconds"] for part in parts),
        clean_seconds=sum(part["seconds"] for part in clean),
        draws=max((part["draws"] for part in drawn), default=0),
        attack_every=max((part["attack_every"] or 1 for part in parts), default=1),
        seeds=tuple(sorted({part["seed"] for part in drawn})),
        lidar=rig.lidar is not None,
        max_attacked=rig.max_attacked,
        grids={
            name: tuple(tables)
            for name, tables in (
                grids(paper)
                | object_grids(paper)
                | method_grids(paper, robust)
                | incident_grids(dict(zip(METHODS, (paper, robust), strict=True)))
                | {"unseen": unseen_grids(answers["unseen"])}
            ).items()
        },
        sheets={name: tuple(plots) for name, plots in (sheets(paper) | object_sheets(paper)).items()},
        unseen=tuple(_unseen(robust if robust.modes else paper)),
    )


def _recordings(clean: Rows) -> Iterator[EvaluatedRecording]:
    by_recording: dict[str, Rows] = defaultdict(list)
    for part in clean:
        by_recording[part["recording_id"]].append(part)
    for recording_id, parts in by_recording.items():
        frames, skipped = (sum(part[name] for part in parts) for name in ("frames", "skipped"))
        yield EvaluatedRecording(parts[0]["name"], recording_id, frames, skipped)


def _unseen(answers: Answers) -> Iterator[str]:
    """Attacks that were detected in too few frames, one sentence each, from what was left out if anything was."""
    if not answers.modes:  # no clean frame was measured
        return
    mode = "block" if "block" in answers.modes else answers.modes[0]
    for row in answers.rows["sensitivity"]:
        if row["left_out"] == mode and row["rate"] < CLEARLY_SEEN:
            attack = f"{row['strength']} facula" if row["strength"] else "bogus wall"
            where = f"{'An' if attack[0] == 'o' else 'A'} {attack}, {size_of(row)}, on the {SHORT_ROLES[row['sensor']]}"
            yield f"{where} was detected in {row['detected']} of {row['cases']} frames."
    for row in answers.rows["further"]:
        everyone = len(row["system"]) == len(answers.rig.sensors)
        if row["left_out"] == mode and everyone and row["rate"] < CLEARLY_SEEN:
            attack = f"{described(row)} on {names(row['attacked'])}"
            yield f"{attack[0].upper()}{attack[1:]}, {_how_seldom(row, _raised_clean(answers, mode))}"
    for number, triple in answers.scenarios.items():
        for strength in answers.strengths:
            for attacked in subsets(triple):
                rate = answers.detection.get((mode, triple, strength, attacked, R_SHOWN))
                if rate is not None and rate.share < CLEARLY_SEEN:
                    yield (
                        f"Scenario {number}: attacks with {strength} faculas on {names(attacked)} were detected in "
                        f"{rate.k} of {rate.n} frames."
                    )


def _raised_clean(answers: Answers, mode: str) -> float:
    """The share of clean frames that all sensors raise."""
    rows = (row for row in answers.rows["false_alarms"] if row["left_out"] == mode and row["r"] == R_SHOWN)
    return next((row["rate"] for row in rows if len(row["system"]) == len(answers.rig.sensors)), 0.0)


def _how_seldom(row: Mapping[str, Any], clean: float) -> str:
    """Whether an attack is seen at all: not where the clean share lies within or above its interval."""
    if row["low"] <= clean:
        shown = f"cannot be seen on this rig, as far as {row['cases']} frames tell"
        return f"{shown}: it was detected in {row['detected']}, no oftener than clean ones may be."
    return f"was detected in {row['detected']} of {row['cases']} frames."


def unseen_grids(rows: Rows) -> Iterator[Grid]:
    """A table for each sensor, by thresholds from as far away as there were any."""
    modes = [mode for mode in LEFT_OUT if any(row["left_out"] == mode for row in rows)]
    chosen = [row for row in rows if row["left_out"] == modes[-1]]
    for attacked in dict.fromkeys(tuple(row["attacked"]) for row in chosen):
        yield Grid(
            title=f"On {names(attacked)}; {LEFT_OUT[modes[-1]]}",
            groups=(("", 2), ("largest that stays unseen, of one who", 2)),
            columns=_UNSEEN_COLUMNS,
            rows=tuple(_unseen_row(row) for row in chosen if tuple(row["attacked"]) == attacked),
        )


def _unseen_row(row: Mapping[str, Any]) -> PageRow:
    sizes = f"{row['smallest']:g} to {row['largest']:g}"
    unseen = (_unseen_size(row, row[name]) for name in ("unseen_in_half", "unseen_at_best"))
    return PageRow(f"{row['attack']}, {row['varied']}", (f"{row['tried']:,}", sizes, *unseen))


def _unseen_size(row: Mapping[str, Any], size: float) -> str:
    """A size in words: below the smallest, or all that was tried."""
    if not size:
        return f"below {row['smallest']:g}"
    return f"{size:g} and more" if size == row["largest"] else f"{size:g}"


def missed_attacks(store: Store) -> Iterator[MissedAttack]:
    """The attacks that `evaluation_missed` chooses. Raises StoreError."""
    kept = missed_pictures(store)
    for row in rows_of(run_query(store, "evaluation_missed", {})):
        picture = kept.get(case_key(row))
        (sensor,) = row["attacked"]
        yield MissedAttack(
            attack=_in_words(row, sensor),
            sensor=f"S_{sensor} ({store.rig(row['rig_id']).name(sensor)})",
            kind=row["kind"],
            recording=row["name"],
            frame=row["frame"],
            largest_z=row["largest_z"],
            limit_z=row["limit_z"],
            image=_data_uri(picture.jpeg) if picture and picture.jpeg else None,
            reason=NOT_KEPT if picture is None else picture.reason or "",
        )


def _data_uri(jpeg: bytes) -> str:
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"


def _in_words(row: Mapping[str, Any], sensor: int) -> str:
    """An attack with its strength and size, beginning with a capital."""
    values = json.loads(row["parameters"]).get(f"S_{sensor}", {})
    name, written = _PAPER_SIZES.get(row["attack"], ("", ""))
    words = described({**row, "variant": row["strength"], "size": None if name else row["size"]})
    if name:
        strength = row["strength"] if row["attack"] == "facula" else None
        size = written.format(values[name]) if name in values else None
        words = ", ".join(filter(None, (" ".join(filter(None, (strength, words))), size)))
    return words[:1].upper() + words[1:]


NO_BREAK_SPACE = "\u00a0"


def render_evaluation_report(store: Store, *, out: Path) -> Path:
    """Write the page of everything that was evaluated into a store; answer `out`.

    Raises StoreError where nothing was evaluated or the page cannot be written.
    """
    return store.write_page(out, render_evaluation(load_evaluation(store)))


def render_evaluation(page: EvaluationPage) -> str:
    """The page as HTML. All of its text is escaped; it refers to nothing outside itself."""
    frame = {"left": LEFT_PX, "right": RIGHT_PX, "top": TOP_PX, "bottom": BOTTOM_PX, "width": WIDTH_PX}
    return fill(
        "evaluation.html",
        {"page": page, "height": HEIGHT_PX, **frame},
        filters={"percent": percent, "thousands": "{:,}".format},
        tests={"rate": lambda cell: isinstance(cell, Rate)},
    )


def percent(share: float) -> str:
    """Per cent to one decimal, never rounded to 0 or 100 % where it is neither."""
    if 0 < share < 0.0005 or 0.9995 <= share < 1:
        return f"{share * 100:.2f}{NO_BREAK_SPACE}%"
    return f"{share * 100:.1f}{NO_BREAK_SPACE}%"
