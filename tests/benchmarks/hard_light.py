"""How often a scan raises clean frames of streets whose cameras do not all have one spectrum, by condition.

Measures clean frames only, and judges them as `auditor evaluate` does at r = 1 %: thresholds come from the other
streets. Run from the repository's top; what is in the store already is not measured again:

    python -m tests.benchmarks.hard_light --store FOLDER [--streets 18] [--frames 12] [--first 1000] [--scale 1]
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from auditor.lab.evaluation import EvaluateTask, Street, judge_cases
from auditor.lab.evaluation.experiments import EXPERIMENTS
from auditor.lab.evaluation.runner import _Run
from auditor.lab.simulation.responses import kinds_of
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.store import Store, run_sql
from tests.benchmarks.clustered import clustered_interval

CAMERAS, FEWEST_SCENES = 3, 5
_JUDGED = """
    SELECT evaluations.name AS street, judged.verdict AS verdict, len(judged.identified) AS named, count(*) AS frames
    FROM case_verdicts AS judged JOIN evaluations USING (evaluation_id)
    WHERE len(judged.attacked) = 0 AND len(judged.system) = 4 AND judged.left_out = 'recording'
    GROUP BY ALL
"""


def measure(street: Street, store: Path) -> None:
    """Measure the clean frames of a street."""
    use_one_thread()
    matcher = find_matcher("sgbm")
    task = EvaluateTask(street, store)
    with street.open() as [drive]:
        run = _Run(task, drive, matcher, Store.open(store, create=True), EXPERIMENTS[:1])
        run.go(lambda what, done: None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--store", type=Path, required=True)
    parser.add_argument("--streets", type=int, default=18, help="one after the other hold all styles and conditions")
    parser.add_argument("--frames", type=int, default=12)
    parser.add_argument("--first", type=int, default=1012)
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
    """Frames, those that are not clean and those that name a sensor, by street and by groups of streets."""
    groups: dict[str, dict[str, list[int]]] = defaultdict(lambda: defaultdict(lambda: [0, 0, 0]))
    for row in rows:
        family, _, number = row["street"].rpartition(" ")
        kinds = "-".join(kind[0] for kind in kinds_of(int(number), CAMERAS))
        for group in (f"{row['street']} ({kinds})", family.partition(", ")[2], f"cameras {kinds}", "all"):
            counts = groups[group][row["street"]]
            counts[0] += row["frames"]
            counts[1] += row["frames"] * (row["verdict"] != "clean")
            counts[2] += row["frames"] * bool(row["named"])
    for group in sorted(groups, key=lambda group: (group == "all", "," not in group, group)):
        frames, raised, named = zip(*groups[group].values(), strict=True)
        line = f"{group:36} {sum(frames):4} frames, {sum(raised):4} not clean, {sum(named):4} name a sensor"
        if len(frames) >= FEWEST_SCENES:
            low, high = clustered_interval(raised, frames)
            line += f"; {100 * sum(raised) / sum(frames):3.0f} % [{100 * low:.0f}, {100 * high:.0f}] not clean"
        yield line


if __name__ == "__main__":
    main()
