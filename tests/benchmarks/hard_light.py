"""How often a scan raises clean frames of streets whose cameras do not all have one spectrum, by condition.

Measures clean frames only, and judges them as `auditor evaluate` does at r = 1 %: thresholds come from the other
streets. Run from the repository's top; what is in the store already is not measured again:

    python -m tests.benchmarks.hard_light --store FOLDER [--streets 18] [--frames 12] [--first 1000] [--scale 1]
"""

import argparse
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from auditor.evaluation import EvaluateTask, Street, judge_cases
from auditor.evaluation.experiments import EXPERIMENTS
from auditor.evaluation.runner import _Run
from auditor.lab.simulation.responses import kinds_of
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.store import Store, run_sql

CAMERAS = 3
_JUDGED = """
    SELECT evaluations.name AS street, judged.verdict AS verdict, len(judged.identified) AS named, count(*) AS frames
    FROM case_verdicts AS judged JOIN evaluations USING (evaluation_id)
    WHERE len(judged.attacked) = 0 AND len(judged.system) = 4 AND judged.left_out = 'recording'
    GROUP BY ALL
"""


def measure(street: Street, store: Path, matcher_name: str = "sgbm") -> None:
    """Measure the clean frames of a street."""
    use_one_thread()
    matcher = find_matcher(matcher_name)
    task = EvaluateTask(street, store)
    with street.open(colour=matcher.colour) as drive:
        run = _Run(task, drive, matcher, Store.open(store, create=True), EXPERIMENTS[:1])
        run.go(lambda what, done: None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--streets", type=int, default=18, help="one after the other hold all styles and conditions")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--first", type=int, default=1008)
    parser.add_argument("--scale", type=float, default=1.0)
    options = parser.parse_args()
    for number in range(options.first, options.first + options.streets):
        street = Street(number, options.frames, scale=options.scale)
        measure(street, options.store)
        print("measured", street, street.family, flush=True)
    store = Store.open(options.store)
    judge_cases(store)
    for line in lines(run_sql(store, _JUDGED).to_pylist()):
        print(line)


def lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Frames, those that are not clean and those that name a sensor, by street and by condition."""
    frames: Counter[str] = Counter()
    raised, named = frames.copy(), frames.copy()
    for row in rows:
        family, _, _ = row["street"].rpartition(" ")
        kinds = "-".join(kind[0] for kind in kinds_of(int(row["street"].split()[-1]), CAMERAS))
        for group in (f"{row['street']} ({kinds})", family.partition(", ")[2], f"cameras {kinds}", "all"):
            frames[group] += row["frames"]
            raised[group] += row["frames"] * (row["verdict"] != "clean")
            named[group] += row["frames"] * bool(row["named"])
    for group in sorted(frames, key=lambda group: (group == "all", "," not in group, group)):
        yield f"{group:36} {frames[group]:4} frames, {raised[group]:4} not clean, {named[group]:4} name a sensor"


if __name__ == "__main__":
    main()
