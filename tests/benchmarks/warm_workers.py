"""What a process costs beside measuring its recording: `python -m tests.benchmarks.warm_workers --recordings 10`.

Small drives of a few frames are measured, each in a process of its own that is forked from one that has imported the
modules which every recording needs (`auditor.pipeline.warm`), or the measuring alone. Prints CPU seconds a recording of
both, by turns, and their ratio.
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from auditor.model.settings import MeasureSettings
from auditor.pipeline import fork_server, workers
from auditor.pipeline.many import find_batch
from auditor.pipeline.measure import measure_recording
from auditor.pipeline.measured import MeasureTask
from tests.making.small_drives import START_NS, THREE_CAMERAS, write_drive

WARM, COLD = "auditor.pipeline.warm", "auditor.pipeline.measure"
_APART_NS = 60 * 10**9


def seconds_of(task: MeasureTask, progress: workers.Progress) -> float:
    """The CPU seconds of a process that measures one recording."""
    measure_recording(task, progress)
    return time.process_time()


def measured(folder: Path, preloaded: str) -> list[float]:
    """The CPU seconds of each recording of a folder, all measured into a new store."""
    fork_server._PRELOADED = [preloaded]
    with TemporaryDirectory() as place:
        batch = find_batch([folder], Path(place) / "audit", MeasureSettings(jobs=1))
        tasks = [replace(task, again=True) for task in batch.tasks]
        outcomes = workers.run_all(seconds_of, tasks, 1, lambda *_: None, lambda _: workers.Limits())
        return [outcome.result or 0.0 for outcome in outcomes]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recordings", type=int, default=10)
    parser.add_argument("--frames", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--one", nargs=2, metavar=("FOLDER", "MODULE"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measured(Path(options.one[0]), options.one[1])))
        return
    with TemporaryDirectory() as place:
        for number in range(options.recordings):
            start_ns = START_NS + number * _APART_NS
            path = Path(place) / f"{number}.mcap"
            write_drive(path, options.frames, seed=number, positions_m=THREE_CAMERAS, start_ns=start_ns)
        found: dict[str, list[float]] = {WARM: [], COLD: []}
        for _ in range(options.rounds):
            for module, those in found.items():
                command = [sys.executable, "-m", "tests.benchmarks.warm_workers", "--one", place, module]
                those.extend(json.loads(subprocess.run(command, check=True, capture_output=True).stdout))
        for module, seconds in found.items():
            print(f"{module}: {median(seconds):.3f} CPU s a recording of {options.frames} frames")
        print(f"ratio {median(found[COLD]) / median(found[WARM]):.2f}")


if __name__ == "__main__":
    main()
