"""How far matchers are from what is known, on the same pixels: share over 3 px, mean error, CPU a sample.

python -m tests.benchmarks.matcher_accuracy [--samples 10] [--weights FILE] [DRIVE...]
python -m tests.benchmarks.matcher_accuracy --streets 20 [--first 2000]
python -m tests.benchmarks.matcher_accuracy --middlebury

Drives are folders or recordings with a LiDAR; without any: KITTI's 0009, 0001 and odometry 04 in AUDITOR_TEST_DATA.
A sample is one pair of cameras of a frame, all pairs in turn; those taken are spread over the drive. Streets know every
pixel's disparity; the weights that come with auditor were trained on those of seeds from 100000 and from 300000, and on
no others. Middlebury's are cones (im2, im6) and Tsukuba (columns 3 and 4), twice as large in each direction: at half
resolution the matchers see them as they were published.
"""

import argparse
import os
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from time import process_time

import cv2
import numpy as np

from auditor.lab.training.samples import (
    RecordingSamples,
    Sample,
    SampleFiles,
    SampleTask,
    StreetSamples,
    make_samples,
    score,
)
from auditor.measurement.disparity.matchers import MatcherOptions, find_matcher

STREET_SAMPLES = 3
"""Of each street."""
ENLARGED = 2
MIDDLEBURY = (
    ("cones/im2.ppm", "cones/im6.ppm", "cones/disp2.pgm", 4.0),
    ("tsukuba/scene1.row3.col3.ppm", "tsukuba/scene1.row3.col4.ppm", "tsukuba/truedisp.row3.col3.pgm", 16.0),
)
"""Left and right picture, the left one's disparities, and their units a pixel."""

DRIVES = ("kitti_raw_2011_09_26_drive_0009", "kitti_raw_2011_09_26_drive_0001", "kitti_odometry_04")


def samples_of(drive: Path, folder: Path, count: int) -> SampleFiles:
    """At most `count` samples, from the first frame with one to the last."""
    files = make_samples(SampleTask(RecordingSamples(drive), folder, 1000), lambda *_: None).files
    return SampleFiles(files[:: -(-len(files) // count)])


def street_samples(seeds: Iterable[int], folder: Path) -> SampleFiles:
    """Some samples of each street."""
    made = (
        make_samples(SampleTask(StreetSamples(seed, STREET_SAMPLES), folder, 1000), lambda *_: None) for seed in seeds
    )
    return SampleFiles(tuple(file for one in made for file in one.files))


def middlebury_samples(folder: Path) -> list[Sample]:
    """Both pairs, enlarged; where nothing is known of a pixel its disparity is NaN."""
    found = []
    for *pictures, truth, units in MIDDLEBURY:
        left, right = (_enlarged(cv2.imread(str(folder / name)), cv2.INTER_CUBIC) for name in pictures)
        stored = _enlarged(cv2.imread(str(folder / truth), cv2.IMREAD_GRAYSCALE), cv2.INTER_NEAREST)
        found.append((left, right, np.where(stored > 0, stored * np.float32(ENLARGED / units), np.float32(np.nan))))
    return found


def _enlarged(image: np.ndarray, how: int) -> np.ndarray:
    return cv2.resize(image, None, fx=ENLARGED, fy=ENLARGED, interpolation=how)


def compare(sets: Iterable[tuple[str, Sequence[Sample]]], weights: Path | None) -> None:
    """Print a line for each set of samples and matcher."""
    network = find_matcher("psmnet", MatcherOptions(weights=weights))
    matchers = {"psmnet": network, "sgbm": find_matcher("sgbm"), "sgbm-full": find_matcher("sgbm-full")}
    print(f"psmnet: {network.settings}")
    for title, samples in sets:
        for name, matcher in matchers.items():
            started = process_time()
            found = score(matcher, samples)
            cpu_s = (process_time() - started) / len(samples)
            print(
                f"{title:32} {name:10} {len(samples)} samples, {found.pixels:,} px: "
                f"{found.over_3px_share:.1%} over 3 px, mean {found.mean_px:.2f} px, {cpu_s:.2f} CPU s a sample",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("drives", nargs="*", type=Path)
    parser.add_argument("--samples", type=int, default=1000, help="of each drive, at most")
    parser.add_argument("--weights", type=Path)
    parser.add_argument("--streets", type=int, default=0)
    parser.add_argument("--first", type=int, default=2000)
    parser.add_argument("--middlebury", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        if options.streets:
            seeds = range(options.first, options.first + options.streets)
            compare([(f"streets {seeds.start} to {seeds[-1]}", street_samples(seeds, folder))], options.weights)
        elif options.middlebury:
            data = Path(os.environ["AUDITOR_TEST_DATA"]) / "middlebury_multiview"
            names = [names[0].partition("/")[0] for names in MIDDLEBURY]
            compare([(name, [one]) for name, one in zip(names, middlebury_samples(data), strict=True)], options.weights)
        else:
            drives = options.drives or [Path(os.environ["AUDITOR_TEST_DATA"]) / name for name in DRIVES]
            compare(((drive.name, samples_of(drive, folder, options.samples)) for drive in drives), options.weights)


if __name__ == "__main__":
    main()
