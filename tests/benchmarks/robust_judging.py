"""The two methods on measured samples: the paper's and the robust one, single frames and windows."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from decimal import Decimal

import numpy as np

from auditor.identification.paper import judge
from auditor.identification.robust import System, name_attacked
from auditor.identification.scores import scales_of, scores
from auditor.identification.statistics import window_means
from auditor.identification.thresholds import threshold
from auditor.model.checks import rig_pair_checks
from auditor.model.rig import Rig
from auditor.model.verdict import Verdict
from tests.benchmarks.intervals import wilson_percent
from tests.benchmarks.robust_measuring import Sample

R = Decimal("0.01")
WINDOW_S = 0.5

Judge = Callable[[Rig, Sequence[Sample], Sequence[Sample]], list[Verdict]]


def paper(statistic: int) -> Judge:
    """E against theta, Algorithm 2, as `--method paper` judges."""

    def verdicts(rig: Rig, clean: Sequence[Sample], tested: Sequence[Sample]) -> list[Verdict]:
        columns = np.array([sample.E[statistic] for sample in clean]).T
        theta = [threshold(sorted(column[~np.isnan(column)].tolist()), R) for column in columns]
        return [
            judge(
                "".join(_state(E, t) for E, t in zip(s.E[statistic], theta, strict=True)),
                rig.triples,
                rig.sensors,
            )
            for s in tested
        ]

    return verdicts


def _state(E: float, theta: float) -> str:
    return "-" if np.isnan(E) else "01"[theta < E]


def robust(window_s: float | None) -> Judge:
    """Margins, joint identification; with a window their means over half a second."""

    def verdicts(rig: Rig, clean: Sequence[Sample], tested: Sequence[Sample]) -> list[Verdict]:
        pair_checks = rig_pair_checks(rig)
        scales = scales_of(np.array([sample.ratios for sample in clean]), pair_checks, R)
        z = scores(np.array([sample.ratios for sample in tested]), scales)
        if window_s is not None:
            z = _windowed(z, tested, window_s)
        return name_attacked(z, System(pair_checks, rig.triples, rig.sensors), [frozenset()] * len(tested))

    return verdicts


def _windowed(z: np.ndarray, tested: Sequence[Sample], window_s: float) -> np.ndarray:
    """Each attack is a series of its own; its frames are attacked all, each by its own draw."""
    series: dict[object, list[int]] = defaultdict(list)
    for index, sample in enumerate(tested):
        series[sample.recording, sample.kind, sample.attacked, sample.draw].append(index)
    result = np.empty_like(z)
    for members in series.values():
        members.sort(key=lambda index: tested[index].stamp_ns)
        stamps = np.array([tested[index].stamp_ns for index in members], dtype=np.int64)
        result[members] = window_means(z[members], stamps, window_s)
    return result


METHODS = {
    "paper, plain E": paper(0),
    "paper, gated E": paper(1),
    "robust, single frames": robust(None),
    f"robust, windows of {WINDOW_S} s": robust(WINDOW_S),
}


def wilson(k: int, n: int) -> str:
    """k of n with the 95 % interval."""
    low, high = wilson_percent(k, n)
    return f"{k:5}/{n:<5} {100 * k / n:5.1f} [{low:5.1f}, {high:5.1f}]"


def clean_of(part: Sequence[Sample]) -> list[Sample]:
    """The clean frames of a part."""
    return [sample for sample in part if sample.kind == "clean"]
