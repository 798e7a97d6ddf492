"""Judging as scan and judge do it: which thresholds, and what the verdicts mean for the exit code."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import TYPE_CHECKING

from auditor.cli import Exit
from auditor.cli.output import say
from auditor.errors import AuditorError, SettingError, ThresholdsError

if TYPE_CHECKING:
    from auditor.model.calibration import Calibration
    from auditor.pipeline.judge import Criteria
    from auditor.store import Store, StoredJudgement


@dataclass(frozen=True)
class Judging:
    """How verdicts are to be reached: the options of the command line. Raises SettingError where they make no sense."""

    r: Decimal
    calibration: str | None = None
    method: str = "robust"
    statistic: str = "gated"
    incidents_per_hour: float | None = None
    transfer: bool = False
    strict: bool = False
    min_coverage: float = 0.99
    recount: bool = False

    def __post_init__(self) -> None:
        if self.method == "paper" and self.incidents_per_hour is not None:
            raise SettingError(
                "the paper's method has no score that incidents per hour could set",
                where="--incidents-per-hour",
                remedy="leave it away, or judge with --method robust",
            )
        if self.method == "paper" and self.recount:
            raise SettingError(
                "the paper's method has no statistics that come from cells",
                where="--recount",
                remedy="leave it away, or judge with --method robust",
            )

    @property
    def criteria(self) -> "Criteria":
        """The same, as judging takes it."""
        from auditor.model.measurement import Statistic  # noqa: PLC0415
        from auditor.model.verdict import Method  # noqa: PLC0415
        from auditor.pipeline.judge import Criteria  # noqa: PLC0415 - keeps --help quick

        return Criteria(
            self.r,
            Method(self.method),
            Statistic(self.statistic),
            self.incidents_per_hour,
            transfer=self.transfer,
            strict=self.strict,
            recount=self.recount,
        )


@dataclass
class Tally:
    """What the exit code depends on, gathered over all recordings of a command."""

    found: bool = False
    incomplete: bool = False
    audited: bool = False
    failed: bool = False

    def exit_code(self) -> Exit:
        """0 to 4: see Exit. Without a single recording that could be looked at, the command could not run."""
        if self.failed and not self.audited and not self.incomplete:
            return Exit.FAILED
        if self.found:
            return Exit.FINDINGS_INCOMPLETE if self.incomplete or self.failed else Exit.FINDINGS
        return Exit.INCOMPLETE if self.incomplete or self.failed else Exit.CLEAN


def named_calibration(folder: Path, name: str | None) -> "Calibration | None":
    """The calibration that the command line names: a file, or an id of the store there or the beginning of one.

    Raises ThresholdsError where there is none, also where there is no store yet.
    """
    from auditor.store import Store, read_calibration  # noqa: PLC0415

    if name is None:
        return None
    if Path(name).is_file():
        return read_calibration(Path(name))
    store = Store.open(folder) if Store.is_at(folder) else None
    matching = store.calibrations_called(name) if store else []
    if store is None or len(matching) != 1:
        what = "several calibrations begin so" if matching else "no calibration has that id, and no file that name"
        known = store is not None and bool(store.ids("calibrations"))
        remedy = listing_calibrations(folder) if known else "the store has none yet: make one with auditor calibrate"
        raise ThresholdsError(what, where=name or "--calibration", remedy=remedy)
    return store.calibration(matching[0])


def listing_calibrations(folder: Path) -> str:
    """A command that lists the calibrations of a store."""
    sql = "SELECT DISTINCT calibration_id, kind, matcher, calibrated_at FROM calibrations"
    return f'auditor query --store {shlex.quote(str(folder))} --sql "{sql}" lists them'


def judge_all(store: "Store", measurements: Sequence[str], judging: Judging, tally: Tally) -> list[str]:
    """Judge measurements, say what cannot be judged and why, and add to the tally; answer those that were judged."""
    from auditor.pipeline.judge import fitting_calibration, judge_measurement, tells_incidents  # noqa: PLC0415

    criteria = judging.criteria
    chosen = named_calibration(store.folder, judging.calibration)
    calibrations = [] if chosen else store.calibrations()
    current = store.current_judgements()
    judged = []
    for measurement in measurements:
        name = recording_name(store, measurement)
        calibration = chosen or fitting_calibration(store, measurement, calibrations)
        if calibration is None:
            say(
                f"{name}: measured, but not judged: the store has no thresholds for its rig kind and matcher; "
                "make some from clean recordings with auditor calibrate"
            )
            tally.incomplete = True
            continue
        try:
            judgement = judge_measurement(store, measurement, calibration, criteria, current)
        except AuditorError as error:
            say(f"{name}: {error}")
            tally.failed = True
            continue
        judged.append(measurement)
        _weigh(store, name, judgement, judging, tally)
        if not tells_incidents(calibration, criteria):
            say(f"{name}: the clean frames are too few to tell so many incidents an hour from none: judged as at 0")
    return judged


def recording_name(store: "Store", measurement: str) -> str:
    """What the user calls the recording of a measurement."""
    return store.recording(store.measurement(measurement).recording_id).name


def _weigh(store: "Store", name: str, judgement: "StoredJudgement", judging: Judging, tally: Tally) -> None:
    from auditor.model.verdict import VerdictKind  # noqa: PLC0415

    measurement = store.measurement(judgement.measurement_id)
    audited = sum(count for kind, count in judgement.counts.items() if kind is not VerdictKind.NOT_AUDITABLE)
    due = measurement.frames - measurement.skipped.get("edge", 0)
    tally.audited = True
    tally.found |= judgement.in_incidents > 0
    if not judgement.resolvable:
        say(f"{name}: r = {judgement.r} is not resolvable with the clean samples there are: judged as at r = 0")
    if audited < judging.min_coverage * due:
        say(f"{name}: {audited} of {due} frames audited")
        tally.incomplete = True
    damaged = sum(topic.damaged for topic in measurement.balance)
    if measurement.damage or damaged:
        pieces = "; ".join(measurement.damage[:3]) or f"{damaged} damaged messages"
        say(f"{name}: damaged: {pieces}")
        tally.incomplete = True
