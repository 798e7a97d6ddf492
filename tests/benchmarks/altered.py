"""Single flipped bits over all tables and pictures of a store: `python -m tests.benchmarks.altered --count 2000`.

Each bit is flipped in the small kept store, with the file's time set back in every other one. `auditor verify` and
`auditor report` run on it, and `auditor query` on every so many: with --verify where the time was set back. Prints how
often each found it, refused, or named it, and whatever ended in a traceback. Everything runs in processes of its own,
a hundred flips each: one that dies is counted.
"""

import argparse
import contextlib
import io
import multiprocessing
import os
import sys
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

from auditor.cli import run
from auditor.store.schema import SCHEMA_VERSION
from tests.making.bit_flips import Flip, draw_flips, flipped
from tests.store.kept import unpack

_TOGETHER = 100
_DEFECTS = ("Traceback", "defect of auditor", "auditor failed on it")


def said(*words: object) -> tuple[int, str]:
    """The exit code of a command and what it printed."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        code = run(list(map(str, words)))
    return code, printed.getvalue()


def tried(folder: Path, flips: list[Flip], query_every: int, first: int) -> Counter[str]:
    """What became of some flips."""
    found: Counter[str] = Counter()
    for number, flip in enumerate(flips, start=first):
        with flipped(flip) as place:
            found["flips"] += 1
            found["silent"] += flip.silent
            code, text = said("verify", folder)
            found["verify: found"] += code == 1 and f"{place}: " in text
            traces = text
            code, text = said("report", "--store", folder)
            found["report: refused"] += code == 2 and len(text.splitlines()) == 1
            traces += text
            if number % query_every == 0:
                how = ["--verify"] if flip.silent else []
                for query in ("summary", "incidents", "thresholds"):
                    _, text = said("query", query, "--store", folder, *how)
                    found["queries"] += 1
                    found["query: named"] += place in text
                    traces += text
                    if flip.silent:  # not known to have changed: whatever it answers, it is no traceback
                        traces += said("query", query, "--store", folder)[1]
            if any(word in traces for word in _DEFECTS):
                found["tracebacks"] += 1
                print(f"TRACEBACK {place} bit {flip.bit}\n{traces[-2000:]}", file=sys.stderr)
    return found


def _work(folder: Path, flips: list[Flip], query_every: int, first: int, results: "multiprocessing.Queue") -> None:  # type: ignore[type-arg]
    results.put(tried(folder, flips, query_every, first))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0, help="leave out those before, as where a run was interrupted")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--query-every", type=int, default=10)
    options = parser.parse_args()
    started, found = perf_counter(), Counter[str]()
    with TemporaryDirectory() as place:
        os.environ["XDG_CACHE_HOME"] = place
        folder, _ = unpack(SCHEMA_VERSION, Path(place))
        said("query", "summary", "--store", folder)
        flips = list(draw_flips(folder, options.count, options.seed))
        for first in range(options.first, len(flips), _TOGETHER):
            results: multiprocessing.Queue = multiprocessing.Queue()  # type: ignore[type-arg]
            part = flips[first : first + _TOGETHER]
            process = multiprocessing.Process(target=_work, args=[folder, part, options.query_every, first, results])
            process.start()
            process.join()
            if process.exitcode == 0:
                found += results.get()
            else:
                found["processes that died"] += 1
            print(f"{perf_counter() - started:6.0f} s  {dict(found)}", flush=True)


if __name__ == "__main__":
    main()
