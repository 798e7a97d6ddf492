"""Do smaller pictures give the statistics of full-size ones? Streets that were measured at both sizes, frame by frame.

    python -m tests.benchmarks.clean_statistics --into FULL --streets 4 --first 9000 --frames 250 --stretch 0 100
    python -m tests.benchmarks.clean_statistics --into HALF --streets 4 --first 9000 --frames 250 --scale 0.5
    python -m tests.benchmarks.picture_sizes FULL HALF [--learn FOLDER...]

Prints the 50, 90 and 99 % quantiles of each check by how many cameras take part, at the first size and at the second,
and how many of the frames are raised at r = 1 % with four cameras and with three.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from auditor.model.checks import rig_sensor_checks
from auditor.model.verdict import VerdictKind
from tests.benchmarks.long_drives import RIGS, judged_drives
from tests.benchmarks.scenes import Scene, load

_QUANTILES = (0.5, 0.9, 0.99)
_RATE = Decimal("0.01")


def shared(first: Sequence[Scene], second: Sequence[Scene]) -> tuple[list[Scene], list[Scene]]:
    """The clean frames of the streets that both hold."""
    of_first, of_second = ({scene.name: scene for scene in scenes} for scenes in (first, second))
    found: tuple[list[Scene], list[Scene]] = [], []
    for name in of_first.keys() & of_second.keys():
        pair = of_first[name], of_second[name]
        numbers = [{case.frame for case in scene.cases if not case.attack} for scene in pair]
        both = numbers[0] & numbers[1]
        for scene, kept in zip(pair, found, strict=True):
            cases = tuple(case for case in scene.cases if case.frame in both and not case.attack)
            kept.append(replace(scene, cases=cases))
    return found


def report(sizes: Sequence[Sequence[Scene]]) -> Iterator[str]:
    """The quantiles of each check at each size."""
    columns: list[dict[tuple[str, int], list[np.ndarray]]] = [defaultdict(list) for _ in sizes]
    for scenes, of_size in zip(sizes, columns, strict=True):
        for scene in scenes:
            statistics = np.stack([case.statistics for case in scene.cases])
            for column, check in enumerate(rig_sensor_checks(scene.rig)):
                of_size[check.check.value, len(check.others)].append(statistics[:, column])
    for check, others in columns[0]:
        cells = (np.nanquantile(np.concatenate(one[check, others]), _QUANTILES) for one in columns)
        yield f"{check}, {others} others: " + "   ".join(" ".join(f"{q:.3f}" for q in cell) for cell in cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("first", type=Path)
    parser.add_argument("second", type=Path)
    parser.add_argument("--learn", type=Path, nargs="*", default=[], help="folders of clean scenes; else the prior")
    options = parser.parse_args()
    sizes = shared(load(options.first), load(options.second))
    print(f"{len(sizes[0])} streets, {sum(len(scene.cases) for scene in sizes[0])} frames", *report(sizes), sep="\n")
    learnt = [scene for folder in options.learn for scene in load(folder)] or None
    for cameras in RIGS:
        for path, scenes in zip((options.first, options.second), sizes, strict=True):
            judged = [one for drive in judged_drives(scenes, cameras, _RATE, learnt) for one in drive]
            raised = sum(one.robust.kind is not VerdictKind.CLEAN for one in judged)
            print(f"{path.name}, {len(cameras)} cameras: {raised} of {len(judged)} not clean")


if __name__ == "__main__":
    main()
