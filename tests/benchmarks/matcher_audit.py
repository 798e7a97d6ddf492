"""Whom the audit names by each matcher on real frames, and what it costs.

python -m tests.benchmarks.matcher_audit [--attacked 6] [--clean 20] [--matchers sgbm psmnet]

Frames of KITTI's drive 0009 (AUDITOR_TEST_DATA), spread over it, clean and under attacks on one sensor, with the LiDAR
and three cameras. By the robust method each frame is judged by itself, r = 1 %, by thresholds from all clean frames of
drives 0001 and odometry 04, and by the prior, which was fitted on SGBM's disparities. Algorithm 2 has the thresholds at
r = 0 of the same clean frames of 0009: in sample.
"""

import argparse
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from time import process_time
from typing import NamedTuple

import numpy as np

from auditor.lab.attacks.paper import Facula, draw_wall
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.experiments import Attacks
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import Matcher, find_matcher
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import Verdict, VerdictKind
from auditor.recordings import find_rigs, open_recording, survey, synchronise
from tests.benchmarks.clean_statistics import DRIVES
from tests.benchmarks.kinds import spread
from tests.benchmarks.real_drives import without
from tests.benchmarks.single_frames import judge_alone
from tests.making.named_on_frames import Errors, disparity_errors, maxima, named

AUDITED, LEARNT = "0009", ("0001", "04")
FACULAS = {"facula R 75 opaque": 2000.0, "facula R 75 mild": 255.0}
RADIUS_PX = 75.0


class Case(NamedTuple):
    """A frame under one attack, or none, and what was measured of it."""

    attack: str
    attacked: tuple[int, ...]
    statistics: tuple[float | None, ...]
    E: Errors


def open_drive(number: str) -> tuple[Rig, Iterator[Frame]]:
    """The rig of the LiDAR and three cameras (cam1, cam3, cam2), and the frames of a drive as a scan sees them."""
    recording = open_recording(Path(os.environ["AUDITOR_TEST_DATA"]) / DRIVES[number])
    surveyed = survey(recording)
    whole = find_rigs(surveyed)[0]
    rig = without(whole, whole.camera(3).name)
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


def report(rig: Rig, cases: list[Case], drives: dict[str, list[Case]]) -> Iterator[str]:
    """A line for each attack and way of judging."""
    tested = [case.statistics for case in cases]
    learnt = [[case.statistics for case in clean] for clean in drives.values()]
    robust: dict[str, list[Verdict]] = {
        "learnt": judge_alone(rig, learnt, tested),
        "prior": judge_alone(rig, [], tested),
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
    yield from report(rig, cases, drives)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--attacked", type=int, default=6, help="frames of the audited drive, clean and attacked")
    parser.add_argument("--clean", type=int, default=0, help="frames of it that are measured clean at least")
    parser.add_argument("--matchers", nargs="+", default=["sgbm", "psmnet"])
    options = parser.parse_args()
    use_one_thread()
    for name in options.matchers:
        for line in audit(name, options.attacked, options.clean):
            print(line, flush=True)


if __name__ == "__main__":
    main()
