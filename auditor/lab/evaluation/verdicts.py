"""The verdicts of a scan on an evaluation's cases, by thresholds from all clean frames and with some left out."""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import cache

import numpy as np

from auditor.identification.cross_validation import thresholds_of
from auditor.identification.drive_level import for_drive
from auditor.identification.parameters import fitted_on
from auditor.identification.robust import judge_frames
from auditor.identification.systems import System
from auditor.identification.transfer import for_sparser_lidar, halvings_of_points, is_another_lidar
from auditor.lab.evaluation.case_series import CaseSeries, CleanSeries
from auditor.lab.evaluation.experiments import scenario_1
from auditor.model.calibration import CleanFrames, RobustThresholds
from auditor.model.checks import rig_sensor_checks
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import Verdict, VerdictKind
from auditor.store.case_arrays import CaseIdentity, Cases, load_cases, too_old
from auditor.store.evaluation_tables import JUDGED_R, CaseVerdict, write_case_verdicts
from auditor.store.store import Store

Block = tuple[str, int]


def judge_cases(store: Store) -> int:
    """Judge every case of a store as a scan would and keep the verdicts. Raises StoreError.

    Thresholds come from the clean cases of the same rig kind and way of measuring, each recording taken for a drive, so
    that any new recording can change every verdict: all cases are judged anew. Returns the number of parts that cannot
    be judged, since an earlier version kept too little of their cases; their old verdicts are deleted.
    """
    old = too_old(store)
    for evaluation_id in old:
        write_case_verdicts(store, evaluation_id, ())
    for cases in load_cases(store):
        verdicts: dict[str, list[CaseVerdict]] = defaultdict(list)
        for evaluation_id, verdict in judged(cases):
            verdicts[evaluation_id].append(verdict)
        for evaluation_id, case_verdicts in verdicts.items():
            write_case_verdicts(store, evaluation_id, case_verdicts)
    return len(old)


def judged(cases: Cases) -> Iterator[tuple[str, CaseVerdict]]:
    """The verdicts on the cases of one setup, each with its part's id, by every system and every set left out.

    There are none for a rig without triples, which has no systems, and none of frames that were not measured clean.
    """
    blocks: dict[Block, list[int]] = defaultdict(list)
    around = CaseSeries(cases)
    for place, case_of in enumerate(cases.known):
        if around.has(place):
            blocks[case_of.block].append(place)
    for sensors in systems(cases.rig) if blocks else ():
        system = _system(cases, sensors)
        thresholds = _thresholds(around.clean(system), system, cases.rig)
        for block, inside in blocks.items():
            chosen = [place for place in inside if _is_judged(cases.known[place], sensors, cases.rig)]
            if not chosen:
                continue
            series, rows = around.series(chosen, system)
            for left_out, learnt in thresholds(block).items():
                for place, verdict in zip(chosen, judge_frames(series, system, learnt, only=rows), strict=True):
                    case = cases.known[place]
                    yield case.evaluation_id, _kept(case, verdict, sensors, left_out, learnt)


def systems(rig: Rig) -> tuple[tuple[int, ...], ...]:
    """Each triple of the leftmost camera; all sensors; of more than three cameras with a LiDAR also those of n = 3."""
    everyone = {sensor for triple in rig.triples for sensor in triple}
    triples = [tuple(triple) for triple in rig.triples if triple.k == rig.n]
    if len(everyone) > 4 and LIDAR in everyone:
        triples.append((LIDAR, 1, 2, rig.n))
    if len(everyone) > 3:
        triples.append(tuple(sorted(everyone)))
    return tuple(triples)


def _system(cases: Cases, sensors: Sequence[int]) -> System:
    """The sensor checks and triples by which some of a rig's sensors are judged."""
    rig, chosen = cases.rig, set(sensors)
    sensor_checks = tuple(check for check in rig_sensor_checks(rig) if set(check.needed) <= chosen)
    fallback = rig.fallback if rig.fallback and set(rig.fallback) <= chosen else None
    triples = tuple(t for t in rig.triples if set(t) <= chosen)
    return System(sensor_checks, triples, tuple(sensors), fallback, fitted_on(cases.procedure))


def _thresholds(
    drives: Sequence[CleanSeries], system: System, rig: Rig
) -> Callable[[Block], dict[str, RobustThresholds]]:
    """For the cases of a block: thresholds by what was left out. Where no clean frame remains they are the prior.

    As in a scan more isolated points are expected where the LiDAR of the recording is sparser than theirs, and the
    recording shows its own usual statistics, here by its clean frames.
    """
    family_of = {one.frames.recording_id: one.family for one in drives}
    shared = len(set(family_of.values())) < len(family_of)  # else a family is what a recording is
    frames_of = {
        recording: [one.frames for one in drives if one.frames.recording_id == recording] for recording in family_of
    }
    returns = {recording: np.concatenate([one.returns for one in own]) for recording, own in frames_of.items()}
    statistics = {
        recording: np.concatenate([one.statistics_of(system.sensor_checks) for one in own])
        for recording, own in frames_of.items()
    }
    stamps_ns = {recording: np.concatenate([one.stamps_ns for one in own]) for recording, own in frames_of.items()}

    def learnt(clean: Sequence[CleanFrames], recording: str) -> RobustThresholds:
        clean = [one for one in clean if one.frames]
        thresholds = thresholds_of(clean, system, JUDGED_R)
        halvings = halvings_of_points(clean, rig, returns[recording])
        thresholds = for_sparser_lidar(thresholds, halvings) if is_another_lidar(halvings) else thresholds
        return for_drive(thresholds, system.sensor_checks, statistics[recording], stamps_ns[recording])

    @cache
    def of_recording(recording: str) -> dict[str, RobustThresholds]:
        folds = {
            "nothing": learnt([one.frames for one in drives], recording),
            "recording": learnt([one.frames for one in drives if one.frames.recording_id != recording], recording),
        }
        if shared:
            others = [one.frames for one in drives if one.family != family_of[recording]]
            folds["family"] = learnt(others, recording)
        return folds

    def of_block(block: Block) -> dict[str, RobustThresholds]:
        recording, number = block
        rest = [one.without(number) if one.frames.recording_id == recording else one.frames for one in drives]
        return of_recording(recording) | {"block": learnt(rest, recording)}

    return of_block


def _is_judged(case: CaseIdentity, sensors: tuple[int, ...], rig: Rig) -> bool:
    """True for a case that tests a system: only its sensors are attacked, and no more than it can identify."""
    if not set(case.attacked) <= set(sensors):
        return False
    if case.experiment == "sensitivity":
        return sensors == scenario_1(rig)
    if case.experiment in ("intervals", "unseen"):
        return sensors == systems(rig)[-1]
    if len(sensors) == 3:
        return case.experiment in ("clean", "combinations")
    return case.experiment != "combinations" or len(case.attacked) <= len(sensors) - 3


def _kept(
    case: CaseIdentity, verdict: Verdict, sensors: tuple[int, ...], left_out: str, learnt: RobustThresholds
) -> CaseVerdict:
    incident = verdict.finding if verdict.in_incident else None
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
        drives=learnt.drives,
        verdict=verdict.kind,
        identified=verdict.attacked if verdict.kind is VerdictKind.ATTACKED else (),
        window_kind=incident and incident.kind,
        window_named=incident.attacked if incident else (),
        event=incident and incident.event,
        causes=verdict.causes,
        largest_z=_largest_z(verdict, learnt.limit),
        limit_z=learnt.limit,
    )


def _largest_z(verdict: Verdict, limit: float) -> float | None:
    """The largest z of a clean frame, which stays below the limit by the verdict's gap."""
    below = verdict.gap if verdict.kind is VerdictKind.CLEAN else None
    return None if below is None or not np.isfinite(below) else limit - below
