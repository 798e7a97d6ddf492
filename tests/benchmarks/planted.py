"""Planted attacks, by which a refresh compares two calibrations, against attacks on images.

A refresh plants an attack by raising the statistic of a check, in each frame and check. This raises all thresholds of a
calibration of the BANK step by step and counts what is lost: of planted attacks, on the clean frames of ATTACKED; and
of the mild and of all attacks on images of ATTACKED, each of which was measured. Prints also what these attacks raise.

    python -m tests.benchmarks.planted BANK --attacked ATTACKED

Both folders are made by tests.benchmarks.clean_statistics, see tests.benchmarks.fleet_nights.
"""

import argparse
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from auditor.identification.prior import log_odds
from auditor.identification.refresh_parameters import GATE
from auditor.identification.refreshing.gate import difference_of, planted_found
from auditor.identification.systems import System
from auditor.model.calibration import RobustThresholds
from auditor.model.verdict import FINDINGS
from tests.benchmarks.rates import clean_frames, judge_scene, system_of, thresholds_of
from tests.benchmarks.scenes import Scene, load

MILD = ("R 75 mild", "wall 1 m", "wall 2.5 m")
RISES = (0.0, 0.25, 0.5, 1.0, 1.5)


def higher(thresholds: RobustThresholds, rise: float) -> RobustThresholds:
    """Thresholds that lie so many deviations higher."""
    expected = {check: replace(one, mean=one.mean + rise * one.deviation) for check, one in thresholds.expected.items()}
    return replace(thresholds, expected=expected)


def found_on_images(scene: Scene, system: System, thresholds: RobustThresholds, names: Sequence[str]) -> int:
    """How many of a scene's attacks are found."""
    judged = judge_scene(scene, system, thresholds, None)
    return sum(one.robust.kind in FINDINGS for one in judged if one.case.attack in names)


def raised(scenes: Sequence[Scene], system: System) -> dict[str, list[float]]:
    """By attack the most that it raises in a check of its sensor, in log odds."""
    found: dict[str, list[float]] = defaultdict(list)
    columns = system.counting(frozenset()).tolist()
    for scene in scenes:
        usual = {case.frame: log_odds(case.statistics) for case in scene.cases if not case.attack}
        for case in scene.cases:
            own = [column for column in columns if system.sensor_checks[column].sensor in case.attacked]
            if own:
                found[case.attack].append(float(np.nanmax((log_odds(case.statistics) - usual[case.frame])[own])))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("bank", type=Path, nargs="+")
    parser.add_argument("--attacked", type=Path, required=True)
    options = parser.parse_args()
    scenes, bank = load(options.attacked), [scene for folder in options.bank for scene in load(folder)]
    system = system_of(scenes[0], (1, 2, 3, 4))
    for name, values in raised(scenes, system).items():
        low, middle, high = np.nanquantile(values, (0.25, 0.5, 0.75))
        print(f"{name}: raises {middle:.1f} log odds, half of them {low:.1f} to {high:.1f}; planted {GATE.planted}")
    learnt, _ = thresholds_of([clean_frames(scene, system) for scene in bank], system, Decimal("0.01"))
    clean, every = [clean_frames(scene, system) for scene in scenes], tuple(raised(scenes, system))
    before: dict[str, list[int]] = {}
    for rise in RISES:
        thresholds = higher(learnt, rise)
        planted = planted_found(clean, system, thresholds)
        counts = {"planted": (list(planted.found), list(planted.planted))}
        for what, names in (("mild", MILD), ("all", every)):
            found = [found_on_images(scene, system, thresholds, names) for scene in scenes]
            counts[what] = found, [sum(case.attack in names for case in scene.cases) for scene in scenes]
        before = before or {what: found for what, (found, _) in counts.items()}
        told = [
            f"{what} found {sum(found) / sum(cases):.1%}, lost "
            f"{difference_of([a - b for a, b in zip(before[what], found, strict=True)], cases)}"
            for what, (found, cases) in counts.items()
        ]
        print(f"thresholds {rise:.2f} deviations higher: {'; '.join(told)}")


if __name__ == "__main__":
    main()
