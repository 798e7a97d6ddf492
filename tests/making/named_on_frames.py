"""Whom Algorithm 2 names on attacked frames, by thresholds at r = 0."""

import numpy as np

from auditor.identification.paper import identify
from auditor.lab.attacks.paper import draw_facula, draw_wall
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.experiments import Attack, Attacks
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.frames import Frame
from auditor.model.measurement import Statistic
from auditor.model.rig import LIDAR, Rig, Triple

MATCHER = find_matcher("sgbm")

Errors = dict[Triple, float | None]


def drawn(frame: Frame, sensor: int, strength: str, rng: np.random.Generator) -> Attack:
    """One attack on one sensor of the frame."""
    if sensor == LIDAR:
        return draw_wall(rng)
    height, width = frame.images[sensor].pixels.shape[:2]
    return draw_facula(rng, width, height, strength)


def disparity_errors(frame: AttackedFrame, attacks: Attacks) -> Errors:
    """The gated E of every triple, as measuring the frame under these attacks gives it."""
    counts = frame.counts(attacks)
    return {
        t: c.disparity_error(Statistic.GATED) if c else None for t, c in zip(frame.rig.triples, counts, strict=False)
    }


def named(E: Errors, theta: dict[Triple, float], rig: Rig) -> tuple[int, ...]:
    """Algorithm 2's answer."""
    e = "".join("-" if E[t] is None else "1" if E[t] > theta[t] else "0" for t in rig.triples)
    return identify(e, rig.triples, rig.sensors).attacked


def maxima(clean: list[Errors]) -> dict[Triple, float]:
    """theta at r = 0."""
    return {t: max(E[t] for E in clean if E[t] is not None) for t in clean[0]}
