"""The robust method on one measurement: the verdict of each frame, and the incidents that frames belong to.

1. Every sensor check becomes a normalised score z.
2. The scores of a frame name the attacked sensors (`naming`).
3. Faults, rain and dirt that may explain a finding as well make it suspect (`faults`).
4. A sequential test over successive frames says which of them make an incident (`incidents`).
"""

from collections import defaultdict
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain

import numpy as np

from auditor.identification.algorithm2 import sensors_where
from auditor.identification.background import BACKGROUND_CHECKS, background, levels_before
from auditor.identification.causes.faults import fault_hypotheses, frozen, is_finding, weigh, z_of
from auditor.identification.causes.light_causes import Nearby, bounds_nearby, seen_of
from auditor.identification.evidence_parameters import INCIDENTS
from auditor.identification.incidents import Event, Evidence, apart, events, evidence_of, of_sensors, peaks_of
from auditor.identification.naming import attack_scores, name_attacked, sensor_scores
from auditor.identification.prior import joint_limit
from auditor.identification.scores import normalised_scores
from auditor.identification.statistics import NANOSECONDS, runs_of
from auditor.identification.systems import System
from auditor.model.arrays import Flags, Floats, Indices, Integers
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.verdict import FINDINGS, Cause, CauseIn, FaultHypothesis, Finding, Verdict, VerdictKind


@dataclass(frozen=True, eq=False)
class FrameSeries:
    """F successive frames that are judged together.

    `stamps_ns` are (F,), and `runs` (F,) number the runs without a gap that they belong to. `statistics` are (F, M) by
    sensor check, NaN where not measured; `present` (F, S) says whether a sensor was there, `frozen` (F, S)
    whether it repeats its data while others change. `fault_scores` are (F,) by fault and sensor, and
    `brightness` by the names of BRIGHTNESS and camera.
    """

    stamps_ns: Integers
    runs: Integers
    statistics: Floats
    present: Flags
    frozen: Flags
    fault_scores: Mapping[CauseIn, Floats] = field(default_factory=dict)
    brightness: Mapping[tuple[str, int], Floats] = field(default_factory=dict)

    @classmethod
    def of_recording(
        cls,
        stamps_ns: Integers,
        statistics: Floats,
        present: Flags,
        fingerprints: Integers,
        fault_scores: Mapping[CauseIn, Floats],
        brightness: Mapping[tuple[str, int], Floats] | None = None,
    ) -> "FrameSeries":
        """All frames of a recording; equal `fingerprints` (F, S) of a sensor are equal data."""
        still = frozen(fingerprints, present)
        return cls(stamps_ns, runs_of(stamps_ns), statistics, present, still, fault_scores, brightness or {})

    @classmethod
    def of_clean(cls, clean: CleanFrames, system: System) -> "FrameSeries":
        """The clean frames of a calibration."""
        nowhere = np.zeros(clean.frames, dtype=np.bool_)
        missing, still = (
            np.stack([of_sensor.get(sensor, nowhere) for sensor in system.sensors], axis=1)
            for of_sensor in (clean.missing, clean.frozen)
        )
        statistics = clean.statistics_of(system.sensor_checks)
        return cls(
            clean.stamps_ns, runs_of(clean.stamps_ns), statistics, ~missing, still, clean.strengths, clean.brightness
        )

    def brightness_in(self, frame: int) -> dict[tuple[str, int], float]:
        """What is known of the cameras' brightness in the frame at this place."""
        return {key: float(values[frame]) for key, values in self.brightness.items()}


def judge_frames(
    series: FrameSeries,
    system: System,
    thresholds: RobustThresholds,
    *,
    only: Sequence[int] | None = None,
    without_causes: bool = False,
) -> list[Verdict]:
    """The verdicts on F frames, or `only` on those at these places.

    Each is that of its frame by itself. Its `finding` is that of the event which it belongs to, an incident or a single
    frame. A sensor with frozen data is left out, and the frame is at least suspect; so it is where a fault explains it
    as well as an attack, unless the caller wants verdicts `without_causes`.
    """
    judge = _Judge(series, system, thresholds, without_causes=without_causes)
    evidence = judge.evidence()
    found = events(evidence, judge.raised, thresholds.score, thresholds.incidents_per_hour)
    judged = list(range(len(series.stamps_ns)) if only is None else only)
    verdicts = judge.verdicts({*judged, *(place for event in found for place in event.frames)})
    whole = [_apart(event, verdicts, evidence, thresholds.score) for event in found]
    for number, event in enumerate(chain.from_iterable(whole), 1):
        added = evidence.added[list(event.frames)].tolist()
        kind, attacked = _likeliest([verdicts[place] for place in event.frames], added)
        for place, more in zip(event.frames, added, strict=True):
            finding = Finding(kind, attacked, number, event.single, more)
            verdicts[place] = replace(verdicts[place], finding=finding)
    return [verdicts[place] for place in judged]


def _apart(event: Event, verdicts: Mapping[int, Verdict], evidence: Evidence, limit: float) -> list[Event]:
    added = evidence.added[list(event.frames)].tolist()
    return apart(event, [verdicts[place].attacked for place in event.frames], added, limit)


def findings_alone(series: FrameSeries, system: System, thresholds: RobustThresholds) -> Flags:
    """(F,) the frames whose verdict by itself is a finding; without any there is no event, and nothing to name."""
    return _Judge(series, system, thresholds).raised


def clean_peaks(series: FrameSeries, system: System, thresholds: RobustThresholds) -> list[float]:
    """The peaks of what F clean frames add to the sequential test: `incident_limit` follows from them."""
    judge = _Judge(series, system, thresholds)
    return peaks_of(judge.evidence(), judge.raised)


class _Judge:
    """The scores of F frames and their fault hypotheses, and the verdicts that follow on each frame by itself."""

    def __init__(
        self, series: FrameSeries, system: System, thresholds: RobustThresholds, *, without_causes: bool = False
    ) -> None:
        self._series, self._system, self._thresholds = series, system, thresholds
        expected = [thresholds.expected.get(check) for check in system.sensor_checks]
        self._z = normalised_scores(series.statistics, expected)
        self._unused = sensors_where(system.sensors, ~series.present | series.frozen)
        self._scores = attack_scores(self._z, system, self._unused)
        still = sensors_where(system.sensors, series.frozen)
        faults = [()] * len(still) if without_causes else _fault_hypotheses(series, thresholds)
        self._hypotheses = [_with_frozen(sensors, others) for sensors, others in zip(still, faults, strict=True)]
        self._faults = np.array([_fault_z(causes) for causes in self._hypotheses], dtype=np.float64)
        self._verdicts: dict[int, Verdict] = {}

    @cached_property
    def raised(self) -> Flags:
        """(F,) whether the verdict on each frame by itself is a finding."""
        return np.asarray((self._scores > self._thresholds.limit) | (self._faults > -np.inf))

    def evidence(self) -> Evidence:
        """What each frame adds to the sequential test: a fault that is a finding does so as a check does."""
        checks, series = self._system.judged_together, self._series
        limit = joint_limit(INCIDENTS.tail_rate, checks)
        of_faults = limit + self._faults
        scores = np.maximum(self._scores, of_faults)
        whole = evidence_of(scores, checks, series.stamps_ns, series.runs)
        findings = self.verdicts(np.flatnonzero(self.raised).tolist())
        explained = np.zeros(len(self.raised), dtype=np.bool_)
        explained[[place for place, verdict in findings.items() if verdict.kind is VerdictKind.SUSPECT]] = True
        beyond = np.repeat(scores[:, None], len(self._system.sensors), axis=1)
        rising = np.flatnonzero(whole.ratios > 0)  # what the others take away they do on any road
        if rising.size:
            clear = self._z[rising] - self._background(rising, whole.periods_s, limit)
            own = sensor_scores(clear, self._system, [self._unused[place] for place in rising])
            beyond[rising] = np.maximum(own, of_faults[rising, None])
        return of_sensors(whole, beyond, explained, checks)

    def _background(self, places: Integers, periods_s: Floats, limit: float) -> Floats:
        """(P, M) by how much the `limit` of each check is raised, in frames at P places, by what it showed before."""
        columns = np.array([one.check in BACKGROUND_CHECKS for one in self._system.sensor_checks])
        raised = np.zeros((len(places), len(columns)))
        before = levels_before(self._z[:, columns], periods_s, self._series.runs, places)
        raised[:, columns] = background(before, limit)
        return raised

    def verdicts(self, places: Collection[int]) -> dict[int, Verdict]:
        """The verdicts on the frames at these places, each by itself."""
        missing = sorted(set(places).difference(self._verdicts))
        self._verdicts.update(zip(missing, self._judged(missing), strict=True))
        return {place: self._verdicts[place] for place in places}

    def _judged(self, places: Sequence[int]) -> list[Verdict]:
        series, system, limit = self._series, self._system, self._thresholds.limit
        named = name_attacked(self._z[places], system, [self._unused[place] for place in places], limit)

        def weighed(place: int, verdict: Verdict) -> Verdict:
            if not verdict.evidence:  # most frames: nothing fired
                return weigh(verdict, self._hypotheses[place], limit) if self._hypotheses[place] else verdict
            brightness = series.brightness_in(place)
            nearby = self._nearby(place)
            seen = seen_of(verdict, self._z[place], series.statistics[place], system, brightness, nearby)
            return weigh(verdict, self._hypotheses[place], limit, seen)

        return [weighed(place, verdict) for place, verdict in zip(places, named, strict=True)]

    def _nearby(self, place: int) -> Nearby:
        """The frames around the one at this place."""
        first, end = (int(bounds[place]) for bounds in self._bounds)
        stamps_ns = self._series.stamps_ns
        return Nearby(self._z[first:end], float(stamps_ns[end - 1] - stamps_ns[first]) / NANOSECONDS)

    @cached_property
    def _bounds(self) -> tuple[Indices, Indices]:
        return bounds_nearby(self._series.stamps_ns, self._series.runs)


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


def _fault_hypotheses(series: FrameSeries, thresholds: RobustThresholds) -> Sequence[tuple[FaultHypothesis, ...]]:
    if not series.fault_scores:
        return [()] * len(series.stamps_ns)
    return fault_hypotheses(series.fault_scores, thresholds.causes)


def _fault_z(causes: Sequence[FaultHypothesis]) -> float:
    """The largest z of the faults that are findings by themselves; -inf where there is none."""
    return max((z_of(one) for one in causes if is_finding(one)), default=-np.inf) if causes else -np.inf


def _with_frozen(still: frozenset[int], others: tuple[FaultHypothesis, ...]) -> tuple[FaultHypothesis, ...]:
    """The sensors with frozen data first; no other fault of theirs can be measured."""
    if not still:
        return others
    first = [FaultHypothesis(Cause.FROZEN, sensor) for sensor in sorted(still)]
    return (*first, *(one for one in others if one.sensor not in still))
