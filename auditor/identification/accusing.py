"""Verdicts of the robust method: the attack that explains all witnesses at once, and what carried it."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from auditor.elements import Element
from auditor.identification.algorithm2 import FEWEST_SENSORS, identify
from auditor.identification.explaining import explains, triple_states
from auditor.identification.joint import PRICE, Explanations, attack_sets, explain
from auditor.identification.states import ABOVE, NOT_ABOVE, NOT_MEASURED
from auditor.results import Verdict, VerdictKind
from auditor.rig import Triple

_UNEXPLAINED = 1.0
"""Raised margins that the best explanation leaves over: with more than this it is none."""

_ALTERNATIVES = 2

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class System:
    """What a rig's frames are judged by: its elements, triples and sensors, in their fixed orders."""

    elements: tuple[Element, ...]
    triples: tuple[Triple, ...]
    sensors: tuple[int, ...]


def accuse(z: Floats, system: System, missing: Sequence[frozenset[int]], threshold: float = 0.0) -> list[Verdict]:
    """The verdicts on F frames from (F, M) margins z, NaN where not measured, and the sensors missing in each.

    A frame is raised where the best attack explains it better than none by more than `threshold`. The verdict's
    `margin` is the lead of the best explanation over the second best, `named` Algorithm 2's answer on the same states,
    `reason` the elements that carried it and the next-best explanations.
    """
    verdicts: list[Verdict | None] = [None] * len(z)
    groups: dict[frozenset[int], list[int]] = {}
    for frame, absent in enumerate(missing):
        groups.setdefault(absent, []).append(frame)
    for absent, frames in groups.items():
        gone = [not absent.isdisjoint(element.needed) for element in system.elements]
        part = np.where(gone, np.nan, z[frames])
        for frame, verdict in zip(frames, _accuse_alike(part, system, absent, threshold), strict=True):
            verdicts[frame] = verdict
    return [verdict for verdict in verdicts if verdict is not None]


def _accuse_alike(z: Floats, system: System, absent: frozenset[int], threshold: float) -> list[Verdict]:
    """Frames that lack the same sensors."""
    present = [sensor for sensor in system.sensors if sensor not in absent]
    outside = tuple(sensor for sensor in system.sensors if sensor in absent)
    sets = attack_sets(present, max(len(present) - 3, 0))
    explanations = explain(z, system.elements, sets)
    best, lead = explanations.best, explanations.lead
    raised = explanations.score > threshold if len(sets) > 1 else np.nanmax(z, axis=1, initial=-np.inf) > threshold
    states = _states(z, system)
    named = cache(lambda e: _algorithm_2(e, system, present))
    verdicts = []
    for f in range(len(z)):
        if np.isnan(z[f]).all():
            kind, attacked, reason = VerdictKind.NOT_AUDITABLE, (), "no witness could be heard"
        elif not raised[f]:
            kind, attacked, reason = VerdictKind.CLEAN, (), ""
        else:
            attacked = explanations.sets[best[f]]
            doubt = _doubt(z[f], attacked, float(lead[f]), system.elements, len(present))
            kind = VerdictKind.UNIDENTIFIED if doubt else VerdictKind.ATTACKED
            reason = "; ".join(part for part in (doubt, _evidence(z[f], system), _others(explanations, f)) if part)
            attacked = () if doubt else attacked
        margin = float(lead[f]) if np.isfinite(lead[f]) else None
        verdicts.append(Verdict(kind, states[f], attacked, named(states[f]), outside, margin, reason))
    return verdicts


def _states(z: Floats, system: System) -> list[str]:
    """The e vector of each frame: a triple is raised where an element inside it is, '-' where none was measured."""
    above, measured = triple_states(z > 0, ~np.isnan(z), system.elements, system.triples)
    marks = np.where(measured, np.where(above, ABOVE, NOT_ABOVE), NOT_MEASURED)
    return ["".join(row) for row in marks.tolist()]


def _algorithm_2(e: str, system: System, present: Sequence[int]) -> tuple[int, ...] | None:
    if len(present) < FEWEST_SENSORS:
        return None
    found = identify(e, system.triples, present)
    return None if found.undetermined else found.attacked


def _doubt(z: Floats, attacked: tuple[int, ...], lead: float, elements: Sequence[Element], N: int) -> str:
    if N < FEWEST_SENSORS:
        return f"an attack on one of {N} sensors cannot be attributed"
    left = sum(max(float(v), 0.0) for v, e in zip(z, elements, strict=True) if v == v and not explains(e, attacked))  # noqa: PLR0124 - not NaN
    if left > _UNEXPLAINED:
        return f"no attack on at most {N - 3} of {N} sensors explains what was measured"
    if lead < PRICE:
        return "two explanations are as good"
    return ""


def _evidence(z: Floats, system: System) -> str:
    raised = sorted((-float(v), e) for v, e in zip(z, system.elements, strict=True) if v > 0)
    return ", ".join(f"{e.witness} S_{e.i} S_{e.k} {-v:+.1f}" for v, e in raised)


def _others(explanations: Explanations, frame: int) -> str:
    ranked = explanations.ranked(frame)
    first = ranked[0][1]
    others = [f"{_names(s)} {cost - first:+.2f}" for s, cost in ranked[1 : 1 + _ALTERNATIVES]]
    return f"next: {', '.join(others)}" if others else ""


def _names(attacked: tuple[int, ...]) -> str:
    return "+".join(f"S_{sensor}" for sensor in attacked) if attacked else "none"
