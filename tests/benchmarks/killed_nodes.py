"""Two machines of a Ray cluster, one of which is killed: `python -m tests.benchmarks.killed_nodes`. Needs Ray.

Many small recordings are measured by two machines of one core each, both on this one. Once half of them are measured
the second machine is killed. Then the same once more with the command killed at a third and started again. Then by
eight shards into one store, two at a time, with the command behind them, and by `--jobs 2`. Prints recordings a second
of each, how many are missing, and whether the store has what that of `--jobs 2` has.
"""

import argparse
import os
import signal
import subprocess
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.benchmarks.killed_shards import auditor
from tests.making.small_drives import DAY_NS, START_NS, THREE_CAMERAS, write_drive
from tests.pipeline.test_object_stores import content_of

SHARDS = 8
_LOOKS_S = 0.2


def scan(logs: Path, store: Path, *words: object) -> list[str]:
    """The command that measures and leaves judging to whoever asks."""
    return auditor("scan", logs, "--store", store, "--measure-only", "--pictures", "none", *words)


def started(command: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)


def measured(store: Path) -> int:
    """How many recordings have a measurement."""
    return len(list(store.glob("measurements/*.parquet")))


def wait_until(share: float, of: int, store: Path, process: subprocess.Popen[bytes]) -> None:
    """Wait until that share is measured; raises RuntimeError where the command ends before."""
    while measured(store) < share * of:
        if process.poll() is not None:
            raise RuntimeError(f"the command ended after {measured(store)} of {of}")
        time.sleep(_LOOKS_S)


def main() -> None:
    from ray.cluster_utils import Cluster  # noqa: PLC0415 - not everybody has it

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recordings", type=int, default=200)
    count = parser.parse_args().recordings
    size = {"num_cpus": 1, "memory": 6 * 10**9, "object_store_memory": 80 * 2**20}
    with tempfile.TemporaryDirectory() as place:
        root, logs = Path(place), Path(place) / "logs"
        logs.mkdir()
        for number in range(count):
            start_ns = START_NS + number * DAY_NS
            write_drive(logs / f"drive_of_{number:03}.mcap", 2, positions_m=THREE_CAMERAS, start_ns=start_ns)

        def told(name: str, began: float, store: Path) -> None:
            missing, equal = count - measured(store), content_of(store) == content_of(root / "here")
            print(
                f"{name}: {count / (time.monotonic() - began):.1f} a second, {missing} missing, equal {equal}",
                flush=True,
            )

        began = time.monotonic()
        started(scan(logs, root / "here", "--jobs", 2)).wait()
        told("--jobs 2", began, root / "here")

        began = time.monotonic()
        with ThreadPoolExecutor(2) as two:
            shards = [scan(logs, root / "shards", "--jobs", 1, "--shard", f"{i}/{SHARDS}") for i in range(SHARDS)]
            list(two.map(lambda command: started(command).wait(), shards))
        started(scan(logs, root / "shards", "--jobs", 2)).wait()  # relates what the shards measured
        told(f"{SHARDS} shards, two at a time", began, root / "shards")

        for name, share in (("a machine killed", 0.5), ("the command killed", 1 / 3)):
            cluster = Cluster(initialize_head=True, head_node_args=size)
            node, store, began = cluster.add_node(**size), root / name.split()[1], time.monotonic()
            on_ray = scan(logs, store, "--engine", "ray", "--address", cluster.address)
            process = started(on_ray)
            wait_until(share, count, store, process)
            if name == "a machine killed":
                cluster.remove_node(node, allow_graceful=False)
                print(f"the command ends with {process.wait()}")
            else:
                os.killpg(process.pid, signal.SIGKILL)
                print(f"{measured(store)} measured as the command was killed")
                print(f"started again it ends with {started(on_ray).wait()}")
            told(name, began, store)
            cluster.shutdown()


if __name__ == "__main__":
    main()
