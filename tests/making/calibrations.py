"""Calibrations of measurements that are called clean, and of samples that a test writes down."""

from collections.abc import Mapping, Sequence
from decimal import Decimal

import numpy as np

from auditor.model.calibration import Calibration, CleanFrames
from auditor.model.checks import SensorCheck
from auditor.model.measurement import Statistic
from auditor.model.rig import Triple
from auditor.model.verdict import Cause, CauseIn
from auditor.pipeline.calibrations.clean import CleanMeasurements
from auditor.pipeline.calibrations.making import make
from auditor.store.store import Store


def calibrate(
    measurements: Sequence[tuple[Store, str]], frames: range | None = None, *, recount: bool = False
) -> Calibration:
    """The calibration that some measurements give, each with its store."""
    return make(CleanMeasurements(tuple(measurements), ()), Decimal("0.01"), frames, recount=recount).calibration


PERIOD_NS = 100_000_000


def clean_frames(
    samples: Mapping[tuple[Statistic, Triple], Sequence[float]],
    recordings: Sequence[str] = ("r1",),
    statistics: Mapping[SensorCheck, Sequence[float]] | None = None,
    strengths: Mapping[CauseIn, Sequence[float]] | None = None,
) -> tuple[CleanFrames, ...]:
    """Clean recordings whose frames have these samples, dealt out in turn; short columns end with unmeasured frames."""
    statistics, strengths = statistics or {}, strengths or {(Cause.DARK, None): []}
    F = max((len(values) for values in (*samples.values(), *statistics.values(), *strengths.values())), default=0)

    def column(values: Sequence[float], first: int) -> np.ndarray:
        padded = np.full(F, np.nan)
        padded[: len(values)] = values
        return padded[first :: len(recordings)]

    return tuple(
        CleanFrames(
            recording,
            np.arange(F, dtype=np.int64)[first :: len(recordings)] * PERIOD_NS,
            {key: column(values, first) for key, values in samples.items()},
            {check: column(values, first) for check, values in statistics.items()},
            {cause: column(values, first) for cause, values in strengths.items()},
        )
        for first, recording in enumerate(recordings)
    )
