"""Judging in several processes at once: each takes its part of a store's measurements."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from auditor.pipeline.many import Judged, JudgeSettings, judge_all
from auditor.pipeline.workers import Progress, run_all
from auditor.store import Store
from auditor.store.log import logged

WORTH_A_PROCESS = 50
"""Measurements that a process is begun for; it has to read the store's judgements and calibrations first."""


@dataclass(frozen=True)
class _Part:
    """The measurements of a store that one process judges, by a calibration that the store keeps, if one is named."""

    folder: Path
    measurements: tuple[str, ...]
    settings: JudgeSettings
    calibration_id: str | None

    def __str__(self) -> str:
        return str(self.folder)


def judge_side_by_side(
    store: Store, measurements: Sequence[str], settings: JudgeSettings, jobs: int | None = None
) -> Iterator[Judged]:
    """As `judge_all`, in so many processes at a time; None stands for as many as there are cores.

    Few measurements are judged in this process. Raises, too, what a process could not even begin with.
    """
    jobs = min(jobs or len(os.sched_getaffinity(0)), len(measurements) // WORTH_A_PROCESS)
    if jobs <= 1:
        return judge_all(store, measurements, settings)
    return _judged(store, measurements, settings, jobs)


def _judged(store: Store, measurements: Sequence[str], settings: JudgeSettings, jobs: int) -> Iterator[Judged]:
    with logged(store.folder):
        named = None
        if settings.calibration is not None:
            named = settings.calibration.calibration_id
            store.keep_calibration(settings.calibration)
        without = replace(settings, calibration=None)
        parts = [_Part(store.folder, tuple(measurements[first::jobs]), without, named) for first in range(jobs)]
        found: dict[str, Judged] = {}
        for outcome in run_all(_judge_part, parts, jobs, lambda *_: None):
            if outcome.error is not None:
                raise outcome.error
            found.update((one.measurement_id, one) for one in outcome.result or ())
        yield from (found[one] for one in measurements)


def _judge_part(part: _Part, _: Progress) -> list[Judged]:
    store = Store.open(part.folder)
    named = store.calibration(part.calibration_id) if part.calibration_id is not None else None
    return list(judge_all(store, part.measurements, replace(part.settings, calibration=named)))
