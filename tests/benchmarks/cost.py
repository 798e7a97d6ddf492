"""The cost of a scan: `python -m tests.benchmarks.cost`.

CPU time per frame (LiDAR and three cameras, from an MCAP file to the finished tables, one process) as a ratio to
two bare SGBM calls on the same frames, rounds interleaved; and with --memory the peak memory of `auditor scan` over a
0.5 GB and a 3 GB recording made of the same frames. Needs AUDITOR_TEST_DATA.
"""

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from statistics import median
from time import process_time

import cv2
import numpy as np

from auditor.model.frames import Frame
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from auditor.recordings import write_mcap
from tests.benchmarks.real_drives import frames

ROUNDS = 5
FRAMES = 120  # a recording of twelve seconds, the 40 frames three times over
PERIOD_NS = 10**8


def bare_sgbm_s(images: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> float:
    """CPU seconds a frame of two bare full-resolution calls, the unit of the ratios."""
    started = process_time()
    for right, middle, left in images:
        for source in (right, middle):
            matcher = cv2.StereoSGBM.create(0, 128, 5, 200, 800, mode=cv2.STEREO_SGBM_MODE_SGBM)
            matcher.compute(left, source)
    return (process_time() - started) / len(images)


def scan_s(recording: Path, folder: Path, count: int) -> float:
    """CPU seconds a frame of measuring a recording into a new store."""
    started = process_time()
    measured = measure_recording(MeasureTask(recording, folder), lambda what, done: None)
    assert measured.frames == count
    return (process_time() - started) / count


def time_per_frame(work: Path) -> None:
    """Print the ratio for each way that images are kept."""
    cv2.setNumThreads(1)
    rig, stream = frames("0009")
    kept = list(stream)
    images = [tuple(frame.images[n].pixels for n in (1, 2, 3)) for frame in kept]
    for form in ("png", "jpeg", "raw"):
        recording = work / f"{form}.mcap"
        write_mcap(recording, rig, _repeated(kept, FRAMES), image=form)
        ratios, costs = [], []
        for number in range(ROUNDS):
            bare = bare_sgbm_s(images[::4])
            cost = scan_s(recording, work / f"{form}-{number}", FRAMES)
            ratios.append(cost / bare)
            costs.append(cost)
        print(
            f"{form:>4}: {1e3 * median(costs):5.1f} ms a frame, {median(ratios):.3f} of two bare SGBM calls "
            f"({min(ratios):.3f} to {max(ratios):.3f})"
        )


def peak_memory(work: Path) -> None:
    """Print the peak memory of a whole scan for two lengths of recording."""
    for gigabytes in (0.5, 3.0):
        rig, stream = frames("0009", all_cameras=True)
        kept = list(islice(stream, 10))
        size = sum(image.pixels.nbytes for image in kept[0].images.values()) + kept[0].cloud.xyz_m.nbytes
        recording = work / "long.mcap"
        write_mcap(recording, rig, _repeated(kept, round(gigabytes * 1e9 / size)), image="raw", compression="none")
        command = [
            sys.executable,
            "-m",
            "auditor",
            "scan",
            str(recording),
            "--store",
            str(work / f"{gigabytes}"),
            "--jobs",
            "1",
        ]
        done = subprocess.run([sys.executable, "-c", _PEAK, *command], capture_output=True, text=True, check=True)
        print(f"{recording.stat().st_size / 1e9:.2f} GB: peak {int(done.stdout.split()[-1]) / 1024:.0f} MB")
        recording.unlink()


_PEAK = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""


def _repeated(kept: list[Frame], count: int) -> Iterator[Frame]:
    for number in range(count):
        frame = kept[number % len(kept)]
        stamp = kept[0].stamp_ns + number * PERIOD_NS
        yield replace(
            frame,
            number=number,
            stamp_ns=stamp,
            cloud=replace(frame.cloud, stamp_ns=stamp),
            images={n: replace(image, stamp_ns=stamp) for n, image in frame.images.items()},
        )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--memory", action="store_true", help="also the peak memory (writes a 3 GB file)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        time_per_frame(Path(folder))
        if options.memory:
            peak_memory(Path(folder))


if __name__ == "__main__":
    main()
