"""A sketch of where a vehicle drove, with the place of an incident: drawn from poses, no map and no network needed."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.store.export import rows_of
from auditor.store.queries import run_sql
from auditor.store.store import Store

_EARTH_M_PER_DEG = 111_320.0
_SIZE, _MARGIN = 480, 40
_SCALES_M = tuple(factor * 10.0**power for power in range(-1, 6) for factor in (1, 2, 5))
_POSES = """
    SELECT frame, latitude_deg, longitude_deg, x_m, y_m
    FROM poses
    WHERE measurement_id = '{}'
    QUALIFY row_number() OVER (
        PARTITION BY frame ORDER BY latitude_deg IS NULL, abs(offset_ns), topic, frame_id
    ) = 1
    ORDER BY frame
"""


@dataclass(frozen=True, eq=False)
class Track:
    """Where a vehicle was: `frames` (F,), `xy_m` (F, 2), east and north or x and y of the first pose's frame."""

    frames: NDArray[np.int64]
    xy_m: NDArray[np.float64]
    of_fixes: bool


def track_of(store: Store, measurement_id: str) -> Track | None:
    """The track of a measurement's frames; None where no two poses of one kind were recorded."""
    rows = rows_of(run_sql(store, _POSES.format(measurement_id)))
    fixes = [row for row in rows if row["latitude_deg"] is not None]
    local = [row for row in rows if row["latitude_deg"] is None and row["x_m"] is not None and row["y_m"] is not None]
    if len(fixes) > 1:
        return _of_fixes(fixes)
    if len(local) > 1:
        xy = np.array([(row["x_m"], row["y_m"]) for row in local], dtype=np.float64)
        return Track(np.array([row["frame"] for row in local]), xy - xy[0], of_fixes=False)
    return None


def _of_fixes(rows: list[dict[str, float]]) -> Track:
    """Metres on a plane that touches the earth at the first fix."""
    degrees = np.array([(row["longitude_deg"], row["latitude_deg"]) for row in rows], dtype=np.float64)
    offset = degrees - degrees[0]
    offset[:, 0] = (offset[:, 0] + 180) % 360 - 180
    metres = offset * _EARTH_M_PER_DEG
    metres[:, 0] *= math.cos(math.radians(degrees[0, 1]))
    return Track(np.array([row["frame"] for row in rows]), metres, of_fixes=True)


def sketch(track: Track, first_frame: int, last_frame: int) -> str:
    """An SVG image of a track; the part from one frame to another is thick and red, its beginning a dot."""
    low, high = track.xy_m.min(axis=0), track.xy_m.max(axis=0)
    extent = max(float((high - low).max()), 1.0)
    scale = (_SIZE - 2 * _MARGIN) / extent
    centred = (track.xy_m - (low + high) / 2) * scale
    points = np.column_stack([_SIZE / 2 + centred[:, 0], _SIZE / 2 - centred[:, 1]])
    inside = (track.frames >= first_frame) & (track.frames <= last_frame)
    nearest = int(np.argmin(np.abs(track.frames - first_frame)))
    marked = points[inside] if inside.any() else points[nearest : nearest + 1]
    bar_m = max((one for one in _SCALES_M if one <= extent / 2), default=_SCALES_M[0])
    axes = "north is up" if track.of_fixes else "x to the right, y up"
    return "\n".join(
        (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_SIZE} {_SIZE}" width="{_SIZE}" height="{_SIZE}" '
            'role="img" font-family="sans-serif" font-size="13">',
            f"<title>Where the vehicle drove, {axes}; the incident is red</title>",
            f'<rect width="{_SIZE}" height="{_SIZE}" fill="#fff"/>',
            f'<polyline points="{_listed(points)}" fill="none" stroke="#888" stroke-width="2"/>',
            f'<polyline points="{_listed(marked)}" fill="none" stroke="#c00" stroke-width="6" stroke-linecap="round"/>',
            f'<circle cx="{marked[0, 0]:.1f}" cy="{marked[0, 1]:.1f}" r="7" fill="#c00"/>',
            f'<path d="M{_MARGIN} {_SIZE - 22}h{bar_m * scale:.1f}" stroke="#000" stroke-width="3"/>',
            f'<text x="{_MARGIN}" y="{_SIZE - 6}">{bar_m:g} m, {axes}</text>',
            "</svg>\n",
        )
    )


def _listed(points: NDArray[np.float64]) -> str:
    """Points of a line; one point alone is a line to itself."""
    kept = points[np.r_[True, np.any(np.diff(np.round(points, 1), axis=0) != 0, axis=1)]]
    kept = kept if len(kept) > 1 else np.repeat(kept, 2, axis=0)
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in kept.tolist())
