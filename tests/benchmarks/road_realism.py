"""Are synthetic drives as hard as the road? Clean disparity errors beside those of a real drive, by the same code.

    python tests/benchmarks/road_realism.py DRIVE [--seeds 6] [--frames 40] [--step 1] [--styles city residential]

DRIVE is the folder of KITTI raw drive 2011_09_26_drive_0009. Prints, for every triple, plain and gated, the median and
the 99th percentile of E over the frames of the real drive, of each seed, and of all seeds of a style together, with
their ratios to the real one's. A ratio outside [1 / 1.5, 1.5] is marked with an asterisk.
"""

import argparse
import dataclasses
import time
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auditor.evidence import measure, use_one_thread
from auditor.evidence.matchers import find_matcher
from auditor.frames import Frame
from auditor.lab.road import make_drive
from auditor.recordings import find_rigs, open_recording, survey, synchronise
from auditor.results import Statistic
from auditor.rig import Rig

FACTOR = 1.5
Errors = NDArray[np.float64]


def real_frames(drive: Path) -> tuple[Rig, list[Frame]]:
    """LiDAR, cam1, cam3 and the reference cam2 of a KITTI drive, with its frames; cam0 at the origin is left out."""
    recording = open_recording(drive)
    look = survey(recording)
    four = find_rigs(look)[0]
    kept = [camera for camera in four.cameras if abs(float(camera.centre_m[0])) > 0.01]
    rig = Rig(four.lidar, tuple(dataclasses.replace(camera, number=i) for i, camera in enumerate(kept, start=1)))
    return rig, [frame for frame in synchronise(recording, rig, look) if isinstance(frame, Frame)]


def disparity_errors(rig: Rig, frames: Iterable[Frame]) -> Errors:
    """(frames, statistics, triples) of E."""
    matcher = find_matcher("sgbm")
    rows = []
    for frame in frames:
        counts = measure(frame, rig, matcher)[0].counts
        rows.append([[c.disparity_error(statistic) if c else None for c in counts] for statistic in Statistic])
    return np.array(rows, dtype=float)


def summary(errors: Errors) -> Errors:
    """(2, statistics, triples): median and 99th percentile."""
    return np.stack([np.nanmedian(errors, axis=0), np.nanquantile(errors, 0.99, axis=0)])


def show(name: str, values: Errors, real: Errors) -> None:
    cells = []
    for value, true in zip(values.ravel(), real.ravel(), strict=True):
        ratio = value / true
        cells.append(f"{value:.3f} {ratio:4.2f}{' ' if 1 / FACTOR <= ratio <= FACTOR else '*'}")
    print(f"{name:18s} " + "  ".join(cells), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("drive", type=Path)
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--step", type=int, default=1)
    parser.add_argument("--styles", nargs="*", default=["city", "residential"])
    options = parser.parse_args()
    use_one_thread()
    rig, frames = real_frames(options.drive)
    real = summary(disparity_errors(rig, frames))
    heads = [f"{q} {s} {t.i}{t.j}{t.k}" for q in ("med", "p99") for s in Statistic for t in rig.triples]
    print(f"{'':18s} " + " ".join(f"{head:>12s}" for head in heads))
    show("drive 0009", real, real)
    for style in options.styles:
        pooled = []
        started = time.perf_counter()
        for seed in range(options.first_seed, options.first_seed + options.seeds):
            drive = make_drive(seed, options.frames, style=style)
            numbers = range(0, options.frames, options.step)
            pooled.append(disparity_errors(drive.rig, (drive.frame(number) for number in numbers)))
            show(f"{style} {seed}", summary(pooled[-1]), real)
        errors = np.concatenate(pooled)
        show(f"{style}, all", summary(errors), real)
        print(f"{'':18s} {(time.perf_counter() - started) / len(errors):.2f} s a frame, made and measured")


if __name__ == "__main__":
    main()
