"""A calibration of many clean measurements, each judged by the others.

Each measurement is read twice: once for what thresholds follow from, which is little, and once to be judged by those of
the others and to be written. Where all have few frames they are read once, and stay. Many are read and judged by
several processes at once; what they give is the same for any number of them.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import cached_property, partial
from itertools import islice
from pathlib import Path

from auditor.errors import NothingMeasuredError, ThresholdsError
from auditor.identification.cross_validation import (
    CleanErrors,
    ErrorsOfOthers,
    LeftOut,
    ThresholdsOfOthers,
    errors_asked_for,
    groups_of,
    judge_by_others,
    judge_by_thetas,
)
from auditor.identification.parameters import fitted_on
from auditor.identification.scores import CleanDrives, DriveSums, largest_asked_for
from auditor.identification.systems import System
from auditor.model.calibration import MOST_FRAMES_KEPT, Calibration, CleanFrames, RobustThresholds, read_later
from auditor.model.measurement import Procedure, Statistic
from auditor.model.rig import Triple
from auditor.model.rig_kind import ComparedTo, RigKind
from auditor.pipeline.calibrations.clean import CleanMeasurements
from auditor.pipeline.clean_frames import clean_frames_of
from auditor.pipeline.judge import refuse_earlier_counting, refuse_withheld, system_of
from auditor.pipeline.workers import Progress, in_order
from auditor.store.calibrations import RecordingContent, content_of, make_calibration
from auditor.store.store import Store

MOST_GIVEN_BACK = 25_000
"""Frames of the recordings that a process judges and gives back at once, about 1 kB each; one recording at least."""

_BEGUN = 2
"""Parts a process that are begun at once: some are judged while others are written."""

ByOthers = tuple[RobustThresholds, Mapping[Triple, float]]
"""The thresholds of other recordings by the robust method, and theta by the paper's."""


@dataclass(frozen=True)
class JudgedByOthers:
    """A clean recording, and its false alarms by thresholds of the others: by the robust method and by the paper's."""

    clean: CleanFrames
    robust: LeftOut
    paper: LeftOut


@dataclass(frozen=True)
class SummaryRequest:
    """What is asked of each recording: of fault scores and of E so many of the largest are kept, over all recordings.

    `frames` are the numbers of the frames that count, all where it is None.
    """

    system: System
    r: Decimal
    most_scores: int
    most_errors: int
    frames: range | None
    recount: bool


@dataclass(frozen=True, eq=False)
class _Part:
    """Some measurements, each with the folder of its store; with what they are judged by, where they are."""

    measurements: tuple[tuple[Path, str], ...]
    asked: SummaryRequest
    by_others: tuple[ByOthers, ...] = ()

    def __str__(self) -> str:
        return str(self.measurements[0][0])

    def read(self) -> Iterator[CleanFrames]:
        """Their clean frames, one after another."""
        of_store: dict[Path, list[str]] = {}
        for folder, measurement in self.measurements:
            of_store.setdefault(folder, []).append(measurement)
        stores = {folder: Store.open(folder).only(measurements=ids) for folder, ids in of_store.items()}
        for store in stores.values():
            store.measurements()  # at once: one by one takes far longer
        for folder, measurement in self.measurements:
            yield clean_frames_of(stores[folder], measurement, self.asked.frames, recount=self.asked.recount)


class _Sums:
    """What the id and all thresholds of a calibration need of some recordings."""

    def __init__(self, asked: SummaryRequest) -> None:
        self.contents: list[RecordingContent] = []
        self.samples = Counter[tuple[Statistic, Triple]]()
        self.drives = DriveSums(asked.system.sensor_checks, asked.most_scores, asked.system.fitted_on)
        self.errors = CleanErrors(Statistic.GATED, asked.most_errors)

    def add(self, clean: CleanFrames) -> None:
        """Take the next recording."""
        self.contents.append(content_of(clean))
        self.samples.update(clean.measured)
        self.drives.add(clean)
        self.errors.add(clean)

    def join(self, later: "_Sums") -> None:
        """Take recordings that follow."""
        self.contents += later.contents
        self.samples.update(later.samples)
        self.drives.join(later.drives)
        self.errors.join(later.errors)


@dataclass(frozen=True, eq=False)
class MadeCalibration:
    """A calibration, and what was `asked` of the `clean` measurements that it was made of, each once.

    `samples` counts their E by statistic and triple.
    """

    calibration: Calibration
    clean: CleanMeasurements
    asked: SummaryRequest
    samples: Mapping[tuple[Statistic, Triple], int]
    drives: CleanDrives
    errors: CleanErrors
    jobs: int

    @cached_property
    def thresholds(self) -> RobustThresholds:
        """The robust thresholds at r."""
        return self.drives.thresholds(self.asked.system.judged_together, self.asked.r, self.calibration.calibration_id)

    def judged_by_others(self) -> Iterator[JudgedByOthers]:
        """Each recording judged by the others; a single one by the prior, and as the paper does by nothing."""
        clean, asked = self.calibration.clean, self.asked
        recordings = [one.recording_id for one in clean]
        robust = ThresholdsOfOthers(self.drives, groups_of(recordings), asked.system, asked.r)
        paper = ErrorsOfOthers(self.errors, asked.r)
        by_others = ((robust.of(one), paper.of(one)) for one in recordings)
        if _is_kept(self.clean.chosen):
            yield from map(partial(_judged, asked.system), clean, by_others)
            return
        parts = (_Part(part, asked, tuple(islice(by_others, len(part)))) for part in _parts_of(self.clean.chosen))
        while waiting := list(islice(parts, _BEGUN * self.jobs)):
            for judged in in_order(_judge_part, waiting, self.jobs):
                yield from judged


def make(
    clean: CleanMeasurements, r: Decimal, frames: range | None = None, *, recount: bool = False, jobs: int = 1
) -> MadeCalibration:
    """The calibration that clean measurements of one rig kind and procedure give, each once; see the module.

    `r` is the rate that its recordings are judged at. `frames` restricts it to these frame numbers of each measurement,
    `recount` computes their statistics again from the stored cells. `jobs` processes read many of them.
    Raises ThresholdsError where kinds or procedures differ, nothing was measured, or it was counted otherwise than
    today.
    """
    if not clean.chosen:
        raise ThresholdsError(
            "no clean recording to calibrate on", remedy="give recordings that are known to be free of attacks"
        )
    measurements = tuple((store, known) for known, store in {known: store for store, known in clean.chosen}.items())
    clean = replace(clean, chosen=measurements)
    _refuse_mixture(measurements)
    asked = _asked_of(measurements, r, frames, recount=recount)
    recordings = tuple(
        (store.measurement(known).recording_id, partial(clean_frames_of, store, known, frames, recount=recount))
        for store, known in measurements
    )
    sums = _Sums(asked)
    if _is_kept(measurements):
        kept = tuple(read() for _, read in recordings)
        for clean_frames in kept:
            sums.add(clean_frames)
    else:
        kept = read_later(recordings)
        located = [(store.folder, known) for store, known in measurements]
        share = -(-len(located) // jobs)
        parts = [_Part(tuple(located[first : first + share]), asked) for first in range(0, len(located), share)]
        for part_sums in in_order(_sum_up, parts, jobs):
            sums.join(part_sums)
    if asked.system.triples and not any(sums.samples.values()):
        raise NothingMeasuredError(
            "no disparity errors to calibrate on", remedy="give clean recordings that can be measured, and their frames"
        )
    calibration = make_calibration(*_kind_and_procedure(*measurements[0]), kept, sums.contents)
    return MadeCalibration(calibration, clean, asked, sums.samples, CleanDrives(sums.drives), sums.errors, jobs)


def make_each(
    groups: Sequence[CleanMeasurements],
    r: Decimal,
    frames: range | None = None,
    *,
    recount: bool = False,
    jobs: int = 1,
) -> Iterator[MadeCalibration]:
    """As `make`, of the measurements of each rig kind and procedure.

    Cameras' pasts with which nothing was compared, as while the vehicle stands, are left out where there are others.
    """
    for group in groups:
        try:
            yield make(group, r, frames, recount=recount, jobs=jobs)
        except NothingMeasuredError:
            if len(groups) == 1 or _compared_to(group) is not ComparedTo.PAST:
                raise


def without_pasts(groups: Sequence[CleanMeasurements]) -> list[CleanMeasurements]:
    """Those that are not of cameras' pasts, where cameras are compared with each other; else all."""
    compared = [_compared_to(group) for group in groups]
    if ComparedTo.CAMERAS not in compared:
        return [*groups]
    return [group for group, to in zip(groups, compared, strict=True) if to is not ComparedTo.PAST]


def _compared_to(clean: CleanMeasurements) -> ComparedTo | None:
    return next((_kind_and_procedure(*one)[0].compared_to for one in clean.chosen[:1]), None)


def by_kind(clean: CleanMeasurements) -> list[CleanMeasurements]:
    """The clean measurements of each rig kind and procedure, those left out with those of their kind.

    Without a chosen one they are returned as they are. A kind of which all are left out has none.
    """
    groups: list[tuple[tuple[RigKind, Procedure], CleanMeasurements]] = []
    for store, measurement in clean.chosen:
        kind, procedure = _kind_and_procedure(store, measurement)
        place = next((n for n, (of, _) in enumerate(groups) if of[1] == procedure and of[0].matches(kind)), None)
        if place is None:
            groups.append(((kind, procedure), CleanMeasurements(((store, measurement),), ())))
        else:
            of, before = groups[place]
            groups[place] = of, replace(before, chosen=(*before.chosen, (store, measurement)))
    return [replace(found, out=tuple(_out_of(clean, *of))) for of, found in groups] or [clean]


def is_of_kind(store: Store, measurement: str, other: str) -> bool:
    """Whether two measurements are of one rig kind and procedure."""
    (kind, procedure), (other_kind, other_procedure) = (_kind_and_procedure(store, one) for one in (measurement, other))
    return procedure == other_procedure and kind.matches(other_kind)


def _out_of(clean: CleanMeasurements, kind: RigKind, procedure: Procedure) -> Iterator[tuple[Store, str, str]]:
    for store, measurement, reason in clean.out:
        its_kind, its_procedure = _kind_and_procedure(store, measurement)
        if kind.matches(its_kind) and procedure == its_procedure:
            yield store, measurement, reason


def _kind_and_procedure(store: Store, measurement: str) -> tuple[RigKind, Procedure]:
    stored = store.measurement(measurement)
    return store.rig(stored.rig_id).kind, stored.procedure


def _refuse_mixture(measurements: Sequence[tuple[Store, str]]) -> None:
    """Raises ThresholdsError for the first that is of another kind or procedure than the first of all."""
    first, first_procedure = _kind_and_procedure(*measurements[0])
    remedy = "calibrate each of them on its own"
    for store, measurement in measurements:
        refuse_earlier_counting(store, measurement)
        refuse_withheld(store, measurement)
        kind, procedure = _kind_and_procedure(store, measurement)
        if not first.matches(kind):
            raise ThresholdsError(f"two rig kinds in one calibration: {first}, and {kind}", remedy=remedy)
        if first_procedure != procedure:
            matchers = f"{first_procedure.matcher}, and {procedure.matcher}"
            raise ThresholdsError(f"two procedures in one calibration: {matchers}", remedy=remedy)


def _asked_of(
    measurements: Sequence[tuple[Store, str]], r: Decimal, frames: range | None, *, recount: bool
) -> SummaryRequest:
    stored = [store.measurement(known) for store, known in measurements]
    groups = groups_of(one.recording_id for one in stored)
    of_groups, of_recordings = Counter[str | int](), Counter[str]()
    for measurement in stored:
        of_groups[groups[measurement.recording_id]] += measurement.frames
        of_recordings[measurement.recording_id] += measurement.frames
    return SummaryRequest(
        system_of(measurements[0][0].rig(stored[0].rig_id), fitted_on(stored[0].procedure)),
        r,
        largest_asked_for(of_groups),
        errors_asked_for(r, of_recordings),
        frames,
        recount,
    )


def _is_kept(measurements: Sequence[tuple[Store, str]]) -> bool:
    """Whether measurements have so few frames that they stay in memory."""
    return sum(store.measurement(known).frames for store, known in measurements) <= MOST_FRAMES_KEPT


def _parts_of(measurements: Sequence[tuple[Store, str]]) -> Iterator[tuple[tuple[Path, str], ...]]:
    """The measurements in parts of no more than MOST_GIVEN_BACK frames, or of one."""
    part, frames = list[tuple[Path, str]](), 0
    for store, measurement in measurements:
        frames += store.measurement(measurement).frames
        if part and frames > MOST_GIVEN_BACK:
            yield tuple(part)
            part, frames = [], store.measurement(measurement).frames
        part.append((store.folder, measurement))
    yield tuple(part)


def _sum_up(part: _Part, _: Progress) -> _Sums:
    sums = _Sums(part.asked)
    for clean_frames in part.read():
        sums.add(clean_frames)
    return sums


def _judge_part(part: _Part, _: Progress) -> list[JudgedByOthers]:
    return list(map(partial(_judged, part.asked.system), part.read(), part.by_others))


def _judged(system: System, clean: CleanFrames, by_others: ByOthers) -> JudgedByOthers:
    thresholds, theta = by_others
    paper = judge_by_thetas(clean, theta, Statistic.GATED, system.fallback)
    return JudgedByOthers(clean, judge_by_others(clean, thresholds, system), paper)
