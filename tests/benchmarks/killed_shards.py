"""Shards that are killed while they write to one store on an object store: `python -m tests.benchmarks.killed_shards`.

Three shards, each on a machine of its own, measure nine recordings from an object store into a store on it. Each is
killed at three drawn moments and started again, and a share of all requests fails or is cut. Then one scan judges.
Prints how often shards were killed, what `auditor verify` says, and whether the store equals that of a scan on disk.
"""

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.making.object_stores import BUCKET, KEY, SECRET, Proxy, object_store
from tests.making.small_drives import DAY_NS, START_NS, THREE_CAMERAS, write_drive
from tests.pipeline.test_object_stores import content_of

SHARDS = 3
STORE, LOGS = f"s3://{BUCKET}/audit", f"s3://{BUCKET}/logs"
_EACH_S = 0.15
_KILLED_SHARE = 0.04


def environment(proxy: Proxy, root: Path, machine: str) -> dict[str, str]:
    named = {"AWS_ACCESS_KEY_ID": KEY, "AWS_SECRET_ACCESS_KEY": SECRET, "AWS_ENDPOINT_URL": proxy.url}
    own = {"XDG_CACHE_HOME": str(root / machine), "XDG_STATE_HOME": str(root / machine), "AWS_REGION": "us-east-1"}
    return {**os.environ, **named, **own}


def auditor(*words: object) -> list[str]:
    return [sys.executable, "-m", "auditor", *map(str, words)]


def scan(*words: object) -> list[str]:
    return auditor("scan", *words, "--pictures", "none", "--jobs", 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--recordings", type=int, default=9)
    parser.add_argument("--kills", type=int, default=3, help="of each shard")
    parser.add_argument("--failing", type=float, default=0.05, help="share of requests")
    parser.add_argument("--seed", type=int, default=3)
    options = parser.parse_args()
    drawn = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as place, object_store() as proxy:
        root = Path(place)
        (root / "logs").mkdir()
        for number in range(options.recordings):
            file = root / "logs" / f"drive_of_{chr(ord('a') + number)}.mcap"
            start_ns = START_NS + number * DAY_NS
            proxy.put(f"logs/{file.name}", write_drive(file, 3, positions_m=THREE_CAMERAS, start_ns=start_ns))
        proxy.failing = options.failing

        def started(shard: int) -> subprocess.Popen[bytes]:
            return subprocess.Popen(
                scan(LOGS, "--store", STORE, "--shard", f"{shard}/{SHARDS}", "--spool", root / "spool"),
                env=environment(proxy, root, f"machine{shard}"),
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                start_new_session=True,
            )

        running = {shard: started(shard) for shard in range(SHARDS)}
        left = dict.fromkeys(running, options.kills)
        while running:
            time.sleep(_EACH_S)
            for shard, process in [*running.items()]:
                if process.poll() == 0:
                    del running[shard]
                elif process.poll() is not None:
                    running[shard] = started(shard)
                elif left[shard] and drawn.random() < _KILLED_SHARE:
                    left[shard] -= 1
                    os.killpg(process.pid, signal.SIGKILL)
        print(f"killed {SHARDS * options.kills - sum(left.values())} times")
        env = environment(proxy, root, "last")
        for words in (scan(LOGS, "--store", STORE), auditor("verify", STORE)):
            done = subprocess.run(words, env=env, capture_output=True, text=True, check=False)
            print(f"{words[3]} ends with {done.returncode}: {done.stdout.strip().splitlines()[-1:]}")
        subprocess.run(scan(root / "logs", "--store", root / "disk"), env=env, capture_output=True, check=False)
        [mirror] = (root / "last" / "auditor" / "mirrors").glob("*-0")
        print(f"equal to a scan on disk: {content_of(mirror / 'store') == content_of(root / 'disk')}")


if __name__ == "__main__":
    main()
