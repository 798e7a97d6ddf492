"""Calibrations in which some frames had been attacked: `python -m tests.benchmarks.contaminated [--streets 3]`.

Streets of each style under faculas on single cameras, drawn anew for every frame, judged frame by frame by thresholds
of the streets of other styles at r = 1 %, of each of which 0, 10, 20 or 50 % of the frames were attacked by mild or by
opaque faculas. How many name exactly the attacked camera. Causes that are not attacks and frozen sensors are left out.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.experiments import SeededDraws, drawn_attack
from auditor.lab.simulation.drives import make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.rig import Rig
from tests.benchmarks.intervals import wilson_percent
from tests.benchmarks.single_frames import judge_alone

SHARES = (0.0, 0.1, 0.2, 0.5)
STRENGTHS = ("mild", "opaque")
FRAMES = 10
MATCHER = find_matcher("sgbm")


@dataclass(frozen=True)
class Sample:
    """The statistics of a frame under a facula of some strength on one camera, None where it is clean."""

    strength: str | None
    camera: int
    statistics: tuple[float | None, ...]


def samples(number: int, style: str) -> tuple[Rig, list[Sample]]:
    """One street, each frame clean and under each facula."""
    drive = make_drive(number, FRAMES, style=style, vehicle=number)
    return drive.rig, [one for frame in drive.frames() for one in _of(AttackedFrame(frame, drive.rig, MATCHER), number)]


def _of(attacked_frame: AttackedFrame, number: int) -> Iterator[Sample]:
    yield Sample(None, 0, attacked_frame.statistics({}))
    draws = SeededDraws(0, number, attacked_frame.frame.number, 0)
    for strength in STRENGTHS:
        for camera in attacked_frame.rig.cameras:
            attack = drawn_attack(attacked_frame.rig, camera.number, strength, draws.of(camera.number))
            yield Sample(strength, camera.number, attacked_frame.statistics({camera.number: attack}))


def mixed(street: Sequence[Sample], share: float, strength: str, rng: np.random.Generator) -> list[Sample]:
    """The clean frames of a street of a calibration, of which a share gives way to attacked ones."""
    clean = [one for one in street if one.strength is None]
    bad = [one for one in street if one.strength == strength]
    count = round(share * len(clean))
    kept = [clean[place] for place in rng.permutation(len(clean))[count:]]
    return kept + [bad[place] for place in rng.permutation(len(bad))[:count]]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--streets", type=int, default=3, help="of each style")
    options = parser.parse_args()
    use_one_thread()
    of_style: dict[str, list[list[Sample]]] = {style: [] for style in STYLES}
    for place, style in enumerate(STYLES, start=1):
        for street in range(options.streets):
            rig, found = samples(1000 * place + street, style)
            of_style[style].append(found)
    rng = np.random.default_rng(0)
    for share in SHARES:
        for strength in STRENGTHS:
            right = dict.fromkeys(STRENGTHS, 0)
            total = dict.fromkeys(STRENGTHS, 0)
            for style, part in of_style.items():
                learnt = [street for other in STYLES if other != style for street in of_style[other]]
                tested = [one for street in part for one in street if one.strength is not None]
                drives = [[one.statistics for one in mixed(street, share, strength, rng)] for street in learnt]
                verdicts = judge_alone(rig, drives, [one.statistics for one in tested])
                for one, verdict in zip(tested, verdicts, strict=True):
                    right[one.strength] += verdict.attacked == (one.camera,)
                    total[one.strength] += 1
            rates = [f"{s} named {right[s]}/{total[s]} {_percent(right[s], total[s])}" for s in STRENGTHS]
            print(f"{share:4.0%} of the calibration {strength:6}: {', '.join(rates)}")


def _percent(k: int, n: int) -> str:
    low, high = wilson_percent(k, n)
    return f"[{low:.1f}, {high:.1f}]"


if __name__ == "__main__":
    main()
