"""The robust method on one measurement: the verdict of each frame, and the incidents that frames belong to.

1. Every sensor check becomes a normalised score z.
2. The scores of a frame name the attacked sensors (`naming`).
3. Faults and dirt that may explain a finding as well make it suspect (`faults`).
4. A sequential test over successive frames says which of them make an incident (`incidents`).
5. Stretches of a second are judged as frames are: what is weak and lasts makes an incident as well (`events`).
6. Findings that no incident holds are alerts where they come in a row, make a tenth of the frames, or are very strong.

Where the calibration changes within a recording, each rig has measurements of its own: they are judged as portions of
one series, so that no change of a rig ends an attack.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from auditor.identification.causes import Nearby, bounds_nearby, scatters, seen_of
from auditor.identification.evidence_parameters import INCIDENTS, STRETCHES
from auditor.identification.faults import OF_DETAIL, fault_hypotheses, is_finding, weigh, z_of
from auditor.identification.incidents.events import (
    LastingEvent,
    Windows,
    held_of,
    lasting_events,
    outer_halves,
    seconds_of,
    series_of,
    thresholds_of,
    windows_of,
    with_lasting,
)
from auditor.identification.incidents.sequential import (
    Event,
    FrameEvidence,
    alerts,
    apart,
    events,
    evidence_of,
    joined,
    of_sensors,
    peaks_of,
    periods_of,
    strong_frames,
)
from auditor.identification.incidents.series import FrameSeries, Portion, on_one_line
from auditor.identification.naming import attack_scores, name_attacked, sensor_scores
from auditor.identification.paper import FEWEST_SENSORS, sensors_where
from auditor.identification.parameters import NAMING, TEMPORAL_WINDOW
from auditor.identification.prior import joint_limit
from auditor.identification.scores import normalised_scores
from auditor.identification.statistics import window_means
from auditor.identification.systems import System
from auditor.model.arrays import Flags, Floats, Indices, Integers
from auditor.model.calibration import RobustThresholds
from auditor.model.checks import Check
from auditor.model.rig import LIDAR
from auditor.model.stamps import NANOSECONDS
from auditor.model.verdict import FINDINGS, Alternative, Cause, FaultHypothesis, Finding, Verdict, VerdictKind

_ACCUSING = frozenset({VerdictKind.ATTACKED, VerdictKind.UNIDENTIFIED})
"""Findings that no other cause explains as well."""

_FIT_NOWHERE = (
    "the camera's pictures of two moments do not fit the LiDAR's ranges elsewhere either: one of the two is wrong, and "
    "nothing tells which"
)
_NOTHING_NEW = "no sensor's data changed since the frame before"


def judge_frames(
    series: FrameSeries,
    system: System,
    thresholds: RobustThresholds,
    *,
    only: Sequence[int] | None = None,
    without_causes: bool = False,
) -> list[Verdict]:
    """The verdicts on F frames, or `only` on those at these places.

    Each is that of its frame by itself. Its `finding` is that of the event which it belongs to, an incident or an
    alert. A sensor with frozen data is left out, and the frame is at least suspect; so it is where a fault explains it
    as well as an attack, unless the caller wants verdicts `without_causes`.
    """
    judge = _Judge(series, system, thresholds, without_causes=without_causes)
    wanted = range(len(series.stamps_ns)) if only is None else only
    verdicts = _judged([judge], np.arange(len(series.stamps_ns)), wanted)
    return [verdicts[place] for place in wanted]


def judge_portions(portions: Sequence[Portion]) -> list[list[Verdict]]:
    """The verdicts on the frames of each portion, as `judge_frames`; all portions are one series of the same sensors.

    Evidence and alerts go on from one portion into the next, in the order of the frames' numbers. What incidents must
    exceed is the largest of the portions' thresholds.
    """
    order = np.argsort(np.concatenate([one.numbers for one in portions]), kind="stable")
    judges = [
        _Judge(series, one.system, one.thresholds)
        for series, one in zip(on_one_line([one.series for one in portions], order), portions, strict=True)
    ]
    verdicts = _judged(judges, order, range(len(order)))
    of_place = dict(zip(order.tolist(), (verdicts[place] for place in range(len(order))), strict=True))
    in_turn = iter(range(len(order)))
    return [[of_place[next(in_turn)] for _ in one.numbers] for one in portions]


def _judged(judges: Sequence["_Judge"], order: Integers, wanted: Collection[int]) -> dict[int, Verdict]:
    """The verdicts on frames at `wanted` places of a series, and on all that belong to events, with their findings.

    The series has the frames of the judges in an `order` of their places one after another.
    """
    evidence = joined([judge.evidence() for judge in judges], order)
    raised = np.concatenate([judge.raised for judge in judges])[order]
    audited = np.concatenate([judge.audited for judge in judges])[order]
    thresholds = max((judge.thresholds for judge in judges), key=lambda one: one.evidence_limit)
    limit, sensors = thresholds.evidence_limit, judges[0].sensors
    incidents = events(evidence, raised, limit, thresholds.incidents_per_hour)
    lasting = _lasting(judges, order)
    needed = {
        *wanted,
        *np.flatnonzero(raised).tolist(),
        *(place for one in incidents for place in one.frames),
        *(place for one in lasting for place in one.frames),
    }
    verdicts = _verdicts_of(judges, order, needed)
    incidents = [part for one in incidents for part in _apart(one, verdicts, evidence, limit)]
    held_events = with_lasting([held_of(one, verdicts, evidence, sensors, limit) for one in incidents], lasting)
    held = _flags(len(raised), (place for one in held_events for place in one.frames))
    accusing = _flags(len(raised), (place for place, verdict in verdicts.items() if verdict.kind in _ACCUSING))
    strong = strong_frames(evidence, raised, thresholds.incidents_per_hour)
    loose = alerts(raised & ~held, verdicts, accusing, audited, strong, evidence.periods_s, float(thresholds.r))
    others = [held_of(one, verdicts, evidence, sensors, limit) for one in loose]
    for number, event in enumerate(sorted([*held_events, *others], key=lambda one: one.first), 1):
        for place, frame in event.frames.items():
            finding = Finding(*frame.held_for, number, event.alert, frame.added)
            verdicts[place] = replace(verdicts[place], finding=finding)
    return verdicts


def _flags(frames: int, places: Iterable[int]) -> Flags:
    flags = np.zeros(frames, dtype=np.bool_)
    flags[list(places)] = True
    return flags


def _lasting(judges: Sequence["_Judge"], order: Integers) -> list[LastingEvent]:
    """The events of the judges' stretches, whose frames are places of the series that the judges' frames make."""
    begins = np.cumsum([0, *(judge.frames for judge in judges)])
    places = np.argsort(order, kind="stable")
    return [
        replace(event, frames=tuple(sorted(places[begin + np.array(event.frames)].tolist())))
        for judge, begin in zip(judges, begins.tolist(), strict=False)
        for event in judge.lasting()
    ]


def _verdicts_of(judges: Sequence["_Judge"], order: Integers, needed: Collection[int]) -> dict[int, Verdict]:
    """The verdicts on the frames at these places of a series of the judges' frames, each by itself."""
    begins = np.cumsum([0, *(judge.frames for judge in judges)])
    of_judge = np.searchsorted(begins, order, side="right") - 1
    places: list[dict[int, int]] = [{} for _ in judges]
    for place in needed:
        which = int(of_judge[place])
        places[which][place] = int(order[place] - begins[which])
    verdict_of: dict[int, Verdict] = {}
    for judge, own in zip(judges, places, strict=True):
        verdicts = judge.verdicts(own.values())
        verdict_of.update((place, verdicts[at]) for place, at in own.items())
    return verdict_of


def _apart(event: Event, verdicts: Mapping[int, Verdict], evidence: FrameEvidence, limit: float) -> list[Event]:
    added = evidence.added[list(event.frames)].tolist()
    return apart(event, [verdicts[place].attacked for place in event.frames], added, limit)


def findings_alone(series: FrameSeries, system: System, thresholds: RobustThresholds) -> Flags:
    """(F,) the frames whose verdict by itself is a finding; without any there is no event, and nothing to name."""
    return _Judge(series, system, thresholds).raised


def clean_peaks(series: FrameSeries, system: System, thresholds: RobustThresholds) -> list[float]:
    """The peaks of what F clean frames add to the sequential test: `incident_limit` follows from them."""
    judge = _Judge(series, system, thresholds)
    return peaks_of(judge.evidence(), judge.raised)


def name_beside_aerosols(
    z: Floats, system: System, missing: Sequence[frozenset[int]], limit: float, agreeing: Floats
) -> list[Verdict]:
    """The verdicts of `name_attacked`; where an aerosol explains the LiDAR, what other sensors show is named alone.

    `agreeing` (F,) are the shares of the LiDAR's points that agree with cameras, NaN where not known.
    """
    verdicts = name_attacked(z, system, missing, limit)
    frames = [frame for frame, verdict in enumerate(verdicts) if _beside_aerosol(verdict, float(agreeing[frame]))]
    quiet = z[frames]
    of_lidar = [check.sensor == LIDAR for check in system.sensor_checks]
    quiet[:, of_lidar] = np.minimum(quiet[:, of_lidar], 0)
    alone = name_attacked(quiet, system, [missing[frame] for frame in frames], limit)
    for frame, verdict in zip(frames, alone, strict=True):
        if verdict.kind in FINDINGS:
            verdicts[frame] = verdict
    return verdicts


def _beside_aerosol(verdict: Verdict, agreeing: float) -> bool:
    """Whether an aerosol explains what the LiDAR shows, and another sensor shows something as well."""
    own = [one for one in verdict.evidence if one.i == LIDAR]
    return len(own) < len(verdict.evidence) and scatters(own, agreeing)


class _Judge:
    """The scores of F frames and their fault hypotheses, and the verdicts that follow on each frame by itself."""

    def __init__(
        self, series: FrameSeries, system: System, thresholds: RobustThresholds, *, without_causes: bool = False
    ) -> None:
        self._series, self._system, self.thresholds = series, system, thresholds
        self._without_causes = without_causes
        self.frames, self.sensors = len(series.stamps_ns), system.sensors
        expected = [thresholds.expected.get(check) for check in system.sensor_checks]
        self._z = normalised_scores(series.statistics, expected)
        unused = ~series.present | series.frozen
        unused[list(series.repeated)] = True
        self._unused = sensors_where(system.sensors, unused)
        self._scores = attack_scores(self._z, system, self._unused)
        still = sensors_where(system.sensors, series.frozen)
        faults = [()] * len(still) if without_causes else _fault_hypotheses(series, thresholds)
        fired = self._scores > thresholds.limit
        self._hypotheses = [
            _with_frozen(sensors, _without_hidden_detail(others) if one else others)
            for sensors, others, one in zip(still, faults, fired.tolist(), strict=True)
        ]
        self._faults = np.array([_fault_z(causes) for causes in self._hypotheses], dtype=np.float64)
        self._agreeing = np.full(self.frames, np.nan) if series.agreeing is None else series.agreeing
        self._verdicts: dict[int, Verdict] = {}

    @cached_property
    def raised(self) -> Flags:
        """(F,) whether the verdict on each frame by itself is a finding."""
        return np.asarray((self._scores > self.thresholds.limit) | (self._faults > -np.inf))

    @cached_property
    def audited(self) -> Flags:
        """(F,) whether each frame has a verdict: a check that counts was measured, or a fault raises it."""
        return np.asarray(np.isfinite(self._scores) | self.raised)

    def evidence(self) -> FrameEvidence:
        """What each frame adds to the sequential test: a fault that is a finding does so as a check does."""
        checks, series = self._system.judged_together, self._series
        limit = joint_limit(INCIDENTS.tail_rate, checks)
        of_faults = limit + self._faults
        scores = np.maximum(self._scores, of_faults)
        periods_s = periods_of(series.stamps_ns, series.runs) if series.periods_s is None else series.periods_s
        whole = evidence_of(scores, checks, periods_s, series.runs)
        findings = self.verdicts(np.flatnonzero(self.raised).tolist())
        explained = np.zeros(len(self.raised), dtype=np.bool_)
        explained[[place for place, verdict in findings.items() if verdict.kind is VerdictKind.SUSPECT]] = True
        of_each = np.repeat(scores[:, None], len(self._system.sensors), axis=1)
        rising = np.flatnonzero(whole.ratios > 0)  # what the others take away they do on any road
        if rising.size:
            own = sensor_scores(self._z[rising], self._system, [self._unused[place] for place in rising])
            of_each[rising] = np.maximum(own, of_faults[rising, None])
        return of_sensors(whole, of_each, explained, checks)

    def lasting(self) -> list[LastingEvent]:
        """The events of the stretches of these frames."""
        windows = windows_of(self._series.stamps_ns, self._series.runs)
        if not len(windows.first):
            return []
        seconds = seconds_of(windows, self._series.stamps_ns)
        thresholds = thresholds_of(self.thresholds, self._system.judged_together, seconds)
        new = replace(self._series, statistics=_of_new_data(self._series, self._system))

        def judged(parts: Windows) -> _Judge:
            return _Judge(series_of(new, parts), self._system, thresholds, without_causes=self._without_causes)

        whole, (halves, of_halves) = judged(windows), outer_halves(windows, self._series.runs)
        z = whole.beyond + thresholds.limit
        of_half = (judged(of_halves).beyond + thresholds.limit).tolist()
        reached = {one for one, own in zip(halves, of_half, strict=True) if own >= STRETCHES.reaches * z[one.window]}
        return lasting_events(windows, whole.beyond, whole.accusing(), reached)

    @cached_property
    def beyond(self) -> Floats:
        """(F,) by how much the largest z of any sensor exceeds the limit of one check among all."""
        return np.asarray(sensor_scores(self._z, self._system, self._unused).max(axis=1) - self.thresholds.limit)

    def accusing(self) -> dict[int, Verdict]:
        """The verdicts that name one sensor, by place, where several sensors vote.

        Where none can be named, those that find an attack. What only two cameras say, that nobody else can vote on, is
        no evidence in time; and what is weak, constant and on several lenses is the sun.
        """
        system = self._system
        several = system.of_scans and len(system.sensors) > 1  # two that disagree, and no third that looks there
        names_one = not several and len(system.sensors) >= FEWEST_SENSORS
        verdicts = self.verdicts(np.flatnonzero(self.beyond > 0).tolist())
        return {
            place: verdict
            for place, verdict in verdicts.items()
            if verdict.kind in _ACCUSING and (not names_one or len(verdict.attacked) == 1)
        }

    def verdicts(self, places: Collection[int]) -> dict[int, Verdict]:
        """The verdicts on the frames at these places, each by itself."""
        missing = sorted(set(places).difference(self._verdicts))
        self._verdicts.update(zip(missing, self._judged(missing), strict=True))
        return {place: self._verdicts[place] for place in places}

    def _judged(self, places: Sequence[int]) -> list[Verdict]:
        series, system, limit = self._series, self._system, self.thresholds.limit
        unused, agreeing = [self._unused[place] for place in places], self._agreeing[places]
        named = name_beside_aerosols(self._z[places], system, unused, limit, agreeing)
        if system.by_time:
            named = [_doubted(verdict, float(self._unmatched[at])) for at, verdict in zip(places, named, strict=True)]

        def weighed(place: int, verdict: Verdict) -> Verdict:
            if place in series.repeated:
                return replace(verdict, reason=_NOTHING_NEW)
            if not verdict.evidence:  # most frames: nothing fired
                return weigh(verdict, self._hypotheses[place], limit) if self._hypotheses[place] else verdict
            brightness = series.brightness_in(place)
            nearby = self._nearby(place)
            seen = seen_of(verdict, self._z[place], series.statistics[place], system, brightness, nearby)
            return weigh(verdict, self._hypotheses[place], limit, seen, float(self._agreeing[place]))

        return [weighed(place, verdict) for place, verdict in zip(places, named, strict=True)]

    @cached_property
    def _unmatched(self) -> Floats:
        """(F,) the share of a lone camera's points that its past does not show, near each frame; NaN where unknown."""
        series = self._series
        nothing = np.full(self.frames, np.nan)
        shares = [series.brightness.get(("unmatched_share", camera), nothing) for camera in self.sensors if camera]
        of_all = np.array(shares, dtype=np.float64).reshape(len(shares), self.frames).T
        means = window_means(of_all, series.stamps_ns, TEMPORAL_WINDOW.seconds, series.runs)
        return np.asarray(np.fmax.reduce(means, axis=1, initial=np.nan))

    def _nearby(self, place: int) -> Nearby:
        """The frames around the one at this place."""
        first, end = (int(bounds[place]) for bounds in self._bounds)
        stamps_ns = self._series.stamps_ns
        return Nearby(self._z[first:end], float(stamps_ns[end - 1] - stamps_ns[first]) / NANOSECONDS)

    @cached_property
    def _bounds(self) -> tuple[Indices, Indices]:
        return bounds_nearby(self._series.stamps_ns, self._series.runs)


def _doubted(verdict: Verdict, unmatched: float) -> Verdict:
    """The verdict on a lone camera and a LiDAR, of which neither is named where the pictures fit the ranges nowhere.

    A pattern that moves over a picture, or other pictures, contradict the LiDAR as a bogus wall does. But beside a wall
    the camera's past shows what its picture does: not an `unmatched` share of its points.
    """
    by_pictures = {one.check_name for one in verdict.evidence} == {Check.PARALLAX_CONFLICT.value}
    if verdict.attacked != (LIDAR,) or not by_pictures or not unmatched > NAMING.most_unmatched:
        return verdict
    alternatives = (Alternative(verdict.attacked, 0.0), *verdict.alternatives)
    return replace(verdict, kind=VerdictKind.UNIDENTIFIED, attacked=(), alternatives=alternatives, reason=_FIT_NOWHERE)


def _of_new_data(series: FrameSeries, system: System) -> Floats:
    """The statistics (F, M), NaN where a check compares a sensor that repeats its data: half a window has no others."""
    if not series.frozen.any():
        return series.statistics
    of_checks = [(check.sensor, *check.others) for check in system.sensor_checks]
    compares = [[sensor in of_check for sensor in system.sensors] for of_check in of_checks]
    return np.asarray(np.where(series.frozen @ np.array(compares).T, np.nan, series.statistics))


def _fault_hypotheses(series: FrameSeries, thresholds: RobustThresholds) -> Sequence[tuple[FaultHypothesis, ...]]:
    if not series.fault_scores:
        return [()] * len(series.stamps_ns)
    return fault_hypotheses(series.fault_scores, thresholds.causes)


def _without_hidden_detail(causes: tuple[FaultHypothesis, ...]) -> tuple[FaultHypothesis, ...]:
    """The causes of a frame in which a check fired: light hides detail, and adds no second finding by it."""
    return tuple(one for one in causes if one.cause not in OF_DETAIL)


def _fault_z(causes: Sequence[FaultHypothesis]) -> float:
    """The largest z of the faults that are findings by themselves; -inf where there is none."""
    return max((z_of(one) for one in causes if is_finding(one)), default=-np.inf) if causes else -np.inf


def _with_frozen(still: frozenset[int], others: tuple[FaultHypothesis, ...]) -> tuple[FaultHypothesis, ...]:
    """The sensors with frozen data first; no other fault of theirs can be measured."""
    first = [FaultHypothesis(Cause.FROZEN, sensor) for sensor in sorted(still)]
    return (*first, *(one for one in others if one.sensor not in still))
