"""How long queries take: `python -m tests.benchmarks.queries [--frames 1000000] [--cameras 3]`.

Ten recordings, five of them labelled, made with the store's own writers; wall time and peak memory of each query.
"""

import argparse
import random
import resource
import tempfile
from pathlib import Path
from time import perf_counter

from auditor.model.measurement import Statistic
from auditor.model.verdict import AttackLabel
from auditor.store import make_calibration, run_query
from auditor.store.store import Store
from tests.making.clean_frames import clean_frames
from tests.making.stores import (
    PERIOD_NS,
    PROCEDURE,
    add_judgement,
    add_measurement,
    make_measurement,
    make_rig,
    new_store,
)

RECORDINGS = "0123456789"
QUERIES = ("summary", "incidents", "skipped", "coverage", "error_distribution", "identification_rate")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--cameras", type=int, default=3)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        started = perf_counter()
        store = fill(Path(folder), options.frames // len(RECORDINGS), options.cameras)
        print(f"wrote {options.frames} frames in {perf_counter() - started:.1f} s")
        for name in QUERIES:
            started = perf_counter()
            rows = run_query(store, name).num_rows
            peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
            print(f"{name:20} {rows:6} rows {perf_counter() - started:6.2f} s, peak {peak_mb} MB")


def fill(folder: Path, frames: int, cameras: int) -> Store:
    store, rig, draw = new_store(folder), make_rig(cameras), random.Random(1)
    samples = {(s, t): [draw.gauss(0.08, 0.02) for _ in range(400)] for t in rig.triples for s in Statistic}
    calibration = make_calibration(rig.kind, PROCEDURE, clean_frames(samples))
    store.write_calibration(calibration)
    template = [make_measurement(rig, 0, [int(draw.gauss(80, 20)) for _ in rig.triples]) for _ in range(200)]
    for number, recording in enumerate(RECORDINGS):
        measured = (
            type(one)(f, f * PERIOD_NS, one.presence, one.counts, one.coverage)
            for f in range(frames)
            for one in [template[f % 200]]
        )
        measurement_id = add_measurement(store, rig, measured, recording=recording)
        if number % 2:
            label = AttackLabel("/cam1", "facula", 0, frames // 2 * PERIOD_NS, {})
            store.write_labels(recording * 64, [label], rig)
        kinds = ("c" * 20 + "1" * 10 + "u" + "2" * 5) * (frames // 36)
        add_judgement(store, rig, measurement_id, kinds, calibration_id=calibration.calibration_id)
    return store


if __name__ == "__main__":
    main()
