"""kill -9 at drawn moments of commands on a store: `python -m tests.benchmarks.killed --count 50 [--only refresh]`.

Scan, judge, calibrate, refresh, report, compact and verify run once undisturbed, to know how long each takes; then
they are killed at moments drawn from that time, every other time with all workers at once. After each kill the chains
are whole or end in one open entry, verify finds no file that is not as it was written, one calibration is in force
and can be read, and the next run closes what was open. Each refresh finds one clean drive more than the one before,
so that it has a version to put in force. Prints what was found of each command.
"""

import argparse
import contextlib
import io
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from pathlib import Path
from tempfile import TemporaryDirectory

from auditor.cli import run
from auditor.store.log.chains import read_chains
from auditor.store.log.runs import logged
from auditor.store.maintenance.verify import verify
from auditor.store.store import Store
from auditor.store.versions.history import calibrations_in_force, histories
from tests.making.fleets import add_drive
from tests.making.small_drives import START_NS, THREE_CAMERAS, write_drive

_MINUTE_NS = 60 * 10**9


def commands(folder: Path) -> dict[str, list[str]]:
    """The commands by their verbs; each writes even where the store has it all."""
    clean, attacked = str(folder / "clean.mcap"), str(folder / "attacked.mcap")
    return {
        "scan": ["scan", attacked, clean, "--measure-again", "--jobs", "2"],
        "judge": ["judge", "-r", "0.02"],
        "calibrate": ["calibrate", clean, "--measure-again", "--jobs", "1"],
        "refresh": ["refresh"],
        "report": ["report"],
        "compact": ["store", "compact", str(folder / "audit")],
        "verify": ["verify", str(folder / "audit")],
    }


def started(words: list[str], store: Path) -> subprocess.Popen[bytes]:
    """A command on a store, in a session of its own."""
    where = [] if words[0] in {"verify", "store"} else ["--store", str(store)]
    command = [sys.executable, "-m", "auditor", *words, *where]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)


def killed(words: list[str], store: Path, after_s: float, *, together: bool) -> bool:
    """Kill a command after a time; False where it had ended before."""
    process = started(words, store)
    time.sleep(after_s)
    alive = process.poll() is None
    with contextlib.suppress(ProcessLookupError):
        if together:
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()
    process.wait()
    time.sleep(0.5)  # workers end when they see that their parent is gone
    return alive


def add_clean(store: Store, numbers: range) -> None:
    """Drives of a small fleet whose statistics are drawn, of one day each."""
    for number in numbers:
        day = number + 12
        add_drive(store, f"clean {day}.mcap", seed=1000 + day, vehicle=f"car{day % 4}", day=day)


def looked_at(store: Store) -> Counter[str]:
    """What is found after a kill, and after the next run."""
    found: Counter[str] = Counter()
    found["chains broken"] += any(chain.problems for chain in read_chains(store.folder))
    after = verify(store)
    found["files not as written"] += bool(after.grave)
    found["open entries"] += len(after.open_runs)
    found["not one in force"] += len(calibrations_in_force(store)) != len(histories(store))
    found["several open"] += len(after.open_runs) > 1
    found["left by killed runs"] += len(after.problems) - len(after.grave)
    for problem in after.grave:
        print(f"  {problem}", file=sys.stderr)
    with logged(store.folder):
        pass
    closed = verify(store)
    found["not closed by the next run"] += bool(closed.open_runs)
    found["files not as written"] += bool(closed.grave)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", choices=list(commands(Path())))
    options = parser.parse_args()
    draw, table = random.Random(options.seed), defaultdict[str, Counter[str]](Counter)
    with TemporaryDirectory() as place:
        folder = Path(place).resolve()
        write_drive(folder / "clean.mcap", 10, seed=1, positions_m=THREE_CAMERAS)
        write_drive(
            folder / "attacked.mcap",
            10,
            seed=1,
            positions_m=THREE_CAMERAS,
            start_ns=START_NS + _MINUTE_NS,
            attacked={2: range(3, 8)},
        )
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            run(["calibrate", str(folder / "clean.mcap"), "--store", str(folder / "audit"), "--jobs", "1"])
        store, takes_s = Store.open(folder / "audit"), {}
        add_clean(store, range(-12, 0))
        for verb, words in commands(folder).items():
            if options.only and verb not in options.only:
                continue
            begun = time.perf_counter()
            started(words, store.folder).wait()
            takes_s[verb] = time.perf_counter() - begun
        for number in range(options.count):
            verb = list(takes_s)[number % len(takes_s)]
            if verb == "refresh":
                add_clean(store, range(number, number + 1))
            moves = sum(len(one.moves) for one in histories(store))
            after_s = draw.uniform(0.15, 1.0) * takes_s[verb]
            table[verb]["kills"] += killed(commands(folder)[verb], store.folder, after_s, together=bool(number % 2))
            table[verb]["runs"] += 1
            table[verb] += looked_at(store)
            table[verb]["put in force"] += sum(len(one.moves) for one in histories(store)) - moves
            print(f"{number + 1:3} {verb:10} after {after_s:5.2f} s", flush=True)
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            for words in commands(folder).values():
                run([*words, *([] if words[0] in {"verify", "store"} else ["--store", str(store.folder)])])
        last = verify(store)
        print(f"after all commands once more: {[*map(str, last.problems)] or 'everything is as it was written'}")
    for verb, found in table.items():
        print(f"{verb:10} {dict(found)}")


if __name__ == "__main__":
    main()
