"""The verdicts of a scan on an evaluation's cases, by thresholds from all clean frames and with some left out."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from auditor.evaluation.case_series import CaseSeries
from auditor.evaluation.experiments import scenario_1
from auditor.identification.naming import System
from auditor.identification.robust import judge_frames
from auditor.identification.scores import thresholds_from
from auditor.model.calibration import RobustThresholds
from auditor.model.checks import rig_pair_checks
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import CauseIn, Verdict, VerdictKind
from auditor.store import Store
from auditor.store.case_arrays import Cases, Floats, Known, load_cases, too_old
from auditor.store.evaluation_tables import JUDGED_R, CaseVerdict, write_case_verdicts

Flags = NDArray[np.bool_]
Block = tuple[str, int]


def judge_cases(store: Store) -> int:
    """Judge every case of a store as a scan would and keep the verdicts. Raises StoreError.

    Thresholds come from the clean cases of the same rig kind and way of measuring, so that any new recording can
    change every verdict: all cases are judged anew. Returns the number of parts that cannot be judged, since an earlier
    version kept too little of their cases; their old verdicts are deleted.
    """
    old = too_old(store)
    for evaluation_id in old:
        write_case_verdicts(store, evaluation_id, ())
    for cases in load_cases(store):
        verdicts: dict[str, list[CaseVerdict]] = defaultdict(list)
        for evaluation_id, verdict in judged(cases):
            verdicts[evaluation_id].append(verdict)
        for evaluation_id, found in verdicts.items():
            write_case_verdicts(store, evaluation_id, found)
    return len(old)


def judged(cases: Cases) -> Iterator[tuple[str, CaseVerdict]]:
    """The verdicts on the cases of one setup, each with its part's id, by every system and every set left out.

    There are none for a rig without triples, which has no systems, and none without clean cases.
    """
    blocks: dict[Block, list[int]] = defaultdict(list)
    window = CaseSeries(cases)
    for place, one in enumerate(cases.known):
        if window.has(place):
            blocks[one.block].append(place)
    for sensors in systems(cases.rig) if cases.clean.any() else ():
        system = _system(cases.rig, sensors)
        thresholds = _thresholds(cases, system, window.clean_scores(system))
        for block, inside in blocks.items():
            chosen = [place for place in inside if _is_judged(cases.known[place], sensors, cases.rig)]
            if not chosen:
                continue
            series, rows = window.window(chosen, system)
            for left_out, scales in thresholds(block).items():
                samples = min((scale.samples for scale in scales.scales_of.values()), default=0)
                for place, verdict in zip(chosen, judge_frames(series, system, scales, only=rows), strict=True):
                    known = cases.known[place]
                    yield known.evaluation_id, _kept(known, verdict, sensors, left_out, samples)


def systems(rig: Rig) -> tuple[tuple[int, ...], ...]:
    """Each triple of the leftmost camera; all sensors; of more than three cameras with a LiDAR also those of n = 3."""
    everyone = {sensor for triple in rig.triples for sensor in triple}
    found = [tuple(triple) for triple in rig.triples if triple.k == rig.n]
    if len(everyone) > 4 and LIDAR in everyone:
        found.append((LIDAR, 1, 2, rig.n))
    if len(everyone) > 3:
        found.append(tuple(sorted(everyone)))
    return tuple(found)


def _system(rig: Rig, sensors: Sequence[int]) -> System:
    """The pair checks and triples by which some of a rig's sensors are judged."""
    chosen = set(sensors)
    pair_checks = tuple(pair_check for pair_check in rig_pair_checks(rig) if set(pair_check.needed) <= chosen)
    fallback = rig.fallback if rig.fallback and set(rig.fallback) <= chosen else None
    return System(pair_checks, tuple(t for t in rig.triples if set(t) <= chosen), tuple(sensors), fallback)


def _thresholds(
    cases: Cases, system: System, scores: Mapping[CauseIn, Floats]
) -> Callable[[Block], dict[str, RobustThresholds]]:
    """For the cases of a block: thresholds by what was left out, where any clean case remains."""
    columns = [place for place, pair_check in enumerate(rig_pair_checks(cases.rig)) if pair_check in system.pair_checks]
    recordings = np.array([one.recording_id for one in cases.known])
    numbers = np.array([one.block[1] for one in cases.known])
    families = np.array([one.family for one in cases.known])
    family_of = {one.recording_id: one.family for one in cases.known}
    shared = len(set(family_of.values())) < len(family_of)  # else a family is what a recording is

    def learnt(kept: Flags) -> RobustThresholds | None:
        clean = cases.clean & kept
        if not clean.any():
            return None
        known = {cause: np.sort(values[clean & ~np.isnan(values)]).tolist() for cause, values in scores.items()}
        return thresholds_from(cases.ratios[clean][:, columns], known, system.pair_checks, JUDGED_R)

    everything = learnt(np.ones_like(cases.clean))
    without_recording = cache(lambda recording: learnt(recordings != recording))
    without_family = cache(lambda family: learnt(families != family))

    def of_block(block: Block) -> dict[str, RobustThresholds]:
        recording, number = block
        others = learnt((recordings != recording) | (numbers != number))
        folds = {"nothing": everything, "block": others, "recording": without_recording(recording)}
        if shared:
            folds["family"] = without_family(family_of[recording])
        return {left_out: found for left_out, found in folds.items() if found is not None}

    return of_block


def _is_judged(case: Known, sensors: tuple[int, ...], rig: Rig) -> bool:
    """True for a case that tests a system: only its sensors are attacked, and no more than it can identify."""
    if not set(case.attacked) <= set(sensors):
        return False
    if case.experiment == "sensitivity":
        return sensors == scenario_1(rig)
    if case.experiment == "intervals":
        return sensors == systems(rig)[-1]
    if len(sensors) == 3:
        return case.experiment in ("clean", "combinations")
    return case.experiment != "combinations" or len(case.attacked) <= len(sensors) - 3


def _kept(case: Known, verdict: Verdict, sensors: tuple[int, ...], left_out: str, samples: int) -> CaseVerdict:
    return CaseVerdict(
        frame=case.frame,
        stamp_ns=case.stamp_ns,
        draw=case.draw,
        attacked=case.attacked,
        attack=case.attack,
        strength=case.strength,
        size=case.size,
        system=sensors,
        left_out=left_out,
        samples=samples,
        verdict=verdict.kind,
        identified=verdict.attacked if verdict.kind is VerdictKind.ATTACKED else (),
        window_kind=verdict.finding and verdict.finding.kind,
        window_named=verdict.finding.attacked if verdict.finding else (),
        causes=verdict.causes,
    )
