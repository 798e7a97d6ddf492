"""Causes that are not attacks, ranked from stored symptoms.

An attack changes a portion of what a sensor sees. A fault changes all of it in one way: every point of a picture lies
on another row, or where it lay a frame ago; every LiDAR point agrees with stereo once all are moved alike. Each cause
has a strength in units of what is just enough for it; its score is half of that, at most 1; an attack has 0.5.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auditor.elements import Witness
from auditor.results import FINDINGS, Cause, Suspicion, Verdict, VerdictKind
from auditor.rig import LIDAR
from auditor.symptoms import Pair

ENOUGH = 0.5
"""The score from which a cause explains a frame about as well as an attack does."""

FAULTS = frozenset({Cause.FROZEN, Cause.LATE, Cause.DISPLACED})
"""Causes that are findings by themselves; the others only say why a frame may have been raised."""

_LATE = 0.1  # more of a picture's points on their rows
_LATE_LIDAR = 0.04  # more of the LiDAR's points that agree
_TILTED, _LEAST_OFFSET_PX = 0.35, 2.0
_BIASED, _LEAST_BIAS_PX = 0.25, 3.0
_TURNED = 0.04
_DARKER = 12.0  # grey levels
_FEWEST_UNLIKE_PX = 200
_DIM_LEVELS = (60.0, 30.0)  # grey levels: where darkness begins, and where it is enough
_SATURATED_SHARE = 0.25
_LEAST_TOLD = 0.1

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Observed:
    """What was observed in F frames: `columns` holds (F, P) values by the names of `symptoms.COLUMNS`.

    `pairs` are the P matched pairs (i, k). `level` and `saturated` are (F, C), mean grey level and saturated share of
    the `cameras`. NaN where not measured.
    """

    pairs: tuple[Pair, ...]
    columns: Mapping[str, Floats]
    cameras: tuple[int, ...]
    level: Floats
    saturated: Floats


def strengths(seen: Observed, sensors: Sequence[int]) -> dict[tuple[Cause, int | None], Floats]:
    """(F,) strength of each cause, by cause and sensor (None: all cameras); 1 is just enough, NaN not measured."""
    found: dict[tuple[Cause, int | None], Floats] = {}
    offset, bias = np.abs(seen.columns["offset_px"]), np.abs(seen.columns["bias_px"])
    rows = np.fmax(seen.columns["in_step"], seen.columns["offset_share"])
    tilted = np.where(offset >= _LEAST_OFFSET_PX, seen.columns["offset_share"] - seen.columns["in_step"], 0.0)
    biased = np.where(bias >= _LEAST_BIAS_PX, seen.columns["biased"] - seen.columns["agreeing"], 0.0)
    agreeing = np.where(bias >= _LEAST_BIAS_PX, seen.columns["biased"], seen.columns["agreeing"])
    for camera in seen.cameras:
        late = {p: seen.columns["late_i" if pair[0] == camera else "late_k"] - rows for p, pair in _with(seen, camera)}
        found[Cause.LATE, camera] = _least([late[p][:, p] for p in late]) / _LATE
        found[Cause.DISPLACED, camera] = np.fmax(
            _alone(seen, camera, tilted) / _TILTED, _alone(seen, camera, biased) / _BIASED
        )
        darker = [
            np.where(
                seen.columns["unlike_px"][:, p] >= _FEWEST_UNLIKE_PX,
                seen.columns["difference"][:, p] * (1.0 if pair[0] == camera else -1.0),
                np.nan,
            )
            for p, pair in _with(seen, camera)
        ]
        found[Cause.SOILED, camera] = _least(darker) / _DARKER
    if LIDAR in sensors:
        places = range(len(seen.pairs))
        late_gain = seen.columns["late_gain"]
        found[Cause.LATE, LIDAR] = _least([late_gain[:, p] for p in places]) / _LATE_LIDAR
        turned = seen.columns["turned"] - agreeing
        found[Cause.DISPLACED, LIDAR] = _least([turned[:, p] for p in places]) / _TURNED
    begins, enough = _DIM_LEVELS
    found[Cause.DARK, None] = (begins - seen.level.max(axis=1, initial=-np.inf)) / (begins - enough)
    found[Cause.GLARE, None] = seen.saturated.min(axis=1, initial=np.inf) / _SATURATED_SHARE
    return found


def suspicions(strength: Mapping[tuple[Cause, int | None], Floats]) -> list[tuple[Suspicion, ...]]:
    """The causes of each frame worth telling, the likeliest first."""
    keys = list(strength)
    scores = np.clip(np.nan_to_num(np.stack([strength[key] for key in keys], axis=1)) * ENOUGH, 0, 1)
    told: list[tuple[Suspicion, ...]] = [()] * len(scores)
    for frame in np.flatnonzero((scores >= _LEAST_TOLD).any(axis=1)).tolist():
        ranked = sorted(zip(scores[frame].tolist(), range(len(keys)), strict=True), key=lambda one: (-one[0], one[1]))
        told[frame] = tuple(Suspicion(*keys[place], score) for score, place in ranked if score >= _LEAST_TOLD)
    return told


def weigh(verdict: Verdict, causes: Sequence[Suspicion]) -> Verdict:
    """The verdict beside the causes of its frame: `suspect` where one of them explains it about as well as an attack.

    A fault is a finding by itself; dirt, darkness and glare only where something was raised that they explain.
    """
    if verdict.kind not in FINDINGS:
        kept = tuple(one for one in causes if one.cause in FAULTS and one.score >= ENOUGH)
    else:
        kept = tuple(one for one in causes if _explains(one, verdict))
    if not kept:
        return verdict
    likely = kept[0].score >= ENOUGH
    if not likely:
        return replace(verdict, causes=kept)
    return replace(verdict, kind=VerdictKind.SUSPECT, attacked=(), causes=kept)


def _explains(suspicion: Suspicion, verdict: Verdict) -> bool:
    """Whether a cause can have raised what a verdict's evidence says."""
    witnesses = {one.witness for one in verdict.evidence}
    if suspicion.cause is Cause.SOILED:
        return suspicion.sensor in (verdict.attacked or {s for e in verdict.evidence for s in (e.i, e.k)})
    if suspicion.cause is Cause.DARK:
        return Witness.LIGHT.value not in witnesses
    return True


def _with(seen: Observed, camera: int) -> list[tuple[int, Pair]]:
    return [(p, pair) for p, pair in enumerate(seen.pairs) if camera in pair]


def _alone(seen: Observed, camera: int, gain: Floats) -> Floats:
    """The least gain of the camera's pairs, less the largest of the others: those cannot be its doing."""
    inside = _least([gain[:, p] for p, _ in _with(seen, camera)])
    outside = [gain[:, p] for p, pair in enumerate(seen.pairs) if camera not in pair]
    return inside - np.nan_to_num(np.fmax.reduce(outside)) if outside else inside


def _least(values: Sequence[Floats]) -> Floats:
    """(F,) the least of those measured, NaN where none was."""
    return np.asarray(np.fmin.reduce(values)) if values else np.array(np.nan)
