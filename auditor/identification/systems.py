"""What a rig's frames are judged by: its sensor checks, triples and sensors, and which of the checks count when."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from auditor.model.arrays import Indices
from auditor.model.checks import CAMERA_CHECKS, FEWEST_VOTERS, Check, SensorCheck, counting_checks
from auditor.model.rig import LIDAR, Triple


@dataclass(frozen=True)
class System:
    """The sensor checks, triples and sensors of a rig, in their fixed orders.

    `fallback` is the triple for frames in which none of `triples` was measured.
    """

    sensor_checks: tuple[SensorCheck, ...]
    triples: tuple[Triple, ...]
    sensors: tuple[int, ...]
    fallback: Triple | None = None

    @cached_property
    def in_several_pairs(self) -> frozenset[int]:
        """The cameras matched with more than one other: a fault in one of them shows in all its pairs."""
        several = [one for one in self.sensor_checks if one.check in CAMERA_CHECKS and len(one.others) >= FEWEST_VOTERS]
        return frozenset(one.sensor for one in several)

    @property
    def judged_together(self) -> int:
        """How many checks a frame is judged by that lacks no sensor."""
        return len(self.detecting(frozenset()))

    def detecting(self, absent: frozenset[int]) -> Indices:
        """The checks one of which must exceed the limit in a finding: those that count, and those of two cameras alone.

        Where only two cameras see a place nobody else votes; that something is wrong there shows all the same.
        """
        alone = (
            column
            for column, one in enumerate(self.sensor_checks)
            if len(one.nameable) > 1 and one.check is not Check.REMOVED_LIGHT and absent.isdisjoint(one.needed)
        )
        return np.array(sorted({*self.counting(absent).tolist(), *alone}), dtype=np.intp)

    def counting(self, absent: frozenset[int]) -> Indices:
        """The checks that count in a frame without these sensors: each of the most voters that are there."""
        return np.array(counting_checks(self.sensor_checks, absent), dtype=np.intp)


def measured_triples(one: System, measured: frozenset[SensorCheck], absent: frozenset[int]) -> list[Triple]:
    """The triples, the fallback among them, whose sensors were all compared by these measured checks.

    The LiDAR is compared with the cameras of its conflicts, a camera with those that it was matched with.
    """
    triples = one.triples if one.fallback is None else (*one.triples, one.fallback)
    conflicts = {camera for c in measured if c.check is Check.LIDAR_CONFLICT for camera in c.others}
    lit = {c.sensor for c in measured if c.check in CAMERA_CHECKS}

    def is_measured(triple: Triple) -> bool:
        if not absent.isdisjoint(triple):
            return False
        cameras = {sensor for sensor in triple if sensor != LIDAR}
        return cameras <= (conflicts if LIDAR in triple else lit)

    return [triple for triple in triples if is_measured(triple)]
