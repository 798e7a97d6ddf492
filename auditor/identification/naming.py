"""Joint identification: from the normalised scores of all sensor checks to the sensors that are named as attacked.

Each check speaks of one sensor, by the vote of others. An attacked sensor votes too: so sensors are named one after the
other, the strongest first, and after each the others are judged by the votes of those that are left.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from auditor.identification.algorithm2 import (
    ABOVE,
    FEWEST_COMPARED,
    FEWEST_SENSORS,
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

_LIDAR_UNCHECKED = "no camera pair can check the LiDAR here: points that it invents pass unnoticed"


@dataclass(frozen=True)
class _Named:
    """The sensors that were named in turn, the checks that exceeded the limit, and the next best by sensor.

    `unclear` are checks of two cameras that do not see the same, without a third that could tell which is wrong.
    """

    sensors: tuple[int, ...]
    evidence: tuple[tuple[float, SensorCheck], ...]
    unclear: tuple[SensorCheck, ...]
    first: Mapping[int, float]


def name_attacked(
    z: Floats, system: System, missing: Sequence[frozenset[int]], limit: float, others: float | None = None
) -> list[Verdict]:
    """The verdicts on F frames from (F, M) scores z, NaN where not measured, and the missing sensors of each.

    A frame is a finding where a check that counts exceeds the `limit`; sensors after the first are named where a check
    exceeds that of `others`, the same where it is not given. The verdict's `gap` is by how much the strongest sensor
    exceeds the next, or the limit; `evidence` are the checks above it, and those that confirm what two cameras alone
    show, the strongest first; `named` is Algorithm 2's answer on the states of the triples. `reason` says why no sensor
    of a finding is named, without which sensors a frame was judged, and where no camera pair can check the LiDAR. A
    frame without a finding in which no three sensors were compared is not auditable.
    """
    verdicts: list[Verdict | None] = [None] * len(z)
    for absent, frames in _frames_by_missing(missing).items():
        for frame, verdict in zip(
            frames, _of_group(z[frames], system, absent, limit, limit if others is None else others), strict=True
        ):
            verdicts[frame] = verdict
    return [verdict for verdict in verdicts if verdict is not None]


def attack_scores(z: Floats, system: System, missing: Sequence[frozenset[int]]) -> Floats:
    """(F,) the largest z of the checks that count in each frame: `name_attacked` compares it with its limit."""
    scores = np.full(len(z), -np.inf)
    for absent, frames in _frames_by_missing(missing).items():
        columns = system.detecting(absent)
        scores[frames] = np.nanmax(z[frames][:, columns], axis=1, initial=-np.inf)
    return scores


def _frames_by_missing(missing: Sequence[frozenset[int]]) -> dict[frozenset[int], list[int]]:
    groups: dict[frozenset[int], list[int]] = {}
    for frame, absent in enumerate(missing):
        groups.setdefault(absent, []).append(frame)
    return groups


def _of_group(z: Floats, system: System, absent: frozenset[int], limit: float, others: float) -> list[Verdict]:
    """The verdicts on frames that all lack the same sensors."""
    present = [sensor for sensor in system.sensors if sensor not in absent]
    outside = tuple(sensor for sensor in system.sensors if sensor in absent)
    columns = system.counting(absent)
    measured: Flags = ~np.isnan(z[:, columns])
    score = np.nanmax(z[:, system.detecting(absent)], axis=1, initial=-np.inf)
    why_not = _why_not_compared(system, present, outside)
    states = cache(lambda which, fired: _states(system, columns, which, fired, absent))
    algorithm_2 = cache(lambda e: _algorithm_2(e, system, present))
    remarks = cache(lambda which, by_fallback: _remarks(system, columns, which, present, by_fallback=by_fallback))
    verdicts = []
    for f, seen in enumerate(measured):
        which = seen.tobytes()
        found = _name(z[f], system, absent, limit, others) if score[f] > limit else None
        fired = frozenset() if found is None else _fired(found)
        e, audited = states(which, fired)
        if found is None and not audited:
            verdicts.append(Verdict(VerdictKind.NOT_AUDITABLE, e, out_of_system=outside, reason=why_not))
            continue
        verdict = Verdict(
            VerdictKind.CLEAN,
            e,
            named=algorithm_2(e),
            out_of_system=outside,
            gap=float(limit - score[f]),
            reason=remarks(which, len(e) > len(system.triples)),
        )
        verdicts.append(verdict if found is None else _finding(verdict, found, limit, present))
    return verdicts


def _name(z: Floats, system: System, absent: frozenset[int], limit: float, others: float) -> _Named:
    """Name the sensors of one frame in turn, until no check exceeds the limit, that of `others` after the first."""
    named: list[int] = []
    evidence: list[tuple[float, SensorCheck]] = []
    first: dict[int, float] = {}
    while True:
        gone = absent.union(named)
        columns = system.counting(gone) if named else system.detecting(gone)
        scored = [(float(z[c]), system.sensor_checks[c]) for c in columns.tolist() if not np.isnan(z[c])]
        of_one = [(value, check) for value, check in scored if len(check.nameable) == 1]
        first = first or _largest(of_one)
        least = others if named else limit
        unclear = tuple(check for value, check in scored if value > least and len(check.nameable) > 1)
        if of_one and (strongest := max(of_one))[0] > least:
            sensor = strongest[1].sensor
        elif not named and (confirmed := _confirmed(first, unclear, limit)) is not None:
            sensor, least = confirmed, NAMING.confirming_share * limit
            evidence += [(value, check) for value, check in scored if check in unclear and sensor in check.nameable]
        else:
            evidence += [(value, check) for value, check in scored if check in unclear]
            return _Named(tuple(sorted(named)), tuple(sorted(evidence, reverse=True)), unclear, first)
        named.append(sensor)
        least = min(least, limit)
        evidence += [(value, check) for value, check in of_one if check.sensor == sensor and value > least]


def _confirmed(first: Mapping[int, float], unclear: Sequence[SensorCheck], limit: float) -> int | None:
    """Which sensor of cameras that, two alone, do not see the same, the votes of the others confirm; None where none.

    That something is wrong is known by then: so less is asked of the votes, and that they clearly speak of one sensor.
    """
    ranked = sorted(((value, sensor) for sensor, value in first.items()), reverse=True)
    if not ranked or not any(ranked[0][1] in check.nameable for check in unclear):
        return None
    value, sensor = ranked[0]
    next_value = ranked[1][0] if len(ranked) > 1 else -np.inf
    share, lead = NAMING.confirming_share, NAMING.confirming_lead
    return sensor if value > share * limit and value - next_value > lead else None


def _largest(scored: Sequence[tuple[float, SensorCheck]]) -> dict[int, float]:
    largest: dict[int, float] = {}
    for value, check in scored:
        largest[check.sensor] = max(value, largest.get(check.sensor, -np.inf))
    return largest


def _fired(found: _Named) -> frozenset[tuple[int, ...]]:
    """The sensors, alone or in pairs, that checks above the limit speak of."""
    return frozenset((*((sensor,) for sensor in found.sensors), *(tuple(sorted(c.nameable)) for c in found.unclear)))


def _finding(verdict: Verdict, found: _Named, limit: float, present: Sequence[int]) -> Verdict:
    """The verdict on a frame that is a finding: with the attacked sensors, or with the reason why none is named."""
    ranked = sorted(found.first.items(), key=lambda one: -one[1])
    best = ranked[0][1] if ranked else limit
    others = [Alternative((sensor,), best - value) for sensor, value in ranked if (sensor,) != found.sensors]
    rivals = [value for sensor, value in ranked if sensor not in found.sensors]
    verdict = replace(
        verdict,
        gap=float(best - max(limit, *rivals)) if rivals else float(best - limit),
        evidence=tuple(_evidence(value, check) for value, check in found.evidence),
        alternatives=tuple(others[: NAMING.alternatives]),
    )
    doubt = _doubt(found, len(present))
    if not doubt:
        return replace(verdict, kind=VerdictKind.ATTACKED, attacked=found.sensors)
    likeliest = (Alternative(found.sensors, 0.0),) if found.sensors and len(present) >= FEWEST_SENSORS else ()
    reason = "; ".join(filter(None, (doubt, verdict.reason)))
    alternatives = tuple(dict.fromkeys((*likeliest, *verdict.alternatives)))
    return replace(verdict, kind=VerdictKind.UNIDENTIFIED, reason=reason, alternatives=alternatives)


def _evidence(value: float, check: SensorCheck) -> Evidence:
    return Evidence(check.check.value, check.sensor, None, check.others[0] if len(check.nameable) > 1 else None, value)


def _doubt(found: _Named, N: int) -> str:
    """Why the sensors that were found cannot be named; empty where they can."""
    if N < FEWEST_SENSORS:
        return f"an attack on one of {N} sensors cannot be attributed"
    if found.unclear:
        pair = listed(sorted(found.unclear[0].nameable))
        return f"{pair} do not see the same, and no third camera tells which of them is wrong"
    if len(found.sensors) > N - FEWEST_COMPARED:
        return (
            f"checks of {listed(found.sensors)} exceed the limit, and at most {N - FEWEST_COMPARED} of {N} sensors"
            " can be told apart"
        )
    return ""


def _remarks(system: System, columns: Indices, measured: bytes, present: Sequence[int], *, by_fallback: bool) -> str:
    """What a verdict does not cover: sensors that were not there, and invented points where no cameras look."""
    outside = [sensor for sensor in system.sensors if sensor not in present]
    without = f"judged without {listed(outside)}" if outside else ""
    alone = f"only {listed(system.fallback)} were compared" if by_fallback and system.fallback else ""
    conflicts = any(one.check is Check.LIDAR_CONFLICT for one in _measured(system, columns, measured))
    unchecked = _LIDAR_UNCHECKED if LIDAR in present and not conflicts else ""
    return "; ".join(filter(None, (without, alone, unchecked)))


def _why_not_compared(system: System, present: Sequence[int], outside: Sequence[int]) -> str:
    """Why no three of the sensors present were compared in a frame."""
    missing = f"{listed(outside)} missing: " if outside else ""
    if len(present) < FEWEST_COMPARED:
        return f"{missing}three sensors have to be compared, and only {listed(present) or 'none'} were there"
    possible = [system.sensor_checks[column] for column in system.counting(frozenset(outside)).tolist()]
    cameras = [sensor for sensor in present if sensor != LIDAR]
    if len(cameras) < FEWEST_COMPARED and not any(one.check is Check.LIDAR_CONFLICT for one in possible):
        return f"{missing}{listed(cameras)} lie too close together to check the LiDAR, and no third camera was there"
    return f"{missing}too little of what any three of {listed(present)} see could be compared"


def _states(
    system: System,
    columns: Indices,
    measured: bytes,
    fired: frozenset[tuple[int, ...]],
    absent: frozenset[int],
) -> tuple[str, bool]:
    """The e vector of a frame, and whether three sensors were compared in it.

    '1' stands where a check of a sensor of the triple exceeded the limit, '-' where the triple was not measured. The
    fallback's state follows where no triple of the sensors present was measured, and it was.
    """
    known = set(measured_triples(system, _measured(system, columns, measured), absent))
    above = {t for t in (*system.triples, system.fallback) if t and any(set(sensors) <= set(t) for sensors in fired)}
    marks = [
        (ABOVE if t in above else NOT_ABOVE) if t in known or (t in above and absent.isdisjoint(t)) else NOT_MEASURED
        for t in system.triples
    ]
    if system.fallback is not None and system.fallback in known and not known.intersection(system.triples):
        marks.append(ABOVE if system.fallback in above else NOT_ABOVE)
    return "".join(marks), bool(known)


def _measured(system: System, columns: Indices, measured: bytes) -> frozenset[SensorCheck]:
    flags = np.frombuffer(measured, dtype=np.bool_)
    return frozenset(system.sensor_checks[c] for c, seen in zip(columns.tolist(), flags.tolist(), strict=True) if seen)


def _algorithm_2(e: str, system: System, present: Sequence[int]) -> tuple[int, ...] | None:
    if len(present) < FEWEST_SENSORS:
        return None
    found = identify(e[: len(system.triples)], system.triples, present)
    return None if found.undetermined else found.attacked
