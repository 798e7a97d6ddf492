"""A rig of LiDARs without cameras: each is compared with its own last scan, and with others' scans of its frame."""

from itertools import permutations
from typing import NamedTuple

import numpy as np

from auditor.measurement.checks.collect import BY_SCANS, DisputedPoints
from auditor.measurement.checks.contested_returns import contested, measure_contested_returns
from auditor.measurement.checks.found import measuring
from auditor.measurement.checks.free_space_conflict import OwnScans
from auditor.model.arrays import Indices
from auditor.model.checks import Check, Pair, SensorCheck
from auditor.model.frames import Frame
from auditor.model.measurement import Coverage
from auditor.model.rig import Rig


class OfLidars(NamedTuple):
    """The statistics of the checks of a frame's LiDARs, None where they cannot be told, and their coverage.

    `disputed` is as in `FrameChecks`.
    """

    shares: dict[SensorCheck, float | None]
    coverage: dict[int, Coverage]
    disputed: dict[Pair, DisputedPoints]


class LidarsAlone:
    """Compares the LiDARs of one recording, or the only one with its past, frame after frame.

    Two are compared with each other where both have a scan of just before: by that is known how the vehicle moves.
    """

    def __init__(self, rig: Rig) -> None:
        self._rig = rig
        self._own = {sensor: OwnScans() for sensor in rig.lidars}

    def compare(self, frame: Frame) -> OfLidars:
        """What the next frame shows; of several the shares of points that others look at are the coverage."""
        shares: dict[SensorCheck, float | None] = {}
        disputed: dict[Pair, DisputedPoints] = {}
        clouds = frame.clouds
        for sensor, own in self._own.items():
            rig = self._rig.alone(sensor)
            from_nowhere = own.conflicts(clouds.get(sensor), rig)
            if from_nowhere is not None:
                shares |= {SensorCheck(check, sensor, ()): measuring(check)(from_nowhere, rig) for check in BY_SCANS}
                disputed[sensor, sensor] = DisputedPoints(from_nowhere, len(clouds[sensor].xyz_m))
        scans = {sensor: own.now for sensor, own in self._own.items() if own.now is not None}
        ways = {sensor: own.way for sensor, own in self._own.items() if own.way is not None}
        lookers = {sensor: np.zeros(len(scan.cell), dtype=np.intp) for sensor, scan in scans.items()}
        said = {
            (i, k): contested(scans[i], scans[k].ended_m, self._rig.beside_m(i, k), ways[i])
            for i, k in permutations(ways, 2)
        }
        for (i, k), of_points in said.items():
            if of_points.fits(said[k, i]):
                lookers[i] += of_points.looked_at
                points = scans[i].points(of_points.points)
                share = measure_contested_returns(points, self._rig.alone(i))
                shares[SensorCheck(Check.CONTESTED_RETURNS, i, (k,))] = share
                disputed[i, k] = DisputedPoints(points, len(clouds[i].xyz_m))
        coverage = {one: self._coverage(one, len(cloud.xyz_m), lookers.get(one)) for one, cloud in clouds.items()}
        return OfLidars(shares, coverage, disputed)

    def _coverage(self, sensor: int, points: int, lookers: Indices | None) -> Coverage:
        """Of a LiDAR of so many points, of which those within reach (M,) were looked at by so many others.

        Of the only one it is the share that would be told by its last scan.
        """
        if not self._rig.others:
            return Coverage(returns=points, compared_share=self._own[sensor].asked_share, compared_by_two_share=0.0)
        by_one, by_two = (0 if lookers is None else np.count_nonzero(lookers >= least) for least in (1, 2))
        whole = max(points, 1)
        return Coverage(returns=points, compared_share=by_one / whole, compared_by_two_share=by_two / whole)
