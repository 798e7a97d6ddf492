"""Attacks from weak to strong, by which an evaluation finds the largest that stays unseen.

Each ladder varies one thing that an attacker chooses, a level, an area, the share of the rows that are lit or a width,
and draws the rest, its place above all, once for the frame. `size` is what is varied, `strength` says what that is.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from auditor.lab.attacks.coloured_light import Veil
from auditor.lab.attacks.faults import HiddenSector
from auditor.lab.attacks.interference import Stripes
from auditor.lab.attacks.paper import PAPER_WIDTH_PX, STRENGTHS, Facula, draw_wall
from auditor.lab.evaluation.experiments import STRIPES_PX, Attack, Case, Experiment, SeededDraws, all_triples
from auditor.model.frames import Frame
from auditor.model.rig import LIDAR, Rig

RADII_PX = (10.0, 20.0, 40.0, 56.0, 75.0, 112.0, 150.0)
LEVELS = (15.0, 30.0, 60.0, 90.0, 120.0, 255.0)
OF_RADIUS_PX = 112.0
DUTIES = (0.025, 0.05, 0.1, 0.2)
STRIPE_LEVEL = 120.0
WIDTHS_M = (0.25, 0.5, 0.75, 1.0, 1.5, 2.5)
RANGES_M = (8.0, 25.0)
SECTORS_DEG = (1.0, 2.0, 4.0, 8.0)
EACH = 10

Step = tuple[str, float, Attack]


def ladder_cases(rig: Rig, draws: SeededDraws, _past: Sequence[Frame]) -> Iterator[Case]:
    """Every step of every ladder, on one sensor at a time."""
    for sensor in rig.sensors:
        for what, size, attack in _on_lidar(draws) if sensor == LIDAR else _on_camera(rig, sensor, draws):
            yield Case({sensor: attack}, what, size)


def _on_camera(rig: Rig, sensor: int, draws: SeededDraws) -> Iterator[Step]:
    camera, rng = rig.camera(sensor), draws.of(sensor)
    place = float(rng.uniform(0, camera.width_px)), float(rng.uniform(0, camera.height_px))
    phase, scale = float(rng.uniform(0, STRIPES_PX)), camera.width_px / PAPER_WIDTH_PX
    for strength in ("mild", "opaque"):
        for radius in RADII_PX:
            yield f"{strength}, R in px", radius, Facula(STRENGTHS[strength], radius * scale, *place)
    for level in LEVELS:
        yield f"R = {OF_RADIUS_PX:g} px, grey levels", level, Facula(level, OF_RADIUS_PX * scale, *place)
    for level in LEVELS:
        yield "grey levels", level, Veil(level)
    for duty in DUTIES:
        yield f"{STRIPE_LEVEL:g} levels, share of the rows", duty, Stripes(STRIPE_LEVEL, STRIPES_PX, phase, duty)


def _on_lidar(draws: SeededDraws) -> Iterator[Step]:
    rng = draws.of(LIDAR)
    wall, azimuth = draw_wall(rng), float(rng.uniform(-25, 25))
    for range_m in RANGES_M:
        for width in WIDTHS_M:
            yield f"{range_m:g} m away, m wide", width, replace(wall, range_m=range_m, width_m=width)
    for width in SECTORS_DEG:
        yield "degrees", width, HiddenSector(width, azimuth)


LADDERS = Experiment("unseen", all_triples, ladder_cases, each=EACH)
