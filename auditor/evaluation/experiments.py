"""The paper's experiments as lists of cases: which sensors are attacked in a frame, and with what."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product

import numpy as np

from auditor.evaluation.bench import Attack
from auditor.frames import Frame
from auditor.lab.attacks import STRENGTHS, BogusWall, Facula, draw_facula, draw_wall
from auditor.rig import LIDAR, Rig, Triple

WALL_WIDTHS_M = (0.5, 1.0, 1.5, 2.0, 2.5)
"""Fig. 11."""

RADII_PX = (37.5, 75.0, 112.5, 150.0, 187.5, 225.0)
"""Fig. 12, on images of the paper's width."""

PAPER_WIDTH_PX = 1242
SENSITIVITY_STRENGTHS = ("mild", "opaque")
MOST_ATTACKED = 2
"""Sets that are only identified, not detected by one triple, have this many sensors at most."""


@dataclass(frozen=True)
class Case:
    """One way to attack a frame.

    `strength` names the amplitude of its faculas, None where it has none to choose. `size` is what a sensitivity
    experiment varies: a wall's width in metres, or a facula's radius in pixels on an image of the paper's width;
    `visible_share` is then the share of the image within that radius.
    """

    attacks: Mapping[int, Attack] = field(default_factory=dict)
    strength: str | None = None
    size: float | None = None
    visible_share: float | None = None

    @property
    def attacked(self) -> tuple[int, ...]:
        """The attacked sensors, ascending."""
        return tuple(sorted(self.attacks))

    @property
    def attack(self) -> str | None:
        """The kind of attack; None where there is none, or several."""
        kinds = {attack.name for attack in self.attacks.values()}
        return kinds.pop() if len(kinds) == 1 else None


@dataclass(frozen=True)
class Dice:
    """Chance that depends on nothing but these numbers: a repeated evaluation draws the same attacks."""

    seed: int
    recording: int
    frame: int
    draw: int

    def of(self, sensor: int) -> np.random.Generator:
        """The generator of one sensor's attack."""
        return np.random.default_rng([self.seed, self.recording, self.frame, self.draw, sensor])


@dataclass(frozen=True)
class Experiment:
    """Cases for every frame and draw; `triples` are the ones that they are measured for.

    `cases` also gets the frames before, the latest last. `drawn` is False where nothing is left to chance, so that one
    draw is all there is; `inputs` tells apart the files that its attacks are made from. `attacks` is False where frames
    are left clean; so many frames as `together` says are attacked one after the other.
    """

    name: str
    triples: Callable[[Rig], tuple[Triple, ...]]
    cases: Callable[[Rig, Dice, Sequence[Frame]], Iterator[Case]]
    drawn: bool = True
    inputs: str | None = None
    attacks: bool = True
    together: int = 1

    def takes(self, frame: int, every: int) -> bool:
        """Whether it looks at the frame of this number where each `every`-th is attacked: at clean ones always."""
        return not self.attacks or frame // self.together % every == 0


def scenario_1(rig: Rig) -> Triple | None:
    """The LiDAR, the leftmost camera and the one farthest from it; None without a LiDAR."""
    return Triple(LIDAR, 1, rig.n) if rig.lidar else None


def attacked_sets(rig: Rig) -> tuple[tuple[int, ...], ...]:
    """Every set that attacks some triple of the leftmost reference, and every one and two that can be identified."""
    sets = {
        attacked
        for triple in rig.triples
        if triple.k == rig.n
        for size in (1, 2, 3)
        for attacked in combinations(triple, size)
    }
    for size in range(1, min(rig.max_attacked, MOST_ATTACKED) + 1):
        sets.update(combinations(rig.sensors, size))
    return tuple(sorted(sets, key=lambda attacked: (len(attacked), attacked)))


def all_triples(rig: Rig) -> tuple[Triple, ...]:
    """Whatever the rig has."""
    return rig.triples


def _scenario_1_only(rig: Rig) -> tuple[Triple, ...]:
    triple = scenario_1(rig)
    return () if triple is None else (triple,)


def _clean(_rig: Rig, _dice: Dice, _past: Sequence[Frame]) -> Iterator[Case]:
    yield Case()


def _combinations(rig: Rig, dice: Dice, _past: Sequence[Frame]) -> Iterator[Case]:
    """Each sensor has one attack in a draw, whatever others are attacked with it; strengths change nothing else."""
    for strength in STRENGTHS:
        attacks = {sensor: drawn_attack(rig, sensor, strength, dice.of(sensor)) for sensor in rig.sensors}
        for attacked in attacked_sets(rig):
            yield Case({sensor: attacks[sensor] for sensor in attacked}, strength)


def drawn_attack(rig: Rig, sensor: int, strength: str, rng: np.random.Generator) -> Facula | BogusWall:
    """The paper's attack on a sensor: a wall on the LiDAR, a facula on a camera."""
    if sensor == LIDAR:
        return draw_wall(rng)
    camera = rig.camera(sensor)
    return draw_facula(rng, camera.width_px, camera.height_px, strength)


def _sensitivity(rig: Rig, dice: Dice, _past: Sequence[Frame]) -> Iterator[Case]:
    """Walls of several widths on S_0; faculas of several radii on the reference camera, then on the witness."""
    triple = scenario_1(rig)
    if triple is None:
        return
    wall = draw_wall(dice.of(LIDAR))
    for width in WALL_WIDTHS_M:
        yield Case({LIDAR: replace(wall, width_m=width)}, size=width)
    for sensor, strength in product((triple.k, triple.j), SENSITIVITY_STRENGTHS):
        camera = rig.camera(sensor)
        drawn = draw_facula(dice.of(sensor), camera.width_px, camera.height_px, strength)
        for radius in RADII_PX:
            facula = replace(drawn, radius_px=radius * camera.width_px / PAPER_WIDTH_PX)
            yield Case({sensor: facula}, strength, radius, disc_share(facula, camera.width_px, camera.height_px))


def disc_share(facula: Facula, width_px: int, height_px: int) -> float:
    """The share of an image's pixels that lie within R of a facula's centre."""
    across = (np.arange(width_px) - facula.u_px) ** 2
    down = (np.arange(height_px) - facula.v_px) ** 2
    return float(np.mean(down[:, None] + across[None, :] <= facula.radius_px**2))


EXPERIMENTS = (
    Experiment("clean", all_triples, _clean, drawn=False, attacks=False),
    Experiment("combinations", all_triples, _combinations),
    Experiment("sensitivity", _scenario_1_only, _sensitivity),
)
"""In the order in which they are measured."""
