"""What a rig's frames are judged by: its sensor checks, triples and sensors, and which of the checks count when."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from auditor.identification.parameters import FittedOn
from auditor.model.arrays import Indices
from auditor.model.checks import CAMERA_CHECKS, FEWEST_VOTERS, SensorCheck, counting_checks
from auditor.model.checks.kind import CellUnit, Of
from auditor.model.rig import LIDAR, Triple

_OF_SCANS = frozenset({Of.OWN_SCANS, Of.OTHER_SCANS})

_Find = Callable[[tuple[SensorCheck, ...], frozenset[int]], tuple[int, ...]]
"""What finds the places of some of a system's checks in a frame without some sensors."""


@dataclass(frozen=True)
class System:
    """The sensor checks, triples and sensors of a rig, in their fixed orders.

    `fallback` is the triple for frames in which none of `triples` was measured. `fitted_on` is the matcher whose prior
    holds for its statistics.
    """

    sensor_checks: tuple[SensorCheck, ...]
    triples: tuple[Triple, ...]
    sensors: tuple[int, ...]
    fallback: Triple | None = None
    fitted_on: FittedOn = FittedOn.SGBM

    @cached_property
    def by_time(self) -> bool:
        """Whether sensors are checked by their own past: a lone camera's and a LiDAR, or LiDARs alone."""
        return self.of_scans or any(one.check.kind.of is Of.LONE_CAMERA for one in self.sensor_checks)

    @cached_property
    def of_scans(self) -> bool:
        """Whether all sensors are LiDARs, which scans alone are compared of."""
        return all(one.check.kind.of in _OF_SCANS for one in self.sensor_checks)

    @cached_property
    def lidars(self) -> frozenset[int]:
        """The LiDARs among the sensors."""
        return frozenset(self.sensors) if self.of_scans else frozenset({LIDAR})

    @property
    def judged_together(self) -> int:
        """How many checks a frame is judged by that lacks no sensor."""
        return self.judged_without(frozenset())

    def judged_without(self, absent: frozenset[int]) -> int:
        """How many checks a frame without these sensors is judged by; all of two cameras alone are one, being alike.

        Those that clean frames hardly ever exceed a limit by do not count (`Kind.common`).
        """
        checks = [self.sensor_checks[column] for column in self.detecting(absent).tolist()]
        pairs = {frozenset(one.nameable) for one in checks if len(one.nameable) > 1}
        return sum(1 for one in checks if len(one.nameable) == 1 and one.check.kind.common) + len(pairs)

    def detecting(self, absent: frozenset[int]) -> Indices:
        """The checks one of which must exceed the limit in a finding: those that count, and those of two cameras alone.

        Where only two cameras see a place nobody else votes; that something is wrong there shows all the same.
        """
        return self._once(_detecting, absent)

    def counting(self, absent: frozenset[int]) -> Indices:
        """The checks that count in a frame without these sensors: each of the most voters that are there."""
        return self._once(counting_checks, absent)

    def but_one(self, absent: frozenset[int]) -> Indices:
        """The checks by all voters but one that find something by them: what is alike in two cameras cancels out."""
        return self._once(_but_one, absent)

    def naming(self, absent: frozenset[int]) -> Indices:
        """The checks that count and speak of one sensor."""
        return self._once(_naming, absent)

    def _once(self, find: _Find, absent: frozenset[int]) -> Indices:
        """What is asked for every frame is found once: to look up all checks takes longer than the rest."""
        if (find, absent) not in self._found:
            self._found[find, absent] = np.array(find(self.sensor_checks, absent), dtype=np.intp)
        return self._found[find, absent]

    @cached_property
    def _found(self) -> dict[tuple[_Find, frozenset[int]], Indices]:
        return {}


def measured_triples(system: System, measured: frozenset[SensorCheck], absent: frozenset[int]) -> list[Triple]:
    """The triples, the fallback among them, whose sensors were all compared by these measured checks.

    The LiDAR is compared with the cameras of its conflicts, or with a lone camera and its past, a camera with those
    that it was matched with.
    """
    triples = system.triples if system.fallback is None else (*system.triples, system.fallback)
    conflicts = {camera for c in measured if c.check.kind.counted is CellUnit.POINTS for camera in c.others}
    lit = {c.sensor for c in measured if c.check in CAMERA_CHECKS}

    def is_measured(triple: Triple) -> bool:
        if not absent.isdisjoint(triple):
            return False
        cameras = {sensor for sensor in triple if sensor != LIDAR}
        return cameras <= (conflicts if LIDAR in triple else lit)

    return [triple for triple in triples if is_measured(triple)]


@cache
def _detecting(sensor_checks: tuple[SensorCheck, ...], absent: frozenset[int]) -> tuple[int, ...]:
    alone = (
        column
        for column, one in enumerate(sensor_checks)
        if len(one.nameable) > 1 and not one.check.kind.never_of_two and absent.isdisjoint(one.needed)
    )
    return tuple(sorted({*counting_checks(sensor_checks, absent), *alone}))


@cache
def _but_one(sensor_checks: tuple[SensorCheck, ...], absent: frozenset[int]) -> tuple[int, ...]:
    counting = (sensor_checks[column] for column in counting_checks(sensor_checks, absent))
    voters = {(one.check, one.sensor): len(one.others) for one in counting if one.check.kind.by_all_but_one}
    return tuple(
        column
        for column, one in enumerate(sensor_checks)
        if absent.isdisjoint(one.needed)
        and FEWEST_VOTERS <= len(one.others) == voters.get((one.check, one.sensor), 0) - 1
    )


def _naming(sensor_checks: tuple[SensorCheck, ...], absent: frozenset[int]) -> tuple[int, ...]:
    columns = counting_checks(sensor_checks, absent)
    return tuple(column for column in columns if len(sensor_checks[column].nameable) == 1)
