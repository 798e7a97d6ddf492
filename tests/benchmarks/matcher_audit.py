"""Whom the audit names by each matcher on real frames, and what it costs.

python -m tests.benchmarks.matcher_audit [--attacked 6] [--clean 20] [--matchers sgbm psmnet]
python -m tests.benchmarks.matcher_audit --tables --attacked 10 --clean 40

Frames of KITTI's drive 0009 (AUDITOR_TEST_DATA), spread over it, clean and under attacks on one sensor, with the LiDAR
and three cameras. By the robust method each frame is judged by itself, r = 1 %, by thresholds from all clean frames of
drives 0001 and odometry 04, and by the prior, each from the matcher's own prior. Algorithm 2 has the thresholds at
r = 0 of the same clean frames of 0009: in sample. `--tables` has the paper's Tables I and II in place of all that, by
triples of the leftmost reference, under the paper's faculas and walls: thresholds of the clean frames, in sample.
"""

import argparse
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from decimal import Decimal
from itertools import combinations
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

from auditor.identification.cross_validation import thresholds_of
from auditor.identification.drive_level import for_clean_drive
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.parameters import FittedOn, fitted_on
from auditor.identification.robust import judge_frames
from auditor.identification.thresholds import threshold
from auditor.lab.attacks.paper import Facula, draw_wall
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.experiments import Attacks
from auditor.lab.evaluation.object_baseline.agreement import scenarios
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import Matcher, find_matcher
from auditor.model.calibration import CleanFrames
from auditor.model.frames import Frame
from auditor.model.measurement import Statistic
from auditor.model.rig import LIDAR, Rig, Triple
from auditor.model.verdict import Verdict, VerdictKind
from auditor.pipeline.judge import system_of
from auditor.pipeline.measured import procedure_by
from auditor.recordings import find_rigs, open_recording, survey, synchronise
from tests.benchmarks.clean_statistics import DRIVES, spread
from tests.benchmarks.real_drives import without
from tests.making.named_on_frames import Errors, disparity_errors, drawn, maxima, named

AUDITED, LEARNT = "0009", ("0001", "04")
RATES = ("0", "0.01", "0.02", "0.03", "0.05")
STRENGTHS = ("mild", "opaque")
FACULAS = {"facula R 75 opaque": 2000.0, "facula R 75 mild": 255.0}
RADIUS_PX = 75.0
R, PERIOD_NS = Decimal("0.01"), 10**8

Statistics = Sequence[Sequence[float | None]]
"""Of some frames, in the order of the rig's sensor checks."""


class Case(NamedTuple):
    """A frame under one attack, or none, and what was measured of it."""

    attack: str
    attacked: tuple[int, ...]
    statistics: tuple[float | None, ...]
    E: Errors


def open_drive(number: str, *, four: bool = False) -> tuple[Rig, Iterator[Frame]]:
    """The rig of the LiDAR and three cameras (cam1, cam3, cam2), or all, and a drive's frames as a scan sees them."""
    recording = open_recording(Path(os.environ["AUDITOR_TEST_DATA"]) / DRIVES[number])
    surveyed = survey(recording)
    whole = find_rigs(surveyed)[0]
    rig = whole if four else without(whole, whole.camera(3).name)
    stream = synchronise(recording, rig, surveyed, colour=True)
    return rig, (frame for frame in stream if isinstance(frame, Frame))


def attacks_on(frame: Frame, rig: Rig) -> Iterator[tuple[str, Attacks]]:
    """Lights on each camera, the same places whatever the matcher, and a wall."""
    rng = np.random.default_rng(frame.number)
    for camera in rig.cameras:
        place = rng.uniform(0, camera.width_px), rng.uniform(0, camera.height_px)
        for name, amplitude in FACULAS.items():
            yield name, {camera.number: Facula(amplitude, RADIUS_PX, *place)}
    yield "wall", {LIDAR: draw_wall(rng)}


def cases_of(frame: Frame, rig: Rig, matcher: Matcher, *, attacked: bool) -> Iterator[Case]:
    """The frame as it is, and attacked."""
    measured = AttackedFrame(frame, rig, matcher)
    for name, attacks in [("clean", {}), *(attacks_on(frame, rig) if attacked else ())]:
        yield Case(name, tuple(attacks), measured.statistics(attacks), disparity_errors(measured, attacks))


def outcome(attacked: tuple[int, ...], answer: tuple[int, ...], raised: bool) -> str:
    """What became of a case."""
    if not raised:
        return "not raised"
    return "named" if answer and answer == attacked else "others named" if answer else "no name"


def judge_alone(
    rig: Rig,
    drives: Sequence[Statistics],
    tested: Statistics,
    fitted: FittedOn = FittedOn.SGBM,
    own: Statistics = (),
) -> list[Verdict]:
    """The verdicts of the robust method by thresholds from the clean frames of drives, each on one frame by itself.

    Rules over successive frames are left out: causes that are not attacks, and frozen sensors. `own` are clean frames
    of the same drive, whose usual statistics the thresholds know as in a scan.
    """
    system, F = system_of(rig, fitted), len(tested)
    clean = [_clean_frames(str(number), rig, statistics) for number, statistics in enumerate(drives)]
    thresholds = thresholds_of(clean, system, R)
    if own:
        thresholds = for_clean_drive(thresholds, system.sensor_checks, _clean_frames("own", rig, own))
    nothing = np.zeros((F, len(system.sensors)), dtype=np.bool_)
    each = np.arange(F, dtype=np.int64)
    series = FrameSeries(each, each, np.array(tested, dtype=np.float64), present=~nothing, frozen=nothing)
    return judge_frames(series, system, thresholds, without_causes=True)


def _clean_frames(name: str, rig: Rig, statistics: Statistics) -> CleanFrames:
    columns = np.array(statistics, dtype=np.float64).T
    stamps = np.arange(len(statistics), dtype=np.int64) * PERIOD_NS
    return CleanFrames(name, stamps, {}, dict(zip(system_of(rig).sensor_checks, columns, strict=True)), {})


def report(rig: Rig, cases: list[Case], drives: dict[str, list[Case]], fitted: FittedOn) -> Iterator[str]:
    """A line for each attack and way of judging."""
    tested = [case.statistics for case in cases]
    learnt = [[case.statistics for case in clean] for clean in drives.values()]
    robust: dict[str, list[Verdict]] = {
        "learnt": judge_alone(rig, learnt, tested, fitted),
        "prior": judge_alone(rig, [], tested, fitted),
    }
    theta = maxima([case.E for case in cases if not case.attacked])
    answers = {by: [(one.attacked, one.kind is not VerdictKind.CLEAN) for one in some] for by, some in robust.items()}
    answers["Algorithm 2"] = [
        (named(case.E, theta, rig), any(E is not None and theta[t] < E for t, E in case.E.items())) for case in cases
    ]
    for name in dict.fromkeys(case.attack for case in cases):
        for by, some in answers.items():
            counts = Counter(
                outcome(case.attacked, *answer) for case, answer in zip(cases, some, strict=True) if case.attack == name
            )
            yield f"  {name:20} {by:12} " + ", ".join(f"{what} {count}" for what, count in sorted(counts.items()))
    for number, clean in (*drives.items(), (AUDITED, [case for case in cases if not case.attacked])):
        means = {t: np.mean([case.E[t] for case in clean if case.E[t] is not None]) for t in clean[0].E}
        yield f"  clean E, {number}: " + ", ".join(f"{t} {mean:.3f}" for t, mean in means.items())


def audit(name: str, attacked: int, clean: int) -> Iterator[str]:
    """The report of a matcher, and what a clean frame costs it."""
    matcher = find_matcher(name)
    drives: dict[str, list[Case]] = {}
    started = process_time()
    for number in LEARNT:
        rig, frames = open_drive(number)
        drives[number] = [case for frame in frames for case in cases_of(frame, rig, matcher, attacked=False)]
    count = sum(len(cases) for cases in drives.values())
    yield f"{name}: {(process_time() - started) / count:.2f} CPU s a clean frame ({count} frames)"
    rig, stream = open_drive(AUDITED)
    every = list(stream)
    hit = spread(every, attacked)
    wanted = hit | spread(every, clean)
    cases = [
        case
        for frame in every
        if frame.number in wanted
        for case in cases_of(frame, rig, matcher, attacked=frame.number in hit)
    ]
    yield from report(rig, cases, drives, fitted_on(procedure_by(matcher, rig.kind.compared_to)))


def tables(name: str, attacked: int, clean: int) -> Iterator[str]:
    """Detection by the two systems of three sensors, and identification of one attacked sensor, by r."""
    matcher = find_matcher(name)
    rig, stream = open_drive(AUDITED)
    every = list(stream)
    hit = spread(every, attacked)
    triples = [triple for triple in rig.triples if triple.k == rig.n]
    calm: list[Errors] = []
    cases: list[tuple[str, tuple[int, ...], Errors]] = []
    for frame in every:
        if frame.number not in hit | spread(every, clean):
            continue
        measured = AttackedFrame(frame, rig, matcher)
        calm.append(errors_of(measured, {}, triples))
        for strength in STRENGTHS if frame.number in hit else ():
            rng = np.random.default_rng([frame.number, len(strength)])
            each = {sensor: drawn(frame, sensor, strength, rng) for sensor in rig.sensors}
            for of_it in attacked_sets(rig):
                E = errors_of(measured, {sensor: each[sensor] for sensor in of_it}, triples)
                cases.append((strength, of_it, E))
    yield f"{name}: {len(calm)} clean frames, {len(hit)} attacked"
    for r in map(Decimal, RATES):
        theta = {t: threshold(sorted(E[t] for E in calm if E[t] is not None), r) for t in triples}
        for strength in STRENGTHS:
            of_it = [(hit_sensors, E) for one, hit_sensors, E in cases if one == strength]
            cells = []
            for triple in scenarios(rig):
                inside = [E[triple] > theta[triple] for sensors, E in of_it if set(sensors) <= set(triple)]
                cells.append(f"{triple} {sum(inside)}/{len(inside)}")
            for sensor in rig.sensors:
                answers = [named(E, theta, rig) for sensors, E in of_it if sensors == (sensor,)]
                cells.append(f"S_{sensor} {answers.count((sensor,))}/{len(answers)}")
            yield f"  r {r:5} {strength:7} " + ", ".join(cells)
        raised = [sum(E[t] > theta[t] for E in calm) for t in triples]
        yield f"  r {r:5} clean frames raised, by triple: {raised}"


def errors_of(measured: AttackedFrame, attacks: Attacks, triples: list[Triple]) -> Errors:
    """The gated E of these triples; None of the others."""
    counts = dict(zip(measured.rig.measured_triples, measured.counts(attacks, triples), strict=True))
    return {t: one.disparity_error(Statistic.GATED) if (one := counts.get(t)) else None for t in measured.rig.triples}


def attacked_sets(rig: Rig) -> list[tuple[int, ...]]:
    """Every combination that attacks one of the two systems."""
    sets = {s for triple in scenarios(rig) for size in (1, 2, 3) for s in combinations(sorted(triple), size)}
    return sorted(sets, key=lambda one: (len(one), one))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--attacked", type=int, default=6, help="frames of the audited drive, clean and attacked")
    parser.add_argument("--clean", type=int, default=0, help="frames of it that are measured clean at least")
    parser.add_argument("--matchers", nargs="+", default=["sgbm", "psmnet"])
    parser.add_argument("--tables", action="store_true", help="the paper's tables")
    options = parser.parse_args()
    use_one_thread()
    for name in options.matchers:
        for line in (tables if options.tables else audit)(name, options.attacked, options.clean):
            print(line, flush=True)


if __name__ == "__main__":
    main()
