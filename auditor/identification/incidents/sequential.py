"""Incidents: a sequential test (CUSUM) on the log-likelihood ratio of each frame, attacked against clean.

1. A frame's ratio compares how likely its largest score is under attack and on clean roads (`log_ratios`).
2. Under attack only some frames may be attacked: a frame that shows nothing takes little away (`evidence_of`).
3. Successive frames are alike: each counts for the independent ones that it is worth at its rate (`frame_worth`).
4. The sum of this evidence, which is never below zero, rises and falls. An excursion from zero that exceeds the limit
   is an incident. It begins with its first rise, and ends where the sum has not risen for some time. A rise at either
   end that is no finding, with no other one beside it, is no part of it; nor is a lone finding far from all others.
5. It has to be evidence of one and the same sensor, in as many findings as an incident needs. Where a fault explains a
   frame as well its evidence counts for a share, and an attack is an incident by the frames that no fault explains
   (`Excursion.peak`).
6. The limit follows from how many false incidents an hour are allowed: the peaks of clean excursions are counted, and
   continued by an exponential tail (`incident_limit`).
7. Findings that no incident holds are alerts: two in a row, two and more of one sensor in a tenth of all frames, or one
   very strong frame. A short recording has little time: such findings count as found all the same, though no rate of
   false alerts is promised (`alerts`).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, log

import numpy as np

from auditor.identification.evidence_parameters import ALERTS, INCIDENTS
from auditor.identification.parameters import SCORE_LIMITS
from auditor.identification.prior import joint_limit
from auditor.model.arrays import Flags, Floats, Integers
from auditor.model.stamps import NANOSECONDS
from auditor.model.verdict import Verdict

_S_PER_HOUR = 3600

FEWEST_FINDINGS = 2
"""Findings of an incident, or in a row: one frame is neither."""
FEWEST_PER_HOUR = 0.01
"""False incidents: fewer are taken for so many, since no clean drives reach further."""


QUIET_FRAMES = round(1 / INCIDENTS.duty)
"""Frames without a rise that no incident ends with: a strobe of one frame in so many is one attack."""


@dataclass(frozen=True)
class Excursion:
    """The places of the frames at which the sum rose between two of its zeros, and the peak that an incident needs.

    `peak` is the largest sum of a sensor that enough findings speak for: of the evidence that no fault explains, or a
    share of all of it. It is 0 where there is no such sensor.
    """

    rises: tuple[int, ...]
    peak: float


@dataclass(frozen=True)
class Event:
    """The places of the frames that belong to an event: an incident, or an `alert`."""

    frames: tuple[int, ...]
    alert: bool = False


@dataclass(frozen=True, eq=False)
class FrameEvidence:
    """What each of F frames adds to the sum (F,), its log-likelihood ratio (F,) and its run (F,) without a gap.

    `of_each` (F, S) is what each sensor adds, and `unexplained` (F, S) of that what no fault explains as well. `worth`
    (F,) is how many independent frames it is worth, and `periods_s` (F,) are the usual times between two frames of its
    run; NaN where there is only one.
    """

    added: Floats
    of_each: Floats
    unexplained: Floats
    ratios: Floats
    worth: Floats
    runs: Integers
    periods_s: Floats


def evidence_of(scores: Floats, checks: int, periods_s: Floats, runs: Integers) -> FrameEvidence:
    """The evidence of F successive frames, from the largest z (F,) of so many checks; -inf where none was measured.

    `runs` (F,) number the runs without a gap that the frames belong to, in ascending order, and `periods_s` (F,) are
    their `periods_of`. One sensor has all scores, and nothing is explained: `of_sensors` says more.
    """
    worth = frame_worth(periods_s)
    ratios = log_ratios(scores, checks)
    added = _added(ratios, worth)
    return FrameEvidence(added, added[:, None], added[:, None], ratios, worth, runs, periods_s)


def of_sensors(whole: FrameEvidence, scores: Floats, explained: Flags, checks: int) -> FrameEvidence:
    """The evidence of F frames by sensor: `scores` (F, S) is the largest z of each.

    `explained` (F,) says which frames a fault explains as well as an attack.
    """
    own = _added(log_ratios(scores, checks), whole.worth[:, None])
    return replace(whole, of_each=own, unexplained=np.where(explained[:, None], 0.0, own))


def _added(ratios: Floats, worth: Floats) -> Floats:
    """What frames add to a sum, of such log-likelihood ratios and worth so many independent ones."""
    duty = INCIDENTS.duty
    intermittent = np.log(duty * np.exp(np.minimum(ratios, INCIDENTS.most_of_a_frame)) + 1 - duty)
    return np.asarray(np.nan_to_num(intermittent) * worth)


def log_ratios(scores: Floats, checks: int) -> Floats:
    """Log-likelihood ratios, attacked against clean, of the largest z of so many checks; NaN where not measured.

    Under attack any score between 0 and the largest is as likely. On clean roads it exceeds the joint limit at a rate,
    and beyond that limit each further deviation is less likely by a factor.
    """
    limit, slope = joint_limit(INCIDENTS.tail_rate, checks), INCIDENTS.tail_slope
    attacked, clean_at_limit = 1 / SCORE_LIMITS.highest, slope * INCIDENTS.tail_rate
    measured = np.where(np.isfinite(scores), scores, np.nan)
    return np.asarray(log(attacked / clean_at_limit) + slope * (measured - limit))


def frame_worth(periods_s: Floats) -> Floats:
    """How many independent frames each frame is worth, 0 to 1, at these times between two; 1 where there is only one.

    The autocorrelation of clean evidence after a time t is taken for c exp(-t / T), so that F frames of period p are
    worth F / (1 + 2 c / (exp(p / T) - 1)).
    """
    periods = np.where(np.isnan(periods_s), np.inf, np.maximum(periods_s, 1 / NANOSECONDS))
    with np.errstate(over="ignore"):
        return np.asarray(1 / (1 + 2 * INCIDENTS.correlation / np.expm1(periods / INCIDENTS.correlation_s)))


def periods_of(stamps_ns: Integers, runs: Integers) -> Floats:
    """(F,) the median time between two frames of the run of each frame, in seconds; NaN of a lone frame."""
    periods = np.full(len(runs), np.nan)
    for run in places_of(runs):
        if len(run) > 1:
            periods[run.start : run.stop] = float(np.median(np.diff(stamps_ns[run.start : run.stop]))) / NANOSECONDS
    return periods


def excursions(evidence: FrameEvidence, raised: Flags) -> Iterator[Excursion]:
    """The excursions of the sum from zero, in order; it begins anew with each run.

    The frames that `raised` (F,) flags are findings by themselves.
    """
    for run in places_of(evidence.runs):
        added = evidence.added[run.start : run.stop].tolist()
        for rises in _rises(run, added, quiet_frames(evidence, run.start)):
            yield Excursion(tuple(rises), _peak(evidence, rises, raised))


def peaks_of(evidence: FrameEvidence, raised: Flags) -> list[float]:
    """The peaks of the excursions that hold as many findings as an incident, where `raised` (F,) frames are findings.

    Of clean drives: `incident_limit` follows from them.
    """
    return [one.peak for one in excursions(evidence, raised) if one.peak > 0]


def events(evidence: FrameEvidence, raised: Flags, limit: float, per_hour: float | None = None) -> list[Event]:
    """The incidents of F frames in the order of time: where the sum exceeds the `limit`.

    Some frames that speak for one and the same sensor must be findings by themselves, as the flags `raised` (F,) say:
    two at least, and as many as are worth most of an independent one. A false incident `per_hour` is allowed.
    """
    strong = strong_frames(evidence, raised, per_hour)
    return [
        Event(_trimmed(one.rises, raised, strong, evidence.periods_s, INCIDENTS.gap_s))
        for one in excursions(evidence, raised)
        if one.peak > limit
    ]


def _trimmed(rises: Sequence[int], raised: Flags, strong: Flags, periods_s: Floats, seconds: float) -> tuple[int, ...]:
    """The frames of an event less those at its ends that stand alone.

    A clean frame with a little evidence, half a second after an attack, is no part of it, where no other is beside it.
    Nor is a finding that is not `strong` (F,), with no other frame within so many `seconds`: a false one long before an
    attack is not its beginning. Where all findings are as far apart, as those of a strobe, each is a part of the event.
    """
    findings = [place for place in rises if raised[place]]
    far = _frames_of(seconds, float(periods_s[rises[0]]))
    weak = ~strong & any(after - one <= far for one, after in pairwise(findings))

    def alone(place: int, beside: int) -> bool:
        return bool(abs(beside - place) > far and weak[place]) if raised[place] else abs(beside - place) > 1

    first, end = 0, len(rises)
    while end - first > 1 and alone(rises[first], rises[first + 1]):
        first += 1
    while end - first > 1 and alone(rises[end - 1], rises[end - 2]):
        end -= 1
    return tuple(rises[first:end])


def strong_frames(evidence: FrameEvidence, raised: Flags, per_hour: float | None) -> Flags:
    """(F,) raised frames as strong as clean frames are less than `per_hour`; None stands for the usual rate."""
    limits = _single_limits(evidence, INCIDENTS.per_hour if per_hour is None else per_hour)
    return np.asarray(raised & (evidence.ratios > limits))


def alerts(
    loose: Flags,
    verdicts: Mapping[int, Verdict],
    accusing: Flags,
    audited: Flags,
    strong: Flags,
    periods_s: Floats,
    r: float,
) -> list[Event]:
    """The alerts among F frames that are judged at r, in the order of time; all flags are (F,), and so are `periods_s`.

    `loose` are findings by themselves that no incident holds, and `verdicts` those on them, by place; `accusing` are
    frames that say attacked or unidentified, `audited` those with a verdict. The `strong` ones are told by themselves.
    """
    share = max(ALERTS.share, ALERTS.times_r * r) * np.count_nonzero(audited)
    named = {place: verdicts[place].attacked for place in np.flatnonzero(loose).tolist()}
    often = _often(named, max(share, FEWEST_FINDINGS))
    groups = [_trimmed(often, loose, strong, periods_s, INCIDENTS.quiet_s)] if often else []
    left = loose.copy()
    left[[place for group in groups for place in group]] = False
    groups += _rows(left, accusing, audited, _fewest_in_a_row(r))
    told = {place for group in groups for place in group}
    groups += [(place,) for place in np.flatnonzero(left & strong).tolist() if place not in told]
    return [Event(group, alert=True) for group in sorted(groups)]


def _often(attacked: Mapping[int, tuple[int, ...]], fewest: float) -> tuple[int, ...]:
    """The findings that name a sensor or nobody, where these are the `fewest` at least.

    Those of several sensors do not add up: findings of one make no alert of another one's. Nor does a sensor that one
    of them names alone, with none beside it.
    """
    sensors: set[int | None] = {sensor for named in attacked.values() for sensor in named}
    often = set[int]()
    for sensor in sensors or {None}:
        places = [place for place, named in attacked.items() if not named or sensor in named]
        naming = [place for place in places if sensor in attacked[place]]
        if len(naming) == 1 and not {naming[0] - 1, naming[0] + 1}.intersection(places):
            places.remove(naming[0])
        if len(places) >= fewest:
            often.update(places)
    return tuple(sorted(often))


def _fewest_in_a_row(r: float) -> int:
    """How many findings in a row independent clean frames hardly ever make, each with the chance r."""
    by_chance = ceil(log(ALERTS.chance) / log(r)) if 0 < r < 1 else 0
    return max(FEWEST_FINDINGS, by_chance)


def _rows(loose: Flags, accusing: Flags, audited: Flags, fewest: int) -> Iterator[tuple[int, ...]]:
    """So many findings in a row, of which one at least accuses; frames that could not be audited do not end a row."""
    places = np.flatnonzero(audited | loose)
    ends = np.flatnonzero(np.diff(np.concatenate([[False], loose[places], [False]]).astype(np.int8)))
    for first, end in zip(ends[::2], ends[1::2], strict=True):
        row = places[first:end]
        if len(row) >= fewest and accusing[row].any():
            yield tuple(row.tolist())


def joined(parts: Sequence[FrameEvidence], order: Integers) -> FrameEvidence:
    """The evidence of the frames of several parts as one series, in an `order` (F,) of their places one after another.

    The parts have the same sensors, and runs that are numbered through.
    """
    columns = zip(*(tuple(vars(part).values()) for part in parts), strict=True)
    return FrameEvidence(*(np.concatenate(column)[order] for column in columns))


def apart(event: Event, named: Sequence[tuple[int, ...]], added: Sequence[float], limit: float) -> list[Event]:
    """The incidents that an event holds: one, or several where one attack follows another on other sensors.

    `named` are the sensors that each of its frames names, and `added` what it adds. Each part must have evidence beyond
    the `limit` for sensors that the other names nowhere, and in time none may lie within another.
    """
    spans: dict[tuple[int, ...], list[int]] = {}
    for place, attacked in enumerate(named):
        if attacked:
            spans.setdefault(attacked, []).append(place)
    clear = [(places, one) for one, places in spans.items() if sum(added[place] for place in places) > limit]
    ordered = sorted(clear)
    follow = all(
        earlier[-1] < later[0] and set(one).isdisjoint(other) for (earlier, one), (later, other) in pairwise(ordered)
    )
    if len(ordered) < 2 or not follow:
        return [event]
    begins = [0, *(places[0] for places, _ in ordered[1:]), len(named)]
    return [Event(event.frames[first:end]) for first, end in pairwise(begins)]


def incident_limit(per_hour: float | None = None, peaks: Sequence[float] = (), hours: float = 0.0) -> float:
    """What the sum exceeds in no more than so many incidents an hour of clean driving; None for the usual rate.

    `peaks` are those of the excursions of so many `hours` of clean driving. Beyond the smallest that counts they are
    taken for exponential; how many there are, and how far they reach, is known beforehand from a few of the prior.
    """
    allowed = max(INCIDENTS.per_hour if per_hour is None else per_hour, FEWEST_PER_HOUR)
    least, prior = INCIDENTS.peaks_from, INCIDENTS.prior_peaks
    beyond = [peak - least for peak in peaks if peak > least]
    rate = (prior + len(beyond)) / (INCIDENTS.prior_hours + hours)
    scale = (prior * INCIDENTS.prior_scale + sum(beyond)) / (prior + len(beyond))
    return least + max(scale * log(rate / allowed), 0.0)


def _single_limits(evidence: FrameEvidence, per_hour: float) -> Floats:
    """(F,) the ratio that clean frames exceed `per_hour` times an hour at the rate of each frame's run.

    A lone frame, whose rate is not known, is taken for one a second.
    """
    rates = max(per_hour, FEWEST_PER_HOUR) * np.nan_to_num(evidence.periods_s, nan=1.0) / _S_PER_HOUR
    return -np.log(SCORE_LIMITS.highest * INCIDENTS.tail_slope * np.maximum(rates, 1 / NANOSECONDS))


def _rises(run: range, added: Sequence[float], quiet: int) -> Iterator[list[int]]:
    """The places at which the sum rises in each excursion of one run, in which its frames add so much.

    One ends at zero, where the sum has not risen for `quiet` frames, and with the run.
    """
    total, rises = 0.0, list[int]()
    for place, more in zip(run, added, strict=True):
        if rises and (total + more <= 0 or (more <= 0 and place - rises[-1] > quiet)):
            yield rises
            total, rises = 0.0, []
        elif rises or more > 0:
            total += more
            if more > 0:
                rises.append(place)
    if rises:
        yield rises


def _peak(evidence: FrameEvidence, rises: Sequence[int], raised: Flags) -> float:
    """The peak of the excursion whose sum rises at these places; the sums of sensors begin and end with it."""
    span, findings = slice(rises[0], rises[-1] + 1), [place for place in rises if raised[place]]

    def highest(added: Floats) -> float:
        speaking = added[findings] > 0
        enough = np.count_nonzero(speaking, axis=0) >= FEWEST_FINDINGS
        enough &= evidence.worth[findings] @ speaking >= INCIDENTS.fewest_worth
        return float((_highest(added[span]) * enough).max())

    return max(highest(evidence.unexplained), INCIDENTS.explained_share * highest(evidence.of_each))


def _highest(added: Floats) -> Floats:
    """(S,) the largest that the sums of (F, S) numbers become, which are never below zero."""
    total = np.cumsum(added, axis=0)
    lowest = np.minimum(np.minimum.accumulate(total, axis=0), 0.0)
    return np.asarray((total - lowest).max(axis=0))


def quiet_frames(evidence: FrameEvidence, place: int) -> int:
    """For how many frames of a run the sum must not have risen until its excursion has ended."""
    return _frames_of(INCIDENTS.quiet_s, float(evidence.periods_s[place]))


def _frames_of(seconds: float, period_s: float) -> int:
    """How many frames so many seconds have at a period, and at least as many as a strobe leaves out."""
    return max(ceil(seconds / period_s) if period_s > 0 else 0, QUIET_FRAMES)


def places_of(runs: Integers) -> Iterator[range]:
    """The places of the frames of each run."""
    bounds = [0, *(np.flatnonzero(np.diff(runs)) + 1).tolist(), len(runs)]
    yield from (range(first, end) for first, end in pairwise(bounds) if end > first)
