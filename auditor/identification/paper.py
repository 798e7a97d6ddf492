"""The paper's method: the verdict on a frame from its disparity errors E, their thresholds theta and Algorithm 2.

From disparity errors to the attacked sensors lead Eq. 6, Eq. 7 read backwards, and Algorithm 2 by Lemmas 1 and 2.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import combinations, combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from auditor.errors import ThresholdsError
from auditor.model.arrays import Flags
from auditor.model.calibration import Thresholds
from auditor.model.rig import Triple
from auditor.model.text import enumerated
from auditor.model.verdict import Alternative, Evidence, Verdict, VerdictKind

ABOVE, NOT_ABOVE, NOT_MEASURED = "1", "0", "-"
"""The states of an element of e (Eq. 6): E > theta, E <= theta, or no E."""

FEWEST_SENSORS = 4
"""N sensors tolerate N - 3 attacked ones, so with three an attack has no name."""

FEWEST_COMPARED = 3
"""The sensors of a triple: fewer cannot be compared."""

MOST_LISTED = 2
"""Attack sets that a verdict lists beside the best."""


@dataclass(frozen=True)
class Identification:
    """Algorithm 2's answer: the attacked sensors, and those that unmeasured elements leave open. Both ascending."""

    attacked: tuple[int, ...]
    undetermined: tuple[int, ...] = ()


def identify(e: str, triples: Sequence[Triple], sensors: Iterable[int]) -> Identification:
    """Identify the attacked among `sensors`, those that took part.

    `e` has one character for each of `triples`: '0', '1', or '-' where not measured. Triples of other sensors are
    ignored. With a LiDAR and all n cameras this is Algorithm 2 as printed; otherwise its S_n is the leftmost camera
    that took part, and so on down.
    """
    states = dict(zip(triples, e, strict=True))
    system = sorted(sensors)
    attacked: list[int] = []
    while True:
        *sources, k = system
        elements = {(i, j): states.get(Triple(i, j, k), NOT_MEASURED) for i, j in combinations(sources, 2)}
        zero = next((pair for pair, state in elements.items() if state == NOT_ABOVE), None)
        if zero is not None:
            identification = _lemma_1(zero, elements, sources)
            return Identification(tuple(sorted((*attacked, *identification.attacked))), identification.undetermined)
        if len(system) < FEWEST_SENSORS or NOT_MEASURED in elements.values():
            return Identification(tuple(sorted(attacked)), tuple(system))
        attacked.append(k)  # Lemma 2: all elements are 1, therefore s_k = 1
        if len(system) == FEWEST_SENSORS:
            return Identification(tuple(sorted(attacked)))
        system = sources


def _lemma_1(zero: tuple[int, int], elements: Mapping[tuple[int, int], str], sources: Sequence[int]) -> Identification:
    """e_{i0,j0,k} = 0: S_i0, S_j0 and S_k are not attacked; each other source then has s_i = e_{i,i0,k} = e_{i,j0,k}.

    The second form stands in where the first was not measured.
    """
    i0, j0 = zero
    s: dict[int, str] = {}
    for i in sources:
        if i in zero:
            continue
        by_i0, by_j0 = elements[min(i, i0), max(i, i0)], elements[min(i, j0), max(i, j0)]
        s[i] = by_j0 if by_i0 == NOT_MEASURED else by_i0
    return Identification(
        attacked=tuple(i for i, state in s.items() if state == ABOVE),
        undetermined=tuple(i for i, state in s.items() if state == NOT_MEASURED),
    )


def codeword(attacked: Collection[int], triples: Sequence[Triple]) -> str:
    """The e vector of an attack (Eq. 7): an element is '1' where a sensor of its triple is attacked."""
    return "".join(ABOVE if any(sensor in attacked for sensor in triple) else NOT_ABOVE for triple in triples)


def disagreements(e: str, attacked: Collection[int], triples: Sequence[Triple]) -> int:
    """How many measured elements of e differ from the codeword of an attack."""
    return sum(
        state not in (NOT_MEASURED, expected) for state, expected in zip(e, codeword(attacked, triples), strict=True)
    )


def without(e: str, triples: Sequence[Triple], absent: frozenset[int]) -> str:
    """The e vector with '-' for every triple that an absent sensor belongs to."""
    return "".join(
        NOT_MEASURED if not absent.isdisjoint(triple) else state for state, triple in zip(e, triples, strict=True)
    )


def listed(sensors: Sequence[int]) -> str:
    """Sensors in words: S_1, S_2 and S_3."""
    return enumerated([f"S_{sensor}" for sensor in sensors])


def sensors_where(sensors: Sequence[int], chosen: Flags) -> list[frozenset[int]]:
    """The chosen sensors of each frame, such as the missing ones, from (F, S) flags."""
    if not chosen.any():
        return [frozenset()] * len(chosen)
    patterns, which = np.unique(chosen, axis=0, return_inverse=True)
    sets = [frozenset(s for s, there in zip(sensors, row, strict=True) if there) for row in patterns.tolist()]
    return [sets[index] for index in which.ravel().tolist()]


def judge(
    e: str,
    triples: Sequence[Triple],
    sensors: Sequence[int],
    missing: frozenset[int] = frozenset(),
    gap: float | None = None,
) -> Verdict:
    """The verdict on one frame of a rig with these triples and sensors, some of which may be missing.

    The system judged is made of the sensors that are present and belong to at least one measured triple; the others are
    `out_of_system`. An attack is attributed only where Algorithm 2 determines every sensor, and the attack it names, on
    at most N - 3 of them, explains every measured element over all references (Eq. 7).
    """
    e = without(e, triples, missing)
    system = {sensor for triple, state in zip(triples, e, strict=True) if state != NOT_MEASURED for sensor in triple}
    outside = tuple(sensor for sensor in sensors if sensor not in system)
    verdict = Verdict(VerdictKind.NOT_AUDITABLE, e, out_of_system=outside, gap=gap)
    if not system:
        return replace(verdict, reason=_why_nothing_was_measured(sensors, missing))
    N = len(system)
    identification = identify(e, triples, system) if N >= FEWEST_SENSORS else None
    verdict = replace(
        verdict,
        named=None if identification is None or identification.undetermined else identification.attacked,
        alternatives=_alternatives(identification, e, triples, system),
    )
    without_them = f"judged without {listed(outside)}" if outside else ""
    if ABOVE not in e:
        return replace(verdict, kind=VerdictKind.CLEAN, reason=without_them)
    doubt = _doubt(identification, e, triples, N)
    if identification is None or doubt:
        return replace(verdict, kind=VerdictKind.UNIDENTIFIED, reason=_join(doubt, without_them))
    return replace(verdict, kind=VerdictKind.ATTACKED, attacked=identification.attacked, reason=without_them)


def judge_frames(
    errors: NDArray[np.float64],
    thresholds: Thresholds,
    triples: Sequence[Triple],
    sensors: Sequence[int],
    missing: Sequence[frozenset[int]],
    fallback: Triple | None = None,
) -> list[Verdict]:
    """The verdicts on F frames: `errors` is (F, T) disparity errors E by triple, NaN where not measured.

    `missing` holds, for each frame, the sensors that were missing or damaged. Frames that share their e vector and
    their missing sensors are judged once. With a `fallback` its E are one more column, which counts where no other E
    of a frame has been measured: there e has one more character. Raises ThresholdsError where no triple of the rig has
    a theta.
    """
    T = len(triples)
    triples = triples if fallback is None else (*triples, fallback)
    theta = np.array([thresholds.theta.get(triple, np.nan) for triple in triples], dtype=np.float64)
    if len(triples) and np.isnan(theta).all():
        raise ThresholdsError(
            "it has no theta for any triple of this rig",
            where=f"calibration {thresholds.calibration_id}",
            remedy="calibrate on clean recordings of this rig kind",
        )
    distances = _mask(errors, triples, missing) - theta
    distances[~np.isnan(distances[:, :T]).all(axis=1), T:] = np.nan
    judged = cache(lambda e, absent: judge(e, triples[: len(e)], sensors, absent))
    evidence = [partial(Evidence, thresholds.statistic.value, *triple) for triple in triples]
    return [
        # Made in full, not by replace(): a night's frames are judged in one go.
        Verdict(
            v.kind,
            v.e,
            v.attacked,
            v.named,
            v.out_of_system,
            gap,
            v.reason,
            _evidence(row, evidence) if ABOVE in v.e else (),
            v.alternatives,
        )
        for e, absent, gap, row in zip(
            _state_vectors(distances, T), missing, _smallest_distances(distances), distances, strict=True
        )
        for v in (judged(e, absent),)
    ]


def _mask(
    errors: NDArray[np.float64], triples: Sequence[Triple], missing: Sequence[frozenset[int]]
) -> NDArray[np.float64]:
    """A copy of the disparity errors without those that a missing sensor belongs to."""
    masked = np.array(errors, dtype=np.float64).reshape(len(missing), len(triples))
    touched = {absent: [not absent.isdisjoint(triple) for triple in triples] for absent in set(missing) if absent}
    for frame, absent in enumerate(missing):
        if absent:
            masked[frame, touched[absent]] = np.nan
    return masked


def _state_vectors(distances: NDArray[np.float64], T: int) -> list[str]:
    """The e vector of each row of E - theta, (F, T); the states after the T-th only where they were measured."""
    if distances.shape[1] == 0:
        return [""] * len(distances)
    states = np.where(np.isnan(distances), ord(NOT_MEASURED), np.where(distances > 0, ord(ABOVE), ord(NOT_ABOVE)))
    rows = np.ascontiguousarray(states.astype(np.uint8)).view(f"S{distances.shape[1]}")
    vectors = (row.decode() for row in rows.ravel().tolist())
    return [e[:T] + e[T:].strip(NOT_MEASURED) for e in vectors]


def _smallest_distances(distances: NDArray[np.float64]) -> list[float | None]:
    """The smallest measured |E - theta| of each row, None where nothing was measured."""
    smallest = np.where(np.isnan(distances), np.inf, np.abs(distances)).min(axis=1, initial=np.inf)
    return [gap if gap < np.inf else None for gap in smallest.tolist()]


def _evidence(row: NDArray[np.float64], of: Sequence[Callable[[float], Evidence]]) -> tuple[Evidence, ...]:
    """The disparity errors of a frame above their theta, from its E - theta; the furthest above first."""
    above = sorted(np.flatnonzero(row > 0).tolist(), key=lambda place: -row[place])
    return tuple(of[place](float(row[place])) for place in above)


def _alternatives(
    identification: Identification | None, e: str, triples: Sequence[Triple], system: Collection[int]
) -> tuple[Alternative, ...]:
    """Of the attacks with one sensor more, less or another than Algorithm 2's, those nearest to e."""
    if identification is None:
        return ()
    identified = frozenset(identification.attacked)
    changes = [
        {a, b}
        for a, b in combinations_with_replacement(sorted(system), 2)
        if a == b or (a in identified) != (b in identified)
    ]
    others = [tuple(sorted(identified ^ change)) for change in changes]
    allowed = [attacked for attacked in others if len(attacked) <= len(system) - 3]
    least = disagreements(e, identification.attacked, triples)
    distances = {attacked: disagreements(e, attacked, triples) - least for attacked in allowed}
    nearest = sorted(distances, key=lambda attacked: (distances[attacked], len(attacked), attacked))
    return tuple(Alternative(attacked, float(distances[attacked])) for attacked in nearest[:MOST_LISTED])


def _doubt(identification: Identification | None, e: str, triples: Sequence[Triple], N: int) -> str:
    """Why Algorithm 2's answer cannot be the verdict; empty where it can."""
    if identification is None:
        return f"an attack on one of {N} sensors cannot be attributed"
    if identification.undetermined:
        return f"unmeasured disparity errors leave {listed(identification.undetermined)} undetermined"
    if disagreements(e, identification.attacked, triples):
        return f"no attack on at most {N - 3} of {N} sensors explains the disparity error states"
    return ""


def _why_nothing_was_measured(sensors: Sequence[int], missing: frozenset[int]) -> str:
    if len(sensors) < 3:
        return f"three overlapping sensors are needed, and the rig has {len(sensors)}"
    absent = tuple(sensor for sensor in sensors if sensor in missing)
    if absent:
        return f"{listed(absent)} missing, and no triple of the other sensors was measured"
    return "no triple with a threshold has enough valid pixels"


def _join(*parts: str) -> str:
    return "; ".join(part for part in parts if part)
