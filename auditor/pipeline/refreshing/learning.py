"""What the logs of one rig kind teach, and whether it may come into force. Nothing is written here."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal

from auditor.identification.cross_validation import thresholds_of
from auditor.identification.parameters import fitted_on, has_prior
from auditor.identification.prior import statistic_at
from auditor.identification.refresh_parameters import CLEAN_DRIVE, INFLUENCE
from auditor.identification.refreshing.drives import DriveScores
from auditor.identification.refreshing.gate import (
    Step,
    compared,
    doubtful,
    doubts,
    false_alarms,
    planted_found,
    raised_often,
    rates_by_condition,
    worse,
)
from auditor.identification.systems import System
from auditor.identification.transfer import closeness
from auditor.model.calibration import Calibration
from auditor.pipeline.judge import system_of
from auditor.pipeline.refreshing.choosing import Choice, LearntRecording, RigKindState, choose, considered
from auditor.pipeline.refreshing.pool import LogGroup
from auditor.store.calibrations import OutdatedCalibrationError, make_calibration
from auditor.store.store import Store
from auditor.store.versions.decisions import Decision, Interval, RefreshOutcome, Rise, read_quarantine
from auditor.store.versions.history import History, histories
from auditor.store.versions.records import UsedRecording, lost_line, lost_versions, read_version


@dataclass(frozen=True, eq=False)
class Learnt:
    """What was decided for a rig kind, and the calibration that it is about; None where none was made."""

    decision: Decision
    calibration: Calibration | None = None


def known_of(store: Store, group: LogGroup) -> RigKindState:
    """What a store knows of a rig kind. Raises StoreError, and ThresholdsError where its version cannot be read."""
    history = group.history
    parent = store.calibration(history.in_force) if history.in_force is not None else None
    return RigKindState(
        parent,
        _confirmed(store, group, parent),
        _used_before(store, parent),
        frozenset(_new_in_withdrawn(store, group)),
        tuple(_lost(store, history)),
        {one.recording_id: one for one in read_quarantine(store, history)},
    )


def learn(group: LogGroup, state: RigKindState, in_force: Sequence[Calibration], r: Decimal) -> Learnt:
    """Choose logs of a rig kind, fit, compare with the version in force, and decide. Raises StoreError.

    `in_force` are the calibrations in force for all rig kinds.
    """
    history, parent = group.history, state.parent
    system = system_of(group.rig, fitted_on(history.procedure))
    choice = choose(group, state, system, r)
    waiting = _too_few(choice, group, parent)
    if waiting:
        return Learnt(_decision(group, state, choice, RefreshOutcome.WAITING, [waiting]))
    calibration = make_calibration(history.rig_kind, history.procedure, [one.drive.clean for one in choice.chosen])
    if parent is not None and calibration.calibration_id == parent.calibration_id:
        refused = list(_too_many_raised(choice)) if choice.judged else []
        decided = RefreshOutcome.REFUSED if refused else RefreshOutcome.NOTHING_NEW
        return Learnt(_decision(group, state, choice, decided, [*refused, *_raised_line(choice)]))
    return Learnt(_decide(group, state, calibration, choice, system, r, in_force), calibration)


def _lost(store: Store, history: History) -> Iterator[str]:
    """What is to be said of versions of a rig kind that came into force and whose history is gone."""
    if history.in_force is None:
        for version in lost_versions(store, histories(store)):
            if (version.kind, version.matcher) == (str(history.rig_kind), history.procedure.matcher):
                yield lost_line(version)


def _too_few(choice: Choice, group: LogGroup, parent: Calibration | None) -> str:
    """Why nothing can be made of what was chosen; empty where something can."""
    procedure = group.history.procedure
    if parent is None and not choice.some_named and not has_prior(procedure):
        reason = f"the prior does not hold for {procedure.matcher}"
        return f"{reason}: name clean recordings, with --clean or auditor label --clean"
    fewest = 1 if parent is not None or choice.some_named else INFLUENCE.fewest_first
    if len(choice.chosen) < fewest:
        clean = len(choice.chosen)
        seem = "1 recording seems" if clean == 1 else f"{clean} recordings seem"
        return f"{seem} clean, of {fewest} that are needed; or name some clean"
    return ""


def _decide(
    group: LogGroup,
    state: RigKindState,
    calibration: Calibration,
    choice: Choice,
    system: System,
    r: Decimal,
    in_force: Sequence[Calibration],
) -> Decision:
    drives = [one.drive.clean for one in choice.chosen]
    shown = [one.shown for one in choice.chosen if one.shown is not None]
    after = thresholds_of(calibration.clean, system, r)
    before = thresholds_of(state.clean, system, r) if state.parent is not None else after
    confirmed = thresholds_of(state.confirmed.clean, system, r) if state.confirmed is not None else before
    attacks = planted_found(drives, system, after)
    step, creep = (compared(drives, system, one, after, attacks) for one in (before, confirmed))
    rates = rates_by_condition([_conditions(one.used) for one in choice.chosen], shown)
    at_first, again = choice.judged_twice if state.parent is not None else ((), ())
    refused = [*_raised_named(choice, state, r), *_too_many_raised(choice), *worse(step, at_first, again)]
    held = [
        *doubts(step, creep),
        *raised_often(shown, r),
        *doubtful(rates, r),
        *_for_a_person(group, state, calibration, choice, in_force),
    ]
    decided = RefreshOutcome.REFUSED if refused else RefreshOutcome.HELD if held else RefreshOutcome.PROMOTED
    reasons = [*refused, *held, *_raised_line(choice), *_few_line(group, choice, shown)]
    first = state.parent is None
    return replace(
        _decision(group, state, choice, decided, reasons),
        calibration_id=calibration.calibration_id,
        in_force=calibration.calibration_id if decided is RefreshOutcome.PROMOTED else group.history.in_force,
        by_others=Interval(*false_alarms(shown)) if shown else None,
        new_by_others=Interval(*false_alarms(again)) if at_first else None,
        new_before=Interval(*false_alarms(at_first)) if at_first else None,
        found_before=None if first else Interval(*step.found),
        found_after=Interval(*attacks.share),
        lost=None if first else Interval(*step.lost),
        lost_in_all=None if first else Interval(*creep.lost),
        creep=None if first else creep.rise,
        rises=() if first else tuple(map(_rise, step.steps)),
        conditions=tuple(rates),
    )


def _conditions(used: UsedRecording) -> dict[str, str | None]:
    return {"vehicle": used.vehicle, "weather": used.weather, "time of day": used.time_of_day}


def _raised_named(choice: Choice, state: RigKindState, r: Decimal) -> Iterator[str]:
    """The recordings that are named clean now; those in force already make nothing worse, and are listed alone."""
    in_force = state.in_force
    for recording in choice.chosen:
        new = recording.used.recording_id not in in_force
        if new and recording.doubtful and recording.shown is not None and (reason := recording.shown.raised(r)):
            yield f"{recording.used.name} was named clean, and others find {reason}"


def _too_many_raised(choice: Choice) -> Iterator[str]:
    for raised, of, subject in (
        (choice.raised, choice.judged, "new recordings"),
        (*choice.waiting_of, "recordings of the days that are learnt from"),
    ):
        if raised > 1 and raised > CLEAN_DRIVE.most_raised * of:
            share = f"{CLEAN_DRIVE.most_raised:.0%}"
            yield f"{raised} of {of} {subject} are raised or unlike the others, more than {share}"
            return


def _for_a_person(
    group: LogGroup,
    state: RigKindState,
    calibration: Calibration,
    choice: Choice,
    in_force: Sequence[Calibration],
) -> Iterator[str]:
    """What a refresh does not decide, whatever the thresholds are."""
    yield from state.lost
    if calibration.calibration_id in group.history.withdrawn:
        yield "it was rolled back before"
    if state.parent is None and not choice.some_named:
        nearest = [
            one for one in in_force if one.procedure == calibration.procedure and closeness(one, group.rig) is not None
        ]
        if nearest:
            yield f"its recordings are judged by {nearest[0].rig_kind}: name some clean for a version of their own"


def _raised_line(choice: Choice) -> list[str]:
    return [f"{choice.raised} raised or unlike the others, and left out"] if choice.raised else []


def _few_line(group: LogGroup, choice: Choice, shown: Sequence[DriveScores]) -> list[str]:
    """That a version is provisional since it is of too few recordings, and how little is known of its false alarms."""
    if group.history.vouched or not choice.too_few:
        return []
    fewest, frames, alarms = INFLUENCE.fewest_first, CLEAN_DRIVE.fewest_frames, false_alarms(shown)
    return [
        f"provisional: fewer than {fewest} recordings of {frames} frames or more, so that false alarms may be "
        f"{100 * alarms.low:.0f} to {100 * alarms.high:.0f} % of half seconds"
    ]


def _confirmed(store: Store, group: LogGroup, parent: Calibration | None) -> Calibration | None:
    confirmed = group.history.confirmed
    try:
        return parent if parent is None or confirmed is None else store.calibration(confirmed)
    except OutdatedCalibrationError:  # it was counted otherwise: nothing is known of it any more
        return parent


def _new_in_withdrawn(store: Store, group: LogGroup) -> set[str]:
    """The recordings of versions that were rolled back, but for those that are in force."""
    recordings = store.calibration_recordings() if group.history.withdrawn else {}
    gone = {recording for one in group.history.withdrawn for recording in recordings.get(one, ())}
    return gone - set(recordings.get(group.history.in_force or "", ()))


def _used_before(store: Store, parent: Calibration | None) -> tuple[UsedRecording, ...]:
    """What the version in force was made of, as far as that is known."""
    version = read_version(store, parent.calibration_id) if parent is not None else None
    return version.included if version is not None else ()


def _decision(
    group: LogGroup, state: RigKindState, choice: Choice, decided: RefreshOutcome, reasons: Sequence[str]
) -> Decision:
    in_force = state.in_force
    doubted = {one.used.recording_id for one in choice.chosen if _doubted(one)}
    used = [replace(one, look_at=one.look_at or one.recording_id in doubted) for one in considered(choice)]
    return Decision(
        kind=str(group.history.rig_kind),
        matcher=group.history.procedure.matcher,
        decided=decided,
        reasons=tuple(reasons),
        calibration_id=None,
        before=group.history.in_force,
        in_force=group.history.in_force,
        provisional=decided is not RefreshOutcome.WAITING and _is_provisional(group, choice),
        recordings=tuple(used),
        new=sum(one.used.recording_id not in in_force for one in choice.chosen),
    )


def _is_provisional(group: LogGroup, choice: Choice) -> bool:
    """Whether a person should confirm a version: none has so far, and its recordings do not speak for themselves."""
    return not group.history.vouched and (choice.too_few or not choice.some_named)


def _doubted(recording: LearntRecording) -> bool:
    """Whether others find an incident in what a person named clean."""
    return recording.doubtful and recording.shown is not None and bool(recording.shown.strong)


def _rise(step: Step) -> Rise:
    check = step.check
    return Rise(
        check.check.value, check.sensor, check.others, statistic_at(step.before), statistic_at(step.after), step.rise
    )
