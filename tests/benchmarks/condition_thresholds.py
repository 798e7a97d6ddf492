"""Whether thresholds of their own for each condition find more: streets judged by the others, with and without them.

    python -m tests.benchmarks.clean_statistics --into ATTACKED --streets 100 --first 7000 --frames 8 \
        --attacked --every 8
    python -m tests.benchmarks.condition_thresholds ATTACKED

A street's condition (its light and weather) is known. With `own` thresholds the expected level of a check is that of
the streets of its condition, drawn towards that of all by DRAWN streets, and the spread between streets is that about
these levels; `pooled` thresholds are those of a refresh. Each fifth of the streets is judged by the others, at r = 1 %:
clean frames that are raised, and attacks that are found. Intervals are 95 %, over streets. `explained` is the share of
the variance between streets that conditions explain, of each check that counts.
"""

import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from decimal import Decimal
from math import nan
from pathlib import Path

import numpy as np

from auditor.identification.cross_validation import as_scanned, thresholds_of
from auditor.identification.drive_level import for_clean_drive
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.prior import OFFSET, log_odds
from auditor.identification.refreshing.clustered import difference_of, share_of
from auditor.identification.robust import findings_alone
from auditor.identification.systems import System
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.checks import SensorCheck
from auditor.pipeline.judge import system_of
from tests.benchmarks.fleet_bank import MILD
from tests.benchmarks.rates import clean_frames, frames_of
from tests.benchmarks.scenes import Case, Scene, load

DRAWN = 4.0
FOLDS = 5
R = Decimal("0.01")

Levels = Mapping[SensorCheck, float]


def condition_of(scene: Scene) -> str:
    """The light and weather of a street."""
    return scene.family.partition(", ")[2]


def level_of(clean: CleanFrames, checks: Sequence[SensorCheck]) -> Levels:
    """The median log odds of each check; NaN where it was not measured."""
    known = {check: log_odds(clean.statistics[check]) for check in checks}
    return {check: nan if np.isnan(odds).all() else float(np.nanmedian(odds)) for check, odds in known.items()}


def moved(clean: CleanFrames, by: Levels) -> CleanFrames:
    """A drive with its log odds moved."""
    statistics = {}
    for check, values in clean.statistics.items():
        share = 1 / (1 + np.exp(-(log_odds(values) + by.get(check, 0.0))))
        statistics[check] = np.clip(share * (1 + 2 * OFFSET) - OFFSET, 0, 1)
    return replace(clean, statistics=statistics)


def as_of_condition(
    drives: Sequence[CleanFrames], of: Sequence[str], levels: Sequence[Levels], checks: Sequence[SensorCheck], to: str
) -> list[CleanFrames]:
    """The drives moved from the levels of their conditions to that of one."""
    usual: dict[str, dict[SensorCheck, float]] = {name: {} for name in (*set(of), to)}
    for check in checks:
        known = np.array([one[check] for one in levels])
        middle = float(np.nanmean(known)) if np.isfinite(known).any() else 0.0
        for name, of_condition in usual.items():
            mine = known[[one == name for one in of]]
            mine = mine[np.isfinite(mine)]
            of_condition[check] = float(np.sum(mine - middle)) / (len(mine) + DRAWN)
    return [
        moved(one, {check: usual[to][check] - usual[name][check] for check in checks})
        for one, name in zip(drives, of, strict=True)
    ]


def explained(levels: Sequence[Levels], of: Sequence[str], check: SensorCheck) -> float:
    """The share of the variance between streets that conditions explain, without that of chance; 0 at least."""
    known = [(one[check], name) for one, name in zip(levels, of, strict=True) if np.isfinite(one[check])]
    values, names = np.array([value for value, _ in known]), np.array([name for _, name in known])
    within = [values[names == name] for name in sorted(set(names.tolist()))]
    error = sum(float(np.sum((some - some.mean()) ** 2)) for some in within) / max(len(values) - len(within), 1)
    return max(1 - error / float(np.var(values, ddof=1)), 0.0) if np.var(values) > 0 else 0.0


def counted(scene: Scene, clean: CleanFrames, system: System, thresholds: RobustThresholds) -> dict[str, int]:
    """Clean frames that are raised, and attacks that are found, mild ones and all."""
    series, own = as_scanned(clean, thresholds, system)
    found = {"clean": int(np.count_nonzero(findings_alone(series, system, own)))}
    expected = for_clean_drive(thresholds, system.sensor_checks, clean)
    for what, cases in attacks(scene).items():
        statistics = frames_of(scene, system, cases).statistics_of(system.sensor_checks)
        number, here = np.arange(len(cases)), np.ones((len(cases), len(system.sensors)), dtype=np.bool_)
        alone = FrameSeries(number * 10**9, number, statistics, here, ~here, {}, {})
        found[what] = int(np.count_nonzero(findings_alone(alone, system, expected)))
    return found


def attacks(scene: Scene) -> dict[str, list[Case]]:
    """The attacked cases of a street."""
    attacked = [case for case in scene.cases if case.attack]
    return {"mild": [case for case in attacked if case.attack in MILD], "all": attacked}


def main() -> None:
    """Print a row for each way of thresholds, and the difference."""
    scenes = load(Path(sys.argv[1]))
    system = system_of(scenes[0].rig)
    checks = [system.sensor_checks[column] for column in system.counting(frozenset()).tolist()]
    drives, of = [clean_frames(scene, system) for scene in scenes], [condition_of(scene) for scene in scenes]
    levels = [level_of(one, checks) for one in drives]
    for check in checks:
        print(
            f"{check.check.value} of S_{check.sensor} by {check.others}: {explained(levels, of, check):.0%} explained"
        )
    counts: dict[str, list[dict[str, int]]] = {"pooled": [{}] * len(scenes), "own": [{}] * len(scenes)}
    for fold in range(FOLDS):
        others = [place for place in range(len(scenes)) if place % FOLDS != fold]
        some, theirs = [drives[place] for place in others], [of[place] for place in others]
        pooled = thresholds_of(some, system, R)
        for name in sorted(set(of)):
            moved_ones = as_of_condition(some, theirs, [levels[place] for place in others], checks, name)
            own = thresholds_of(moved_ones, system, R)
            for place in range(fold, len(scenes), FOLDS):
                if of[place] == name:
                    counts["pooled"][place] = counted(scenes[place], drives[place], system, pooled)
                    counts["own"][place] = counted(scenes[place], drives[place], system, own)
    for what in ("clean", "mild", "all"):
        cases = [len(attacks(scene).get(what, ())) or drives[place].frames for place, scene in enumerate(scenes)]
        rows = {way: [one[what] for one in known] for way, known in counts.items()}
        difference = [own - pooled for own, pooled in zip(rows["own"], rows["pooled"], strict=True)]
        told = "; ".join(f"{way} {share_of(hits, cases)}" for way, hits in rows.items())
        print(f"{what}: {told}; own less pooled {difference_of(difference, cases)}")


if __name__ == "__main__":
    main()
