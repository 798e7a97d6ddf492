"""kill -9 at drawn moments of packing: `python -m tests.benchmarks.killed_packing --count 30`.

A store of many small files is packed by a process that kills itself as it opens, locks, renames or removes a file,
the number of which is drawn from all that packing does; every other time after an earlier packing, so that packs are
made anew. After each kill all rows are read, and again after a packing that nobody kills. Prints how often anything was
lost, there twice, otherwise than before, or not as `auditor verify` knows it.
"""

import argparse
import multiprocessing
import os
import random
import shutil
import signal
import sys
from collections import Counter
from hashlib import sha256
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from auditor.store.maintenance.verify import verify
from auditor.store.packs.index import PACKED
from auditor.store.packs.packing import pack
from auditor.store.queries import run_sql
from auditor.store.store import Store
from auditor.store.tables import read_rows
from tests.benchmarks.fleet import OF_FRAMES, fill

_CONTEXT = multiprocessing.get_context("forkserver")
_TOUCHES = frozenset({"open", "os.rename", "os.remove", "fcntl.flock"})
_COUNTED = ("recordings", "measurements", "judgements", "frames", "verdicts", "poses")


def told(folder: Path) -> dict[str, str]:
    """All that a store has by table and id, and what SQL counts in it."""
    store = Store.open(folder)
    found = {}
    for table in PACKED:
        for row_id in store.ids(table):
            rows = read_rows(table, store.source(table, row_id))
            found[f"{table} {row_id}"] = sha256(repr(rows).encode()).hexdigest()
    for table in _COUNTED:
        found[table] = repr(run_sql(store, f"SELECT count(*) FROM {table}").to_pylist())
    return found


def packed(folder: Path, dies_at: int, told_to: "Connection[Any, Any]") -> None:
    """Pack a store, and be killed at the touch of a file of this number; tell how many there were."""
    touches = 0

    def touched(event: str, _: object) -> None:
        nonlocal touches
        if event in _TOUCHES:
            touches += 1
            if touches == dies_at:
                os.kill(os.getpid(), signal.SIGKILL)

    store = Store.open(folder)
    sys.addaudithook(touched)
    pack(store)
    told_to.send(touches)


def run_packing(folder: Path, dies_at: int = 0) -> int:
    """Pack a store in a process of its own; how many touches of files it took, 0 where it was killed."""
    reader, writer = _CONTEXT.Pipe(duplex=False)
    process = _CONTEXT.Process(target=packed, args=(folder, dies_at, writer))
    process.start()
    process.join()
    return reader.recv() if reader.poll() else 0


def looked_at(folder: Path, before: dict[str, str]) -> Counter[str]:
    """What is found after a kill, and after the packing that follows it."""
    found: Counter[str] = Counter()
    for when in ("after the kill", "after the next packing"):
        now = told(folder)
        found[f"lost {when}"] += len(before.keys() - now.keys())
        found[f"otherwise {when}"] += sum(now[key] != value for key, value in before.items() if key in now)
        found[f"more {when}"] += len(now.keys() - before.keys())
        grave = verify(Store.open(folder)).grave
        found[f"not as written {when}"] += len(grave)
        for problem in grave:
            print(f"  {when}: {problem}", flush=True)
        if when == "after the kill":
            pack(Store.open(folder))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=30)
    parser.add_argument("--recordings", type=int, default=30)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    _CONTEXT.set_forkserver_preload(["auditor.store.packs.packing"])
    draw, total = random.Random(options.seed), Counter[str]()
    tables = [*OF_FRAMES[1:], "verdicts"]
    with TemporaryDirectory() as place:
        stores = {
            "small files": Path(place) / "small" / "audit",
            "packs and small files": Path(place) / "both" / "audit",
        }
        half = options.recordings // 2
        fill(stores["small files"], half, 20, tables)
        shutil.copytree(stores["small files"], stores["packs and small files"])
        pack(Store.open(stores["packs and small files"]))
        for folder in stores.values():
            fill(folder, options.recordings - half, 20, tables, half)
        before = {kind: told(folder) for kind, folder in stores.items()}
        tried, touches = Path(place) / "tried" / "audit", dict[str, int]()
        for number in range(options.count):
            kind = list(stores)[number % len(stores)]
            if kind not in touches:
                shutil.copytree(stores[kind], tried)
                touches[kind] = run_packing(tried)
                shutil.rmtree(tried)
            shutil.copytree(stores[kind], tried)
            dies_at = draw.randint(1, touches[kind])
            total["killed"] += run_packing(tried, dies_at) == 0
            total.update(looked_at(tried, before[kind]))
            print(f"{number + 1:3} {kind:22} at {dies_at:5} of {touches[kind]:5} touches of files", flush=True)
            shutil.rmtree(tried)
    for what in sorted(total):
        print(f"{what}: {total[what]}")


if __name__ == "__main__":
    main()
