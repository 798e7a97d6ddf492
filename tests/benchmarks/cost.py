"""What a whole scan costs: `python -m tests.benchmarks.cost`.

Recordings of real frames are scanned by the command line into fresh stores, judging included. Printed are the CPU
seconds of all its processes a frame, as a ratio to two bare full-resolution SGBM calls on frames of the same drive in
the same round, and how often the recording was read. What a scan of the first frames alone takes is what any scan
takes to begin; the rest is what a further frame costs. With --memory the peak memory of a scan over a 0.5 GB and a 3 GB
recording made of the same frames. With --check a short run alone, which ends with 1 where a scan costs far more than it
did when the bounds were set: CI does this. Needs AUDITOR_TEST_DATA.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median
from time import process_time

import cv2

from auditor.measurement.disparity.half_resolution import grey
from auditor.model.arrays import Image
from auditor.model.frames import Frame
from auditor.model.rig import Rig
from auditor.recordings import write_mcap
from auditor.recordings.writers.messages import Form
from tests.benchmarks.clean_statistics import alone
from tests.benchmarks.real_drives import frames

DRIVE = "0009"
PERIOD_NS = 10**8
BARE_FRAMES = 6
BEGINNING = 3
"""So many frames make a scan that ends as any other does."""

CHECKED_FRAMES = 23
CHECKED_ROUNDS = 2
MOST_TO_BEGIN, MOST_A_FRAME = 20.0, 1.0
"""Pairs of bare calls: 1.6 times what a scan took when they were set, 12 to begin and 0.61 a further frame.

So short a recording is read through for its survey as well; a long one takes less a frame.
"""

ENVIRONMENT = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
"""As users have it: what Python has compiled once it finds again."""

SENSORS = ("3 cameras", "4 cameras", "1 camera")
FORMS: tuple[Form, ...] = ("raw", "jpeg", "png")


@dataclass(frozen=True)
class Cost:
    """What a process took with all that it started: CPU seconds, and bytes that were read, of files and pipes."""

    cpu_s: float
    read_bytes: int

    @classmethod
    def so_far(cls) -> "Cost":
        """Of this process's children that have ended, and of those of theirs."""
        used = getrusage(RUSAGE_CHILDREN)
        [read] = [line.split()[1] for line in Path("/proc/self/io").read_text().splitlines() if "rchar" in line]
        return cls(used.ru_utime + used.ru_stime, int(read))

    def since(self, before: "Cost") -> "Cost":
        """What came since then; what this process read itself is a few kilobytes."""
        return Cost(self.cpu_s - before.cpu_s, self.read_bytes - before.read_bytes)


def bare_s(images: Sequence[tuple[Image, ...]]) -> float:
    """CPU seconds a frame of two bare full-resolution calls, the unit of the ratios."""
    started = process_time()
    for *sources, reference in images:
        for source in sources:
            matcher = cv2.StereoSGBM.create(0, 128, 5, 200, 800, mode=cv2.STEREO_SGBM_MODE_SGBM)
            matcher.compute(reference, source)
    return (process_time() - started) / len(images)


def cost_of(*arguments: str) -> Cost:
    """What one run of the command line takes; whatever it finds."""
    before = Cost.so_far()
    command = [sys.executable, "-m", "auditor", *arguments]
    done = subprocess.run(command, capture_output=True, check=False, env=ENVIRONMENT)
    if done.returncode not in {0, 1, 3, 4}:
        raise RuntimeError(done.stderr.decode())
    return Cost.so_far().since(before)


def recorded(sensors: str, count: int) -> tuple[Rig, list[Frame]]:
    """A drive as often over as it takes for so many frames, with some of its sensors."""
    rig, stream = frames(DRIVE, all_cameras=sensors != "3 cameras", colour=True)
    kept = list(stream)
    if sensors == "1 camera":
        rig = rig.lone(rig.n)
        kept = [alone(frame, len(frame.images)) for frame in kept]
    return rig, list(_repeated(kept, count))


def scans(options: argparse.Namespace, work: Path) -> None:
    """Print a line for each set of sensors and form of images."""
    cv2.setNumThreads(1)
    _, stream = frames(DRIVE)
    images = [tuple(grey(one.images[n].pixels) for n in (1, 2, 3)) for one in list(stream)[:: 40 // BARE_FRAMES]]
    for sensors in options.sensors:
        rig, kept = recorded(sensors, options.frames)
        for form in options.forms:
            begun, whole = work / f"begun-{form}.mcap", work / f"{form}.mcap"
            write_mcap(begun, rig, kept[:BEGINNING], image=form)
            write_mcap(whole, rig, kept, image=form)
            cost_of("scan", str(begun), "--store", str(work / "compiled"), "--jobs", "1", "--measure-again")
            _compare(f"{sensors}, {form}", begun, whole, images, options, work)
            begun.unlink()
            whole.unlink()


def _compare(
    name: str,
    begun: Path,
    whole: Path,
    images: Sequence[tuple[Image, ...]],
    options: argparse.Namespace,
    work: Path,
) -> None:
    ratios, further, read, seconds = [], [], [], []
    more, size = options.frames - BEGINNING, whole.stat().st_size - begun.stat().st_size
    for _ in range(options.rounds):
        with tempfile.TemporaryDirectory(dir=work) as folder:
            unit = bare_s(images)
            first, all_of_it = (
                cost_of("scan", str(path), "--store", f"{folder}/{path.stem}", "--jobs", "1") for path in (begun, whole)
            )
            rest = all_of_it.since(first)
        unit = (unit + bare_s(images)) / 2
        ratios.append(all_of_it.cpu_s / options.frames / unit)
        further.append(rest.cpu_s / more / unit)
        seconds.append((1e3 * all_of_it.cpu_s / options.frames, first.cpu_s, 1e3 * unit))
        read.append(rest.read_bytes / size)
    ms, start_s, unit_ms = (median(values) for values in zip(*seconds, strict=True))
    print(
        f"{name:16} {median(ratios):.3f} ({min(ratios):.3f} to {max(ratios):.3f}) of two bare calls of {unit_ms:.0f} "
        f"ms: {ms:.0f} ms a frame; a further frame {median(further):.3f}; to begin {start_s:.2f} s; "
        f"read {median(read):.2f} times {size / 1e6:.0f} MB",
        flush=True,
    )


def check(work: Path) -> bool:
    """Print what a short scan costs, each the least of some rounds in turn; whether it is within the bounds.

    The least, since what else a machine does only adds; CPU seconds and a ratio, since machines differ.
    """
    cv2.setNumThreads(1)
    rig, kept = recorded("3 cameras", CHECKED_FRAMES)
    images = [tuple(grey(one.images[n].pixels) for n in (1, 2, 3)) for one in kept[::4]]
    paths = work / "begun.mcap", work / "whole.mcap"
    for path, count in zip(paths, (BEGINNING, CHECKED_FRAMES), strict=True):
        write_mcap(path, rig, kept[:count])
    units, begun, whole = [], [], []
    for number in range(CHECKED_ROUNDS):
        units.append(bare_s(images))
        for path, costs in zip(paths, (begun, whole), strict=True):
            costs.append(
                cost_of("scan", str(path), "--store", str(work / f"{path.stem}-{number}"), "--jobs", "1").cpu_s
            )
    unit = min(units)
    to_begin, a_frame = min(begun) / unit, (min(whole) - min(begun)) / (CHECKED_FRAMES - BEGINNING) / unit
    print(
        f"a scan takes {to_begin:.1f} pairs of bare calls of {1e3 * unit:.0f} ms to begin (at most {MOST_TO_BEGIN:g}), "
        f"and {a_frame:.2f} a further frame of a LiDAR and 3 cameras (at most {MOST_A_FRAME:g})"
    )
    return to_begin <= MOST_TO_BEGIN and a_frame <= MOST_A_FRAME


def inspections(options: argparse.Namespace, work: Path) -> None:
    """Print what `inspect`, `--help` and a question cost, and how often `inspect` reads a recording."""
    rig, kept = recorded("3 cameras", options.frames)
    begun, whole = work / "begun.mcap", work / "whole.mcap"
    write_mcap(begun, rig, kept[:BEGINNING])
    write_mcap(whole, rig, kept)
    size = whole.stat().st_size - begun.stat().st_size
    first, all_of_it = cost_of("inspect", str(begun)), cost_of("inspect", str(whole))
    read = all_of_it.since(first).read_bytes / size
    print(f"inspect: {all_of_it.cpu_s:.2f} CPU s, reads {read:.2f} times {size / 1e6:.0f} MB")
    cost_of("scan", str(begun), "--store", str(work / "asked"), "--jobs", "1")
    for name, arguments in (("help", ["--help"]), ("question", ["query", "incidents", "--store", str(work / "asked")])):
        print(f"{name}: {median(cost_of(*arguments).cpu_s for _ in range(options.rounds)):.2f} CPU s")


def peak_memory(work: Path) -> None:
    """Print the peak memory of a whole scan for two lengths of recording."""
    for gigabytes in (0.5, 3.0):
        rig, stream = frames(DRIVE, all_cameras=True)
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


def _repeated(kept: Sequence[Frame], count: int) -> Iterator[Frame]:
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


def main() -> int:
    """Measure and print; 1 where a check finds that a scan costs too much."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--sensors", nargs="+", choices=SENSORS, default=SENSORS)
    parser.add_argument("--forms", nargs="+", choices=FORMS, default=FORMS)
    parser.add_argument("--frames", type=int, default=120, help="of a recording: 40 frames of a drive, over and over")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--memory", action="store_true", help="also the peak memory (writes a 3 GB file)")
    parser.add_argument("--check", action="store_true", help="a short run that fails far beyond the bounds")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        if options.check:
            return 0 if check(Path(folder)) else 1
        scans(options, Path(folder))
        inspections(options, Path(folder))
        if options.memory:
            peak_memory(Path(folder))
    return 0


if __name__ == "__main__":
    sys.exit(main())
