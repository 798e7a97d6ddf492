"""What the robust benchmarks measure: clean frames and attacked ones, each sensor's part computed once."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from auditor.evaluation.attacked_frame import Attack, AttackedFrame, Attacks
from auditor.lab.attacks.paper import STRENGTHS, Facula, draw_facula, draw_wall
from auditor.measurement.disparity.matchers import find_matcher
from auditor.model.frames import Frame
from auditor.model.measurement import Statistic
from auditor.model.rig import LIDAR, Rig

WALLS_M = (0.5, 1.0, 1.5, 2.5)
SMALL = ((75.0, "mild"), (75.0, "opaque"), (112.5, "mild"))
MATCHER = find_matcher("sgbm")


@dataclass(frozen=True)
class Sample:
    """One frame, clean or attacked: its kind, who was attacked, the (M,) local ratios and the (2, T) E."""

    recording: str
    frame: int
    stamp_ns: int
    kind: str
    attacked: tuple[int, ...]
    draw: int
    ratios: tuple[float, ...]
    E: tuple[tuple[float, ...], ...]


def measured(
    attacked_frame: AttackedFrame, attacks: Attacks
) -> tuple[tuple[float, ...], tuple[tuple[float, ...], ...]]:
    """Local ratios by element and (plain, gated) E by triple, with these attacks on these sensors."""
    counts = attacked_frame.counts(attacks)
    E = tuple(tuple(_or_nan(c and c.disparity_error(statistic)) for c in counts) for statistic in Statistic)
    return tuple(map(_or_nan, attacked_frame.ratios(attacks))), E


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


def cases(rig: Rig, rng: np.random.Generator) -> Iterator[tuple[str, dict[int, Attack]]]:
    """One draw of every attack: walls, faculas, small faculas, and every allowed or paper's combination of them."""
    wall = draw_wall(rng)
    for width in WALLS_M:
        yield f"wall {width} m", {LIDAR: replace(wall, width_m=width)}
    camera = rig.cameras[0]
    faculas = {c.number: draw_facula(rng, c.width_px, c.height_px, "mild") for c in rig.cameras}
    for radius, strength in SMALL:
        scaled = radius * camera.width_px / 1242
        for c, f in faculas.items():
            yield f"R {radius:g} {strength}", {c: Facula(STRENGTHS[strength], scaled, f.u_px, f.v_px)}
    for strength, A in STRENGTHS.items():
        attacks: dict[int, Attack] = {c: Facula(A, f.radius_px, f.u_px, f.v_px) for c, f in faculas.items()}
        for c, f in attacks.items():
            yield strength, {c: f}
        attacks[LIDAR] = wall
        largest = rig.n + 1 if rig.n == 3 else rig.max_attacked
        for size in range(2, largest + 1):
            for chosen in combinations(rig.sensors, size):
                yield strength, {sensor: attacks[sensor] for sensor in chosen}


def samples(recording: str, rig: Rig, frames: Iterable[Frame], draws: int, seed: int) -> Iterator[Sample]:
    """Every frame clean, and under `draws` draws of every attack."""
    for frame in frames:
        attacked_frame = AttackedFrame(frame, rig, MATCHER)
        yield Sample(recording, frame.number, frame.stamp_ns, "clean", (), 0, *measured(attacked_frame, {}))
        for draw in range(draws):
            drawn = np.random.default_rng([seed, frame.number, draw])
            for kind, attacks in cases(rig, drawn):
                found = measured(attacked_frame, attacks)
                yield Sample(recording, frame.number, frame.stamp_ns, kind, tuple(sorted(attacks)), draw, *found)
            attacked_frame.forget_attacks()
