"""What the logs of one rig kind teach, and whether it may come into force. Nothing is written here."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal

from auditor.errors import ThresholdsError
from auditor.identification.cross_validation import thresholds_of
from auditor.identification.prior import statistic_at
from auditor.identification.refresh_parameters import CLEAN_DRIVE, INFLUENCE
from auditor.identification.refreshing import (
    Drive,
    Shown,
    Source,
    Step,
    doubts,
    limited,
    planted_found,
    shown_by,
    shown_by_others,
    steps,
    worse,
)
from auditor.identification.sub_rigs import closeness
from auditor.identification.systems import System
from auditor.model.calibration import Calibration, CleanFrames
from auditor.pipeline.judge import PRIOR_MATCHER, clean_frames_of, system_of
from auditor.pipeline.refreshing.pool import NAMED, Group, Log
from auditor.pipeline.versions import GIVEN, day_of, used_recording
from auditor.store import Store, make_calibration
from auditor.store.versions.decisions import Decided, Decision, Rise
from auditor.store.versions.records import UsedRecording, read_version

_WITHDRAWN = "it was new in a version that was rolled back; label it clean if it is"
_BY_PERSON = (NAMED, GIVEN)
_BEFORE = "in the version of before"
_NOT_NAMED = "the first version is made of what was named clean"


@dataclass(frozen=True, eq=False)
class Learnt:
    """What was decided for a rig kind, and the calibration that it is about; None where none was made."""

    decision: Decision
    calibration: Calibration | None = None


@dataclass(frozen=True, eq=False)
class _Chosen:
    """A recording that is learnt from, its frames, and what it shows when others judge it."""

    used: UsedRecording
    drive: Drive
    shown: Shown | None = None

    @property
    def named(self) -> bool:
        """Whether a person called it clean."""
        return self.used.reason in _BY_PERSON

    def out(self, reason: str) -> UsedRecording:
        """The recording as one that was raised."""
        return replace(self.found, included=False, reason=reason, look_at=True)

    @property
    def found(self) -> UsedRecording:
        """The recording with what it shows."""
        if self.shown is None:
            return self.used
        return replace(self.used, findings_by_others=self.shown.findings, incidents_by_others=self.shown.incidents)


@dataclass(frozen=True, eq=False)
class _Choice:
    """The logs that are learnt from, those that are not, and how many seemed clean or not when they were judged."""

    chosen: tuple[_Chosen, ...]
    out: tuple[UsedRecording, ...]
    judged: int
    raised: int


def learn(store: Store, group: Group, in_force: Sequence[Calibration], r: Decimal) -> Learnt:
    """Choose logs of a rig kind, fit, compare with the version in force, and decide. Raises StoreError.

    `in_force` are the calibrations in force for all rig kinds. Raises ThresholdsError where the version in force of
    this one cannot be read.
    """
    history = group.history
    parent = store.calibration(history.in_force) if history.in_force is not None else None
    system = system_of(group.logs[0].rig)
    choice = _choose(store, group, parent, system, r)
    waiting = _too_few(choice, group, parent)
    if waiting:
        return Learnt(_decision(group, parent, choice, Decided.WAITING, [waiting]))
    calibration = make_calibration(history.rig_kind, history.procedure, [one.drive.clean for one in choice.chosen])
    if parent is not None and calibration.calibration_id == parent.calibration_id:
        return Learnt(_decision(group, parent, choice, Decided.NOTHING_NEW, _raised_line(choice)))
    decided = _decide(store, group, parent, calibration, choice, system, r, in_force)
    return Learnt(decided, calibration)


def _choose(store: Store, group: Group, parent: Calibration | None, system: System, r: Decimal) -> _Choice:
    """The logs that nothing bars, as many as may count, that seem clean or were named so."""
    withdrawn = _new_in_withdrawn(store, group)
    known = set(parent.recordings) if parent is not None else set()
    before = _used_before(store, parent)
    vouched = {one.recording_id for one in before if one.reason in _BY_PERSON}
    named_only = parent is None and any(log.named and not log.barred for log in group.logs)
    out: list[UsedRecording] = []
    named, others = list[Log](), list[Log]()
    for log in group.logs:
        if log.barred:
            out.append(_out(log, log.barred, look_at=log.look_at))
        elif log.named or log.recording.recording_id in vouched:
            named.append(log)
        elif log.doubt:
            out.append(_out(log, log.doubt, look_at=log.look_at))
        elif log.recording.recording_id in withdrawn:
            out.append(_out(log, _WITHDRAWN, look_at=True))
        elif named_only:
            out.append(_out(log, _NOT_NAMED))
        else:
            others.append(log)
    too_many = dict(limited([_source(log) for log in others]))
    out += [_out(others[place], reason) for place, reason in too_many.items()]
    others = [log for place, log in enumerate(others) if place not in too_many]
    base = thresholds_of(parent.clean if parent is not None else (), system, r)
    chosen, raised = [_chosen(log, _drive(log, parent), NAMED) for log in named], 0
    chosen += _gone(parent, before, group)
    for log in others:
        drive = _drive(log, parent)
        if log.recording.recording_id in known:
            chosen.append(_chosen(log, drive, _BEFORE))
            continue
        shown = shown_by(drive.clean, system, base)
        if reason := shown.raised(r):
            raised += 1
            by = "the version in force" if parent is not None else "the prior"
            out.append(_out(log, f"raised by {by}: {reason}", look_at=True, shown=shown))
        else:
            by = "the version in force" if parent is not None else "the prior and the others"
            chosen.append(_chosen(log, drive, f"judged clean by {by}"))
    return _judged_by_others(_Choice(tuple(chosen), tuple(out), len(others), raised), system, r)


def _judged_by_others(choice: _Choice, system: System, r: Decimal) -> _Choice:
    """Each log judged by logs of other vehicles and days; those that nobody named and that are raised then go out."""
    while True:
        every = shown_by_others([one.drive for one in choice.chosen], system, r)
        chosen = tuple(replace(one, shown=shown) for one, shown in zip(choice.chosen, every, strict=True))
        raised = [one for one in chosen if one.shown and one.shown.raised(r) and not one.named]
        left = tuple(one for one in chosen if one not in raised)
        if not raised:
            return replace(choice, chosen=chosen)
        out = tuple(one.out(f"raised by the others: {one.shown.raised(r)}") for one in raised if one.shown)
        choice = _Choice(left, (*choice.out, *out), choice.judged, choice.raised + len(raised))


def _too_few(choice: _Choice, group: Group, parent: Calibration | None) -> str:
    """Why nothing can be made of what was chosen; empty where something can."""
    named = _some_named(choice)
    matcher = group.history.procedure.matcher
    if parent is None and not named and matcher != PRIOR_MATCHER:
        return f"the prior does not hold for {matcher}: name clean recordings, with --clean or auditor label --clean"
    fewest = 1 if parent is not None or named else INFLUENCE.fewest_first
    if len(choice.chosen) < fewest:
        return f"{len(choice.chosen)} recordings seem clean, of {fewest} that are needed; or name some clean"
    return ""


def _decide(
    store: Store,
    group: Group,
    parent: Calibration | None,
    calibration: Calibration,
    choice: _Choice,
    system: System,
    r: Decimal,
    in_force: Sequence[Calibration],
) -> Decision:
    drives = [one.drive.clean for one in choice.chosen]
    shown = [one.shown for one in choice.chosen if one.shown is not None]
    after = thresholds_of(calibration.clean, system, r)
    before = thresholds_of(parent.clean, system, r) if parent is not None else None
    found_after = planted_found(drives, system, after)
    found_before = planted_found(drives, system, before) if before is not None else (0, 0)
    rises = steps(before, after, system) if before is not None else []
    creep = steps(thresholds_of(_confirmed(store, group, parent).clean, system, r), after, system) if parent else []
    refused = [*_raised_named(choice, r), *_too_many_raised(choice), *worse(shown, r, found_before, found_after)]
    held = [*doubts(rises, creep), *_for_a_person(group, parent, calibration, choice, in_force)]
    decided = Decided.REFUSED if refused else Decided.HELD if held else Decided.PROMOTED
    windows = sum(one.windows for one in shown)
    return replace(
        _decision(group, parent, choice, decided, [*refused, *held, *_raised_line(choice)]),
        calibration_id=calibration.calibration_id,
        in_force=calibration.calibration_id if decided is Decided.PROMOTED else group.history.in_force,
        by_others=sum(one.raised_windows for one in shown) / windows if windows else None,
        found_before=_share(found_before),
        found_after=_share(found_after),
        creep=max((step.rise for step in creep), default=None),
        rises=tuple(map(_rise, rises)),
    )


def _raised_named(choice: _Choice, r: Decimal) -> Iterator[str]:
    for one in choice.chosen:
        if one.named and one.shown is not None and (reason := one.shown.raised(r)):
            yield f"{one.used.name} was named clean, and others find {reason}"


def _too_many_raised(choice: _Choice) -> Iterator[str]:
    if choice.raised > CLEAN_DRIVE.few_raised and choice.raised > CLEAN_DRIVE.most_raised * choice.judged:
        yield (
            f"{choice.raised} of {choice.judged} recordings that nobody named clean are raised, more than "
            f"{CLEAN_DRIVE.most_raised:.0%}: look at them first"
        )


def _for_a_person(
    group: Group,
    parent: Calibration | None,
    calibration: Calibration,
    choice: _Choice,
    in_force: Sequence[Calibration],
) -> Iterator[str]:
    """What a refresh does not decide, whatever the thresholds are."""
    if calibration.calibration_id in group.history.withdrawn:
        yield "it was rolled back before"
    if parent is None and not _some_named(choice):
        rig = group.logs[0].rig
        nearest = [
            one for one in in_force if one.procedure == calibration.procedure and closeness(one, rig) is not None
        ]
        if nearest:
            yield f"its recordings are judged by {nearest[0].rig_kind}: name some clean for a version of their own"


def _some_named(choice: _Choice) -> bool:
    return any(one.named for one in choice.chosen)


def _raised_line(choice: _Choice) -> list[str]:
    return [f"{choice.raised} raised and left out"] if choice.raised else []


def _confirmed(store: Store, group: Group, parent: Calibration | None) -> Calibration:
    assert parent is not None
    confirmed = group.history.confirmed
    try:
        return parent if confirmed in (None, parent.calibration_id) else store.calibration(str(confirmed))
    except ThresholdsError:  # it was counted otherwise: nothing is known of it any more
        return parent


def _new_in_withdrawn(store: Store, group: Group) -> set[str]:
    """The recordings of versions that were rolled back, but for those that are in force."""
    known = store.calibration_recordings() if group.history.withdrawn else {}
    gone = {recording for one in group.history.withdrawn for recording in known.get(one, ())}
    return gone - set(known.get(group.history.in_force or "", ()))


def _used_before(store: Store, parent: Calibration | None) -> tuple[UsedRecording, ...]:
    """What the version in force was made of, as far as that is known."""
    version = read_version(store, parent.calibration_id) if parent is not None else None
    return version.included if version is not None else ()


def _gone(parent: Calibration | None, before: Sequence[UsedRecording], group: Group) -> list[_Chosen]:
    """The recordings of the version in force that no store has any more: their frames are in its calibration."""
    there = {log.recording.recording_id for log in group.logs}
    known = {one.recording_id: one for one in before}
    return [
        _Chosen(known[one.recording_id], Drive(Source(one.recording_id, *known[one.recording_id].origin), one))
        for one in (parent.clean if parent is not None else ())
        if one.recording_id not in there and one.recording_id in known
    ]


def _chosen(log: Log, drive: Drive, reason: str) -> _Chosen:
    known = log.measurement.measurement_id
    return _Chosen(used_recording(log.store, known, reason=reason, clean=drive.clean), drive)


def _drive(log: Log, parent: Calibration | None) -> Drive:
    """The frames of a log: those that the version in force keeps, or the store's."""
    return Drive(_source(log), _kept_frames(log, parent) or clean_frames_of(log.store, log.measurement.measurement_id))


def _kept_frames(log: Log, parent: Calibration | None) -> CleanFrames | None:
    of_log = [one for one in parent.clean if one.recording_id == log.recording.recording_id] if parent else []
    return of_log[0] if len(of_log) == 1 else None


def _source(log: Log) -> Source:
    return Source(log.recording.recording_id, log.recording.vehicle, day_of(log.recording))


def _out(log: Log, reason: str, *, look_at: bool = False, shown: Shown | None = None) -> UsedRecording:
    known = log.measurement.measurement_id
    return used_recording(log.store, known, reason=reason, by_others=shown, look_at=look_at)


def _decision(
    group: Group, parent: Calibration | None, choice: _Choice, decided: Decided, reasons: Sequence[str]
) -> Decision:
    known = set(parent.recordings) if parent is not None else set()
    used = tuple(
        replace(one.found, look_at=one.named and decided is Decided.REFUSED and bool(one.shown and one.shown.strong))
        for one in choice.chosen
    )
    return Decision(
        kind=str(group.history.rig_kind),
        matcher=group.history.procedure.matcher,
        decided=decided,
        reasons=tuple(reasons),
        calibration_id=None,
        before=group.history.in_force,
        in_force=group.history.in_force,
        provisional=decided is not Decided.WAITING and not group.history.vouched and not _some_named(choice),
        recordings=tuple(sorted((*used, *choice.out), key=lambda one: (str(one.day or ""), one.name))),
        new=sum(one.recording_id not in known for one in used),
    )


def _rise(step: Step) -> Rise:
    check = step.check
    return Rise(
        check.check.value, check.sensor, check.others, statistic_at(step.before), statistic_at(step.after), step.rise
    )


def _share(found: tuple[int, int]) -> float | None:
    return found[0] / found[1] if found[1] else None
