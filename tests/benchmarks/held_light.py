"""What becomes of lights and lens faults that are held still: `python -m tests.benchmarks.held_light FOLDER...`.

Reads scenes of `attack_kinds`, `thrown_light` or `clean_statistics --attacked`. Each changed frame of a camera is judged
alone, as the first and as the middle one of equal frames that last for four seconds, by thresholds of the other
families of its folder: a light that an attacker holds on one place is the hardest to tell from a fault of the lens.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np

from auditor.identification.robust import FrameSeries, judge_frames
from auditor.identification.scores import for_drive
from auditor.model.verdict import Verdict, VerdictKind
from tests.benchmarks.rates import brightness_of, clean_frames, frames_of, system_of, thresholds_of
from tests.benchmarks.scenes import Scene, load

FRAMES, PERIOD_NS = 41, 10**8


def held(scenes: Sequence[Scene], cameras: Sequence[int], r: Decimal) -> Iterator[tuple[str, tuple[int, ...], Verdict]]:
    """By change and whether colours are seen: what was changed, and the verdicts alone, first and in the middle."""
    clean = {scene.name: clean_frames(scene, system_of(scene, cameras)) for scene in scenes}
    for scene in scenes:
        system = system_of(scene, cameras)
        learnt, _ = thresholds_of([clean[one.name] for one in scenes if one.family != scene.family], system, r)
        thresholds = for_drive(learnt, system.sensor_checks, clean[scene.name].statistics_of(system.sensor_checks))
        for case in scene.cases:
            if len(case.attacked) == 1 and case.attacked[0] in cameras:
                own = frames_of(scene, system, [case]).statistics_of(system.sensor_checks)
                brightness = brightness_of([case], system)
                for length, places in ((1, (0,)), (FRAMES, (0, FRAMES // 2))):
                    here = np.ones((length, len(system.sensors)), dtype=np.bool_)
                    series = FrameSeries(
                        np.arange(length, dtype=np.int64) * PERIOD_NS,
                        np.zeros(length, dtype=np.int64),
                        np.repeat(own, length, axis=0),
                        here,
                        ~here,
                        brightness={key: np.repeat(values, length) for key, values in brightness.items()},
                    )
                    verdicts = judge_frames(series, system, thresholds, only=places)
                    kind = "colour" if scene.kinds[case.attacked[0] - 1] == "c" else "grey"
                    for verdict in verdicts:
                        yield f"{case.attack:26} {kind}", case.attacked, verdict


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folders", type=Path, nargs="+", help="judged each by itself")
    parser.add_argument("--r", type=Decimal, default=Decimal("0.01"))
    parser.add_argument("--cameras", type=int, nargs="+", default=[1, 2, 3, 4])
    options = parser.parse_args()
    for folder in options.folders:
        rows: dict[str, list[Counter[str]]] = defaultdict(lambda: [Counter() for _ in range(3)])
        scenes = load(folder)
        for number, (kind, attacked, verdict) in enumerate(held(scenes, options.cameras, options.r)):
            outcome = "named" if verdict.attacked == attacked else verdict.kind.value
            rows[kind][number % 3][outcome] += 1
        for kind, counts in rows.items():
            told = (f"{n['named']:3} named {n[VerdictKind.SUSPECT.value]:3} suspect" for n in counts)
            print(f"{kind}: of {counts[0].total():3} alone, first, in the middle", *told, sep="; ")


if __name__ == "__main__":
    main()
