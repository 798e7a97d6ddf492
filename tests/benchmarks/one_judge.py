"""Does an evaluation give the verdicts of a scan? `python -m tests.benchmarks.one_judge [--frames 25] [--every 12]`.

The first frames of drive 0009 of the folder AUDITOR_TEST_DATA (LiDAR, cam1, cam3, reference cam2), by thresholds of
drive 0001 at r = 1 %. All cases of `auditor evaluate` for each so many-th frame, and of the first interval, is
compared with `auditor scan` of copies that are attacked alike: the kind of verdict, the sensors it names, causes,
and the incident that it belongs to. A scan cannot repeat experiments that measure a single triple (sensitivity).
"""

import argparse
import os
import tempfile
from collections import Counter
from itertools import islice
from pathlib import Path

from auditor.lab.evaluation import experiments_of
from auditor.recordings import write_mcap
from tests.benchmarks.real_drives import frames
from tests.making.attacked_copies import APART, compare, same


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=25)
    parser.add_argument("--every", type=int, default=APART)
    options = parser.parse_args()
    patterns = tuple(sorted((Path(os.environ["AUDITOR_TEST_DATA"]) / "laser_patterns").rglob("*.png"))[:1])
    counts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for number in ("0009", "0001"):
            rig, stream = frames(number, colour=True)
            write_mcap(folder / f"{number}.mcap", rig, islice(stream, options.frames), image="raw")
        paths = folder / "0009.mcap", folder / "0001.mcap"
        for one in compare(folder, *paths, experiments_of(patterns), every=options.every, patterns=patterns):
            agree = same(one.evaluated, one.scanned)
            counts.update([f"{one.experiment}, {one.attack}", "all"])
            counts.update([f"verdict {one.scanned.kind}", f"incident {one.scanned.finding or 'none'}"])
            counts["differ"] += not agree
            if not agree:
                print(one)
    for name, count in counts.items():
        print(f"{name:40} {count:5}")


if __name__ == "__main__":
    main()
