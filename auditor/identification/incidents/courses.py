"""Courses: which sensors an incident's frames are held for, where these are not the same from its first to its last."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence

from auditor.identification.evidence_parameters import INCIDENTS
from auditor.identification.incidents.sequential import FEWEST_FINDINGS, Event, FrameEvidence, quiet_frames
from auditor.model.verdict import FINDINGS, Verdict, VerdictKind

HeldFor = tuple[VerdictKind, tuple[int, ...]]
"""What a frame is held for: the kind, and the attacked sensors."""


def courses(
    named: Sequence[tuple[int, ...]], event: Event, evidence: FrameEvidence, sensors: Sequence[int], limit: float
) -> list[set[int]]:
    """The sensors that each frame of an event is in the course of; `named` are those that each names by itself.

    A course goes from a frame that names the sensor to the last that does, and ends as incidents do where none has for
    some time. By itself it must be an incident: beyond the `limit`, by the evidence of this sensor alone, of which
    there is a column for each of the `sensors`.
    """
    within = [set[int]() for _ in named]
    for sensor in sorted({sensor for attacked in named for sensor in attacked}):
        of_sensor = [at for at, attacked in enumerate(named) if sensor in attacked]
        for course in _courses(of_sensor, event, evidence):
            places = [event.frames[at] for at in course]
            worth = len(places) >= FEWEST_FINDINGS and evidence.worth[places].sum() >= INCIDENTS.fewest_worth
            if worth and evidence.of_each[places, sensors.index(sensor)].sum() > limit:
                for at in range(course[0], course[-1] + 1):
                    within[at].add(sensor)
    return within


def _courses(of_sensor: Sequence[int], event: Event, evidence: FrameEvidence) -> Iterator[list[int]]:
    course = [of_sensor[0]]
    for at in of_sensor[1:]:
        place, before = event.frames[at], event.frames[course[-1]]
        if place - before > quiet_frames(evidence, before):
            yield course
            course = []
        course.append(at)
    yield course


def names_of(verdicts: Sequence[Verdict], added: Sequence[float], within: Sequence[set[int]]) -> list[HeldFor]:
    """What each frame of an incident is held for: the sensors that it is `within` the courses of.

    Without courses of the likeliest set it is what most of the evidence speaks for. Where a share of it names sensors
    that this set has none of, each frame is what it says itself, if another frame says the same, and unidentified else:
    sensors may have been attacked in turn, and no innocent one is named.
    """
    likeliest = _likeliest(verdicts, added)
    naming = [(one.attacked, more) for one, more in zip(verdicts, added, strict=True) if one.attacked]
    others = sum(more for attacked, more in naming if set(attacked).isdisjoint(likeliest[1]))
    if not likeliest[1] or others <= INCIDENTS.contested_share * sum(more for _, more in naming):
        return _along(within, likeliest)
    times = Counter(attacked for attacked, _ in naming)
    return [
        (VerdictKind.ATTACKED, one.attacked) if times[one.attacked] > 1 else (VerdictKind.UNIDENTIFIED, ())
        for one in verdicts
    ]


def _along(within: Sequence[set[int]], likeliest: HeldFor) -> list[HeldFor]:
    """What frames within courses are held for; those in none, for what the frame before is, or the first in one."""
    sensors = set[int]().union(*within)
    if not likeliest[1] or not sensors.issuperset(likeliest[1]):
        return [likeliest] * len(within)
    held, before = list[HeldFor](), next(of_frame for of_frame in within if of_frame)
    for of_frame in within:
        before = of_frame or before
        held.append((VerdictKind.ATTACKED, tuple(sorted(before))))
    return held


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
