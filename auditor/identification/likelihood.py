"""How likely it is that exactly these sensors are attacked: likelihood ratios of attack sets, and their posterior.

An attack set explains a frame where each of its sensors is shown by the votes of those outside the set, and where what
those outside show of each other is as in clean frames. Both become a logarithm of a likelihood by curves that were
fitted to attacked and clean frames of real drives and streets (multinomial logistic regression; benchmark
`likelihood`). The ratio compares a set with no attack; the posterior adds a stated prior. No ratio is larger than
the clean frames carry that the curves were fitted to: what happens less often than once in them nobody has seen.
"""

from collections.abc import Collection, Mapping, Sequence
from functools import cache
from itertools import combinations
from math import comb
from typing import NamedTuple

import numpy as np

from auditor.identification.evidence_parameters import INCIDENTS, LIKELIHOOD, OWN_AT, REST_AT
from auditor.identification.paper import FEWEST_COMPARED
from auditor.identification.parameters import SCORE_LIMITS
from auditor.identification.prior import joint_limit
from auditor.identification.systems import System
from auditor.model.arrays import Floats, Indices
from auditor.model.checks import FEWEST_VOTERS, MOST_LEFT_OUT, Check, SensorCheck
from auditor.model.checks.kind import Of
from auditor.model.rig import LIDAR

_UNMATCHED = tuple(one for one in Check if one.kind.by_all_but_one)
_OF_OWN_SCANS = frozenset({Of.VIEW, Of.OWN_SCANS, Of.SURROUNDINGS})
_SUSPECTS = 6  # sensors that sets of several are made of, the likeliest: it bounds the work


AttackSet = tuple[int, ...]
"""Attacked sensors, ascending; () is no attack."""

LARGEST_RATIO = float(np.log(LIKELIHOOD.clean_worth))
"""The logarithm of the largest likelihood ratio that is said."""


class AttackSetScores(NamedTuple):
    """What F frames show of an attack set.

    `own` are (F,) by sensor of the set: its largest z by the votes of sensors outside the set, -inf where they have not
    voted. `rest` (F,) is the largest z that sensors outside the set show of each other, less the limit that it exceeds
    in 1 % of clean frames. `lacking` (F,) is the z by which its cameras lack light more than they show any added.
    """

    own: Mapping[int, Floats]
    rest: Floats
    lacking: Floats


def attack_sets(system: System, absent: frozenset[int], suspects: Sequence[int]) -> list[AttackSet]:
    """No attack, each sensor alone, and sets of `suspects`: of sensors that are there, as many as can be told apart.

    Three sensors outside the set have to be left that vote; and votes are measured without two voters at most. Of
    three sensors one is told where it shows by itself (`singles_out`). Of a lone camera and a LiDAR each is told by the
    other and by the camera's past, LiDARs alone by their own past and by each other.
    """
    present = [sensor for sensor in system.sensors if sensor not in absent]
    if system.by_time:
        return [(), *((sensor,) for sensor in present)] if LIDAR in present or system.of_scans else [()]
    most = min(len(present) - FEWEST_COMPARED, MOST_LEFT_OUT + 1)
    if len(present) < FEWEST_COMPARED:
        return [()]
    several = (one for size in range(2, most + 1) for one in combinations(sorted(suspects), size))
    return [(), *((sensor,) for sensor in present), *several]


def suspects_of(z: Floats, system: System, absent: frozenset[int]) -> tuple[int, ...]:
    """The sensors that sets of several are made of in a frame of scores (M,): those of the largest z."""
    present = [sensor for sensor in system.sensors if sensor not in absent]
    if len(present) <= _SUSPECTS:
        return tuple(present)
    largest = {sensor: _largest(z[None], of_sensor(system, absent, sensor))[0] for sensor in present}
    return tuple(sorted(sorted(present, key=lambda sensor: -largest[sensor])[:_SUSPECTS]))


def explained(z: Floats, system: System, absent: frozenset[int], attacked: AttackSet) -> AttackSetScores:
    """What frames of scores (F, M) without these sensors show of an attack set."""
    gone = absent.union(attacked)
    own = {s: _largest(z, telling(system, gone - {s}, s), -np.inf) for s in attacked}
    rest, usual = _rest(system, gone)
    return AttackSetScores(own, _largest(z, rest) - usual, np.maximum(_lacking(z, system, absent, attacked), 0.0))


@cache
def lit_alike(system: System, absent: frozenset[int], lacking: AttackSet) -> AttackSet:
    """The cameras that say what light those of a set lack: the same light may have been added to all of them.

    They are empty where a LiDAR is in the set, or where they are not two.
    """
    if not lacking or not system.lidars.isdisjoint(lacking):
        return ()
    gone = absent.union(lacking)
    columns = (column for sensor in lacking for column in of_sensor(system, gone - {sensor}, sensor).tolist())
    checks = (system.sensor_checks[column] for column in columns)
    voters = {other for one in checks if one.check.kind.opposite_of for other in one.others}
    return tuple(sorted(voters)) if len(voters) >= FEWEST_VOTERS else ()


def brighter_than(system: System, lacking: AttackSet, others: AttackSet) -> Indices:
    """The checks by which each of the other cameras has a patch that is brighter than all that those of a set show."""
    checks = {one: column for column, one in enumerate(system.sensor_checks) if one.check.kind.by_all_but_one}
    places = (checks.get(SensorCheck(check, other, lacking)) for check in _UNMATCHED for other in others)
    return np.array([column for column in places if column is not None], dtype=np.intp)


def _explained_by(z: Floats, system: System, absent: frozenset[int], lacking: AttackSet) -> AttackSetScores:
    """What frames of scores (F, M) show of light on all cameras but those of a set, which says it by what it lacks."""
    others, gone = lit_alike(system, absent, lacking), absent.union(lacking)
    removed = np.min([_light(z, system, gone - {s}, s).removed for s in lacking], axis=0)
    rest, usual = _rest(system, gone)
    own = dict.fromkeys(others, np.maximum(removed, _alike(z, system, lacking, others)))
    against = np.maximum(-_lacking(z, system, absent, lacking), 0.0)
    return AttackSetScores(own, _largest(z, rest) - usual, against)


def _lacking(z: Floats, system: System, absent: frozenset[int], attacked: AttackSet) -> Floats:
    """(F,) by how much z the cameras of a set, together, lack light that all others have more than they show any."""
    gone = absent.union(attacked)
    alike = _alike(z, system, attacked, lit_alike(system, absent, attacked))
    light = [_light(z, system, gone - {s}, s) for s in attacked if s not in system.lidars]
    more = (np.maximum(np.maximum(one.removed, alike), 0.0) - np.maximum(one.added, 0.0) for one in light)
    return np.asarray(sum(more, np.zeros(len(z))))


def _alike(z: Floats, system: System, lacking: AttackSet, others: AttackSet) -> Floats:
    """(F,) the z by which all of the other cameras have a patch that is brighter than all that those of a set show."""
    columns = brighter_than(system, lacking, others)
    if not 0 < len(others) == columns.size:
        return np.full(len(z), -np.inf)
    return np.asarray(np.nan_to_num(z[:, columns], nan=-np.inf).min(axis=1))


def light_alike(z: Floats, system: System, absent: frozenset[int]) -> dict[int, Floats]:
    """By camera (F,) the z of light that it and all others but one have alike, in frames of scores (F, M)."""
    of_each = {sensor: lit_alike(system, absent, (sensor,)) for sensor in system.sensors if sensor not in absent}
    scores: dict[int, list[Floats]] = {}
    for sensor, others in of_each.items():
        alike = _alike(z, system, (sensor,), others)
        for other in others:
            scores.setdefault(other, []).append(alike)
    return {sensor: np.max(of_sensor, axis=0) for sensor, of_sensor in scores.items()}


class _Light(NamedTuple):
    """(F,) the largest z of light `removed` from a camera, and of light `added` to it."""

    removed: Floats
    added: Floats


def _light(z: Floats, system: System, gone: frozenset[int], sensor: int) -> _Light:
    columns = of_sensor(system, gone, sensor)
    kinds = [system.sensor_checks[column].check.kind for column in columns.tolist()]
    removes = np.array([bool(kind.opposite_of) for kind in kinds], dtype=np.bool_)
    adds = np.array([kind.adds for kind in kinds], dtype=np.bool_)
    return _Light(_largest(z, columns[removes]), _largest(z, columns[adds]))


def log_likelihood_ratios(
    z: Floats, system: System, absent: frozenset[int], sets: Sequence[AttackSet], alike: Sequence[AttackSet] = ()
) -> Floats:
    """(F, H + A) natural logarithms of the likelihood of each attack set against that of no attack, the first of them.

    `z` are (F, M) normalised scores of frames without the `absent` sensors, NaN where not measured. No attack is held
    less likely than the likeliest set by the largest ratio at most. The last are those of light on all cameras but
    those of each set of `alike`.
    """
    seen = [explained(z, system, absent, attacked) for attacked in sets]
    seen += [_explained_by(z, system, absent, lacking) for lacking in alike]
    ratios = np.stack([_log_likelihood(one, system.lidars) for one in seen], axis=1)
    clean = np.maximum(ratios[:, 0], ratios.max(axis=1) - LARGEST_RATIO)
    return np.asarray(np.concatenate([clean[:, None], ratios[:, 1:]], axis=1) - clean[:, None])


class LikelySets(NamedTuple):
    """The attack sets of a frame and their probabilities, the likeliest first, and their logarithmic ratios.

    `alike` are those of them that are more than can be told apart, each with the others: what they lack shows it.
    """

    likely: list[tuple[AttackSet, float]]
    ratios: Mapping[AttackSet, float]
    alike: Mapping[AttackSet, AttackSet]


def likely_sets(z: Floats, system: System, absent: frozenset[int]) -> list[LikelySets]:
    """The attack sets of each of F frames of scores (F, M) without the `absent` sensors."""
    suspects = [suspects_of(one, system, absent) for one in z]
    by_frame: dict[int, LikelySets] = {}
    for those in dict.fromkeys(suspects):
        frames = [frame for frame, its in enumerate(suspects) if its == those]
        sets = attack_sets(system, absent, those)
        lit = {others: one for one in sets if (others := lit_alike(system, absent, one)) and others not in sets}
        ratios = log_likelihood_ratios(z[frames], system, absent, sets, [*lit.values()])
        every = [*sets, *lit]
        chances = posteriors(ratios, every, len(system.sensors) - len(absent))
        for frame, of_frame, its_ratios in zip(frames, chances.tolist(), ratios.tolist(), strict=True):
            likely = sorted(zip(every, of_frame, strict=True), key=lambda one: -one[1])
            by_frame[frame] = LikelySets(likely, dict(zip(every, its_ratios, strict=True)), lit)
    return [by_frame[frame] for frame in range(len(z))]


def posteriors(ratios: Floats, sets: Sequence[AttackSet], sensors: int) -> Floats:
    """(F, H) probabilities of the attack sets from their logarithmic ratios (F, H), of a rig of so many sensors."""
    weights = ratios + np.log([_prior(len(attacked), sensors) for attacked in sets])
    weights = np.exp(weights - weights.max(axis=1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def _prior(size: int, sensors: int) -> float:
    """The stated odds of one attack set: any attack is as likely as none, and a further sensor a share as likely."""
    return LIKELIHOOD.further_sensor ** (size - 1) / comb(sensors, size) if size else 1.0


def _log_likelihood(seen: AttackSetScores, lidars: Collection[int]) -> Floats:
    """(F,) the logarithm of a set's likelihood, but for what all sets of a frame have in common.

    Several sensors explain nothing where one of them has no vote: a smaller set says as much.
    """
    ratio = np.interp(seen.rest, REST_AT, LIKELIHOOD.of_rest) + LIKELIHOOD.of_lacking * seen.lacking
    for sensor, own in seen.own.items():
        ratio = ratio + np.interp(own, OWN_AT, LIKELIHOOD.of_lidar if sensor in lidars else LIKELIHOOD.of_camera)
    if len(seen.own) < 2:
        return np.asarray(ratio)
    voted = np.min([*seen.own.values()], axis=0) > -np.inf
    return np.where(voted, ratio + LIKELIHOOD.of_several * (len(seen.own) - 1), -np.inf)


@cache
def _rest(system: System, gone: frozenset[int]) -> tuple[Indices, float]:
    """The checks among the sensors that are left, and the limit that one of them exceeds in 1 % of clean frames."""
    columns = system.detecting(gone)
    return columns, joint_limit(INCIDENTS.tail_rate, system.judged_without(gone))


@cache
def of_sensor(system: System, gone: frozenset[int], sensor: int) -> Indices:
    """The places of the checks that name a sensor, by the votes of all that are left."""
    checks = system.sensor_checks
    columns = [column for column in system.counting(gone).tolist() if checks[column].nameable == (sensor,)]
    return np.array(columns, dtype=np.intp)


@cache
def telling(system: System, gone: frozenset[int], sensor: int) -> Indices:
    """The places of the checks that tell that it is this sensor: `of_sensor`, of three sensors what singles it out."""
    if system.by_time or len(system.sensors) - len(gone) != FEWEST_COMPARED:
        return of_sensor(system, gone, sensor)
    checks = [(column, system.sensor_checks[column]) for column in system.detecting(gone).tolist()]
    vouched = {one.sensor for _, one in checks if sensor not in one.needed}
    return np.array(
        [
            column
            for column, one in checks
            if one.sensor == sensor and (singles_out(one) or (one.check.kind.adds and vouched.issuperset(one.others)))
        ],
        dtype=np.intp,
    )


def singles_out(check: SensorCheck) -> bool:
    """Whether a check tells by itself which of those that it compares is attacked.

    No light on a camera changes a scan, and two cameras that agree outvote the third. What is brighter in one of two
    cameras is light on it, or dirt on the other where no third camera vouches for that one; and where white light
    takes the colours from one of two, the other one seems lit by them.
    """
    return check.check.kind.of in _OF_OWN_SCANS if check.sensor == LIDAR else len(check.others) >= FEWEST_VOTERS


def _largest(z: Floats, columns: Indices, unmeasured: float = SCORE_LIMITS.lowest) -> Floats:
    """(F,) the largest z of these checks, `unmeasured` where none was measured."""
    return np.asarray(np.fmax.reduce(z[:, columns], axis=1, initial=unmeasured))
