"""Verdicts on frames that do not follow each other: a benchmark's attacks are drawn anew for each."""

from collections.abc import Sequence
from decimal import Decimal

import numpy as np

from auditor.identification.incidents.series import FrameSeries
from auditor.identification.robust import judge_frames
from auditor.identification.scores import thresholds_from
from auditor.model.calibration import CleanFrames
from auditor.model.rig import Rig
from auditor.model.verdict import Verdict
from auditor.pipeline.judge import system_of

R = Decimal("0.01")
PERIOD_NS = 100_000_000

Statistics = Sequence[Sequence[float | None]]
"""Of some frames, in the order of the rig's sensor checks."""


def judge_alone(rig: Rig, drives: Sequence[Statistics], tested: Statistics) -> list[Verdict]:
    """The verdicts of the robust method by thresholds from the clean frames of drives, each on one frame by itself.

    Rules over successive frames are left out: causes that are not attacks, and frozen sensors.
    """
    system, F = system_of(rig), len(tested)
    clean = [_clean_frames(str(number), rig, statistics) for number, statistics in enumerate(drives)]
    thresholds = thresholds_from(clean, system.sensor_checks, system.judged_together, R)
    nothing = np.zeros((F, len(system.sensors)), dtype=np.bool_)
    each = np.arange(F, dtype=np.int64)
    series = FrameSeries(each, each, np.array(tested, dtype=np.float64), present=~nothing, frozen=nothing)
    return judge_frames(series, system, thresholds, without_causes=True)


def _clean_frames(name: str, rig: Rig, statistics: Statistics) -> CleanFrames:
    columns = np.array(statistics, dtype=np.float64).T
    stamps = np.arange(len(statistics), dtype=np.int64) * PERIOD_NS
    return CleanFrames(name, stamps, {}, dict(zip(system_of(rig).sensor_checks, columns, strict=True)), {})
