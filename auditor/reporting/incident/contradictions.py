"""What LiDARs without cameras contradict of each other in an incident, and where: in words, from the stored regions."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from auditor.model.arrays import Floats
from auditor.model.rig import Rig
from auditor.store.export import rows_of
from auditor.store.queries import run_sql
from auditor.store.store import Store

_LARGEST_THINGS = """
    SELECT
        sensor,
        frame,
        list(DISTINCT view) AS by,
        max_by(centre_m, points) AS centre_m,
        max_by(size_m, points) AS size_m,
        max(points) AS points
    FROM stored_regions
    WHERE measurement_id = '{}' AND centre_m IS NOT NULL
    GROUP BY sensor, frame
    ORDER BY sensor, frame
"""

_STRAIGHT_M = 0.25
"""So far aside is straight ahead."""

_MOVES_M = 1.0
"""What keeps its place beside the vehicle is within so much of it."""


@dataclass(frozen=True, eq=False)
class Contradiction:
    """Points of a LiDAR that others, or its own last scan, say are not there: the largest thing of each frame.

    `others` are those others, each with the number of frames, `by_past` in how many its last scan does. `place_m` (F,
    3) is its middle in so many frames: right, down and ahead of the LiDAR, in the axes of the vehicle. `wide_m`,
    `tall_m` and `points` are the medians.
    """

    sensor: int
    others: Mapping[int, int]
    by_past: int
    place_m: Floats
    wide_m: float
    tall_m: float
    points: int

    @property
    def frames(self) -> int:
        """In how many frames."""
        return len(self.place_m)

    @property
    def where(self) -> str:
        """Where the thing is, seen from the LiDAR whose points it is of."""
        right, down, ahead = np.median(self.place_m, axis=0).tolist()
        along = f"{abs(ahead):.1f} m {'ahead of' if ahead >= 0 else 'behind'} it"
        aside = f"{abs(right):.1f} m to the {'right' if right > 0 else 'left'}"
        low, high = -down - self.tall_m / 2, -down + self.tall_m / 2
        height = f"from {_over(low)} to {_over(high)} it"
        return f"{along}{f' and {aside}' if abs(right) > _STRAIGHT_M else ''}, {self.wide_m:.1f} m wide, {height}"

    @property
    def spread_m(self) -> float:
        """How far the thing was, at most, from its middle place beside the vehicle."""
        away = self.place_m - np.median(self.place_m, axis=0)
        return float(np.hypot(away[:, 0], away[:, 2]).max())

    @property
    def stays(self) -> bool:
        """Whether it kept its place beside the vehicle."""
        return self.frames > 1 and self.spread_m <= _MOVES_M


def largest_things(store: Store, measurement_id: str, rig: Rig) -> Sequence[Mapping[str, Any]]:
    """By LiDAR and frame the largest thing that is not there, and who says so; nothing of a rig with cameras."""
    return [] if rig.cameras else rows_of(run_sql(store, _LARGEST_THINGS.format(measurement_id)))


def contradictions(
    things: Iterable[Mapping[str, Any]], rig: Rig, frames: Collection[int], attacked: Collection[int]
) -> tuple[Contradiction, ...]:
    """Those of the frames of an incident, those of most frames first; of the attacked sensors where some are named."""
    by_frame: dict[int, list[Mapping[str, Any]]] = {}
    for row in things:
        if row["frame"] in frames and (not attacked or row["sensor"] in attacked):
            by_frame.setdefault(row["sensor"], []).append(row)
    told = [_told(rig, sensor, rows) for sensor, rows in by_frame.items()]
    return tuple(sorted(told, key=lambda one: -one.frames))


def _told(rig: Rig, sensor: int, rows: list[Mapping[str, Any]]) -> Contradiction:
    by = Counter(one for row in rows for one in sorted(row["by"]))
    by_past = by.pop(sensor, 0)
    place_m = np.array([row["centre_m"] for row in rows]) @ rig.lidars[sensor].rig_SE3_lidar[:3, :3].T
    wide_m, tall_m, _ = np.median([row["size_m"] for row in rows], axis=0).tolist()
    points = round(np.median([row["points"] for row in rows]))
    return Contradiction(sensor, by, by_past, place_m, wide_m, tall_m, points)


def _over(height_m: float) -> str:
    return f"{abs(height_m):.1f} m {'above' if height_m >= 0 else 'below'}"
