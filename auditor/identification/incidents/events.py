"""Events: the frames that belong together, and what each of them is held for."""

from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from auditor.identification.evidence_parameters import INCIDENTS
from auditor.identification.incidents.sequential import Event, Evidence
from auditor.identification.incidents.stretches import LastingEvent
from auditor.model.verdict import FINDINGS, Verdict, VerdictKind

HeldFor = tuple[VerdictKind, tuple[int, ...]]
"""What a frame is held for: the kind, and the attacked sensors."""


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


def held_of(event: Event, verdicts: Mapping[int, Verdict], evidence: Evidence) -> HeldEvent:
    """An event of single frames, with what they are held for."""
    added = evidence.added[list(event.frames)].tolist()
    own = [verdicts[place] for place in event.frames]
    names = [(verdict.kind, verdict.attacked) for verdict in own] if event.alert else _names(own, added)
    held = (HeldFrame(*pair) for pair in zip(names, added, strict=True))
    return HeldEvent(dict(zip(event.frames, held, strict=True)), event.alert)


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
        frames = _beyond(event, alike).difference(others)
        held = HeldFrame((event.kind, event.attacked), event.strength / len(event.frames))
        whole = dict.fromkeys(sorted(frames), held)
        for other in alike:
            whole.update((place, replace(held, added=frame.added)) for place, frame in other.frames.items())
        events = [other for other in events if other not in alike]
        events += [HeldEvent(dict(sorted(whole.items())))] if whole else []
    return events


def _beyond(event: LastingEvent, alike: Collection[HeldEvent]) -> set[int]:
    """The frames of an event of stretches that lie clearly before or behind the events of frames that it takes in."""
    if not alike:
        return set(event.frames)
    first, last = min(other.first for other in alike), max(other.last for other in alike)
    before = {place for place in event.frames if place < first}
    behind = {place for place in event.frames if place > last}
    return {place for part in (before, behind) if len(part) > event.half for place in part}


def _names(verdicts: Sequence[Verdict], added: Sequence[float]) -> list[tuple[VerdictKind, tuple[int, ...]]]:
    """What each frame of an incident is held for: what most of its evidence speaks for.

    Where a share of it names sensors that the likeliest set has none of, each frame is what it says itself, if another
    frame says the same, and unidentified else: sensors may have been attacked in turn, and no innocent one is named.
    """
    likeliest = _likeliest(verdicts, added)
    naming = [(one.attacked, more) for one, more in zip(verdicts, added, strict=True) if one.attacked]
    others = sum(more for attacked, more in naming if set(attacked).isdisjoint(likeliest[1]))
    if not likeliest[1] or others <= INCIDENTS.contested_share * sum(more for _, more in naming):
        return [likeliest] * len(verdicts)
    times = Counter(attacked for attacked, _ in naming)
    return [
        (VerdictKind.ATTACKED, one.attacked) if times[one.attacked] > 1 else (VerdictKind.UNIDENTIFIED, ())
        for one in verdicts
    ]


def _likeliest(verdicts: Sequence[Verdict], added: Sequence[float]) -> tuple[VerdictKind, tuple[int, ...]]:
    """The kind and the attacked sensors that most of an event's evidence speaks for.

    The evidence of a frame speaks for what its own verdict says; that of a frame without a finding for nothing. Where
    its sensors cannot be named it speaks for its likeliest set, if other frames of the event name that.
    """
    named = {verdict.attacked for verdict in verdicts if verdict.kind is VerdictKind.ATTACKED}
    votes: dict[tuple[VerdictKind, tuple[int, ...]], float] = defaultdict(float)
    for verdict, more in zip(verdicts, added, strict=True):
        likeliest = verdict.alternatives[0].attacked if verdict.alternatives else ()
        if verdict.kind is VerdictKind.UNIDENTIFIED and likeliest in named:
            votes[VerdictKind.ATTACKED, likeliest] += more
        elif verdict.kind in FINDINGS:
            votes[verdict.kind, verdict.attacked] += more
    return max(votes.items(), key=lambda one: one[1])[0]
