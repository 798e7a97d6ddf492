"""Fits the priors of `identification.parameters` to clean scenes, and says how heavy the tails are.

Reads what `python -m tests.benchmarks.clean_statistics` measured. For each check and number of cameras: the mean of the
log odds, the standard deviation within and between drives (a third of the variance between scenes is between drives of
one rig kind, the rest between rig kinds: `Hierarchy.rig_kind`), and the factor by which the largest thousandth of z,
by thresholds of other families, lies farther out than a normal distribution's:

    python -m tests.benchmarks.prior FOLDER [--r 0.01]
"""

import argparse
from collections import defaultdict
from collections.abc import Mapping, Sequence
from decimal import Decimal
from math import sqrt
from pathlib import Path
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import HIERARCHY
from auditor.identification.prior import Prior, effective_size, log_odds, prior_of_cause, prior_of_check
from auditor.identification.scores import normalised_scores, thresholds_from
from auditor.model.checks import SensorCheck
from auditor.model.verdict import CauseIn
from tests.benchmarks.rates import clean_frames, system_of
from tests.benchmarks.scenes import Scene, load

CAMERAS = (1, 2, 3, 4)
TAILS = (0.99, 0.998)
FEWEST = 4
"""Frames of a drive that are fitted to."""


Floats = NDArray[np.float64]


def subject_of(key: SensorCheck | CauseIn) -> str:
    """The name of the prior that a check or a fault has."""
    if isinstance(key, SensorCheck):
        return f"{key.check.value} of {min(len(key.others), 3)}"
    cause, sensor = key
    return f"{cause.value} of {'LiDAR' if sensor == 0 else 'all' if sensor is None else 'camera'}"


def fitted(values: Sequence[Floats]) -> tuple[float, float, float]:
    """Mean, and deviations within and between drives, of the values of scenes."""
    means = np.array([one.mean() for one in values])
    worth = np.array([effective_size(one) for one in values])
    squares = np.array([one.var() for one in values])
    within = float((worth * squares).sum() / max((worth - 1).sum(), 1.0))
    between = max(float(means.var(ddof=1) - np.mean(within / worth)), 0.0)
    return float(means.mean()), sqrt(within), sqrt(between / (1 + 1 / HIERARCHY.rig_kind))


def tails(scenes: Sequence[Scene], r: Decimal) -> tuple[Mapping[str, Floats], Floats]:
    """All z by prior, and the largest z of each frame, by thresholds of the other families."""
    of_prior: dict[str, list[Floats]] = defaultdict(list)
    largest: list[Floats] = []
    system = system_of(scenes[0], CAMERAS)
    clean = [(scene.family, clean_frames(scene, system_of(scene, CAMERAS))) for scene in scenes]
    for family, one in clean:
        others = [other for of, other in clean if of != family]
        thresholds = thresholds_from(others, system.sensor_checks, system.judged_together, r)
        expected = [thresholds.expected.get(check) for check in system.sensor_checks]
        z = normalised_scores(one.statistics_of(system.sensor_checks), expected)
        for column, check in enumerate(system.sensor_checks):
            of_prior[subject_of(check)].append(z[:, column])
        largest.append(np.nanmax(z[:, system.counting(frozenset())], axis=1))
    return {name: np.concatenate(values) for name, values in of_prior.items()}, np.concatenate(largest)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--r", type=Decimal, default=Decimal("0.01"))
    options = parser.parse_args()
    scenes = load(options.folder)
    values: dict[str, list[Floats]] = defaultdict(list)
    ships: dict[str, Prior] = {}
    for scene in scenes:
        clean = clean_frames(scene, system_of(scene, CAMERAS))
        for check, column in clean.statistics.items():
            values[subject_of(check)].append(log_odds(column[~np.isnan(column)]))
            ships[subject_of(check)] = prior_of_check(check)
        for cause, column in clean.strengths.items():
            values[subject_of(cause)].append(column[~np.isnan(column)])
            ships[subject_of(cause)] = prior_of_cause(cause)
    z, largest = tails(scenes, options.r)
    print(f"{'prior':32} {'fitted: mean within between':30} {'ships':24} tail at {', '.join(map(str, TAILS))}")
    for name, columns in sorted(values.items()):
        mean, within, between = fitted([one for one in columns if one.size >= FEWEST])
        line = f"{name:32} {mean:8.2f} {within:8.2f} {between:8.2f}     {ships[name]!s:.60}"
        if name in z:
            known = z[name][~np.isnan(z[name])]
            line += " " + " ".join(f"{np.quantile(known, q) / NormalDist().inv_cdf(q):5.2f}" for q in TAILS)
        print(line)
    shares = (0.5, 0.8, 0.95, 0.99, 0.999)
    print("largest z of a frame:", ", ".join(f"{q}: {np.quantile(largest, q):.2f}" for q in shares))


if __name__ == "__main__":
    main()
