"""How far matchers are from the LiDAR on real drives, on the same pixels: share over 3 px, mean error, CPU a sample.

python -m tests.benchmarks.matcher_accuracy [--samples 10] [--weights FILE] [DRIVE...]

Drives are folders or recordings with a LiDAR; without any: KITTI's 0009, 0001 and odometry 04 in AUDITOR_TEST_DATA.
A sample is one pair of cameras of a frame, all pairs in turn; those taken are spread over the drive.
"""

import argparse
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import process_time

from auditor.lab.training.samples import Recorded, SampleFiles, SampleTask, make_samples
from auditor.measurement.disparity.matchers import MatcherOptions, find_matcher
from auditor.measurement.disparity.matchers.scoring import score

DRIVES = ("kitti_raw_2011_09_26_drive_0009", "kitti_raw_2011_09_26_drive_0001", "kitti_odometry_04")


def samples_of(drive: Path, folder: Path, count: int) -> SampleFiles:
    """At most `count` samples, from the first frame with one to the last."""
    files = make_samples(SampleTask(Recorded(drive), folder, 1000), lambda *_: None).files
    return SampleFiles(files[:: -(-len(files) // count)])


def compare(drives: Sequence[Path], count: int, weights: Path | None) -> None:
    """Print a line for each drive and matcher."""
    network = find_matcher("psmnet", MatcherOptions(weights=weights))
    matchers = {"psmnet": network, "sgbm": find_matcher("sgbm"), "sgbm-full": find_matcher("sgbm-full")}
    print(f"psmnet: {network.settings}")
    with tempfile.TemporaryDirectory() as folder:
        for drive in drives:
            samples = samples_of(drive, Path(folder), count)
            for name, matcher in matchers.items():
                started = process_time()
                found = score(matcher, samples)
                cpu_s = (process_time() - started) / len(samples)
                print(
                    f"{drive.name:32} {name:10} {len(samples)} samples, {found.pixels:,} px: "
                    f"{found.over_3px_share:.1%} over 3 px, mean {found.mean_px:.2f} px, {cpu_s:.2f} CPU s a sample",
                    flush=True,
                )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("drives", nargs="*", type=Path)
    parser.add_argument("--samples", type=int, default=1000, help="of each drive, at most")
    parser.add_argument("--weights", type=Path)
    options = parser.parse_args()
    drives = options.drives or [Path(os.environ["AUDITOR_TEST_DATA"]) / name for name in DRIVES]
    compare(drives, options.samples, options.weights)


if __name__ == "__main__":
    main()
