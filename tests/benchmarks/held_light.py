"""What becomes of lights and lens faults that last: `python -m tests.benchmarks.held_light FOLDER...`.

Reads scenes of `attack_kinds`, `thrown_light` or `clean_statistics --attacked`. Each changed frame of a camera is
judged alone, and held still for 0.1 s to four seconds among copies of its clean frame, by thresholds of the other
families of its folder: a light that an attacker holds on one place is the hardest to tell from a fault of the lens.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np

from auditor.identification.drive_level import for_clean_drive
from auditor.identification.incidents.series import FrameSeries
from auditor.identification.robust import judge_frames
from auditor.identification.systems import System
from auditor.model.verdict import Verdict, VerdictKind
from tests.benchmarks.rates import ByOtherFamilies, brightness_of, clean_frames, frames_of, system_of
from tests.benchmarks.scenes import Case, Scene, load

FRAMES, PERIOD_NS = 41, 10**8
LASTING = {"alone": None, "0.1 s": 1, "0.5 s": 5, "1 s": 10, "2 s": 20, "4 s": FRAMES}
"""Frames in the middle that are changed; None is a recording of one frame."""


def held(
    scenes: Sequence[Scene], cameras: Sequence[int], r: Decimal, lasting: Mapping[str, int | None] = LASTING
) -> Iterator[tuple[str, str, tuple[int, ...], Verdict]]:
    """By change and whether the camera has colours, and by how long it lasts: the sensor, and the middle's verdict."""
    by_others = ByOtherFamilies(scenes, cameras, r)
    for scene in scenes:
        system = system_of(scene, cameras)
        learnt, _ = by_others.of(scene.family, system)
        thresholds = for_clean_drive(learnt, system.sensor_checks, clean_frames(scene, system))
        before = {case.frame: case for case in scene.cases if not case.attack}
        for case in scene.cases:
            if len(case.attacked) == 1 and case.attacked[0] in cameras:
                kind = "colour" if scene.kinds[case.attacked[0] - 1] == "c" else "grey"
                for name, length in lasting.items():
                    series = _series(scene, system, before[case.frame], case, length)
                    [verdict] = judge_frames(series, system, thresholds, only=[len(series.runs) // 2])
                    yield f"{case.attack:26} {kind:6}", name, case.attacked, verdict


def _series(scene: Scene, system: System, clean: Case, changed: Case, length: int | None) -> FrameSeries:
    count = 1 if length is None else FRAMES
    first = 0 if length is None else (FRAMES - length) // 2
    is_changed = (np.arange(count) >= first) & (np.arange(count) < first + (length or 1))
    statistics = frames_of(scene, system, [clean, changed]).statistics_of(system.sensor_checks)
    brightness = brightness_of([clean, changed], system)
    here = np.ones((count, len(system.sensors)), dtype=np.bool_)
    which = is_changed.astype(np.intp)
    return FrameSeries(
        np.arange(count, dtype=np.int64) * PERIOD_NS,
        np.zeros(count, dtype=np.int64),
        statistics[which],
        here,
        ~here,
        brightness={key: values[which] for key, values in brightness.items()},
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folders", type=Path, nargs="+", help="judged each by itself")
    parser.add_argument("--r", type=Decimal, default=Decimal("0.01"))
    parser.add_argument("--cameras", type=int, nargs="+", default=[1, 2, 3, 4])
    options = parser.parse_args()
    for folder in options.folders:
        rows: dict[str, dict[str, Counter[str]]] = defaultdict(lambda: {name: Counter() for name in LASTING})
        for kind, lasting, attacked, verdict in held(load(folder), options.cameras, options.r):
            rows[kind][lasting]["named" if verdict.attacked == attacked else verdict.kind.value] += 1
        print(f"{folder}: named and suspect, {', '.join(LASTING)}")
        for kind, counts in rows.items():
            told = (f"{n['named']:3} {n[VerdictKind.SUSPECT.value]:3}" for n in counts.values())
            print(f"{kind} of {counts['alone'].total():3}", *told, sep="; ")


if __name__ == "__main__":
    main()
