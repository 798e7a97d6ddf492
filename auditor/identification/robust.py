"""The robust method on one measurement: what each frame says by itself, and what its temporal window says."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from auditor.identification.algorithm2 import (
    ABOVE,
    FEWEST_SENSORS,
    NOT_ABOVE,
    NOT_MEASURED,
    allowed_attack_sets,
    identify,
    sensors_where,
)
from auditor.identification.attack_sets import PENALTY_PER_SENSOR, Explanations, explain, explains, triple_states
from auditor.identification.faults import fault_hypotheses, frozen, weigh
from auditor.identification.parameters import EXPLANATION, TEMPORAL_WINDOW
from auditor.identification.scores import scores
from auditor.identification.statistics import runs_of, window_means
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.checks import Check, PairCheck
from auditor.model.rig import LIDAR, Triple
from auditor.model.verdict import (
    FINDINGS,
    Alternative,
    Cause,
    CauseIn,
    Evidence,
    FaultHypothesis,
    Finding,
    Verdict,
    VerdictKind,
)

_UNEXPLAINED = EXPLANATION.most_uncovered
"""Raised margins that the best explanation leaves over: with more than this it is none."""


_ALTERNATIVES = EXPLANATION.alternatives


_NOT_MEASURED = f"nobody could deny what S_{LIDAR} reports: points that it invents pass unnoticed"


Floats = NDArray[np.float64]


@dataclass(frozen=True)
class System:
    """What a rig's frames are judged by: its elements, triples and sensors, in their fixed orders."""

    pair_checks: tuple[PairCheck, ...]
    triples: tuple[Triple, ...]
    sensors: tuple[int, ...]

    @property
    def in_several_pairs(self) -> frozenset[int]:
        """The cameras matched with more than one other: what is wrong with one of them shows in all its pairs."""
        pairs = Counter(s for e in self.pair_checks if e.check is Check.PHOTOMETRIC_INCONSISTENCY for s in (e.i, e.k))
        return frozenset(sensor for sensor, number in pairs.items() if number > 1)


def usable(z: Floats, system: System, missing: Sequence[frozenset[int]]) -> Floats:
    """A copy of (F, M) margins with NaN for the elements that need a sensor missing in their frame."""
    masked = np.array(z, dtype=np.float64)
    gone = {
        absent: [not absent.isdisjoint(pair_check.needed) for pair_check in system.pair_checks]
        for absent in set(missing)
        if absent
    }
    for frame, absent in enumerate(missing):
        if absent:
            masked[frame, gone[absent]] = np.nan
    return masked


def candidate_score(z: Floats, explanations: Explanations) -> Floats:
    """(F,) how far each frame is raised, from its margins (F, M) and their explanations.

    How much better the best attack explains it than none does; with three sensors, which tell no attacks apart, the
    largest margin; -inf where nothing was measured.
    """
    if len(explanations.sets) > 1:
        return explanations.score
    return np.asarray(np.nanmax(z, axis=1, initial=-np.inf))


def name_attacked(
    z: Floats, system: System, missing: Sequence[frozenset[int]], threshold: float = 0.0
) -> list[Verdict]:
    """The verdicts on F frames from (F, M) margins z, NaN where not measured, and the sensors missing in each.

    A frame is raised where the best attack explains it better than none by more than `threshold`. The verdict's `gap`
    is how much better the best explanation is than the second best, or the largest z where three sensors tell none
    apart; `evidence` are the raised elements, the strongest first, `named` is Algorithm 2's answer on the same states.
    `reason` says why a raised frame is not attributed, and where the LiDAR was there but could not be contradicted.
    """
    verdicts: list[Verdict | None] = [None] * len(z)
    z = usable(z, system, missing)
    for absent, frames in _alike(missing).items():
        for frame, verdict in zip(frames, _name_alike(z[frames], system, absent, threshold), strict=True):
            verdicts[frame] = verdict
    return [verdict for verdict in verdicts if verdict is not None]


def candidate_scores(z: Floats, system: System, missing: Sequence[frozenset[int]]) -> Floats:
    """(F,) what `accuse` compares with its threshold, from the same (F, M) margins and missing sensors."""
    scores = np.full(len(z), -np.inf)
    z = usable(z, system, missing)
    for absent, frames in _alike(missing).items():
        sets = allowed_attack_sets(sensor for sensor in system.sensors if sensor not in absent)
        scores[frames] = candidate_score(z[frames], explain(z[frames], system.pair_checks, sets))
    return scores


def _alike(missing: Sequence[frozenset[int]]) -> dict[frozenset[int], list[int]]:
    """The frames that lack the same sensors."""
    groups: dict[frozenset[int], list[int]] = {}
    for frame, absent in enumerate(missing):
        groups.setdefault(absent, []).append(frame)
    return groups


def _name_alike(z: Floats, system: System, absent: frozenset[int], threshold: float) -> list[Verdict]:
    """Frames that lack the same sensors."""
    present = [sensor for sensor in system.sensors if sensor not in absent]
    outside = tuple(sensor for sensor in system.sensors if sensor in absent)
    sets = allowed_attack_sets(present)
    explanations = explain(z, system.pair_checks, sets)
    score = candidate_score(z, explanations)
    lead = explanations.lead if len(sets) > 1 else score
    ranked = np.argsort(explanations.cost, axis=1, kind="stable")[:, : 1 + _ALTERNATIVES]
    measured = np.count_nonzero(~np.isnan(z), axis=1)
    named = cache(lambda e: _algorithm_2(e, system, present))
    remarks = _remarks(z, system, present)
    verdicts = []
    for f, e in enumerate(_states(z, system)):
        if not measured[f]:
            reason = "no witness could be heard"
            verdicts.append(Verdict(VerdictKind.NOT_AUDITABLE, e, out_of_system=outside, reason=reason))
            continue
        verdict = Verdict(
            kind=VerdictKind.CLEAN,
            e=e,
            named=named(e),
            out_of_system=outside,
            gap=float(lead[f]),
            reason=remarks[f],
            evidence=_evidence(z[f], system),
            alternatives=_alternatives(explanations, f, ranked[f]),
        )
        if score[f] > threshold:
            verdict = _fired(verdict, explanations.sets[ranked[f, 0]], z[f], system.pair_checks, len(present))
        verdicts.append(verdict)
    return verdicts


def _fired(verdict: Verdict, attacked: tuple[int, ...], z: Floats, pair_checks: Sequence[PairCheck], N: int) -> Verdict:
    """The verdict on a frame that is raised: with the attacked sensors, or why none can be named."""
    doubt = _doubt(z, attacked, verdict.gap or 0.0, pair_checks, N)
    if not doubt:
        return replace(verdict, kind=VerdictKind.ATTACKED, attacked=attacked)
    likeliest = (Alternative(attacked, 0.0),) if N >= FEWEST_SENSORS else ()
    return replace(
        verdict,
        kind=VerdictKind.UNIDENTIFIED,
        reason="; ".join(filter(None, (doubt, verdict.reason))),
        alternatives=(*likeliest, *verdict.alternatives),
    )


def _remarks(z: Floats, system: System, present: Sequence[int]) -> list[str]:
    """What each verdict does not cover: invented points, where the LiDAR is there and nobody could deny them.

    No two cameras see enough of its points, or lie far enough apart, or clean frames taught nothing of it.
    """
    if LIDAR not in present:
        return [""] * len(z)
    denied = [e.check is Check.LIDAR_CONFLICT for e in system.pair_checks]
    not_measured = np.logical_and.reduce(np.isnan(z[:, denied]), axis=1)
    return [_NOT_MEASURED if alone else "" for alone in not_measured.tolist()]


def _states(z: Floats, system: System) -> list[str]:
    """The e vector of each frame: a triple is raised where an element inside it is, '-' where none was measured."""
    above, measured = triple_states(z > 0, ~np.isnan(z), system.pair_checks, system.triples)
    marks = np.where(measured, np.where(above, ABOVE, NOT_ABOVE), NOT_MEASURED)
    return ["".join(row) for row in marks.tolist()]


def _algorithm_2(e: str, system: System, present: Sequence[int]) -> tuple[int, ...] | None:
    if len(present) < FEWEST_SENSORS:
        return None
    found = identify(e, system.triples, present)
    return None if found.undetermined else found.attacked


def _doubt(z: Floats, attacked: tuple[int, ...], lead: float, pair_checks: Sequence[PairCheck], N: int) -> str:
    if N < FEWEST_SENSORS:
        return f"an attack on one of {N} sensors cannot be attributed"
    left = sum(max(float(v), 0.0) for v, e in zip(z, pair_checks, strict=True) if v == v and not explains(e, attacked))  # noqa: PLR0124 - not NaN
    if left > _UNEXPLAINED:
        return f"no attack on at most {N - 3} of {N} sensors explains what was measured"
    if lead < PENALTY_PER_SENSOR:
        return "two explanations are as good"
    return ""


def _evidence(z: Floats, system: System) -> tuple[Evidence, ...]:
    """The raised elements, the strongest first."""
    fired = [(float(z[place]), system.pair_checks[place]) for place in np.flatnonzero(z > 0)]
    return tuple(Evidence(e.check.value, e.i, None, e.k, v) for v, e in sorted(fired, key=lambda one: -one[0]))


def _alternatives(explanations: Explanations, frame: int, ranked: NDArray[np.intp]) -> tuple[Alternative, ...]:
    """All explanations but the best of those ranked, with how much worse they are."""
    cost = explanations.cost[frame]
    best = cost[ranked[0]]
    return tuple(Alternative(explanations.sets[s], float(cost[s] - best)) for s in ranked[1:].tolist())


WINDOW_S = TEMPORAL_WINDOW.seconds
"""Attacks last, most mistakes do not: incidents are made of what half a second says."""


Flags = NDArray[np.bool_]


Numbers = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class FrameSeries:
    """What the judge needs of F successive frames.

    `stamps_ns` are (F,), and `runs` (F,) number the runs without a gap that they belong to. `ratios` are (F, M) local
    ratios by element, NaN where not measured; `present` (F, S) whether a sensor was there, `frozen` (F, S) whether it
    stands still while others go on. `fault_scores` are (F,) by cause that is not an attack.
    """

    stamps_ns: Numbers
    runs: Numbers
    ratios: Floats
    present: Flags
    frozen: Flags
    fault_scores: Mapping[CauseIn, Floats] = field(default_factory=dict)

    @classmethod
    def of_recording(
        cls,
        stamps_ns: Numbers,
        ratios: Floats,
        present: Flags,
        fingerprints: Numbers,
        fault_scores: Mapping[CauseIn, Floats],
    ) -> "FrameSeries":
        """All frames of a recording; `fingerprints` (F, S) tell whether a sensor's data change."""
        return cls(stamps_ns, runs_of(stamps_ns), ratios, present, frozen(fingerprints, present), fault_scores)

    @classmethod
    def of_clean(cls, clean: CleanFrames, system: System) -> "FrameSeries":
        """The clean frames of a calibration."""
        nowhere = np.zeros(clean.frames, dtype=np.bool_)
        missing, still = (
            np.stack([of_sensor.get(sensor, nowhere) for sensor in system.sensors], axis=1)
            for of_sensor in (clean.missing, clean.frozen)
        )
        ratios = clean.ratios_of(system.pair_checks)
        return cls(clean.stamps_ns, runs_of(clean.stamps_ns), ratios, ~missing, still, clean.strengths)


def judge_frames(
    series: FrameSeries,
    system: System,
    thresholds: RobustThresholds,
    *,
    only: Sequence[int] | None = None,
    without_causes: bool = False,
) -> list[Verdict]:
    """The verdicts on F frames, or `only` on those at these places.

    Each is that of its frame alone; `finding` is what the half second around it says, where both raise it: incidents
    are made of these, and `thresholds.score` is the threshold of the half seconds' score. A sensor that stands still
    while others go on is left out, and the frame is at least suspect; so it is where another cause that is not an
    attack explains it as well, unless the caller wants it `without_causes`.
    """
    chosen = np.arange(len(series.stamps_ns)) if only is None else np.asarray(only, dtype=np.intp)
    left_out = _left_out(series, system)
    z, window = _scores(series, system, thresholds, left_out)
    missing = [left_out[place] for place in chosen.tolist()]
    alone = name_attacked(z[chosen], system, missing)
    moments = name_attacked(window[chosen], system, missing, thresholds.score)
    faults = [()] * len(chosen) if without_causes else _causes(series, thresholds, chosen)
    still = sensors_where(system.sensors, series.frozen[chosen])
    hypotheses = [_with_frozen(those, others) for those, others in zip(still, faults, strict=True)]
    several = system.in_several_pairs
    return [
        _with_window(weigh(one, why, several), weigh(moment, why, several))
        for one, moment, why in zip(alone, moments, hypotheses, strict=True)
    ]


def window_scores(series: FrameSeries, system: System, thresholds: RobustThresholds) -> Floats:
    """(F,) the score of the half second around each frame: what `judge_frames` compares with `thresholds.score`."""
    left_out = _left_out(series, system)
    _, window = _scores(series, system, thresholds, left_out)
    return candidate_scores(window, system, left_out)


def _scores(
    series: FrameSeries, system: System, thresholds: RobustThresholds, left_out: Sequence[frozenset[int]]
) -> tuple[Floats, Floats]:
    """(F, M) margins of the frames, and their means over the half seconds around them."""
    scales = [thresholds.scales_of.get(pair_check) for pair_check in system.pair_checks]
    z = usable(scores(series.ratios, scales), system, left_out)
    return z, window_means(z, series.stamps_ns, WINDOW_S, series.runs)


def _left_out(series: FrameSeries, system: System) -> list[frozenset[int]]:
    """The sensors that each frame is judged without."""
    return sensors_where(system.sensors, ~series.present | series.frozen)


def _causes(
    series: FrameSeries, thresholds: RobustThresholds, chosen: NDArray[np.intp]
) -> Sequence[tuple[FaultHypothesis, ...]]:
    if not series.fault_scores:
        return [()] * len(chosen)
    return fault_hypotheses({cause: scores[chosen] for cause, scores in series.fault_scores.items()}, thresholds.causes)


def _with_frozen(still: frozenset[int], others: tuple[FaultHypothesis, ...]) -> tuple[FaultHypothesis, ...]:
    """The sensors that stand still first: nothing else that is observed of them means anything."""
    if not still:
        return others
    first = [FaultHypothesis(Cause.FROZEN, sensor) for sensor in sorted(still)]
    return (*first, *(one for one in others if one.sensor not in still))


def _with_window(alone: Verdict, window: Verdict) -> Verdict:
    if alone.kind not in FINDINGS or window.kind not in FINDINGS:
        return alone
    return replace(alone, finding=Finding(window.kind, window.attacked))
