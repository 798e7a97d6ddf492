"""Is the synthetic road as hard as the real one? Clean E per triple, side by side.

Measures the 40 real frames of KITTI's drive 0009 (rig of LiDAR, cam1, cam3, reference cam2) and synthetic drives with
the same code, and prints medians and 99th percentiles with their ratios. Run from the repository's top:

    AUDITOR_TEST_DATA=... python -m tests.benchmarks.realism [--frames 40] [--seeds 1 2 3] [--styles city residential]
"""

import argparse
import sys
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from auditor.lab.simulation.drives import make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.measurement import measure, use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.frames import Frame
from auditor.model.measurement import Statistic
from auditor.model.rig import Rig
from tests.benchmarks import real_drives

FACTOR = 1.5

Errors = NDArray[np.float64]  # (frames, statistics, triples)


def disparity_errors(frames: Iterable[Frame], rig: Rig) -> Errors:
    matcher = find_matcher("sgbm")
    rows = []
    for frame in frames:
        counts = measure(frame, rig, matcher)[0].counts
        row = [[c.disparity_error(s) if c else None for c in counts] for s in Statistic]
        rows.append(np.array(row, dtype=np.float64))
    return np.array(rows)


def spread(errors: Errors) -> NDArray[np.float64]:
    """(2, statistics, triples): medians and 99th percentiles."""
    return np.stack([np.nanmedian(errors, axis=0), np.nanquantile(errors, 0.99, axis=0)])


def lines(name: str, errors: Errors, inconsistent: NDArray[np.float64]) -> Iterator[str]:
    figures = spread(errors)
    ratios = figures / inconsistent
    outside = int(np.count_nonzero((ratios > FACTOR) | (ratios < 1 / FACTOR)))
    for s, statistic in enumerate(Statistic):
        cells = [
            f"{figures[0, s, k]:.3f} x{ratios[0, s, k]:.2f}  {figures[1, s, k]:.3f} x{ratios[1, s, k]:.2f}"
            for k in range(figures.shape[2])
        ]
        tail = f"  {outside} of {ratios.size} outside" if s else ""
        yield f"{name:16} {statistic:6} | " + " | ".join(cells) + tail


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--every", type=int, default=1, help="measure every so many frames only")
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--styles", nargs="+", default=list(STYLES))
    options = parser.parse_args()
    use_one_thread()
    rig, frames = real_drives.frames("0009")
    real = disparity_errors(frames, rig)
    print("a triple: median, its ratio to drive 0009's, 99th percentile, its ratio; triples " + str(rig.triples))
    print(*lines("drive 0009", real, spread(real)), sep="\n")
    everything = []
    for style in options.styles:
        of_style = []
        for seed in options.seeds:
            drive = make_drive(seed, options.frames, style=style, vehicle=seed)
            numbers = range(0, options.frames, options.every)
            of_style.append(disparity_errors((drive.frame(number) for number in numbers), drive.rig))
            print(*lines(f"{style} {seed}", of_style[-1], spread(real)), sep="\n", flush=True)
        print(*lines(f"{style}, all", np.concatenate(of_style), spread(real)), sep="\n")
        everything += of_style
    print(*lines("all", np.concatenate(everything), spread(real)), sep="\n")
    ratios = spread(np.concatenate(everything)) / spread(real)
    return int(bool(np.any((ratios > FACTOR) | (ratios < 1 / FACTOR))))


if __name__ == "__main__":
    sys.exit(main())
