"""How often Algorithm 2 names exactly the attacked sensor on real frames: `python -m tests.benchmarks.identification`.

Drives 0009 (and with --both 0001) of the folder AUDITOR_TEST_DATA; rig of LiDAR, cam1, cam3 and the reference cam2;
gated E at r = 0. Every frame is attacked three times on each sensor: a facula on each camera (R uniform in 187 to 375
px, centre uniform over the image), a wall of 1.5 m x 2.5 m on the LiDAR (6 to 10 m away, lateral -3 to 3 m, standing
within 0.6 m of the road). In sample, thresholds are the maxima over all clean frames; left out, over those of the
other blocks of ten.
"""

import argparse
from collections import defaultdict

import numpy as np

from auditor.identification.algorithm2 import identify
from auditor.lab.attacks.paper import draw_facula, draw_wall
from auditor.lab.evaluation.attacked_frame import AttackedFrame
from auditor.lab.evaluation.attacks import Attack, Attacks
from auditor.measurement import use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.frames import Frame
from auditor.model.measurement import Statistic
from auditor.model.rig import LIDAR, Rig, Triple
from tests.benchmarks.intervals import wilson_percent
from tests.benchmarks.real_drives import frames

DRAWS = 3
BLOCK = 10
MATCHER = find_matcher("sgbm")

Errors = dict[Triple, float | None]


def drawn(frame: Frame, sensor: int, strength: str, rng: np.random.Generator) -> Attack:
    """One attack on one sensor of the frame."""
    if sensor == LIDAR:
        return draw_wall(rng)
    height, width = frame.images[sensor].pixels.shape[:2]
    return draw_facula(rng, width, height, strength)


def disparity_errors(frame: AttackedFrame, attacks: Attacks) -> Errors:
    """The gated E of every triple, as measuring the frame under these attacks gives it."""
    counts = frame.counts(attacks)
    return {
        t: c.disparity_error(Statistic.GATED) if c else None for t, c in zip(frame.rig.triples, counts, strict=False)
    }


def named(E: Errors, theta: dict[Triple, float], rig: Rig) -> tuple[int, ...]:
    """Algorithm 2's answer."""
    e = "".join("-" if E[t] is None else "1" if E[t] > theta[t] else "0" for t in rig.triples)
    return identify(e, rig.triples, rig.sensors).attacked


def maxima(clean: list[Errors]) -> dict[Triple, float]:
    """theta at r = 0."""
    return {t: max(E[t] for E in clean if E[t] is not None) for t in clean[0]}


def wilson(k: int, n: int) -> str:
    """k of n with the 95 % interval."""
    low, high = wilson_percent(k, n)
    return f"{k}/{n} = {100 * k / n:5.1f} % [{low:.1f}, {high:.1f}]"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--strength", default="opaque", choices=["mild", "strong", "opaque"])
    parser.add_argument("--both", action="store_true", help="drives 0009 and 0001 together")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    use_one_thread()
    clean: dict[tuple[str, int], Errors] = {}
    cases: dict[tuple[str, int], list[tuple[int, Errors]]] = defaultdict(list)
    for number in ("0009", "0001") if options.both else ("0009",):
        rig, stream = frames(number)
        for frame in stream:
            key = (f"{number}/{frame.number // BLOCK}", frame.number)
            measured = AttackedFrame(frame, rig, MATCHER)
            clean[key] = disparity_errors(measured, {})
            rng = np.random.default_rng([options.seed, int(number), frame.number])
            for _ in range(DRAWS):
                for sensor in rig.sensors:
                    attacks = {sensor: drawn(frame, sensor, options.strength, rng)}
                    cases[key].append((sensor, disparity_errors(measured, attacks)))
    for mode in ("in sample", "left out"):
        hits, false_alarms = defaultdict(list), 0
        for key, attacks in cases.items():
            theta = maxima([E for other, E in clean.items() if mode == "in sample" or other[0] != key[0]])
            false_alarms += bool(named(clean[key], theta, rig))
            for sensor, E in attacks:
                hits[sensor].append(named(E, theta, rig) == (sensor,))
        print(f"{mode}: {options.strength} faculas, walls, r = 0")
        for sensor, hit in sorted(hits.items()):
            print(f"  S_{sensor} named alone in {wilson(sum(hit), len(hit))}")
        every = [hit for one in hits.values() for hit in one]
        print(
            f"  all         {wilson(sum(every), len(every))}; clean frames identified: {false_alarms} of {len(clean)}"
        )


if __name__ == "__main__":
    main()
