"""Calibrations of measurements that are called clean."""

from collections.abc import Sequence
from decimal import Decimal

from auditor.model.calibration import Calibration
from auditor.pipeline.calibrations.clean import CleanMeasurements
from auditor.pipeline.calibrations.making import make
from auditor.store.store import Store


def calibrate(
    measurements: Sequence[tuple[Store, str]], frames: range | None = None, *, recount: bool = False
) -> Calibration:
    """The calibration that some measurements give, each with its store."""
    return make(CleanMeasurements(tuple(measurements), ()), Decimal("0.01"), frames, recount=recount).calibration
