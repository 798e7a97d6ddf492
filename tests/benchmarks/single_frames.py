"""Verdicts on frames that do not follow each other: a benchmark's attacks are drawn anew for each."""

from collections.abc import Sequence
from decimal import Decimal

import numpy as np

from auditor.identification.robust import FrameSeries, judge_frames
from auditor.identification.scores import thresholds_from
from auditor.model.rig import Rig
from auditor.model.verdict import Verdict
from auditor.pipeline.judge import system_of

R = Decimal("0.01")

Ratios = Sequence[Sequence[float | None]]


def judge_alone(rig: Rig, clean: Ratios, tested: Ratios) -> list[Verdict]:
    """The verdicts of the robust method by thresholds from clean windowed ratios, each on one frame by itself.

    Rules over successive frames are left out: causes that are not attacks, and frozen sensors.
    """
    system, F = system_of(rig), len(tested)
    thresholds = thresholds_from(np.array(clean, dtype=np.float64), {}, system.pair_checks, R)
    nothing = np.zeros((F, len(system.sensors)), dtype=np.bool_)
    each = np.arange(F, dtype=np.int64)
    series = FrameSeries(each, each, np.array(tested, dtype=np.float64), present=~nothing, frozen=nothing)
    return judge_frames(series, system, thresholds, without_causes=True)
