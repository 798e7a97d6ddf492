"""From an evaluation's cases to its page: every figure comes from the queries."""

import json
from collections import defaultdict
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
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
from auditor.reporting.evaluation.figures import sheets
from auditor.reporting.evaluation.incidents import incident_grids
from auditor.reporting.evaluation.methods import METHODS, by_method, method_grids
from auditor.reporting.evaluation.missed import missed_attacks
from auditor.reporting.evaluation.objects import OBJECT_RATES, object_grids, object_sheets
from auditor.reporting.evaluation.page import Evaluated, EvaluationPage, Setup
from auditor.reporting.evaluation.tables import described, grids
from auditor.reporting.evaluation.unseen import unseen_grids
from auditor.store.export import rows_of
from auditor.store.queries import run_queries, run_sql
from auditor.store.store import Store

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
    found = run_queries(store, {f"evaluation_{name}": parameters for name, parameters in wanted.items()})
    answers = {name: rows_of(found[f"evaluation_{name}"]) for name in wanted}
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
    found, robust = (Answers(rig, by_method(answers, method)) for method in METHODS)
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
                grids(found)
                | object_grids(found)
                | method_grids(found, robust)
                | incident_grids(dict(zip(METHODS, (found, robust), strict=True)))
                | {"unseen": unseen_grids(answers["unseen"])}
            ).items()
        },
        sheets={name: tuple(plots) for name, plots in (sheets(found) | object_sheets(found)).items()},
        unseen=tuple(_unseen(robust if robust.modes else found)),
    )


def _recordings(clean: Rows) -> Iterator[Evaluated]:
    by_recording: dict[str, Rows] = defaultdict(list)
    for part in clean:
        by_recording[part["recording_id"]].append(part)
    for known, parts in by_recording.items():
        frames, skipped = (sum(part[name] for part in parts) for name in ("frames", "skipped"))
        yield Evaluated(parts[0]["name"], known, frames, skipped)


def _unseen(answers: Answers) -> Iterator[str]:
    """Attacks that were detected in too few frames, one sentence each, from what was left out if anything was."""
    if not answers.modes:  # no clean frame was measured
        return
    mode = "block" if "block" in answers.modes else answers.modes[0]
    for row in answers.rows["sensitivity"]:
        if row["left_out"] == mode and row["rate"] < CLEARLY_SEEN:
            what = f"{row['strength']} facula" if row["strength"] else "bogus wall"
            where = f"{'An' if what[0] == 'o' else 'A'} {what}, {size_of(row)}, on the {SHORT_ROLES[row['sensor']]}"
            yield f"{where} was detected in {row['detected']} of {row['cases']} frames."
    for row in answers.rows["further"]:
        everyone = len(row["system"]) == len(answers.rig.sensors)
        if row["left_out"] == mode and everyone and row["rate"] < CLEARLY_SEEN:
            what = f"{described(row)} on {names(row['attacked'])}"
            yield f"{what[0].upper()}{what[1:]}, {_how_seldom(row, _raised_clean(answers, mode))}"
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
