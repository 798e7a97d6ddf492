"""A scan on a cluster of Ray.

ray job submit -- python ray_scan.py 's3://bucket/fleet/**/*.mcap' s3://bucket/audit

The store is an address, or a folder that all machines reach. Where the scan is killed, the same command goes on. As a
command line: auditor scan ... --store ... --engine ray --address auto
"""

import sys

import auditor

if __name__ == "__main__":
    recordings, store = sys.argv[1:]
    found = []
    for one in auditor.scan(recordings, store=store, engine="ray"):
        if one.error is not None:
            print(one.error)
        elif one.found:
            found.append(one.recording)
    print(f"{len(found)} recordings with findings", *found, sep="\n")
