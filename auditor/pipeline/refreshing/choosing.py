"""Which logs of a rig kind are learnt from. Nothing is written here."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal

from auditor.identification.cross_validation import thresholds_of
from auditor.identification.refresh_parameters import CLEAN_DRIVE, INFLUENCE
from auditor.identification.refreshing.drives import Drive, DriveScores, DriveSource, shown_by, shown_by_others
from auditor.identification.refreshing.influence import crowded, influential, limited
from auditor.identification.refreshing.two_samples import differing
from auditor.identification.systems import System
from auditor.model.calibration import Calibration, CleanFrames
from auditor.pipeline.calibrations.versions import GIVEN, taken
from auditor.pipeline.refreshing.pool import Log, LogGroup
from auditor.store.versions.decisions import QuarantineEntry
from auditor.store.versions.records import UsedRecording

NAMED = "named clean"
LABELLED = "labelled clean"
REVIEWED = "its incidents were reviewed as false alarms"
"""Somebody looked at this recording: it has a label of its own, or reviews."""

_BY_PERSON = (NAMED, LABELLED, REVIEWED, GIVEN)
_WITHDRAWN = "it was new in a version that was rolled back; label it clean if it is"
_BEFORE = "in the version of before"
_NOT_NAMED = "the first version is made of what was named clean"


@dataclass(frozen=True, eq=False)
class RigKindState:
    """What is known of a rig kind before a refresh.

    `parent` is the version in force, `before` what it was made of, `confirmed` the version that a person confirmed
    last. `withdrawn` are recordings that were new in versions that were rolled back; `waiting` those that a person
    should look at, by recording. `lost` says which versions came into force before, where no history tells of any.
    """

    parent: Calibration | None = None
    confirmed: Calibration | None = None
    before: tuple[UsedRecording, ...] = ()
    withdrawn: frozenset[str] = frozenset()
    lost: tuple[str, ...] = ()
    waiting: Mapping[str, QuarantineEntry] = field(default_factory=dict)

    @property
    def clean(self) -> Sequence[CleanFrames]:
        """The recordings of the version in force; none where there is none."""
        return self.parent.clean if self.parent is not None else ()

    @property
    def in_force(self) -> frozenset[str]:
        """The ids of the recordings of the version in force."""
        return frozenset(self.parent.recordings if self.parent is not None else ())

    @property
    def judges(self) -> str:
        """Which thresholds new logs are judged by."""
        return "the version in force" if self.parent is not None else "the prior"


@dataclass(frozen=True, eq=False)
class LearntRecording:
    """A recording that is learnt from, its frames, and what it shows when others judge it.

    `at_first` is what it showed by the version in force; None where it was not judged by that.
    """

    used: UsedRecording
    drive: Drive
    shown: DriveScores | None = None
    at_first: DriveScores | None = None

    @property
    def named(self) -> bool:
        """Whether a person called it clean."""
        return self.used.reason in _BY_PERSON

    @property
    def doubtful(self) -> bool:
        """Whether it was named clean among others, and nobody says that this one was looked at."""
        return self.named and self.used.reason not in (LABELLED, REVIEWED)

    @property
    def new(self) -> bool:
        """Whether it was judged in this refresh for the first time."""
        return self.at_first is not None

    def out(self, reason: str) -> UsedRecording:
        """The recording as one that a person should look at."""
        return replace(self.found, included=False, reason=reason, look_at=True)

    @property
    def found(self) -> UsedRecording:
        """The recording with what it shows."""
        return with_shown(self.used, self.shown or self.at_first)


@dataclass(frozen=True, eq=False)
class Choice:
    """The logs that are learnt from, and those that are not.

    `raised` of the `judged` logs that are new did not seem clean.
    """

    chosen: tuple[LearntRecording, ...]
    out: tuple[UsedRecording, ...]
    judged: int
    raised: int

    @property
    def judged_twice(self) -> tuple[list[DriveScores], list[DriveScores]]:
        """What the new logs that are learnt from show by the version in force, and by the others."""
        both = [(one.at_first, one.shown) for one in self.chosen if one.at_first is not None and one.shown is not None]
        return [before for before, _ in both], [after for _, after in both]

    @property
    def waiting_of(self) -> tuple[int, int]:
        """The logs that did not seem clean, and that nobody has looked at, and of how many.

        Both of the days since the first that is learnt from and that nobody named: the list of those that wait grows
        without end where nobody looks at it, and what is learnt from does not.
        """
        days = [one.used.day for one in self.chosen if not one.named and one.used.day is not None]
        since = min(days, default=None)

        def counts(used: UsedRecording) -> bool:
            return since is None or used.day is None or used.day >= since

        waiting = sum(one.look_at and one.findings_by_others is not None and counts(one) for one in self.out)
        return waiting, waiting + sum(counts(one.used) for one in self.chosen)

    @property
    def too_few(self) -> bool:
        """Whether fewer recordings than a first version needs have as many frames as say anything of a drive."""
        enough = sum(one.used.frames >= CLEAN_DRIVE.fewest_frames for one in self.chosen)
        return enough < INFLUENCE.fewest_first

    @property
    def some_named(self) -> bool:
        """Whether a person called one of them clean."""
        return any(one.named for one in self.chosen)

    def without(self, reasons: Mapping[int, str]) -> "Choice":
        """The choice without some of those that are learnt from, by their places, which were raised.

        Those of the version in force wait as well; of the new ones they are none.
        """
        left = tuple(one for place, one in enumerate(self.chosen) if place not in reasons)
        out = tuple(self.chosen[place].out(reason) for place, reason in reasons.items())
        return Choice(
            left, (*self.out, *out), self.judged, self.raised + sum(self.chosen[place].new for place in reasons)
        )


def with_shown(used: UsedRecording, shown: DriveScores | None) -> UsedRecording:
    """The recording with what it shows; as it is where it was not judged."""
    if shown is None:
        return used
    return replace(used, findings_by_others=shown.findings, incidents_by_others=shown.incidents)


def choose(group: LogGroup, state: RigKindState, system: System, r: Decimal) -> Choice:
    """The logs that nothing bars, as many as may count, that seem clean or were named so."""
    named, others, barred = _eligible(group, state)
    others, too_many = _within_limits(others, named, [one for one in group.logs if _waits(one, state)])
    base = thresholds_of(state.clean, system, r)
    in_force = state.in_force
    by = state.judges if state.parent is not None else f"{state.judges} and the others"
    chosen = [_chosen(log, state, _by_person(log)) for log in named] + _gone(state, group)
    raised = list[UsedRecording]()
    for log in others:
        if log.used.recording_id in in_force:
            chosen.append(_chosen(log, state, _BEFORE))
            continue
        recording = _chosen(log, state, f"judged clean by {by}")
        recording = replace(recording, at_first=shown_by(recording.drive.clean, system, base))
        if recording.at_first is not None and (reason := recording.at_first.raised(r)):
            raised.append(recording.out(f"raised by {state.judges}: {reason}"))
        else:
            chosen.append(recording)
    out = (*barred, *too_many, *raised)
    new = sum(one.new for one in chosen) + len(raised)
    choice = _compared(Choice(tuple(chosen), out, new, len(raised)), system, r)
    reasons = _found_by_scans(choice, group) if state.parent is not None else {}
    return _compared(choice.without(reasons), system, r) if reasons else choice


def _found_by_scans(choice: Choice, group: LogGroup) -> dict[int, str]:
    """Why new logs that nobody named wait, by their places: they end a scan in findings, and nobody has looked yet."""
    told = {log.used.recording_id: log.told for log in group.logs}
    return {
        place: f"{told[recording]} frames of it are in incidents or alerts"
        for place, one in enumerate(choice.chosen)
        if one.new and not one.named and told.get(recording := one.used.recording_id)
    }


def _by_person(log: Log) -> str:
    """How a person called a log clean."""
    return (REVIEWED if log.reviewed else LABELLED) if log.labelled else NAMED


def _within_limits(
    logs: Sequence[Log], named: Sequence[Log], waiting: Sequence[Log]
) -> tuple[list[Log], list[UsedRecording]]:
    """The logs that count, and those of a vehicle, day or road that has too many of them.

    Those that a person `named` clean have no limit, and are said where a vehicle has some.
    """
    too_many = dict(limited([log.source for log in logs], [log.source for log in waiting]))
    left = [log for place, log in enumerate(logs) if place not in too_many]
    same_road = dict(crowded([log.circumstances().visited for log in left]))
    out = [_out(logs[place], reason + _beside(logs[place], named)) for place, reason in too_many.items()]
    out += [_out(left[place], reason) for place, reason in same_road.items()]
    return [log for place, log in enumerate(left) if place not in same_road], out


def _beside(log: Log, named: Sequence[Log]) -> str:
    """What is said of the logs of the same vehicle that a person named clean, where there are any."""
    count = sum(one.source.vehicle == log.source.vehicle is not None for one in named)
    return f" ({count} of it that a person named clean {'is' if count == 1 else 'are'} not counted)" if count else ""


def _waits(log: Log, state: RigKindState) -> bool:
    """Whether a log was raised before, and nobody has looked at it since."""
    waiting = state.waiting.get(log.used.recording_id)
    return waiting is not None and waiting.judged and not log.named


def _eligible(group: LogGroup, state: RigKindState) -> tuple[list[Log], list[Log], list[UsedRecording]]:
    """The logs that a person named, others that may be learnt from, and those that may not."""
    vouched = {one.recording_id for one in state.before if one.reason in _BY_PERSON}
    named_only = state.parent is None and any(log.named and not log.barred for log in group.logs)
    named, others, out = list[Log](), list[Log](), list[UsedRecording]()
    for log in group.logs:
        recording = log.used.recording_id
        waiting = state.waiting.get(recording)
        if log.barred:
            out.append(_out(log, log.barred, look_at=log.look_at))
        elif log.named or recording in vouched:
            named.append(log)
        elif log.doubt:
            out.append(_out(log, log.doubt, look_at=log.look_at))
        elif waiting is not None and waiting.judged:
            used = replace(log.used, findings_by_others=waiting.findings_by_others)
            out.append(replace(used, reason=waiting.reason, look_at=True))
        elif recording in state.withdrawn:
            out.append(_out(log, _WITHDRAWN, look_at=True))
        elif named_only:
            out.append(_out(log, _NOT_NAMED))
        else:
            others.append(log)
    return named, others, out


def _compared(choice: Choice, system: System, r: Decimal) -> Choice:
    """New logs compared with the others, then each judged by logs of other vehicles and days.

    Those that nobody named, and that are not like the others, move a threshold far or are raised, go out; then the rest
    is compared again.
    """
    while True:
        drives = [one.drive for one in choice.chosen]
        new = [place for place, one in enumerate(choice.chosen) if one.new]
        odd = {place: str(one) for place, one in differing(drives, new, system).items()}
        if odd := odd or influential(drives, new, system, r):
            choice = choice.without(odd)
            continue
        every = shown_by_others(drives, system, r)
        chosen = tuple(replace(one, shown=shown) for one, shown in zip(choice.chosen, every, strict=True))
        raised = {place: shown.raised(r) for place, shown in enumerate(every) if not chosen[place].named}
        choice = replace(choice, chosen=chosen)
        reasons = {place: f"raised by the others: {reason}" for place, reason in raised.items() if reason}
        if not reasons:
            return choice
        choice = choice.without(reasons)


def _gone(state: RigKindState, group: LogGroup) -> list[LearntRecording]:
    """The recordings of the version in force that no store has any more: their frames are in its calibration."""
    there = {log.used.recording_id for log in group.logs}
    used = {one.recording_id: one for one in state.before}
    return [
        LearntRecording(
            used[one.recording_id], Drive(DriveSource(one.recording_id, *used[one.recording_id].origin), one)
        )
        for one in state.clean
        if one.recording_id not in there and one.recording_id in used
    ]


def _chosen(log: Log, state: RigKindState, reason: str) -> LearntRecording:
    drive = Drive(log.source, _kept_frames(log, state) or log.frames())
    hour = log.circumstances().time_of_day
    used = replace(taken(log.used, drive.clean), reason=reason, time_of_day=hour.value if hour else None)
    return LearntRecording(used, drive)


def _kept_frames(log: Log, state: RigKindState) -> CleanFrames | None:
    """The frames of a log that the version in force keeps; None where it has none, or those of several rigs."""
    of_log = [one for one in state.clean if one.recording_id == log.used.recording_id]
    return of_log[0] if len(of_log) == 1 else None


def _out(log: Log, reason: str, *, look_at: bool = False) -> UsedRecording:
    return replace(log.used, reason=reason, look_at=look_at)


def considered(choice: Choice) -> Sequence[UsedRecording]:
    """All recordings, those that are learnt from and those that are not, by day and name."""
    every = (*(one.found for one in choice.chosen), *choice.out)
    return sorted(every, key=lambda one: (str(one.day or ""), one.name))
