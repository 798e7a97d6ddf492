"""Cameras that do not stand on one line: `python -m tests.benchmarks.off_line`.

The same synthetic streets (1242 x 375, LiDAR and three cameras like KITTI's, unrectified) through cameras on the line
and beside it: the sensors named for strong faculas and walls of the paper's sizes, frames one by one, thresholds at r =
1 % learnt on four other streets with vehicles of their own, causes that are not attacks and frozen sensors left out;
and the CPU time of measuring a frame, rounds interleaved.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from statistics import median
from time import process_time

import cv2
import numpy as np

from auditor.lab.attacks.paper import draw_facula, draw_wall
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.simulation.drives import SyntheticDrive, make_drive
from auditor.measurement import measure
from auditor.measurement.disparity.matchers.sgbm import SgbmMatcher
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import VerdictKind
from tests.benchmarks.single_frames import judge_alone
from tests.making.scenes import moved

OFFSETS_M = {
    "on the line": ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    "S_1 10 cm higher, S_2 15 cm ahead": ((0.0, -0.1, 0.0), (0.0, 0.0, 0.15), (0.0, 0.0, 0.0)),
    "S_1 30 cm higher, S_2 10 cm lower and 15 cm ahead": ((0.0, -0.3, 0.0), (0.0, 0.1, 0.15), (0.0, 0.0, 0.0)),
}
LEARNT_ON, TESTED_ON = (1001, 1002, 1004, 1005), (1003, 1006)
DRAWS, EVERY, ROUNDS = 6, 3, 5


def street(seed: int, offsets_m: tuple[tuple[float, float, float], ...]) -> SyntheticDrive:
    drive = make_drive(seed, 6, vehicle=seed)
    return replace(drive, vehicle=replace(drive.vehicle, rig=moved(drive.rig, offsets_m)))


def named(drives: Sequence[SyntheticDrive], learnt_on: Sequence[SyntheticDrive]) -> Counter[tuple[str, str]]:
    """How often each set of attacked sensors got each verdict."""
    rig, matcher, rng = drives[0].rig, SgbmMatcher(), np.random.default_rng(5)
    clean = [
        [AttackedFrame(frame, drive.rig, matcher).statistics({}) for frame in list(drive.frames())[::2]]
        for drive in learnt_on
    ]
    cases = [{}] + [{s: draw_facula(rng, 1242, 375, "strong")} for s in (1, 2, 3) for _ in range(DRAWS)]
    cases += [{LIDAR: draw_wall(rng)} for _ in range(DRAWS)]
    attacked, statistics = [], []
    for frame in (frame for d in drives for frame in list(d.frames())[::EVERY]):
        attacked_frame = AttackedFrame(frame, rig, matcher)
        attacked += cases
        statistics += [attacked_frame.statistics(case) for case in cases]
    verdicts = judge_alone(rig, clean, statistics)
    called = ("clean" if v.kind is VerdictKind.CLEAN else f"attacked {v.attacked}" for v in verdicts)
    return Counter(
        (f"attacked {tuple(case)}" if case else "clean", what) for case, what in zip(attacked, called, strict=True)
    )


def frame_s(frames: Sequence[Frame], rig: Rig) -> float:
    started = process_time()
    for frame in frames:
        measure(frame, rig, SgbmMatcher())
    return (process_time() - started) / len(frames)


def main() -> None:
    cv2.setNumThreads(1)
    costs: dict[str, list[float]] = {}
    driven = {name: street(TESTED_ON[0], offsets) for name, offsets in OFFSETS_M.items()}
    frames = {name: list(drive.frames()) for name, drive in driven.items()}
    for _ in range(ROUNDS + 1):
        for name, drive in driven.items():
            costs.setdefault(name, []).append(frame_s(frames[name], drive.rig))
    for name, offsets in OFFSETS_M.items():
        counts = named([street(s, offsets) for s in TESTED_ON], [street(s, offsets) for s in LEARNT_ON])
        first, here = costs["on the line"][1:], costs[name][1:]  # views are made in the first round
        ratios = [b / a for a, b in zip(first, here, strict=True)]
        print(f"{name}: {median(ratios):.2f} times the CPU time a frame ({min(ratios):.2f} to {max(ratios):.2f})")
        for (attacked, verdict), count in sorted(counts.items()):
            print(f"  {attacked}: {verdict} {count}")


if __name__ == "__main__":
    main()
