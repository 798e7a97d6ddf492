"""Are the spectra of synthetic streets like the real ones? Materials and pairs of cameras, side by side.

LiDAR points say what is compared: asphalt is what lies at the road's height, vegetation what stands higher and is
green. Prints, for each real drive and each condition of streets with grey and colour cameras in turn:

* the level of the grey S_3 over the luma of the colour S_4 on asphalt and on vegetation, and the ratio of the two;
* the residual after one gain and offset are fitted, in grey levels: median, 95th and 99th percentile,
  of pairs of two grey cameras (gg), of two colour cameras (cc), and of one each (gc).

Run from the repository's top:

    AUDITOR_TEST_DATA=... python -m tests.benchmarks.spectral_realism [--streets 3] [--every 4]
"""

import argparse
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from time import process_time
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.lab.simulation.conditions import CONDITIONS
from auditor.lab.simulation.drives import make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.half_resolution import grey
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.recordings import find_rigs, open_recording, survey, synchronise
from tests.benchmarks.real_drives import drive

KINDS = ("grey", "colour", "grey", "colour")
PAIRS = {"gg": ((1, 3),), "cc": ((2, 4),), "gc": ((1, 2), (3, 4))}
ROAD_M, BESIDE_M, AHEAD_M = (1.5, 1.8), 4.0, 25.0  # below the cameras, to the side, ahead
ABOVE_M = 1.2
GREENER = 1.05
SMOOTHED = 15
FEWEST = 100
WHITE = 250
ROUNDS, KEPT = 6, 0.6
PICTURES = 8

Floats = NDArray[np.floating]


def fit_gain(target: Floats, source: Floats) -> tuple[float, float]:
    """Gain and offset from source to target (M,): least squares over the six tenths that fit best, six times."""
    gain, offset = 1.0, float(np.median(target) - np.median(source))
    for _ in range(ROUNDS):
        distance = np.abs(gain * source + offset - target)
        best = np.argsort(distance)[: int(KEPT * len(source))]
        gain, offset = (float(one) for one in np.polyfit(source[best], target[best], 1))
    return gain, offset


def real(path: Path) -> tuple[Rig, Iterator[Frame]]:
    recording = open_recording(path)
    surveyed = survey(recording)
    rig = find_rigs(surveyed)[0]
    return rig, (f for f in synchronise(recording, rig, surveyed, colour=True) if isinstance(f, Frame))


def levels(frame: Frame, rig: Rig) -> tuple[Floats, dict[int, Floats], Floats]:
    """(3, N) points in the rig frame, (N,) smoothed grey levels by camera, (N, 3) channels of S_4, of what all see."""
    assert frame.cloud is not None
    assert rig.lidar is not None
    T = rig.lidar.rig_SE3_lidar
    points = T[:3, :3] @ frame.cloud.xyz_m.T + T[:3, 3:]
    points = points[:, points[2] > 1]
    seen, found = np.ones(points.shape[1], dtype=bool), {}
    for camera in rig.cameras:
        u, v, w = camera.projection @ np.vstack([points, np.ones(points.shape[1])])
        column, row = np.rint(u / w).astype(int), np.rint(v / w).astype(int)
        inside = (column >= 0) & (column < camera.width_px) & (row >= 0) & (row < camera.height_px)
        pixels = cv2.blur(frame.images[camera.number].pixels, (SMOOTHED, SMOOTHED))
        row, column = np.where(inside, row, 0), np.where(inside, column, 0)
        found[camera.number] = grey(pixels)[row, column].astype(np.float32)
        if camera.number == rig.n:
            channels = pixels[row, column].astype(np.float32)
        seen &= inside
    return points[:, seen], {number: level[seen] for number, level in found.items()}, channels[seen]


def figures(frames: Iterable[Frame], rig: Rig) -> list[list[float]]:
    """One row a frame: grey over luma on asphalt, on vegetation, and residuals by PAIRS and quantile."""
    rows = []
    for frame in frames:
        (x, y, z), level, channels = levels(frame, rig)
        blue, green, red = channels.T
        usable = (level[3] < WHITE) & (level[4] < WHITE) & (level[4] > 2)
        asphalt = usable & (y > ROAD_M[0]) & (y < ROAD_M[1]) & (np.abs(x) < BESIDE_M) & (z < AHEAD_M)
        plants = usable & (y < ABOVE_M) & (green > GREENER * np.maximum(red, blue))
        row = [
            float(np.median(level[3][m]) / np.median(level[4][m])) if m.sum() > FEWEST else np.nan
            for m in (asphalt, plants)
        ]
        row.append(row[1] / row[0])
        for pairs in PAIRS.values():
            residuals = np.concatenate([residual(level[k], level[i]) for i, k in pairs])
            row += np.quantile(residuals, (0.5, 0.95, 0.99)).tolist()
        rows.append(row)
    return rows


def residual(target: Floats, source: Floats) -> Floats:
    gain, offset = fit_gain(target, source)
    both = np.maximum(target, source) < WHITE
    return np.abs(gain * source + offset - target)[both]


def line(name: str, rows: list[list[float]]) -> str:
    cells = np.nanmedian(np.array(rows), axis=0)
    ratios, rest = cells[:3], cells[3:]
    pairs = "  ".join(
        f"{kind} " + " ".join(f"{value:5.1f}" for value in rest[3 * n : 3 * n + 3]) for n, kind in enumerate(PAIRS)
    )
    return f"{name:24} {len(rows):3} frames  " + " ".join(f"{ratio:5.2f}" for ratio in ratios) + f"  {pairs}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--streets", type=int, default=3, help="of each condition")
    parser.add_argument("--frames", type=int, default=2, help="of each street")
    parser.add_argument("--every", type=int, default=4, help="use every so many frames of the real drives")
    options = parser.parse_args()
    use_one_thread()
    print("medians of frames: grey / luma on asphalt, on vegetation, their ratio; residuals 50, 95 and 99 %")
    data = Path(os.environ["AUDITOR_TEST_DATA"])
    for name, path in (
        ("odometry 04", data / "kitti_odometry_04" / "sequences" / "04"),
        ("0009", drive("0009")),
        ("0001", drive("0001")),
    ):
        rig, frames = real(path)
        print(
            line(f"real: {name}", figures([f for n, f in enumerate(frames) if n % options.every == 0], rig)), flush=True
        )
    everything = []
    for place, condition in enumerate(CONDITIONS):
        rows = []
        for number in range(options.streets):
            seed, style = 5000 + 100 * place + number, list(STYLES)[number % len(STYLES)]
            made = make_drive(seed, 40, n_cameras=4, style=style, vehicle=seed, condition=condition, kinds=KINDS)
            rows += figures((made.frame(at) for at in np.linspace(2, 38, options.frames).astype(int)), made.rig)
        everything += rows
        print(line(f"streets: {condition}", rows), flush=True)
    print(line("streets: all", everything))
    plain, *spectral = (cost(**how) for how in ({}, {"kinds": ("grey",) * 3}, {"kinds": ("colour",) * 3}))
    print(
        "CPU time of a picture over that of a plain street: grey {:.2f}, colour {:.2f}".format(
            *(c / plain for c in spectral)
        )
    )


def cost(**how: Any) -> float:
    """CPU seconds of a picture; with `kinds` of a street in colour."""
    made = make_drive(7, PICTURES, condition="low sun" if how else None, **how)
    made.image(0, 1)
    started = process_time()
    for number in range(PICTURES):
        made.image(number, 1)
    return (process_time() - started) / PICTURES


if __name__ == "__main__":
    main()
