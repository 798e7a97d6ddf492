"""Point clouds as pictures: one, or all of a moment, from above, and one as a range image."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import cv2
import numpy as np

from auditor.measurement.localisation.points import among
from auditor.model.arrays import Floats, Image, Indices, Mask, Points
from auditor.model.optics.geometry import Matrix
from auditor.model.pictures import DAMAGED_COLOUR, LIDAR_COLOURS
from auditor.model.rig import Rig

_GROUND, _LINES, _WORDS = (28, 24, 22), (80, 72, 66), (190, 185, 180)
_FONT, _FONT_SCALE = cv2.FONT_HERSHEY_SIMPLEX, 0.45

_RED, *_OF_LIDARS = ((rgb[2], rgb[1], rgb[0]) for rgb in map(bytes.fromhex, (DAMAGED_COLOUR, *LIDAR_COLOURS)))
_WHITE = (255, 255, 255)

_ABOVE_PX = 900
_RING_M = 10.0
_RINGS_CLOSER_M, _BEYOND = 20.0, 1.25
_EDGE_PX, _FRAME_PX, _LINE_PX, _LARGER = 40, 8, 20, 0.6
_REACHES_M = (10.0, 20.0, 40.0, 60.0, 80.0, 120.0)
_SHOWN_SHARE = 0.95
"""Of the points: the view from above reaches as far as the smallest of its reaches that holds so many of them."""
_HEIGHTS_M = (-3.0, 3.0)

_RANGE_PX = (1440, 256)
_NEAR_M, _FAR_M = 2.0, 80.0
_ELEVATIONS_SHARE = (0.001, 0.999)
_LEGEND_PX = 22


class ThingInFrame(NamedTuple):
    """The points (N, 3), at least one, of a thing of another LiDAR, in the frame of the one whose picture is drawn."""

    sensor: int
    points: Points


def seen_from_above(points: Points, damaged: Mask, rig_SE3_lidar: Matrix) -> Image:
    """(S, S, 3) BGR: the vehicle in the middle, ahead is up; colour is height, damaged points are red and larger.

    `points` (N, 3) are in the LiDAR's frame, `damaged` (N,) says which are; a ring is 10 m.
    """
    right, down, forward = _in_rig(points, rig_SE3_lidar)
    above = _Above(_reach(np.hypot(right, forward)), _RING_M)
    column, row, inside = above.pixels(right, forward)
    above.drawn[row[inside], column[inside]] = _colours(-down, *_HEIGHTS_M)[inside]
    above.mark(right[damaged], forward[damaged], 2)
    cv2.drawMarker(above.drawn, (above.middle, above.middle), _WORDS, cv2.MARKER_TRIANGLE_UP, 14, 2)
    above.say([f"from above, rings of {_RING_M:.0f} m, ahead is up; {_count(damaged)}"], _FONT_SCALE)
    return above.drawn


def seen_together(points: Mapping[int, Points], damaged: Mapping[int, Mask], rig: Rig) -> Image:
    """(S, S, 3) BGR: the clouds of LiDARs, each in its colour, in one view from above with S_0 in the middle.

    `points` and `damaged` are as in `seen_from_above`, by LiDAR. Damaged points are red, rimmed in white, and the view
    reaches just beyond them.
    """
    places_m = {
        sensor: rig.lidars[sensor].rig_SE3_lidar[:3, 3] - rig.lidars[0].rig_SE3_lidar[:3, 3] for sensor in points
    }
    placed = {
        sensor: _in_rig(own, rig.lidars[sensor].rig_SE3_lidar) + places_m[sensor][:, None]
        for sensor, own in points.items()
    }
    marked = {sensor: own[:, damaged[sensor]] for sensor, own in placed.items()}
    away_m = np.concatenate([np.hypot(own[0], own[2]) for own in (marked if _any(damaged) else placed).values()])
    reach_m = _reach(away_m * _BEYOND) if _any(damaged) else _reach(away_m)
    above = _Above(reach_m, _RING_M if reach_m > _RINGS_CLOSER_M else _RING_M / 2)
    for sensor in sorted(placed, key=lambda one: -placed[one].shape[1]):  # the sparse ones on top of the dense
        right, _, forward = placed[sensor]
        above.dot(right, forward, _OF_LIDARS[sensor])
    above.axes()
    for right, _, forward in marked.values():
        above.mark(right, forward, 4, rimmed=True)
    above.sensors(places_m)
    words = [f"red: points of S_{sensor} that are contradicted" for sensor in points if damaged[sensor].any()]
    above.say([f"from above, rings of {above.ring_m:.0f} m around S_0", *words], _LARGER)
    return above.drawn


class _Above:
    """A picture from above: rings around the middle, ahead is up."""

    def __init__(self, reach_m: float, ring_m: float) -> None:
        self.drawn: Image = np.full((_ABOVE_PX, _ABOVE_PX, 3), _GROUND, dtype=np.uint8)
        self.middle, self.ring_m = _ABOVE_PX // 2, ring_m
        self._scale = _ABOVE_PX / (2 * reach_m)
        self._rings_m = np.arange(ring_m, reach_m * 1.42, ring_m)
        for ring in self._rings_m:
            cv2.circle(self.drawn, (self.middle, self.middle), round(ring * self._scale), _LINES, 1, cv2.LINE_AA)

    def pixels(self, right: Floats, forward: Floats) -> tuple[Indices, Indices, Mask]:
        """The columns, rows and whether they are in the picture, of points (N,) so many metres right and ahead."""
        column, row = (
            np.floor(self.middle + sign * axis * self._scale).astype(np.intp)
            for sign, axis in ((1, right), (-1, forward))
        )
        return column, row, (column >= 0) & (column < _ABOVE_PX) & (row >= 0) & (row < _ABOVE_PX)

    def mark(self, right: Floats, forward: Floats, radius: int, *, rimmed: bool = False) -> None:
        """Draw points that are damaged."""
        column, row, inside = self.pixels(right, forward)
        places = list(zip(column[inside].tolist(), row[inside].tolist(), strict=True))
        for size, colour in [(radius + 1, _WHITE)] * rimmed + [(radius, _RED)]:
            for place in places:
                cv2.circle(self.drawn, place, size, colour, -1, cv2.LINE_AA)

    def dot(self, right: Floats, forward: Floats, colour: tuple[int, int, int]) -> None:
        """Draw points in a colour, two pixels wide."""
        column, row, inside = self.pixels(right, forward)
        for aside, below in ((0, 0), (1, 0), (0, 1), (1, 1)):
            places = np.minimum(row[inside] + below, _ABOVE_PX - 1), np.minimum(column[inside] + aside, _ABOVE_PX - 1)
            self.drawn[places] = colour

    def axes(self) -> None:
        """Say what is ahead and how far the rings are."""
        cv2.line(self.drawn, (self.middle, 0), (self.middle, _ABOVE_PX), _LINES, 1)
        cv2.line(self.drawn, (0, self.middle), (_ABOVE_PX, self.middle), _LINES, 1)
        _write(self.drawn, "ahead", (self.middle + 6, 22), _WORDS, _LARGER)
        _write(self.drawn, "right", (_ABOVE_PX - 56, self.middle - 8), _WORDS, _LARGER)
        for ring in self._rings_m:
            if (column := self.middle + round(ring * self._scale)) < _ABOVE_PX - _EDGE_PX:
                _write(self.drawn, f"{ring:.0f} m", (column - 20, self.middle + 20), _WORDS, _LARGER)

    def sensors(self, places_m: Mapping[int, Matrix]) -> None:
        """Draw LiDARs at their places; the name of one stands below that of one ahead of it."""
        below = 0
        for sensor, (right, _, forward) in sorted(places_m.items(), key=lambda one: -one[1][2]):
            (column,), (row,), _ = self.pixels(np.array([right]), np.array([forward]))
            cv2.circle(self.drawn, (int(column), int(row)), 7, _OF_LIDARS[sensor], -1, cv2.LINE_AA)
            cv2.circle(self.drawn, (int(column), int(row)), 7, _GROUND, 2, cv2.LINE_AA)
            below = max(int(row) + 6, below + _LINE_PX)
            _write(self.drawn, f"S_{sensor}", (int(column) - 46, below), _OF_LIDARS[sensor], _LARGER)

    def say(self, lines: Sequence[str], size: float) -> None:
        """Write lines at the bottom."""
        for place, line in enumerate(reversed(lines)):
            row = _ABOVE_PX - 10 - round(50 * size) * place
            _write(self.drawn, line, (8, row), _WORDS, size)


def _write(drawn: Image, text: str, at: tuple[int, int], colour: tuple[int, int, int], size: float) -> None:
    """Write in a colour on whatever is there."""
    cv2.putText(drawn, text, at, _FONT, size, _GROUND, 5, cv2.LINE_AA)
    cv2.putText(drawn, text, at, _FONT, size, colour, 1, cv2.LINE_AA)


def range_image(points: Points, damaged: Mask, rig_SE3_lidar: Matrix, framed: Sequence[ThingInFrame] = ()) -> Image:
    """(H, W, 3) BGR: columns are azimuths, rows elevations; colour is range, near is red, damaged points are white.

    Azimuths are those of the cloud, straight ahead in their middle where it looks all around. `framed` are things of
    other LiDARs that the beams of this one went through: a frame shows where they would be.
    """
    width, height = _RANGE_PX
    drawn = np.full((height + _LEGEND_PX, width, 3), _GROUND, dtype=np.uint8)
    away = points.any(axis=1)
    directions = np.stack(_directions(points[away], rig_SE3_lidar))
    if directions.size:
        order = np.argsort(-directions[2])  # far to near: of several points in a pixel the nearest stays
        (azimuth, elevation, range_m), marked = directions[:, order], damaged[away][order]
        lowest, highest = np.quantile(elevation, _ELEVATIONS_SHARE)
        column, row = (
            _placed(azimuth, azimuth.min(), azimuth.max(), width),
            _placed(-elevation, -highest, -lowest, height),
        )
        colours = _colours(-np.log(range_m), -np.log(_FAR_M), -np.log(_NEAR_M))
        colours[marked] = _WHITE
        # Beams are sparser than rows: a point is three pixels high.
        for shift in (-1, 1, 0):
            drawn[np.clip(row + shift, 0, height - 1), column] = colours
        for shift in (-1, 0, 1):
            drawn[np.clip(row[marked] + shift, 0, height - 1), column[marked]] = _WHITE
        words = (
            f"azimuth {azimuth.min():+.0f} to {azimuth.max():+.0f} deg, elevation {lowest:+.0f} to {highest:+.0f} deg; "
            f"red {_NEAR_M:.0f} m, blue {_FAR_M:.0f} m; {_count(damaged)} (white)"
        )
        cv2.putText(drawn, words, (8, height + 16), _FONT, _FONT_SCALE, _WORDS, 1, cv2.LINE_AA)
        for thing in framed:
            _frame(drawn, thing, rig_SE3_lidar, (azimuth.min(), azimuth.max(), highest, lowest))
    return drawn


def _frame(drawn: Image, thing: ThingInFrame, rig_SE3_lidar: Matrix, limits_deg: Sequence[float]) -> None:
    """Draw a frame where the points of a thing would be in a range image of such azimuths and elevations."""
    width, height = _RANGE_PX
    least, most, highest, lowest = limits_deg
    azimuth, elevation, range_m = _directions(thing.points, rig_SE3_lidar)
    middle = float(np.median(azimuth))  # what stands behind goes over one edge, and not through the whole picture
    column = _placed(middle + (azimuth - middle + 180) % 360 - 180, least, most, width)
    row = _placed(-elevation, -highest, -lowest, height)
    left, top = int(column.min()) - _FRAME_PX, max(int(row.min()) - _FRAME_PX, 0)
    cv2.rectangle(drawn, (left, top), (int(column.max()) + _FRAME_PX, int(row.max()) + _FRAME_PX), _WHITE, 2)
    words = f"S_{thing.sensor} has points here, {np.median(range_m):.0f} m away"
    at = min(max(left, 4), width - 340), top - 8 if top > _EDGE_PX else int(row.max()) + _FRAME_PX + 22
    _write(drawn, words, at, _WHITE, _LARGER)


def _directions(points: Points, rig_SE3_lidar: Matrix) -> tuple[Floats, Floats, Floats]:
    """(N,) azimuths and elevations in degrees, and ranges in metres, of points away from the LiDAR."""
    right, down, forward = _in_rig(points, rig_SE3_lidar)
    range_m = np.sqrt(right**2 + down**2 + forward**2)
    return np.degrees(np.arctan2(right, forward)), np.degrees(np.arcsin(-down / range_m)), range_m


def _in_rig(points: Points, rig_SE3_lidar: Matrix) -> Floats:
    """(3, N): right, down and forward of the rig's directions, around the LiDAR."""
    return np.asarray((points @ rig_SE3_lidar[:3, :3].T).T, dtype=np.float64)


def _reach(distance_m: Floats) -> float:
    far = float(np.quantile(distance_m, _SHOWN_SHARE)) if len(distance_m) else 0.0
    return next((reach for reach in _REACHES_M if reach >= far), _REACHES_M[-1])


def _placed(values: Floats, low: float, high: float, size: int) -> Indices:
    """Where values lie among `size` pixels from `low` to `high`; those outside at the border."""
    share = (values - low) / max(high - low, 1e-9)
    return np.clip(np.floor(share * size), 0, size - 1).astype(np.intp)


def _colours(values: Floats, low: float, high: float) -> Image:
    """(N, 3) BGR of values from `low`, blue, to `high`, red."""
    if not len(values):
        return np.zeros((0, 3), dtype=np.uint8)
    levels = np.clip(255 * (values - low) / (high - low), 0, 255).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(levels.reshape(-1, 1), cv2.COLORMAP_TURBO).reshape(-1, 3), dtype=np.uint8)


def _any(damaged: Mapping[int, Mask]) -> bool:
    return any(mask.any() for mask in damaged.values())


def _count(damaged: Mask) -> str:
    points = int(np.count_nonzero(damaged))
    return f"{points} damaged point{'' if points == 1 else 's'}"


_WIDTH_PX = 640
_JPEG_QUALITY = 80


def small_jpeg(pixels: Image) -> bytes:
    """An image (H, W) or (H, W, 3) BGR as a JPEG, at most 640 px wide."""
    height, width = pixels.shape[:2]
    if width > _WIDTH_PX:
        size = _WIDTH_PX, max(1, round(height * _WIDTH_PX / width))
        pixels = np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])
    return data.tobytes()


def changed_cloud(before: Points, after: Points, rig_SE3_lidar: Matrix) -> Image:
    """(S, S, 3) BGR: both clouds from above; points that are in one of them alone are red."""
    removed = before[~among(before, after)]
    changed = np.concatenate([~among(after, before), np.ones(len(removed), dtype=np.bool_)])
    return seen_from_above(np.concatenate([after, removed]), changed, rig_SE3_lidar)
