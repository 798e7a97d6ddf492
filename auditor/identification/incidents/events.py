"""Events: the frames that belong together, and what each of them is held for; and whole stretches of a recording.

A stretch is judged as frames are: what is constant for a second counts, however weak it is. It is a window of
successive frames, and each value of it is the median of theirs. Medians of clean stretches differ far less than frames
do, and rare frames do not move them. So the same scores, the same naming and the same causes read a stretch as they
read a frame, with smaller deviations and a limit of its own.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from auditor.identification.evidence_parameters import INCIDENTS, STRETCHES
from auditor.identification.incidents.courses import HeldFor, courses, names_of
from auditor.identification.incidents.sequential import (
    FEWEST_PER_HOUR,
    Event,
    FrameEvidence,
    periods_of,
    places_of,
)
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.prior import joint_limit, prior_of_check
from auditor.identification.statistics import measured_medians
from auditor.model.arrays import Floats, Integers
from auditor.model.calibration import NullDistribution, RobustThresholds
from auditor.model.checks import SensorCheck
from auditor.model.stamps import NANOSECONDS
from auditor.model.verdict import FINDINGS, Verdict, VerdictKind

_AT_ONCE = 512
"""Windows whose values are in memory at once."""


@dataclass(frozen=True, eq=False)
class Windows:
    """W windows over F frames: the first frame of each and the one after its last, both (W,)."""

    first: Integers
    end: Integers

    @property
    def middle(self) -> Integers:
        """(W,) the frame in the middle of each."""
        return (self.first + self.end) // 2


@dataclass(frozen=True)
class LastingEvent:
    """The frames (their places) in which the same sensors were held for attacked over whole stretches.

    `strength` is by how much z the strongest stretch exceeded the limit, `half` is half of the frames of a stretch.
    """

    frames: tuple[int, ...]
    kind: VerdictKind
    attacked: tuple[int, ...]
    strength: float
    half: int


def windows_of(stamps_ns: Integers, runs: Integers) -> Windows:
    """All windows of a stretch's length within the runs (F,) of frames with such stamps (F,).

    A window has the frames of `seconds`, a few at least. A run of fewer frames has none, and one that is shorter than a
    window is one.
    """
    firsts, ends = [np.zeros(0, dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    periods_s = periods_of(stamps_ns, runs)
    for run in places_of(runs):
        if len(run) < STRETCHES.fewest_frames:
            continue
        period_s = max(float(periods_s[run.start]), 1 / NANOSECONDS)
        frames = min(max(round(STRETCHES.seconds / period_s), STRETCHES.fewest_frames), len(run))
        first = np.arange(run.start, run.stop - frames + 1)
        firsts.append(first)
        ends.append(first + frames)
    return Windows(np.concatenate(firsts), np.concatenate(ends))


def series_of(series: FrameSeries, windows: Windows) -> FrameSeries:
    """The windows of a series as a series: each value is the median of its frames, and each flag that of most."""
    middle, columns = windows.middle, [*series.fault_scores.values(), *series.brightness.values()]
    medians = iter(
        _of_windows(np.array(columns, dtype=np.float64).reshape(len(columns), len(series.stamps_ns)).T, windows).T
    )
    return FrameSeries(
        series.stamps_ns[middle],
        series.runs[middle],
        _of_windows(series.statistics, windows),
        _of_windows(series.present.astype(np.float64), windows) > 0.5,
        _of_windows(series.frozen.astype(np.float64), windows) > 0.5,
        {cause: next(medians) for cause in series.fault_scores},
        {key: next(medians) for key in series.brightness},
        agreeing=None if series.agreeing is None else _of_windows(series.agreeing[:, None], windows)[:, 0],
        periods_s=None if series.periods_s is None else series.periods_s[middle],
    )


def _of_windows(values: Floats, windows: Windows) -> Floats:
    """(W, C) the medians of columns (F, C); NaN where fewer than half of a window's values were measured."""
    medians = np.full((len(windows.first), values.shape[1]), np.nan)
    lengths = windows.end - windows.first
    for length in sorted({*lengths.tolist()}):
        view = sliding_window_view(values, length, axis=0)
        places = np.flatnonzero(lengths == length)
        for at in np.split(places, range(_AT_ONCE, len(places), _AT_ONCE)):
            middle, measured = measured_medians(view[windows.first[at]])
            medians[at] = np.where(2 * measured > length, middle, np.nan)
    return medians


def thresholds_of(thresholds: RobustThresholds, checks: int, seconds: float) -> RobustThresholds:
    """What is expected of windows of so many seconds, and the limit that one of so many checks exceeds too rarely.

    That is as often as false incidents are allowed.
    """
    per_hour = INCIDENTS.per_hour if thresholds.incidents_per_hour is None else thresholds.incidents_per_hour
    rate = max(per_hour, FEWEST_PER_HOUR) * seconds / 3600
    expected = {check: of_stretch(check, usual) for check, usual in thresholds.expected.items()}
    return replace(thresholds, limit=joint_limit(rate, checks), expected=expected)


def of_stretch(check: SensorCheck, usual: NullDistribution) -> NullDistribution:
    """What is expected of the median of a stretch, by what is expected of a frame.

    The deviation between drives is that of frames; the one within drives is a share of theirs, and the tail is its own.
    """
    between = max(usual.deviation**2 - usual.within**2, 0.0)
    deviation = sqrt(between + (STRETCHES.within * usual.within) ** 2)
    return replace(usual, deviation=STRETCHES.tail * deviation / prior_of_check(check).tail)


class OuterHalf(NamedTuple):
    """The half of a window, by its place, that lies at the beginning of its run, or at the end."""

    window: int
    at_end: bool


def outer_halves(windows: Windows, runs: Integers) -> tuple[list[OuterHalf], Windows]:
    """The halves of windows with which the runs (F,) begin and end, and their frames as windows."""
    begins = np.isin(windows.first, [run.start for run in places_of(runs)])
    ends = np.isin(windows.end, [run.stop for run in places_of(runs)])
    halves = [
        OuterHalf(place, at_end)
        for at_end in (False, True)
        for place in np.flatnonzero([begins, ends][at_end]).tolist()
    ]
    first = [windows.middle[place] if at_end else windows.first[place] for place, at_end in halves]
    end = [windows.end[place] if at_end else windows.middle[place] for place, at_end in halves]
    return halves, Windows(np.array(first, dtype=np.int64), np.array(end, dtype=np.int64))


def lasting_events(
    windows: Windows, beyond: Floats, verdicts: Mapping[int, Verdict], reached: Collection[OuterHalf]
) -> list[LastingEvent]:
    """The events of windows that are findings, in the order of time.

    `beyond` (W,) is by how much z each window exceeds the limit, and `verdicts` are those that say attacked or
    unidentified, by place. Of windows that overlap at least half have to: where a fault explains most of them, one that
    it does not quite explain is no attack. An event goes from the middle of its first window to that of its last, or to
    the run's ends where it `reached` those halves of them. Where windows that follow one another name other sensors,
    they are events of their own.
    """
    events: list[LastingEvent] = []
    for group in _close_by(windows, np.flatnonzero(beyond > 0).tolist()):
        accusing = [place for place in group if place in verdicts]
        if 2 * len(accusing) >= len(group):
            events += _of_group(windows, accusing, beyond, verdicts, reached)
    return events


def _close_by(windows: Windows, places: Sequence[int]) -> Iterator[list[int]]:
    """The places of windows in groups whose windows overlap."""
    group: list[int] = []
    for place in places:
        if group and windows.first[place] >= windows.end[group[-1]]:
            yield group
            group = []
        group.append(place)
    if group:
        yield group


def _of_group(
    windows: Windows,
    group: Sequence[int],
    beyond: Floats,
    verdicts: Mapping[int, Verdict],
    reached: Collection[OuterHalf],
) -> Iterator[LastingEvent]:
    names = _most_named([verdicts[place].attacked for place in group])
    for attacked, members in groupby(zip(names, group, strict=True), key=lambda pair: pair[0]):
        places = [place for _, place in members]
        kind = VerdictKind.ATTACKED if attacked else VerdictKind.UNIDENTIFIED
        strength = float(beyond[places].max())
        half = int(windows.end[places[0]] - windows.first[places[0]]) // 2
        yield LastingEvent(_frames(windows, places[0], places[-1], reached), kind, attacked, strength, half)


def _most_named(attacked: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """The sensors that each of successive windows is held for.

    They are those that most windows name, unless a large share names sensors that are none of them: then each window
    is held for what it names, and one that names none for what the window before names.
    """
    named = [one for one in attacked if one]
    if not named:
        return [()] * len(attacked)
    likeliest = max(dict.fromkeys(named), key=named.count)
    others = sum(set(one).isdisjoint(likeliest) for one in named)
    if others <= INCIDENTS.contested_share * len(named):
        return [likeliest] * len(attacked)
    names, before = [], named[0]
    for sensors in attacked:
        before = sensors or before
        names.append(before)
    return names


def _frames(windows: Windows, first: int, last: int, reached: Collection[OuterHalf]) -> tuple[int, ...]:
    """The frames from the middle of a window to that of another; to the ends of those that are `reached`."""
    middle = windows.middle
    begin = windows.first[first] if OuterHalf(first, at_end=False) in reached else middle[first]
    end = windows.end[last] if OuterHalf(last, at_end=True) in reached else middle[last] + 1
    return tuple(range(int(begin), int(end)))


def seconds_of(windows: Windows, stamps_ns: Integers) -> float:
    """The time that a usual window lasts, in seconds; 0 without any."""
    if not len(windows.first):
        return 0.0
    lasts = stamps_ns[windows.end - 1] - stamps_ns[windows.first]
    return float(np.median(lasts)) / NANOSECONDS


@dataclass(frozen=True)
class HeldFrame:
    """What a frame of an event is held for, and what it adds to the event."""

    held_for: HeldFor
    added: float


@dataclass(frozen=True)
class HeldEvent:
    """The frames of an event, by their places."""

    frames: Mapping[int, HeldFrame]
    alert: bool = False

    @property
    def first(self) -> int:
        """The place of its first frame."""
        return min(self.frames)

    @property
    def last(self) -> int:
        """The place of its last frame."""
        return max(self.frames)

    @property
    def named(self) -> set[tuple[int, ...]]:
        """The sets of attacked sensors that its frames are held for."""
        return {frame.held_for[1] for frame in self.frames.values() if frame.held_for[0] is VerdictKind.ATTACKED}


def held_of(
    event: Event, verdicts: Mapping[int, Verdict], evidence: FrameEvidence, sensors: Sequence[int], limit: float
) -> HeldEvent:
    """An event of single frames, with what they are held for; a course needs evidence beyond the `limit`.

    A frame at an end of an incident that says itself of other sensors alone, or of none, with no other beside it, is no
    part of it.
    """
    added = evidence.added[list(event.frames)].tolist()
    own = [verdicts[place] for place in event.frames]
    if event.alert:
        names = [(verdict.kind, verdict.attacked) for verdict in own]
    else:
        names = names_of(own, added, courses([verdict.attacked for verdict in own], event, evidence, sensors, limit))
    held = dict(zip(event.frames, (HeldFrame(*pair) for pair in zip(names, added, strict=True)), strict=True))
    return HeldEvent(held if event.alert else _of_own_ends(held, verdicts), event.alert)


def _of_own_ends(held: Mapping[int, HeldFrame], verdicts: Mapping[int, Verdict]) -> dict[int, HeldFrame]:
    """The frames of an incident from the first to the last that speaks for it, or has another one beside it."""
    places = list(held)
    inner = [
        at
        for at, place in enumerate(places)
        if _speaks_for(verdicts[place], held[place]) or {place - 1, place + 1}.intersection(held)
    ]
    return {place: held[place] for place in places[inner[0] : inner[-1] + 1]} if inner else dict(held)


def _speaks_for(verdict: Verdict, frame: HeldFrame) -> bool:
    """Whether a frame says itself that one of the sensors is attacked that it is held for, or that it cannot tell."""
    attacked = set(frame.held_for[1])
    return verdict.kind in FINDINGS and not (verdict.attacked and attacked and attacked.isdisjoint(verdict.attacked))


def with_lasting(of_frames: Sequence[HeldEvent], lasting: Sequence[LastingEvent]) -> list[HeldEvent]:
    """All events: those of single frames, and those of stretches.

    An event of stretches takes in the events of frames that it meets and that name no other sensors. Between their
    frames these say which belong to it, since an attack may leave frames alone; and so they do at its ends, which
    stretches tell to half of their length. Frames of events that name other sensors stay theirs.
    """
    events = list(of_frames)
    for event in lasting:
        met = [other for other in events if not set(event.frames).isdisjoint(other.frames)]
        alike = [other for other in met if other.named <= {event.attacked}]
        others = {place for other in met if other not in alike for place in other.frames}
        whole_of = {place for other in alike for place in other.frames}
        frames = _beyond(event, whole_of | _naming(event, met)).difference(others)
        held = HeldFrame((event.kind, event.attacked), event.strength / len(event.frames))
        whole = dict.fromkeys(sorted(frames), held)
        for other in alike:
            whole.update((place, replace(held, added=frame.added)) for place, frame in other.frames.items())
        events = [other for other in events if other not in alike]
        events += [HeldEvent(dict(sorted(whole.items())))] if whole else []
    return events


def _naming(event: LastingEvent, others: Sequence[HeldEvent]) -> set[int]:
    """The frames of other events that are held for the sensors of an event of stretches, and maybe for more."""
    attacked = set(event.attacked)
    frames = ((place, set(frame.held_for[1])) for other in others for place, frame in other.frames.items())
    return {place for place, sensors in frames if attacked and attacked <= sensors}


def _beyond(event: LastingEvent, held: Collection[int]) -> set[int]:
    """The frames of an event of stretches that lie clearly before or behind frames that are held for the same."""
    if not held:
        return set(event.frames)
    first, last = min(held), max(held)
    before = {place for place in event.frames if place < first}
    behind = {place for place in event.frames if place > last}
    return {place for part in (before, behind) if len(part) > event.half for place in part}
