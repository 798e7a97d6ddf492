"""What sensor checks say of causes that are no attacks: dirt, exposures, white balance, and aerosols.

Dirt, exposures and white balance do not change a camera's light checks as light does. Dust, steam and exhaust in the
LiDAR's cloud make returns scatter: they are told by the checks that find what does.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from math import exp, isnan, nan
from typing import NamedTuple

import numpy as np

from auditor.identification.evidence_parameters import CHANGED_AT, DARKER_AT, SATURATED_AT, THROWN_LIGHT
from auditor.identification.parameters import FAULT_SCORES, HIERARCHY, LIGHT_OF_CAUSES
from auditor.identification.statistics import window_bounds
from auditor.identification.systems import System
from auditor.model.arrays import Floats, Indices, Integers
from auditor.model.checks import CAMERA_CHECKS, FEWEST_VOTERS, Check
from auditor.model.rig import LIDAR
from auditor.model.stamps import NANOSECONDS
from auditor.model.verdict import Cause, Evidence, FaultHypothesis, Verdict


def of_aerosol(verdict: Verdict, agreeing: float = nan) -> tuple[FaultHypothesis, ...]:
    """An aerosol, where the strongest of what fired is that returns scatter, as `scatters` says."""
    strongest = strongest_of(verdict.evidence)
    return (FaultHypothesis(Cause.AEROSOL, strongest.i),) if strongest and scatters(verdict.evidence, agreeing) else ()


def of_dirt(verdict: Verdict) -> tuple[FaultHypothesis, ...]:
    """Dirt on a lone camera, where the strongest of what fired is that something stays: light may as well be thrown."""
    strongest = strongest_of(verdict.evidence)
    if strongest is None or strongest.check_name != Check.STILL_TEXTURE:
        return ()
    return (FaultHypothesis(Cause.SOILED, strongest.i),)


def scatters(evidence: Sequence[Evidence], agreeing: float = nan) -> bool:
    """Whether the strongest of what fired is that returns scatter, in a cloud of which a share is `agreeing`.

    Most beams pass an aerosol. A cloud that agrees with cameras nearly nowhere is of another place or time, and what
    cameras contradict of it scatters as well. NaN where no cameras say how much agrees.
    """
    strongest = strongest_of(evidence)
    return (
        strongest is not None
        and Check(strongest.check_name).kind.of_aerosol
        and not agreeing < FAULT_SCORES.least_in_aerosol
    )


def strongest_of(evidence: Sequence[Evidence]) -> Evidence | None:
    """The evidence with the largest score, None where nothing fired."""
    return max(evidence, key=lambda one: one.score, default=None)


ENOUGH = 0.5
"""The score from which on a fault is as likely as an attack."""


class Nearby(NamedTuple):
    """The frames around one that is judged, itself among them: scores z (N, M), over `span_s` seconds."""

    z: Floats
    span_s: float

    def lasting(self, column: int, z: float) -> tuple[float, float]:
        """What a check shows nearby, whose score in the frame is `z`: for how many seconds as much, in which share not.

        Half of its z is as much: it comes and goes by what the light falls on. NaN where no other frame was measured.
        """
        scores = self.z[~np.isnan(self.z[:, column]), column]
        if len(scores) < 2:
            return nan, nan
        shown = (np.count_nonzero(scores >= LIGHT_OF_CAUSES.as_much * z) - 1) / (len(scores) - 1)
        return shown * min(self.span_s, LIGHT_OF_CAUSES.nearby_s), 1 - shown


def bounds_nearby(stamps_ns: Integers, runs: Integers) -> tuple[Indices, Indices]:
    """(F,) the first of the frames that are nearby each of F frames, and the one after the last.

    They are those of its run within half of `nearby_s`; on a side where none is, the next one within `further_s`, even
    beyond a gap: a lens is not cleaned in a gap. A clock that was set back tells nothing.
    """
    first, end = window_bounds(stamps_ns, LIGHT_OF_CAUSES.nearby_s, runs)
    step = np.diff(stamps_ns)
    close = (step > 0) & (step <= LIGHT_OF_CAUSES.further_s * NANOSECONDS)
    places = np.arange(len(stamps_ns))
    first = first - ((first == places) & np.concatenate([[False], close]))
    end = end + ((end == places + 1) & np.concatenate([close, [False]]))
    return first, end


class CameraScores(NamedTuple):
    """The scores z of a named camera's checks, by all cameras that are not named; NaN where not measured.

    `darker` is how many times as large as added light removed light is, of the statistics themselves. `saturated_px`
    is that of Coverage, NaN where it is not known. `coloured` is the z of light of one colour, NaN
    where no other colour camera voted; `striped` that of light in rows, and `unpredicted` that of unmatched or veiling
    light or of added texture, which no tone curve predicts, NaN where they were not measured. `shown_s` are the seconds
    nearby in which its strongest check shows as much, `gone` the share of the frames nearby in which it does not; NaN
    where no other frame is known. `texture` is the z of added texture alone.
    """

    added: float
    removed: float
    inconsistent: float
    darker: float
    saturated_px: float = nan
    coloured: float = nan
    striped: float = nan
    unpredicted: float = nan
    shown_s: float = nan
    gone: float = nan
    texture: float = nan

    @property
    def thrown(self) -> bool:
        """Whether light of one colour or in rows was added, or much texture: no dirt or exposure does."""
        lit = self.coloured >= LIGHT_OF_CAUSES.least_thrown or self.striped >= LIGHT_OF_CAUSES.least_thrown
        return lit or self.texture >= LIGHT_OF_CAUSES.least_texture

    @property
    def unchanged(self) -> bool:
        """Whether the camera still sees what the others see."""
        return self.inconsistent < LIGHT_OF_CAUSES.unchanged

    @property
    def chance_of_lens(self) -> float:
        """How likely dirt, drops or glare on the lens are, against light thrown in; even odds before it is seen.

        What is not known says nothing. A lens's fault stays for minutes, thrown light seldom so long, and what is
        there for one frame is on no lens.
        """
        of = THROWN_LIGHT
        curves = (
            (self.removed, CHANGED_AT, of.of_removed),
            (self.inconsistent, CHANGED_AT, of.of_inconsistent),
            (float(np.log(self.darker)), DARKER_AT, of.of_darker),
        )
        ratio = of.start + sum(float(np.interp(x, at, values)) for x, at, values in curves if not isnan(x))
        ratio += 0.0 if isnan(self.saturated_px) else _of_saturated(self.saturated_px)
        if not isnan(self.shown_s):
            ratio += self._of_time
        return 1 / (1 + exp(ratio))

    @property
    def _of_time(self) -> float:
        return LIGHT_OF_CAUSES.for_gone * self.gone - LIGHT_OF_CAUSES.shown_a_second * self.shown_s


def _of_saturated(px: float) -> float:
    """What so many saturated pixels add to the logarithm of the ratio, light thrown into a camera against its lens."""
    return float(np.interp(np.log1p(px), SATURATED_AT, THROWN_LIGHT.of_saturated))


def seen_of(
    verdict: Verdict,
    z: Floats,
    statistics: Floats,
    system: System,
    brightness: Mapping[tuple[str, int], float],
    nearby: Nearby | None = None,
) -> dict[int, CameraScores]:
    """What the cameras of a finding's evidence show, from the scores and statistics (M,) of its frame.

    Those are left out that lack a light which several others have, so saturated as a lens seldom is: dirt makes none
    brighter. `brightness` is what is known of BRIGHTNESS by name and camera; `nearby` are the frames around it, where
    they are known.
    """
    saturated_px = {camera: px for (name, camera), px in brightness.items() if name == "saturated_px"}
    lit = {camera for camera, px in saturated_px.items() if _of_saturated(px) > 0}
    lacking = Counter(one.k for one in verdict.evidence if Check(one.check_name).kind.by_all_but_one and one.i in lit)
    named = {one.i for one in verdict.evidence if one.k is None and one.i != LIDAR and lacking[one.i] < FEWEST_VOTERS}
    scores_of = {}
    for sensor in sorted(named):
        columns = system.counting(frozenset(verdict.out_of_system) | (named - {sensor}))
        own = {
            sensor_check.check: column
            for column in columns.tolist()
            if (sensor_check := system.sensor_checks[column]).sensor == sensor
        }
        added, removed, inconsistent = (own.get(check) for check in CAMERA_CHECKS)
        coloured, striped, unmatched, veiling, texture = (
            nan if (column := own.get(check)) is None else float(z[column])
            for check in (
                Check.COLOURED_LIGHT,
                Check.STRIPED_LIGHT,
                Check.UNMATCHED_LIGHT,
                Check.VEILING_LIGHT,
                Check.ADDED_TEXTURE,
            )
        )
        if added is not None and removed is not None and inconsistent is not None:
            darker = (statistics[removed] + HIERARCHY.offset) / (statistics[added] + HIERARCHY.offset)
            saturated = saturated_px.get(sensor, nan)
            own_z = z[added], z[removed], z[inconsistent]
            strongest = max(own.values(), key=lambda column: -np.inf if np.isnan(z[column]) else z[column])
            lasting = (nan, nan) if nearby is None else nearby.lasting(strongest, float(z[strongest]))
            most = float(np.fmax.reduce([unmatched, veiling, texture]))
            scores_of[sensor] = CameraScores(*own_z, darker, saturated, coloured, striped, most, *lasting, texture)
    return scores_of


def of_lens(seen: Mapping[int, CameraScores]) -> tuple[FaultHypothesis, ...]:
    """The cameras of which dirt, drops or glare on the lens are likelier than light that was thrown into them.

    Glare adds light, and what is seen is the same; dirt and drops take light away, or show something else.
    """
    hypotheses = []
    for sensor, scores in seen.items():
        chance = 0.0 if scores.thrown else scores.chance_of_lens
        if chance >= ENOUGH:
            glare = scores.unchanged and scores.darker < 1
            hypotheses.append(FaultHypothesis(Cause.GLARE if glare else Cause.SOILED, sensor, chance))
    return tuple(hypotheses)


def by_tone(seen: CameraScores) -> bool:
    """Whether an exposure or a white balance may be all that changed: a facula adds light, and changes what is seen.

    Where an exposure saturates a camera, it does not see what the others see; where a tone curve is steep, it is a
    little brighter than predicted. Neither adds light of one colour, in rows, or that a tone curve does not predict.
    """
    added = seen.thrown or seen.unpredicted >= LIGHT_OF_CAUSES.least_thrown
    return not added and (seen.unchanged or seen.added < LIGHT_OF_CAUSES.hardly_added)
