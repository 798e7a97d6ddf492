"""A scan in shards, one task of Ray each.

ray job submit -- python ray_scan.py 's3://bucket/fleet/**/*.mcap' /shared/audit

The store is a folder that all nodes reach, or an address such as s3://bucket/audit.
A task whose node is lost is run again, and goes on where it was.
"""

import sys

import ray

import auditor

SHARDS = 8


@ray.remote(num_cpus=2, max_retries=3)
def measure(address: str, store: str, shard: str) -> list[str]:
    """Measure one shard; gives a line for each recording that could not be."""
    scanned = auditor.scan(address, store=store, shard=shard, jobs=2)
    return [str(one.error) for one in scanned if one.error is not None]


if __name__ == "__main__":
    address, store = sys.argv[1:]
    ray.init()
    for lines in ray.get([measure.remote(address, store, f"{number}/{SHARDS}") for number in range(SHARDS)]):
        print(*lines, sep="\n", end="\n" if lines else "")
    found = [one.recording for one in auditor.scan(address, store=store) if one.found]  # judges, and reads nothing
    print(f"{len(found)} recordings with findings", *found, sep="\n")
