"""Measuring as scan and calibrate do it: many recordings, side by side, none spoilt by another."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from auditor.cli.judging import Tally
from auditor.cli.output import progress, say
from auditor.errors import LimitError, RigError

if TYPE_CHECKING:
    from auditor.measurement.disparity.matchers import MatcherOptions
    from auditor.pipeline.measure import Measured
    from auditor.pipeline.workers import Limits
    from auditor.recordings import Origin


@dataclass(frozen=True)
class Measuring:
    """How recordings are to be measured: the options of the command line."""

    matcher: str
    network: "MatcherOptions"
    rig: Path | None
    origin_of: "Callable[[Path], Origin]"
    budget: "Callable[[Path], Limits]"
    jobs: int


def measure_all(
    paths: Sequence[Path],
    store: Path,
    tally: Tally,
    measuring: Measuring,
) -> "list[Measured]":
    """Measure every recording at the paths into a store, in the order given; say what cannot be, and why.

    Raises SettingError where `origin_of` does, and RigError for a rig file that cannot be read, before any work.
    """
    from auditor.measurement.disparity.matchers import find_matcher  # noqa: PLC0415
    from auditor.pipeline.measure import MeasureTask, measure_recording  # noqa: PLC0415
    from auditor.pipeline.workers import run_all  # noqa: PLC0415
    from auditor.recordings import check_rig_file, find_recordings  # noqa: PLC0415
    from auditor.store import Store  # noqa: PLC0415

    find_matcher(measuring.matcher, measuring.network)  # an unknown one is the command's error, not each recording's
    if measuring.rig:
        check_rig_file(measuring.rig)  # so is one that cannot be read
    found = find_recordings(paths)
    for error in found.errors:
        say(f"auditor: {error}")
        tally.failed = True
    if not found.recordings:
        return []
    Store.open(store, create=True)
    network, jobs = shared(measuring.network, min(measuring.jobs, len(found.recordings)))
    tasks = [
        MeasureTask(path, store, measuring.matcher, network, measuring.rig, measuring.origin_of(path))
        for path in found.recordings
    ]
    measured = {}
    with progress(len(tasks), "measuring") as (advanced, finished):
        for outcome in run_all(measure_recording, tasks, jobs, advanced, lambda task: measuring.budget(task.recording)):
            if outcome.error is not None:
                finished(f"auditor: {outcome.error.located(outcome.item)}")
                # What cannot be audited, or took too much, was looked at, and says what is missing.
                tally.incomplete |= isinstance(outcome.error, RigError | LimitError)
                tally.failed = True
            elif outcome.result is not None:
                measured[outcome.item] = outcome.result
                how = "measured" if outcome.result.fresh else "measured before"
                finished(f"{outcome.item}: {outcome.result.frames} frames {how}")
                for warning in outcome.result.calibration_warnings:
                    finished(f"{outcome.item}: WARNING: {warning}")
    return [measured[task] for task in tasks if task in measured]


def shared(network: "MatcherOptions", jobs: int) -> "tuple[MatcherOptions, int]":
    """How many processes match side by side: the CPU's threads are shared among them, a GPU is not."""
    if network.device != "cpu":
        return network, 1
    return replace(network, threads=max(1, len(os.sched_getaffinity(0)) // jobs)), jobs
