"""Joint identification: from the normalised scores of all sensor checks to the sensors that are named as attacked.

Each check speaks of one sensor, by the vote of others, and an attacked sensor votes too. So sets of attacked sensors
are compared, each by the votes of those outside it (`likelihood`). The likeliest is named where it is likely enough.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from math import inf, isnan, log10

import numpy as np

from auditor.identification.likelihood import (
    AttackSet,
    LikelySets,
    brighter_than,
    light_alike,
    likely_sets,
    of_sensor,
    telling,
)
from auditor.identification.paper import (
    ABOVE,
    FEWEST_COMPARED,
    FEWEST_SENSORS,
    MOST_LISTED,
    NOT_ABOVE,
    NOT_MEASURED,
    identify,
    listed,
)
from auditor.identification.parameters import NAMING
from auditor.identification.systems import System, measured_triples
from auditor.model.arrays import Flags, Floats, Indices
from auditor.model.checks import Check, SensorCheck
from auditor.model.rig import LIDAR
from auditor.model.verdict import Alternative, Evidence, Verdict, VerdictKind

_STANDS = (
    "the camera saw too little move by its range, as where the vehicle stands or its picture is white: "
    "nothing was compared"
)
_NO_SCAN_BEFORE = "there is no scan of the same place a moment before: nothing was compared"
_NOBODY = LikelySets([((), 1.0)], {(): 0.0}, {})
"""The attack sets of too few sensors to tell which of them is attacked."""

_LIDAR_UNCHECKED = "no camera pair can check the LiDAR here: points that it invents pass unnoticed"


@dataclass(frozen=True)
class _Explanation:
    """What explains one frame that is a finding.

    `likely` are the attack sets and their probabilities, the likeliest first, () being no attack; empty where too few
    sensors are there. `ratio` is the decimal logarithm of the likelihood ratio of the likeliest that is one against no
    attack. `attacked` is that set, or those that lack light, where all others are lit alike. `evidence` are the checks
    that show it, and what exceeds the limit outside it: `outside`. It is `shown` where each of its sensors exceeds the
    limit.
    """

    attacked: AttackSet
    likely: tuple[tuple[AttackSet, float], ...]
    ratio: float | None
    evidence: tuple[tuple[float, SensorCheck], ...]
    outside: tuple[SensorCheck, ...]
    shown: bool = False


def name_attacked(z: Floats, system: System, missing: Sequence[frozenset[int]], limit: float) -> list[Verdict]:
    """The verdicts on F frames from (F, M) scores z, NaN where not measured, and the missing sensors of each.

    A frame is a finding where a check that counts exceeds the `limit`. Its sensors are named where the posterior of
    their set is large enough, and nothing outside the set exceeds the limit that a larger set could not explain. The
    verdict's `gap` is by how much the strongest sensor exceeds the next, or the limit; `evidence` are the checks of the
    likeliest set above it, at least one of each sensor, and what exceeds it outside, the strongest first; `named` is
    Algorithm 2's answer on the states of the triples. `reason` says why no sensor of a finding is named, without which
    sensors a frame was judged, and where no camera pair can check the LiDAR. A frame without a finding in which no
    three sensors were compared is not auditable, nor one in which cameras that could did not check the LiDAR.
    """
    verdicts: list[Verdict | None] = [None] * len(z)
    for absent, frames in _frames_by_missing(missing).items():
        for frame, verdict in zip(frames, _of_group(z[frames], system, absent, limit), strict=True):
            verdicts[frame] = verdict
    return [verdict for verdict in verdicts if verdict is not None]


def attack_scores(z: Floats, system: System, missing: Sequence[frozenset[int]]) -> Floats:
    """(F,) the largest z of the checks that count in each frame: `name_attacked` compares it with its limit."""
    scores = np.full(len(z), -np.inf)
    for absent, frames in _frames_by_missing(missing).items():
        scores[frames] = _detected(z[frames], system, absent)
    return scores


def _detected(z: Floats, system: System, absent: frozenset[int]) -> Floats:
    """(F,) the largest z of the checks that count; of all cameras but one, alike, what lies beyond a margin."""
    counts = np.nanmax(z[:, system.detecting(absent)], axis=1, initial=-np.inf)
    but_one = np.nanmax(z[:, system.but_one(absent)], axis=1, initial=-np.inf)
    but_one = np.max([but_one, *light_alike(z, system, absent).values()], axis=0)
    return np.asarray(np.maximum(counts, but_one - NAMING.but_one_beyond))


def sensor_scores(z: Floats, system: System, missing: Sequence[frozenset[int]]) -> Floats:
    """(F, S) the largest z of the checks of each sensor that count in each frame; -inf where none was measured."""
    scores = np.full((len(z), len(system.sensors)), -np.inf)
    for absent, frames in _frames_by_missing(missing).items():
        columns, but_one = system.counting(absent).tolist(), system.but_one(absent).tolist()
        alike, nothing = light_alike(z[frames], system, absent), np.full(len(frames), -np.inf)
        for place, sensor in enumerate(system.sensors):
            own = [column for column in columns if sensor in system.sensor_checks[column].nameable]
            further = [column for column in but_one if system.sensor_checks[column].sensor == sensor]
            beyond = np.column_stack([z[np.ix_(frames, further)], alike.get(sensor, nothing)]) - NAMING.but_one_beyond
            scores[frames, place] = np.nanmax(np.hstack([z[np.ix_(frames, own)], beyond]), axis=1, initial=-np.inf)
    return scores


def _frames_by_missing(missing: Sequence[frozenset[int]]) -> dict[frozenset[int], list[int]]:
    groups: dict[frozenset[int], list[int]] = {absent: [] for absent in missing}
    if len(groups) == 1:  # in most recordings nothing is missing
        return {missing[0]: [*range(len(missing))]}
    for frame, absent in enumerate(missing):
        groups[absent].append(frame)
    return groups


def _of_group(z: Floats, system: System, absent: frozenset[int], limit: float) -> list[Verdict]:
    """The verdicts on frames that all lack the same sensors."""
    present = [sensor for sensor in system.sensors if sensor not in absent]
    outside = tuple(sensor for sensor in system.sensors if sensor in absent)
    columns = system.counting(absent)
    score = _detected(z, system, absent)
    raised = np.flatnonzero(score > limit)
    explained = dict(zip(raised.tolist(), _explain(z[raised], system, absent, limit), strict=True))
    why_not = _why_not_compared(system, present, outside)
    states = cache(lambda which, fired: _states(system, columns, which, fired, absent))
    algorithm_2 = cache(lambda e: _algorithm_2(e, system, present))
    lidar_checked = cache(lambda which: _is_lidar_checked(system, columns, which))
    remarks = cache(lambda which, by_fallback: _remarks(system, columns, which, present, by_fallback=by_fallback))
    verdicts = []
    for f, (value, which) in enumerate(zip(score.tolist(), _rows(~np.isnan(z[:, columns])), strict=True)):
        explanation = explained.get(f)
        fired = frozenset() if explanation is None else _fired(explanation, limit)
        e, audited = states(which, fired)
        if explanation is None and not (audited and lidar_checked(which)):
            reason = _LIDAR_UNCHECKED if audited else why_not
            verdicts.append(Verdict(VerdictKind.NOT_AUDITABLE, e, out_of_system=outside, reason=reason))
            continue
        verdict = Verdict(
            VerdictKind.CLEAN,
            e,
            named=algorithm_2(e),
            out_of_system=outside,
            gap=limit - value,
            reason=remarks(which, len(e) > len(system.triples)),
        )
        verdicts.append(verdict if explanation is None else _finding(verdict, explanation, z[f], system, limit))
    return verdicts


def _rows(flags: Flags) -> Iterator[bytes]:
    """The flags (F, M) of each frame as bytes, which few of them differ by."""
    content, (frames, width) = flags.tobytes(), flags.shape
    return (content[frame * width : (frame + 1) * width] for frame in range(frames))


def _explain(z: Floats, system: System, absent: frozenset[int], limit: float) -> list[_Explanation]:
    """What explains each of F frames of scores (F, M); of too few sensors one only where it shows by itself."""
    few = not system.by_time and len(system.sensors) - len(absent) < FEWEST_SENSORS
    explanations = []
    for scores, sets in zip(z, likely_sets(z, system, absent), strict=True):
        if system.of_scans and _is_undecided(sets.likely, _first(sets.likely)):
            sets.likely.sort(key=lambda one: -_contested(one[0], scores, system))
        explanation = _explained(scores, system, absent, limit, sets)
        told = not few or (explanation.shown and not _undecided(explanation))
        explanations.append(explanation if told else _explained(scores, system, absent, limit, _NOBODY))
    return explanations


def _first(likely: Sequence[tuple[AttackSet, float]]) -> AttackSet:
    """The likeliest of the sets that are an attack, () where there is none."""
    return next((one for one, _ in likely if one), ())


def _contested(attacked: AttackSet, z: Floats, system: System) -> float:
    """The largest z of what other LiDARs contest of the points of a set: of two candidates alike it goes first.

    Which of them is named over a whole incident is not said by frames in which the other one's points are contested.
    """
    own = [float(z[c]) for c, one in enumerate(system.sensor_checks) if one.sensor in attacked and one.others]
    return max((value for value in own if not isnan(value)), default=-inf)


def _explained(z: Floats, system: System, absent: frozenset[int], limit: float, sets: LikelySets) -> _Explanation:
    """What explains a frame of scores (M,), of which the attack sets are known."""
    first = _first(sets.likely)
    attacked = sets.alike.get(first, first)
    left = {sensor: absent.union(attacked) - {sensor} for sensor in attacked}
    own = [entry for sensor, others in left.items() for entry in _own(z, system, others, sensor, limit)]
    gone = absent.union(attacked)
    columns = system.counting(gone).tolist() if attacked else system.detecting(gone).tolist()
    others = [(float(z[c]), system.sensor_checks[c]) for c in columns if z[c] > limit]
    if LIDAR not in attacked:  # light on a camera is no conflict of the LiDAR, whoever votes
        of_lidar = [c for c in system.counting(absent).tolist() if system.sensor_checks[c].sensor == LIDAR]
        clear = [c for c in of_lidar if z[c] > limit + NAMING.beside_lit and c not in columns]
        others += [(float(z[c]), system.sensor_checks[c]) for c in clear]
    if not attacked:
        return _Explanation((), (), None, tuple(sorted(others, reverse=True)), tuple(check for _, check in others))
    unshown = {sensor for sensor, others in left.items() if not (z[telling(system, others, sensor)] > limit).any()}
    pairs = [(float(z[c]), system.sensor_checks[c]) for c in system.detecting(absent).tolist() if z[c] > limit]
    alone = [(value, one) for value, one in pairs if len(one.nameable) > 1 and not unshown.isdisjoint(one.nameable)]
    lit = brighter_than(system, attacked, first) if first in sets.alike else ()
    alike = [(float(z[c]), system.sensor_checks[c]) for c in lit if z[c] > limit]
    evidence = dict.fromkeys((*own, *alone, *alike, *others))
    ratio = float(sets.ratios[first] * np.log10(np.e))
    shows, outside = tuple(sorted(evidence, reverse=True)), tuple(check for _, check in others)
    return _Explanation(attacked, tuple(sets.likely), ratio, shows, outside, shown=not unshown)


def _own(z: Floats, system: System, gone: frozenset[int], sensor: int, limit: float) -> list[tuple[float, SensorCheck]]:
    """The checks that name a sensor by the votes of those left: those above the limit, or else the largest.

    Of LiDARs alone none else: what one shows by its own past says nothing of what another one contests.
    """
    columns = of_sensor(system, gone, sensor).tolist()
    scores = [(float(z[c]), system.sensor_checks[c]) for c in columns if not np.isnan(z[c])]
    return [one for one in scores if one[0] > limit] or ([] if system.of_scans else sorted(scores)[-1:])


def _fired(explanation: _Explanation, limit: float) -> frozenset[tuple[int, ...]]:
    """The sensors, alone or in pairs, that checks above the limit speak of."""
    own = {(one.sensor,) for value, one in explanation.evidence if value > limit and len(one.nameable) == 1}
    return frozenset(
        (*own, *((s,) for s in explanation.attacked), *(tuple(sorted(one.nameable)) for one in explanation.outside))
    )


def _finding(verdict: Verdict, explanation: _Explanation, z: Floats, system: System, limit: float) -> Verdict:
    """The verdict on a frame that is a finding: with the attacked sensors, or with the reason why none is named."""
    absent = frozenset(verdict.out_of_system)
    chances = dict(explanation.likely)
    first = _first(explanation.likely)
    best = chances.get(first)
    others = [(one, chance) for one, chance in explanation.likely if one != first]
    alternatives = [] if best is None else [Alternative(one, log10(best / p)) for one, p in others if p]
    verdict = replace(
        verdict,
        gap=_lead(z, system, absent, explanation.attacked, limit),
        evidence=tuple(_evidence(value, check) for value, check in explanation.evidence),
        alternatives=tuple(alternatives[:MOST_LISTED]),
        posterior=best,
        log10_ratio=explanation.ratio,
    )
    by_time = system.by_time and explanation.attacked
    doubt = _undecided(explanation) if by_time else _doubt(explanation, len(system.sensors) - len(absent))
    if not doubt:
        shown = tuple(one for one in verdict.evidence if one.k is not None or one.i in explanation.attacked)
        return replace(verdict, kind=VerdictKind.ATTACKED, attacked=explanation.attacked, evidence=shown)
    likeliest = (Alternative(first, 0.0),) if first else ()
    reason = "; ".join(filter(None, (doubt, verdict.reason)))
    return replace(
        verdict, kind=VerdictKind.UNIDENTIFIED, reason=reason, alternatives=(*likeliest, *verdict.alternatives)
    )


def _lead(z: Floats, system: System, absent: frozenset[int], attacked: AttackSet, limit: float) -> float:
    """By how much z the strongest sensor exceeds the next that is not named, or the limit."""
    columns = system.naming(absent)
    scores = zip(z[columns].tolist(), columns.tolist(), strict=True)
    measured = [(value, system.sensor_checks[c].sensor) for value, c in scores if not isnan(value)]
    best = max((value for value, _ in measured), default=limit)
    if best <= limit:  # what names no sensor exceeds it alone: what two say of each other
        return float(_detected(z[None], system, absent)[0]) - limit
    rivals = [value for value, sensor in measured if sensor not in attacked] if attacked else []
    return best - max(limit, *rivals) if rivals else best - limit


def _evidence(value: float, check: SensorCheck) -> Evidence:
    return Evidence(check.check.value, check.sensor, None, check.others[0] if len(check.nameable) > 1 else None, value)


def _doubt(explanation: _Explanation, N: int) -> str:
    """Why the sensors that were found cannot be named; empty where they can."""
    most = N - FEWEST_COMPARED
    if N < FEWEST_SENSORS and not explanation.attacked:
        return f"an attack on one of {N} sensors cannot be attributed"
    if explanation.outside and len(explanation.attacked) >= most:
        rest = explanation.outside[0].nameable
        if len(rest) > 1:
            return f"{listed(sorted(rest))} do not see the same, and no third camera tells which of them is wrong"
        shown = sorted({*explanation.attacked, *rest})
        return f"checks of {listed(shown)} exceed the limit, and at most {most} of {N} sensors can be told apart"
    return _undecided(explanation)


def _undecided(explanation: _Explanation) -> str:
    """Why none of the attack sets is likely enough; empty where one is."""
    # r alone says how sure it is that there is an attack.
    attacks = [(one, chance) for one, chance in explanation.likely if one]
    whole = sum(chance for _, chance in attacks)
    if _is_undecided(explanation.likely, explanation.attacked):
        named = listed(explanation.attacked)
        if attacks[0][0] != explanation.attacked:
            rather = f"{listed(attacks[0][0])} rather than {named}"
            return f"{rather}, which lacks light that they show: more than can be told apart"
        shares = " or ".join(f"{listed(one)} ({_percent(chance / whole)})" for one, chance in attacks[:2])
        beside = sorted({sensor for one in explanation.outside for sensor in one.nameable})
        more = f", and beside {named} checks of {listed(beside)} exceed the limit" if beside else ""
        return f"{shares}: less than {_percent(NAMING.least_probability)} for any set of sensors{more}"
    return ""


def _is_undecided(likely: Sequence[tuple[AttackSet, float]], attacked: AttackSet) -> bool:
    """Whether an attack set is not likely enough among all that are one."""
    return dict(likely)[attacked] / sum(chance for one, chance in likely if one) < NAMING.least_probability


def _percent(share: float) -> str:
    return f"{share:.0%}".replace("%", " %")


def _remarks(system: System, columns: Indices, measured: bytes, present: Sequence[int], *, by_fallback: bool) -> str:
    """What a verdict does not cover: sensors that were not there, and invented points where no cameras look."""
    outside = [sensor for sensor in system.sensors if sensor not in present]
    without = f"judged without {listed(outside)}" if outside else ""
    alone = f"only {listed(system.fallback)} were compared" if by_fallback and system.fallback else ""
    conflicts = system.by_time or _have_conflicts(_measured(system, columns, measured))
    unchecked = _LIDAR_UNCHECKED if LIDAR in present and not conflicts else ""
    return "; ".join(filter(None, (without, alone, unchecked)))


def _is_lidar_checked(system: System, columns: Indices, measured: bytes) -> bool:
    """Whether pairs of cameras checked the LiDAR in a frame, where those that are there can."""
    possible = [system.sensor_checks[column] for column in columns.tolist()]
    return _have_conflicts(_measured(system, columns, measured)) or not _have_conflicts(possible)


def _have_conflicts(checks: Iterable[SensorCheck]) -> bool:
    """Whether pairs of cameras check the LiDAR among some checks."""
    return any(one.check is Check.LIDAR_CONFLICT for one in checks)


def _why_not_compared(system: System, present: Sequence[int], outside: Sequence[int]) -> str:
    """Why no three of the sensors present were compared in a frame."""
    missing = f"{listed(outside)} missing: " if outside else ""
    if system.of_scans and present:
        return missing + _NO_SCAN_BEFORE
    if system.by_time and not outside:
        return _STANDS
    if len(present) < FEWEST_COMPARED:
        return f"{missing}three sensors have to be compared, and only {listed(present) or 'none'} were there"
    possible = [system.sensor_checks[column] for column in system.counting(frozenset(outside)).tolist()]
    cameras = [sensor for sensor in present if sensor != LIDAR]
    if len(cameras) < FEWEST_COMPARED and not _have_conflicts(possible):
        return f"{missing}{listed(cameras)} lie too close together to check the LiDAR, and no third camera was there"
    return f"{missing}too little of what any three of {listed(present)} see could be compared"


def _states(
    system: System,
    columns: Indices,
    measured: bytes,
    fired: frozenset[tuple[int, ...]],
    absent: frozenset[int],
) -> tuple[str, bool]:
    """The e vector of a frame, and whether three sensors were compared in it, or a LiDAR alone with its last scan.

    '1' stands where a check of a sensor of the triple exceeded the limit, '-' where the triple was not measured. The
    fallback's state follows where no triple of the sensors present was measured, and it was.
    """
    triples = set(measured_triples(system, _measured(system, columns, measured), absent))
    above = {t for t in (*system.triples, system.fallback) if t and any(set(sensors) <= set(t) for sensors in fired)}
    marks = [
        (ABOVE if t in above else NOT_ABOVE) if t in triples or (t in above and absent.isdisjoint(t)) else NOT_MEASURED
        for t in system.triples
    ]
    if system.fallback is not None and system.fallback in triples and not triples.intersection(system.triples):
        marks.append(ABOVE if system.fallback in above else NOT_ABOVE)
    return "".join(marks), bool(triples) or (not system.triples and any(measured))


def _measured(system: System, columns: Indices, measured: bytes) -> frozenset[SensorCheck]:
    flags = np.frombuffer(measured, dtype=np.bool_)
    return frozenset(system.sensor_checks[c] for c, seen in zip(columns.tolist(), flags.tolist(), strict=True) if seen)


def _algorithm_2(e: str, system: System, present: Sequence[int]) -> tuple[int, ...] | None:
    if len(present) < FEWEST_SENSORS:
        return None
    identification = identify(e[: len(system.triples)], system.triples, present)
    return None if identification.undetermined else identification.attacked
