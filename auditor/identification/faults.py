"""Causes that are not attacks, ranked from stored fault features, and what they make of a verdict.

An attack changes a portion of what a sensor sees. A fault changes all of it in one way: every point of a picture lies
on another row, or where it lay a frame ago; every LiDAR point agrees with stereo once all are moved alike.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from auditor.identification.parameters import FAULT_HYPOTHESES, FAULT_SCORES, FROZEN, TEMPORAL_WINDOW
from auditor.identification.scores import scores
from auditor.identification.statistics import window_means
from auditor.model.calibration import HIGHEST_SCORE, Scale
from auditor.model.checks import LIDAR_CHECKS, Check, Pair, PairCheck, lead
from auditor.model.measurement import NO_FINGERPRINT
from auditor.model.rig import LIDAR
from auditor.model.verdict import FINDINGS, Alternative, Cause, CauseIn, Evidence, FaultHypothesis, Verdict, VerdictKind

LONGEST_WINDOW_S = TEMPORAL_WINDOW.soiled_seconds


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


def strengths(
    seen: Observed, stamp_ns: NDArray[np.int64], sensors: Sequence[int], runs: NDArray[np.int64] | None = None
) -> dict[CauseIn, Floats]:
    """(F,) strength of each cause over the half second around each frame (dirt: two); 1 is just enough.

    `stamp_ns` (F,) are the frames' stamps, `runs` (F,) number their runs where they are known. NaN where nothing was
    measured.
    """
    found: dict[CauseIn, Floats] = {}
    for camera in seen.cameras:
        found[Cause.LATE, camera] = _late(seen, camera)
        found[Cause.DISPLACED, camera] = _displaced(seen, camera)
        found[Cause.SOILED, camera] = _darker(seen, camera) / FAULT_SCORES.soiled
    if LIDAR in sensors:
        found[Cause.LATE, LIDAR] = _late_lidar(seen)
        found[Cause.DISPLACED, LIDAR] = _turned(seen)
        found[Cause.RAIN, LIDAR] = _rain(seen)
    begins, enough = FAULT_SCORES.dark_from, FAULT_SCORES.dark
    found[Cause.DARK, None] = (begins - np.fmax.reduce(seen.level.T)) / (begins - enough)
    found[Cause.GLARE, None] = np.fmin.reduce(seen.saturated.T) / FAULT_SCORES.glare
    usual = TEMPORAL_WINDOW.seconds
    seconds = {who: LONGEST_WINDOW_S if who[0] is Cause.SOILED else usual for who in found}
    return {who: window_means(values[:, None], stamp_ns, seconds[who], runs)[:, 0] for who, values in found.items()}


def _late(seen: Observed, camera: int) -> Floats:
    """A camera lags where all its pairs find more points on one row once it is taken for a frame earlier."""
    columns = seen.columns
    now = np.fmax(columns["row_aligned"], columns["offset_share"])
    gains = [(columns["lagged_i" if camera == i else "lagged_k"] - now)[:, p] for p, (i, _) in _with(seen, camera)]
    return _least(gains, seen) / FAULT_SCORES.late_camera


def _displaced(seen: Observed, camera: int) -> Floats:
    """A camera has turned where all its pairs, and no others, are off by one constant: in rows, or in disparities."""
    columns = seen.columns
    offset, bias = np.abs(columns["offset_px"]), np.abs(columns["bias_px"])
    tilted = np.where(offset >= FAULT_SCORES.tilted_by_px, columns["offset_share"] - columns["row_aligned"], 0.0)
    biased = np.where(bias >= FAULT_SCORES.biased_by_px, columns["biased"] - columns["agreeing"], 0.0)
    tilted, biased = (_alone(seen, camera, gain) for gain in (tilted, biased))
    return np.fmax(tilted / FAULT_SCORES.tilted, biased / FAULT_SCORES.biased)


def _late_lidar(seen: Observed) -> Floats:
    """The LiDAR lags where most points that tell two frames apart agree with stereo of the one before."""
    return _mean(lead(seen.columns["before_only"], seen.columns["now_only"])) / FAULT_SCORES.late_lidar


def _turned(seen: Observed) -> Floats:
    """The LiDAR has turned where most points that tell agree with stereo of every pair once all are moved alike.

    Where a constant bias of a pair's disparities does as well its cameras have turned instead.
    """
    columns = seen.columns
    moved = lead(columns["rotated_only"], columns["unrotated_only"])
    cameras = (np.abs(columns["bias_px"]) >= FAULT_SCORES.biased_by_px) & (columns["biased"] >= columns["rotated"])
    return _least(list(np.where(cameras, np.minimum(moved, 0), moved).T), seen) / FAULT_SCORES.turned_lidar


def _rain(seen: Observed) -> Floats:
    """Drops stand alone near the LiDAR; spoofed points at chance ranges do so farther away nearly as often."""
    beyond = FAULT_SCORES.rain_beyond * seen.columns["isolated_beyond"]
    return _mean(seen.columns["isolated_near"] - beyond) / FAULT_SCORES.rain


def _with(seen: Observed, camera: int) -> list[tuple[int, Pair]]:
    return [(p, pair) for p, pair in enumerate(seen.pairs) if camera in pair]


def _alone(seen: Observed, camera: int, gain: Floats) -> Floats:
    """The least gain of the camera's pairs, less the largest of the others: those cannot be its doing."""
    inside = _least([gain[:, p] for p, _ in _with(seen, camera)], seen)
    outside = [gain[:, p] for p, pair in enumerate(seen.pairs) if camera not in pair]
    return inside - np.maximum(np.nan_to_num(np.fmax.reduce(outside)), 0) if outside else inside


def _darker(seen: Observed, camera: int) -> Floats:
    """(F,) by how many grey levels a camera is at least darker than its partners where they are unlike.

    A partner that is as much brighter than others is itself what has changed.
    """
    unlike, difference = seen.columns["inconsistent_px"], seen.columns["difference"]
    found = []
    for p, (i, k) in _with(seen, camera):
        partner = i if camera == k else k
        darker = difference[:, p] * (1.0 if camera == i else -1.0)
        enough = FAULT_SCORES.soiled_partner * unlike[:, p]
        others = [
            np.where(unlike[:, q] > enough, difference[:, q] * (1.0 if partner == pair[1] else -1.0), 0.0)
            for q, pair in _with(seen, partner)
            if q != p
        ]
        usual = np.fmax(np.fmax.reduce(others), 0.0) if others else 0.0
        found.append(np.where(unlike[:, p] >= FAULT_SCORES.soiled_fewest, darker - usual, 0 * unlike[:, p]))
    return _least(found, seen)


def _mean(values: Floats) -> Floats:
    """(F,) the means of what was measured in each row of (F, P), NaN where nothing was."""
    measured = ~np.isnan(values)
    count = measured.sum(axis=1)
    return np.asarray(np.where(count > 0, np.where(measured, values, 0).sum(axis=1) / np.maximum(count, 1), np.nan))


def _least(values: Sequence[Floats], seen: Observed) -> Floats:
    """(F,) the least of those measured, NaN where none was."""
    return np.asarray(np.fmin.reduce(values)) if len(values) else np.full(len(seen.level), np.nan)


MIN_FRAMES = FROZEN.least_repeats
"""Frames that must be equal to the one before them: a single repeat happens when frames tick faster than a sensor."""


Bools = NDArray[np.bool_]


def frozen(prints: NDArray[np.int64], present: Bools) -> Bools:
    """(F, S) whether a sensor stands still in a frame, from the fingerprints (F, S) of F successive frames.

    Its data equal those of the frame before, two times running at least, while another sensor's changed at each of
    these steps. Where all stand still the recording does, and no sensor is frozen. One that is not `present` (F, S)
    is not frozen, nor one without a fingerprint.
    """
    known = present & (prints != NO_FINGERPRINT)
    both = known[1:] & known[:-1]
    changed = both & (prints[1:] != prints[:-1])
    still = np.zeros(present.shape, dtype=np.bool_)
    still[1:] = both & ~changed & changed.any(axis=1, keepdims=True)
    return np.asarray(_runs_of(still, MIN_FRAMES))


def _runs_of(still: Bools, length: int) -> Bools:
    """The entries that belong to a run of at least `length` down a column."""
    starts = np.ones((max(len(still) - length + 1, 0), still.shape[1]), dtype=np.bool_)
    for step in range(length):
        starts &= still[step : step + len(starts)]
    result = np.zeros_like(still)
    for step in range(length):
        result[step : step + len(starts)] |= starts
    return result


ENOUGH = FAULT_HYPOTHESES.enough
"""The score of a margin of zero: from here on a cause is seen more strongly than clean frames show it."""


FAULTS = frozenset({Cause.FROZEN, Cause.LATE, Cause.DISPLACED})
"""Causes that are findings by themselves; the others only say why a frame may have been raised."""


_CLEARLY = FAULT_HYPOTHESES.clear_lead
"""An attack whose strongest margin leads that of a cause by more than this is not doubted for it."""


_MOSTLY = FAULT_HYPOTHESES.most_of_it
"""Share of the raised margins that a sensor with a fault must be able to raise, to explain them."""


_LEAST_TOLD = FAULT_HYPOTHESES.least_told


_RAIN_RAISES = FAULT_HYPOTHESES.rain_highest
"""The largest margin that rain counts with, however hard it rains: drops lie apart, and raise next to nothing."""


def fault_hypotheses(
    strength: Mapping[CauseIn, Floats], scales: Mapping[CauseIn, Scale]
) -> list[tuple[FaultHypothesis, ...]]:
    """The causes of each frame worth telling, the likeliest first, from their (F,) strengths.

    Their margins are those of the witnesses, above the threshold of clean frames; a score is 0.5 at a margin of zero
    and 1 at the highest. A cause without a yardstick is not told.
    """
    keys = list(strength)
    z = scores(np.stack([strength[key] for key in keys], axis=1), [scales.get(key) for key in keys])
    share = np.nan_to_num(ENOUGH * (1 + z / HIGHEST_SCORE))
    hypotheses: list[tuple[FaultHypothesis, ...]] = [()] * len(share)
    for frame in np.flatnonzero((share >= _LEAST_TOLD).any(axis=1)).tolist():
        ranked = sorted(zip(share[frame].tolist(), range(len(keys)), strict=True), key=lambda one: (-one[0], one[1]))
        hypotheses[frame] = tuple(
            FaultHypothesis(*keys[place], score) for score, place in ranked if score >= _LEAST_TOLD
        )
    return hypotheses


def weigh(verdict: Verdict, causes: Sequence[FaultHypothesis], in_several_pairs: Collection[int] = ()) -> Verdict:
    """The verdict beside the causes of its frame: `suspect` where one of them explains it about as well as an attack.

    A fault is a finding by itself; darkness, glare and rain are told where nothing was raised, and are none. A sensor
    that the verdict was reached without cannot have raised anything. What stands out much further in one place than a
    cause does over the whole picture is that place's own: an attack. Of a `suspect` verdict it stays the first of the
    alternatives. `in_several_pairs` are the cameras matched with more than one other.
    """
    fired = verdict.kind in FINDINGS
    least = max((one.score for one in verdict.evidence), default=0.0) - _CLEARLY if fired else 0.0
    kept = tuple(one for one in causes if (_explains(one, verdict, in_several_pairs) if fired else _by_itself(one)))
    enough = any(
        one.score >= ENOUGH
        and _margin(one) >= least
        and (one.sensor not in verdict.out_of_system if fired else one.cause in FAULTS)
        for one in kept
    )
    if not enough:
        return replace(verdict, causes=kept) if kept else verdict
    likeliest = (Alternative(verdict.attacked, 0.0),) if verdict.attacked else ()
    alternatives = (*likeliest, *verdict.alternatives)
    return replace(verdict, kind=VerdictKind.SUSPECT, attacked=(), alternatives=alternatives, causes=kept)


def _margin(hypothesis: FaultHypothesis) -> float:
    """The margin that a cause's score was made of; rain's is not larger than what it can raise."""
    margin = (hypothesis.score / ENOUGH - 1) * HIGHEST_SCORE
    return min(margin, _RAIN_RAISES) if hypothesis.cause is Cause.RAIN else margin


def _by_itself(hypothesis: FaultHypothesis) -> bool:
    """Whether a cause is worth telling where nothing was raised: dirt would have raised something."""
    return hypothesis.score >= ENOUGH and hypothesis.cause is not Cause.SOILED


def _explains(hypothesis: FaultHypothesis, verdict: Verdict, in_several_pairs: Collection[int]) -> bool:
    """Whether a cause can have raised what a verdict's evidence says."""
    checks = {one.check_name for one in verdict.evidence}
    if hypothesis.cause is Cause.SOILED and hypothesis.sensor not in verdict.attacked:
        # To one pair dirt on a camera looks like light in the other: several must see it, clearer than what was raised.
        strongest = max(one.score for one in verdict.evidence)
        seen = hypothesis.sensor in in_several_pairs and _margin(hypothesis) >= strongest
        return seen and _raises_most(hypothesis.sensor, verdict)
    if hypothesis.cause is Cause.DARK:
        return Check.BRIGHTNESS_DIFFERENCE.value not in checks
    if hypothesis.cause is Cause.RAIN and not checks.isdisjoint(LIDAR_CHECKS):
        return False
    if hypothesis.sensor is None or hypothesis.sensor in verdict.out_of_system:
        return True
    return _raises_most(hypothesis.sensor, verdict)


def _raises_most(sensor: int | None, verdict: Verdict) -> bool:
    """Whether a fault of a sensor can have raised at least half of the margins."""
    fired = [(one.score, sensor in _nameable(one)) for one in verdict.evidence]
    return sum(margin for margin, own in fired if own) >= _MOSTLY * sum(margin for margin, _ in fired)


def _nameable(evidence: Evidence) -> tuple[int, ...]:
    """The sensors one of which must be at fault where it is raised."""
    return PairCheck(Check(evidence.check_name), evidence.i, evidence.k).nameable
