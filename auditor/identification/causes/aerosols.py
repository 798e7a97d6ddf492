"""Dust, steam and exhaust in the LiDAR's cloud, which make returns scatter: told by the checks that find what does."""

from collections.abc import Sequence

import numpy as np

from auditor.identification.naming import name_attacked
from auditor.identification.systems import System
from auditor.model.arrays import Floats
from auditor.model.checks import Check
from auditor.model.rig import LIDAR
from auditor.model.verdict import FINDINGS, Cause, Evidence, FaultHypothesis, Verdict


def of_aerosol(verdict: Verdict) -> tuple[FaultHypothesis, ...]:
    """An aerosol, where the strongest of what fired is that returns scatter."""
    strongest = _strongest(verdict.evidence)
    return (FaultHypothesis(Cause.AEROSOL, strongest.i),) if strongest and _scatters(verdict.evidence) else ()


def name_beside_aerosols(z: Floats, system: System, missing: Sequence[frozenset[int]], limit: float) -> list[Verdict]:
    """The verdicts of `name_attacked`; where an aerosol explains the LiDAR, what other sensors show is named alone."""
    verdicts = name_attacked(z, system, missing, limit)
    frames = [frame for frame, verdict in enumerate(verdicts) if _beside_aerosol(verdict)]
    quiet = z[frames]
    of_lidar = [check.sensor == LIDAR for check in system.sensor_checks]
    quiet[:, of_lidar] = np.minimum(quiet[:, of_lidar], 0)
    alone = name_attacked(quiet, system, [missing[frame] for frame in frames], limit)
    for frame, verdict in zip(frames, alone, strict=True):
        if verdict.kind in FINDINGS:
            verdicts[frame] = verdict
    return verdicts


def _beside_aerosol(verdict: Verdict) -> bool:
    """Whether an aerosol explains what the LiDAR shows, and another sensor shows something as well."""
    own = [one for one in verdict.evidence if one.i == LIDAR]
    return len(own) < len(verdict.evidence) and _scatters(own)


def _scatters(evidence: Sequence[Evidence]) -> bool:
    strongest = _strongest(evidence)
    return strongest is not None and Check(strongest.check_name).kind.of_aerosol


def _strongest(evidence: Sequence[Evidence]) -> Evidence | None:
    return max(evidence, key=lambda one: one.score, default=None)
