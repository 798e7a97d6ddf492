"""Faults, rain and dirt: their scores from fault features, and which verdicts they make suspect.

An attack changes a portion of what a sensor sees. A fault changes all of it in one way: every point of an image lies
on another row, or where it lay a frame ago; every LiDAR point agrees with stereo once all are moved by one offset.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from math import nan

import numpy as np

from auditor.identification.causes import ENOUGH, CameraScores, by_tone, of_aerosol, of_dirt, of_lens, strongest_of
from auditor.identification.parameters import (
    FAULT_SCALE,
    FAULT_SCORES,
    TEMPORAL_WINDOW,
)
from auditor.identification.statistics import measured_medians, window_maxima, window_means
from auditor.model.arrays import Flags, Floats, Integers
from auditor.model.calibration import ThetaScale
from auditor.model.checks import DIRECTION_CHECKS, FEWEST_VOTERS, LIDAR_CHECKS, Check, Pair
from auditor.model.fault_features import ObservedFeatures, relative_excess
from auditor.model.rig import LIDAR
from auditor.model.verdict import (
    FINDINGS,
    Alternative,
    Cause,
    CauseIn,
    Evidence,
    FaultHypothesis,
    Verdict,
    VerdictKind,
)

_LEAST_LISTED = 0.2  # the score from which on a cause is listed; from ENOUGH on it explains
_LEAST_TEXTURE = 0.01  # the share with texture that is told from none, so that its logarithm is finite

LONGEST_WINDOW_S = TEMPORAL_WINDOW.seconds + TEMPORAL_WINDOW.lasting_s
"""No fault score depends on frames further away than half of this."""

OF_DETAIL = frozenset({Cause.BLURRED, Cause.BLIND})
"""Causes that a camera shows less detail, as light makes it do as well."""

FAULTS = frozenset({Cause.FROZEN, Cause.LATE, Cause.DISPLACED}) | OF_DETAIL
"""Causes that are findings by themselves; the others only explain why a check may have fired."""

_OF_LIGHT = frozenset(one for one in Check if one.kind.of_light)
"""Checks that darkness does not make fire."""


TONES = frozenset({Cause.EXPOSURE, Cause.WHITE_BALANCE})
"""Causes that change the levels of a camera and not what it sees; they are as unusual either way."""


def faults_of(sensors: Collection[int]) -> tuple[CauseIn, ...]:
    """The faults, each with its sensor, that a rig of these sensors has scores of."""
    cameras = [sensor for sensor in sensors if sensor != LIDAR]
    return (
        *((cause, sensor) for sensor in sensors for cause in (Cause.LATE, Cause.DISPLACED)),
        *((Cause.EXPOSURE, camera) for camera in cameras if len(cameras) > FEWEST_VOTERS),
        *((cause, camera) for camera in cameras for cause in (Cause.WHITE_BALANCE, Cause.BLURRED) if len(cameras) > 1),
        *((Cause.BLIND, camera) for camera in cameras),
        *((Cause.RAIN, sensor) for sensor in sensors if sensor == LIDAR),
        (Cause.DARK, None),
    )


def fault_scores(
    seen: ObservedFeatures, stamp_ns: Integers, sensors: Sequence[int], runs: Integers | None = None
) -> dict[CauseIn, Floats]:
    """(F,) score of each fault over the temporal window; 1 is just enough.

    A sensor that has turned stays so: what seems to come and go within seconds are near edges beside the road.
    `stamp_ns` (F,) are the frames' stamps, `runs` (F,) number their runs where they are known. NaN where nothing was
    measured.
    """
    by_cause: dict[CauseIn, Floats] = {}
    for camera in seen.cameras:
        by_cause[Cause.LATE, camera] = _lagging(seen, camera)
        by_cause[Cause.DISPLACED, camera] = _displaced(seen, camera)
    of_cameras: dict[Cause, list[Floats]] = {}
    if len(seen.cameras) > FEWEST_VOTERS:
        of_cameras[Cause.EXPOSURE] = _levels(seen)
    if len(seen.cameras) > 1:
        of_cameras |= {Cause.WHITE_BALANCE: _warmth(seen), Cause.BLURRED: _blurred(seen)}
    of_cameras[Cause.BLIND] = _blind(seen, stamp_ns, runs)
    for cause, of_each in of_cameras.items():
        by_cause |= {(cause, camera): one for camera, one in zip(seen.cameras, of_each, strict=True)}
    if LIDAR in sensors:
        by_cause[Cause.LATE, LIDAR] = _lagging_lidar(seen)
        by_cause[Cause.DISPLACED, LIDAR] = _rotated_lidar(seen)
        by_cause[Cause.RAIN, LIDAR] = _mean(seen.columns["isolated_near"]) / FAULT_SCORES.rain
    by_cause[Cause.DARK, None] = 2 - np.fmax.reduce(seen.brightness["level"].T, initial=np.nan) / FAULT_SCORES.dark
    lasting = np.array([cause is Cause.DISPLACED for cause, _ in by_cause])
    scores = np.stack([*by_cause.values()], axis=1)
    for those, seconds in ((~lasting, TEMPORAL_WINDOW.seconds), (lasting, TEMPORAL_WINDOW.lasting_s)):
        scores[:, those] = window_means(scores[:, those], stamp_ns, seconds, runs)
    of_window = dict(zip(by_cause, np.ascontiguousarray(scores.T), strict=True))
    # Light hides detail: the frames beside an attack are not blurred by it.
    return {key: np.fmin(by_cause[key], one) if key[0] in OF_DETAIL else one for key, one in of_window.items()}


def fault_hypotheses(
    scores: Mapping[CauseIn, Floats], scales: Mapping[CauseIn, ThetaScale]
) -> list[tuple[FaultHypothesis, ...]]:
    """The fault hypotheses of each frame, the likeliest first, from (F,) fault scores.

    A fault score becomes z as a check's statistic does; a hypothesis has 0.5 at z = 0 and 1 at the highest z. Those
    below 0.2, and faults without a scale, are left out.
    """
    keys = list(scores)
    scale_of = [scales.get(key) for key in keys]
    theta = np.array([np.nan if one is None else one.theta for one in scale_of], dtype=np.float64)
    scale = np.array([np.nan if one is None else one.scale for one in scale_of], dtype=np.float64)
    unusual = np.stack([_unusual(key[0], scores[key], one) for key, one in zip(keys, scale_of, strict=True)], axis=1)
    z = np.nan_to_num((unusual - theta) / scale, nan=-FAULT_SCALE.highest)
    share = ENOUGH * (1 + np.minimum(z, FAULT_SCALE.highest) / FAULT_SCALE.highest)
    least = _LEAST_LISTED
    hypotheses: list[tuple[FaultHypothesis, ...]] = [()] * len(share)
    for frame in np.flatnonzero((share >= least).any(axis=1)).tolist():
        places: list[int] = np.argsort(-z[frame], kind="stable").tolist()
        scored = ((keys[place], float(share[frame, place])) for place in places)
        hypotheses[frame] = tuple(FaultHypothesis(*cause, score) for cause, score in scored if score >= least)
    return hypotheses


def weigh(
    verdict: Verdict,
    causes: Sequence[FaultHypothesis],
    limit: float,
    seen: Mapping[int, CameraScores] | None = None,
    agreeing: float = nan,
) -> Verdict:
    """The verdict with the fault hypotheses of its frame: `suspect` where one explains it about as well as an attack.

    A fault is a finding by itself; darkness, rain and exposure are listed where no check fired, and are no
    finding. The fault of a sensor that was left out cannot explain a verdict. Where a check exceeds the `limit` by
    more than a fault its threshold, the fault does not explain it: an attack changes a portion of the view, and more
    strongly. The attack of a `suspect` verdict is the first of its alternatives. `seen` is what `seen_of` gives,
    `agreeing` the share of the LiDAR's points that agree with cameras.
    """
    fired = verdict.kind in FINDINGS
    hypotheses = (*causes, *of_lens(seen or {}), *of_aerosol(verdict, agreeing), *of_dirt(verdict))
    ranked = sorted(hypotheses, key=lambda one: (not is_finding(one), -one.score))
    kept = tuple(one for one in ranked if (_explains(one, verdict) if fired else _by_itself(one)))
    enough = _explaining(kept, verdict, limit, seen or {}) if fired else map(is_finding, kept)
    if not any(enough):
        return replace(verdict, causes=kept) if kept else verdict
    likeliest = (Alternative(verdict.attacked, 0.0),) if verdict.attacked else ()
    alternatives = (*likeliest, *verdict.alternatives)
    return replace(verdict, kind=VerdictKind.SUSPECT, attacked=(), alternatives=alternatives, causes=kept)


def is_finding(hypothesis: FaultHypothesis) -> bool:
    """Whether a fault is a finding where no check fired."""
    return hypothesis.cause in FAULTS and hypothesis.score >= ENOUGH


def z_of(hypothesis: FaultHypothesis) -> float:
    """The z that a hypothesis' score comes from."""
    return (hypothesis.score / ENOUGH - 1) * FAULT_SCALE.highest


def _explaining(
    causes: Sequence[FaultHypothesis], verdict: Verdict, limit: float, seen: Mapping[int, CameraScores]
) -> Iterator[bool]:
    lead = max((one.score - limit for one in verdict.evidence), default=0.0)
    for cause in causes:
        if cause.score < ENOUGH or cause.sensor in verdict.out_of_system or cause.cause is Cause.RAIN:
            yield False
        elif cause.cause in TONES:
            own = seen.get(cause.sensor) if cause.sensor is not None else None
            yield own is not None and by_tone(own)
        elif _of_a_lens(cause):  # it has been weighed against light already
            yield True
        else:
            # Cameras that see next to nothing contradict the LiDAR by noise, however much.
            unlit = cause.cause is Cause.DARK and _by_cameras(strongest_of(verdict.evidence))
            yield unlit or z_of(cause) >= min(lead, FAULT_SCALE.highest)


def _lagging(seen: ObservedFeatures, camera: int) -> Floats:
    """A camera lags where in all its pairs more points are row-aligned with the image of the frame before."""
    columns = seen.columns
    now = np.fmax(columns["row_aligned"], columns["offset_share"])
    gains = [
        (columns["lagged_i" if camera == i else "lagged_k"] - now)[:, p] for p, (i, _) in _pairs_with(seen, camera)
    ]
    return _least(gains, seen) / FAULT_SCORES.lagging_camera


def _displaced(seen: ObservedFeatures, camera: int) -> Floats:
    """A camera is rotated where all its pairs, and no others, are off by one constant: in rows, or in disparities."""
    columns = seen.columns
    offset, bias = np.abs(columns["offset_px"]), np.abs(columns["bias_px"])
    # What was not measured stays NaN: cameras side by side cannot check the LiDAR, and are no evidence against a bias.
    tilted = np.where(offset < FAULT_SCORES.tilted_by_px, 0.0, columns["offset_share"] - columns["row_aligned"])
    biased = np.where(bias < FAULT_SCORES.biased_by_px, 0.0, columns["biased"] - columns["agreeing"])
    tilted, biased = (_beyond_others(seen, camera, gain) for gain in (tilted, biased))
    return np.fmax(tilted / FAULT_SCORES.tilted, biased / FAULT_SCORES.biased)


def _lagging_lidar(seen: ObservedFeatures) -> Floats:
    """The LiDAR lags where of the points that agree with one of two frames only most agree with the one before."""
    excess = relative_excess(seen.columns["before_only"], seen.columns["now_only"])
    return _mean(excess) / FAULT_SCORES.lagging_lidar


def _rotated_lidar(seen: ObservedFeatures) -> Floats:
    """The LiDAR is rotated where most points agree with stereo of every pair only once all are moved by one offset.

    Where a constant bias of a pair's disparities does as well, its cameras are rotated instead.
    """
    columns = seen.columns
    moved = relative_excess(columns["rotated_only"], columns["unrotated_only"])
    cameras = (np.abs(columns["bias_px"]) >= FAULT_SCORES.biased_by_px) & (columns["biased"] >= columns["rotated"])
    return _least(list(np.where(cameras, np.minimum(moved, 0), moved).T), seen) / FAULT_SCORES.rotated_lidar


def _levels(seen: ObservedFeatures) -> list[Floats]:
    """By camera, how much brighter than the median of the others it is, as a logarithm: darker cameras are below 0."""
    levels = np.log(np.maximum(seen.brightness["level"], 1.0))
    others = (np.delete(levels, place, axis=1) for place in range(len(seen.cameras)))
    return [(levels[:, place] - _medians(one)) / FAULT_SCORES.exposure for place, one in enumerate(others)]


def _warmth(seen: ObservedFeatures) -> list[Floats]:
    """By camera, how much redder than bluer it is than the other colour cameras, as a logarithm; NaN of grey ones.

    A scene's colours change all cameras alike, and of two cameras it is not known which of them has changed. So half of
    what one other camera has is subtracted, and the whole median of more; the one that has changed stands out by more.
    """
    red, blue = (np.maximum(seen.brightness[name], 1.0) for name in ("red_level", "blue_level"))
    warmth = np.log(red / blue)
    scores = []
    for place in range(len(seen.cameras)):
        others = np.delete(warmth, place, axis=1)
        alone = np.nan_to_num(np.fmax.reduce(others, axis=1)) * FAULT_SCORES.warmth_of_one_other
        scores.append((warmth[:, place] - np.where(_enough(others), _medians(others), alone)) / FAULT_SCORES.warmth)
    return scores


def _blurred(seen: ObservedFeatures) -> list[Floats]:
    """By camera, how much less of its image has texture than of any other's, as a logarithm.

    What is darker has less texture. So by how much it is darker than the darkest other one is taken off.
    """
    shares = np.log(np.maximum(1 - seen.brightness["textureless_share"], _LEAST_TEXTURE))
    levels = np.log(np.maximum(seen.brightness["level"], 1.0))
    scores = []
    for place in range(len(seen.cameras)):
        less, darker = (np.fmin.reduce(np.delete(one, place, axis=1).T) - one[:, place] for one in (shares, levels))
        scores.append((less - np.maximum(darker, 0)) / FAULT_SCORES.blurred)
    return scores


def _blind(seen: ObservedFeatures, stamp_ns: Integers, runs: Integers | None) -> list[Floats]:
    """By camera, how much less of its image has texture than of the best other camera's, as a logarithm.

    That of a lone camera is compared with its best seconds before or after: what it never showed is not missed, since
    nobody says whether it is night.
    """
    shares = np.log(np.maximum(1 - seen.brightness["textureless_share"], _LEAST_TEXTURE))
    if len(seen.cameras) == 1:
        best = [window_maxima(shares[:, 0], stamp_ns, TEMPORAL_WINDOW.lasting_s, runs)]
    else:
        best = [np.fmax.reduce(np.delete(shares, place, axis=1).T) for place in range(len(seen.cameras))]
    return [np.asarray((other - own) / FAULT_SCORES.blind) for other, own in zip(best, shares.T, strict=True)]


def _enough(values: Floats) -> Flags:
    """(F,) whether two or more were measured in each row."""
    return np.asarray(np.count_nonzero(~np.isnan(values), axis=1) >= FEWEST_VOTERS)


def _medians(values: Floats) -> Floats:
    """(F,) the median of what was measured in each row, of two at least; else NaN."""
    enough = _enough(values)
    medians = np.full(len(values), np.nan)
    medians[enough] = measured_medians(values[enough])[0]
    return medians


def _unusual(cause: Cause, scores: Floats, scale: ThetaScale | None) -> Floats:
    """The scores, or how far they are from what is usual; far brighter than usual a camera is dazzled, not exposed."""
    if scale is None or scale.usual is None:
        return scores
    beyond = scores - scale.usual
    dazzled = (beyond > FAULT_SCORES.dazzled) & (cause is Cause.EXPOSURE)
    return np.where(dazzled, np.nan, np.abs(beyond))


def _pairs_with(seen: ObservedFeatures, camera: int) -> list[tuple[int, Pair]]:
    return [(p, pair) for p, pair in enumerate(seen.pairs) if camera in pair]


def _beyond_others(seen: ObservedFeatures, camera: int, gain: Floats) -> Floats:
    """The least gain of the camera's pairs, less the largest of the other pairs: the camera cannot cause that one."""
    inside = _least([gain[:, p] for p, _ in _pairs_with(seen, camera)], seen)
    outside = [gain[:, p] for p, pair in enumerate(seen.pairs) if camera not in pair]
    return inside - np.maximum(np.nan_to_num(np.fmax.reduce(outside)), 0) if outside else inside


def _mean(values: Floats) -> Floats:
    """(F,) the means of what was measured in each row of (F, P), NaN where nothing was."""
    measured = ~np.isnan(values)
    count = measured.sum(axis=1)
    return np.asarray(np.where(count > 0, np.where(measured, values, 0).sum(axis=1) / np.maximum(count, 1), np.nan))


def _least(values: Sequence[Floats], seen: ObservedFeatures) -> Floats:
    """(F,) the least of those measured, NaN where none was."""
    return np.asarray(np.fmin.reduce(values)) if len(values) else np.full(len(seen.brightness["level"]), np.nan)


def _of_a_lens(hypothesis: FaultHypothesis) -> bool:
    """Whether it is dirt, drops or glare of one camera's lens."""
    return hypothesis.cause in (Cause.SOILED, Cause.GLARE)


def _by_itself(hypothesis: FaultHypothesis) -> bool:
    """Whether a hypothesis is listed where no check fired: dirt would have made one fire."""
    return hypothesis.score >= ENOUGH and hypothesis.cause is not Cause.SOILED


def _explains(hypothesis: FaultHypothesis, verdict: Verdict) -> bool:
    """Whether a fault can have made the checks of a verdict's evidence fire."""
    checks = {one.check_name for one in verdict.evidence}
    if hypothesis.cause is Cause.DARK:
        return checks.isdisjoint(_OF_LIGHT)
    if hypothesis.cause is Cause.RAIN and not checks.isdisjoint(LIDAR_CHECKS):
        return False
    if hypothesis.sensor is None or hypothesis.sensor in verdict.out_of_system:
        return True
    return _covers_strongest(hypothesis, verdict)


def _covers_strongest(hypothesis: FaultHypothesis, verdict: Verdict) -> bool:
    """Whether a fault of a sensor can have made the strongest check of a verdict fire.

    A camera that lags or has turned disagrees with the LiDAR too.
    """
    disagrees = hypothesis.cause in FAULTS and hypothesis.sensor != LIDAR
    strongest = strongest_of(verdict.evidence)
    of_it = strongest is not None and hypothesis.sensor in (strongest.i, strongest.k)
    return of_it or (disagrees and _by_cameras(strongest))


def _by_cameras(evidence: Evidence | None) -> bool:
    """Whether it is what cameras say of the LiDAR."""
    return evidence is not None and (
        evidence.check_name in DIRECTION_CHECKS or evidence.check_name == Check.FALSE_RANGES
    )
