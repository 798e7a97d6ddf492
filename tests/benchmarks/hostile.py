"""The table of hostile files: `python -m tests.benchmarks.hostile`.

For each: messages recovered, CPU seconds, peak memory above the idle process, and what was said.
"""

import tempfile
from pathlib import Path
from time import process_time

from tests.recordings.hostile import HOSTILE
from tests.recordings.reading_all import read_all
from tests.recordings.test_hostile import FORGET_PEAK, memory_mb


def main() -> None:
    """Measure and print."""
    worst_s = worst_mb = 0.0
    for hostile in HOSTILE:
        with tempfile.TemporaryDirectory() as folder:
            path = hostile.make(Path(folder))
            FORGET_PEAK.write_text("5")
            idle_mb, started = memory_mb("VmRSS"), process_time()
            outcome = read_all(path)
            seconds, peak_mb = process_time() - started, memory_mb("VmHWM") - idle_mb
        worst_s, worst_mb = max(worst_s, seconds), max(worst_mb, peak_mb)
        told = outcome.told.replace(folder, "")[:90]
        print(f"{hostile.name:55} {outcome.messages:8} {seconds:5.2f} s {peak_mb:4.0f} MB  {told}")
    print(f"{len(HOSTILE)} files, at most {worst_s:.2f} s and {worst_mb:.0f} MB")


if __name__ == "__main__":
    main()
