"""Attacks that last: a second of a drive under one attack that holds still, or is drawn anew for every frame."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from auditor.evaluation.experiments import Case, Dice, Experiment, all_triples, drawn_attack
from auditor.frames import Frame
from auditor.rig import LIDAR, Rig
from auditor.store.evaluations import INTERVAL_FRAMES

STRENGTH = "mild"
"""Of the faculas: the weakest that the combinations try."""


def cases(rig: Rig, dice: Dice, _past: Sequence[Frame]) -> Iterator[Case]:
    """One sensor at a time, then the first and the last together; what holds still is drawn for the whole interval."""
    held = replace(dice, frame=dice.frame - dice.frame % INTERVAL_FRAMES)
    together = (LIDAR if rig.lidar else 1, rig.n)
    for variant, chance in (("still", held), ("moving", dice)):
        attacks = {sensor: drawn_attack(rig, sensor, STRENGTH, chance.of(sensor)) for sensor in rig.sensors}
        for attacked in (*((sensor,) for sensor in rig.sensors), together):
            yield Case({sensor: attacks[sensor] for sensor in attacked}, variant)


INTERVALS = Experiment("intervals", all_triples, cases, together=INTERVAL_FRAMES)
