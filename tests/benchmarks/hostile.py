"""The table of hostile files: `python -m tests.benchmarks.hostile [--scan]`.

For each: messages recovered, CPU seconds, peak memory above the idle process, and the damage reported. With --scan all
of them, and a good recording among them, go through one `auditor scan`: its line for each, and how it ends.
"""

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter, process_time

from tests.making.hostile_packed import ALL, forget_peak, memory_mb
from tests.making.reading_all import read_all
from tests.making.small_drives import write_drive


def read_each() -> None:
    """Read every file by itself, measure and print."""
    worst_s = worst_mb = 0.0
    for hostile in ALL:
        with tempfile.TemporaryDirectory() as folder:
            path = hostile.make(Path(folder))
            forget_peak()
            idle_mb, started = memory_mb("VmRSS"), process_time()
            outcome = read_all(path)
            seconds, peak_mb = process_time() - started, memory_mb("VmHWM") - idle_mb
        worst_s, worst_mb = max(worst_s, seconds), max(worst_mb, peak_mb)
        damage = outcome.text.replace(folder, "")[:90]
        print(f"{hostile.name:55} {outcome.messages:8} {seconds:5.2f} s {peak_mb:4.0f} MB  {damage}")
    print(f"{len(ALL)} files, at most {worst_s:.2f} s and {worst_mb:.0f} MB")


def scan_all() -> None:
    """Scan all files by one command, and print its line for each."""
    with tempfile.TemporaryDirectory() as above:
        folder = Path(above)
        paths = {}
        for number, hostile in enumerate(ALL):
            (folder / f"{number:03d}").mkdir()
            paths[hostile.make(folder / f"{number:03d}")] = hostile.name
        good = write_drive(folder / "good.mcap", count=5)
        first, *others = map(str, paths)
        command = [sys.executable, "-m", "auditor", "scan", first, str(good), *others]
        started = perf_counter()
        done = subprocess.run(
            [*command, "--measure-only", "--store", str(folder / "audit")], capture_output=True, text=True, check=False
        )
        lines = done.stderr.splitlines()
        silent = 0
        for path, name in paths.items():
            found = [line for line in lines if str(path) in line]
            silent += not found
            print(f"{name:55} {len(found)} line: {(found or ['none'])[0].replace(above, '')[:120]}")
        seconds = perf_counter() - started
        ending = next(line for line in lines if str(good) in line).rpartition(":")[2].strip()
        traces = done.stderr.count("Traceback")
        print(
            f"{len(paths)} files, {silent} without a line, {traces} tracebacks, exit {done.returncode}, {seconds:.0f} s"
        )
        print(f"the good recording among them: {ending}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scan", action="store_true", help="all files through one scan")
    (scan_all if parser.parse_args().scan else read_each)()


if __name__ == "__main__":
    main()
