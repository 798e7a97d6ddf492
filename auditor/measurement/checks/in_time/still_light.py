"""Still light: light that stays at its place in a camera's picture while the scene moves through it.

A point of the scene has the same radiance now and a moment ago. Where it lies in both pictures follows from the LiDAR's
range and from how the camera moved. So after the tone curve of the two pictures the difference of its levels is light
that was added where it is now, less light that was added where it was then. Round lights are tried all over the
picture: of each, points that moved into it have to be brighter, and those that moved out of it darker, and some of
them have to saturate in it. What saturates in both pictures says nothing, and is no evidence against a light: one that
is opaque shows at its rim alone. Between drops of mud it is brighter too, as the scene itself is there. A light has to
have shown at the same place a frame before, or to fade at its edge; else it counts for less. What passes near by, as a
roof that reflects the sky, is another light in each frame, and ends at edges.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.measurement.disparity.half_resolution import halve
from auditor.measurement.ego_motion import Motion, pixels_of
from auditor.measurement.parameters import HALF, LIDAR_PROJECTION
from auditor.measurement.time_parameters import STILL_LIGHT
from auditor.measurement.tone_curve import saturation_level, tone_curve
from auditor.model.arrays import Floats, Floats32, Image, Indices, Mask
from auditor.model.optics.geometry import Matrix

_STEP = HALF * HALF
_MIDDLE = (1 / _STEP - 1) / 2
_QUARTERED = np.array([[1 / _STEP, 0, _MIDDLE], [0, 1 / _STEP, _MIDDLE], [0, 0, 1]])
"""From pixels to quarter px."""
_NEARBY = np.ones((STILL_LIGHT.nearby_px, STILL_LIGHT.nearby_px), dtype=np.uint8)
_AROUND = np.ones((3, 3), dtype=np.uint8)
_WHITE = 255
_VARIANCE = 1 / 12
"""That of a pixel's own width."""


@dataclass(frozen=True, eq=False)
class Glimpse:
    """What is kept of a frame: its picture at `half` resolution, and at a quarter, (h, w) means of levels.

    `intrinsics` (3, 3) are those of such a picture, `nearest_m` (h, w) the depth of the nearest LiDAR point around each
    pixel, out to the LiDAR's next rows above and below; inf where there is none. `world_SE3_camera` is where the
    camera was, after `way_m`; `stamp_ns` when.
    """

    stamp_ns: int
    half: Image
    levels: Image
    saturation: int
    intrinsics: Matrix
    nearest_m: Floats32
    world_SE3_camera: Motion
    way_m: float

    @classmethod
    def of(
        cls, stamp_ns: int, half: Image, intrinsics: Matrix, point_m: Matrix, placed: tuple[Motion, float]
    ) -> "Glimpse":
        """Of a half-resolution grey picture, the camera's intrinsics and its LiDAR points (M, 3) in its own frame."""
        quarter = halve(half)
        K = _QUARTERED @ intrinsics
        nearest = np.full(quarter.shape, np.inf, dtype=np.float32)
        place = np.rint(pixels_of(K, point_m)).astype(np.intp)
        inside = ((place >= 0) & (place < quarter.shape[::-1])).all(axis=1)
        column, row = place[inside].T
        np.minimum.at(nearest, (row, column), point_m[inside, 2].astype(np.float32))
        blurred = np.asarray(cv2.blur(quarter, (STILL_LIGHT.mean_px, STILL_LIGHT.mean_px)), dtype=np.uint8)
        rows = max(STILL_LIGHT.nearby_px, 2 * _rows_apart(row, column) + 1)
        nearest = np.asarray(cv2.erode(nearest, np.ones((rows, STILL_LIGHT.nearby_px), dtype=np.uint8)))
        return cls(stamp_ns, half, blurred, saturation_level(quarter), K, nearest, *placed)

    @cached_property
    def highest(self) -> Image:
        """(h, w) the highest level nearby."""
        return np.asarray(cv2.dilate(self.levels, _NEARBY), dtype=np.uint8)

    @cached_property
    def lowest(self) -> Image:
        """(h, w) the lowest level nearby."""
        return np.asarray(cv2.erode(self.levels, _NEARBY), dtype=np.uint8)

    @cached_property
    def fading(self) -> Image:
        """(h, w) 1 at the pixels of patches that saturate, are round and fade at their edge, as thrown light does."""
        saturated = self.levels >= self.saturation
        count, patch = cv2.connectedComponents(saturated.view(np.uint8), connectivity=8, ltype=cv2.CV_32S)
        around = np.asarray(cv2.dilate(patch.astype(np.float32), _AROUND))
        edge = np.flatnonzero((around > 0) & ~saturated)
        ways = (cv2.Sobel(self.levels, cv2.CV_32F, *way, ksize=3, scale=1 / 8) for way in ((1, 0), (0, 1)))
        steep = np.hypot(*(np.asarray(slope).take(edge) for slope in ways)) > STILL_LIGHT.fades
        of = around.take(edge).astype(np.intp)
        steep_of, edge_of = (np.bincount(some, minlength=count) for some in (of[steep], of))
        fades = (2 * steep_of < edge_of) & (_roundness(np.asarray(patch, dtype=np.int32), count) >= STILL_LIGHT.round)
        fades[0] = False
        return np.asarray(fades[np.asarray(patch)], dtype=np.uint8)

    def since(self, before: "Glimpse") -> Motion:
        """How the camera moved: from its frame now to its frame before."""
        back = before.world_SE3_camera.rotation.T
        turned = back @ self.world_SE3_camera.rotation
        return Motion(turned, back @ (self.world_SE3_camera.translation_m - before.world_SE3_camera.translation_m))


def _roundness(patch: NDArray[np.int32], count: int) -> Floats:
    """(count,) of the pixels of each number but 0 of a picture (h, w) the shorter over the longer axis of them."""
    row, column = (axis.astype(np.float64) for axis in np.nonzero(patch))
    number = patch[patch > 0]
    pixels = np.maximum(np.bincount(number, minlength=count), 1)

    def mean(values: Floats) -> Floats:
        return np.asarray(np.bincount(number, weights=values, minlength=count) / pixels)

    across, down = mean(column), mean(row)
    xx = mean(column * column) - across * across + _VARIANCE
    yy = mean(row * row) - down * down + _VARIANCE
    apart = np.hypot((xx - yy) / 2, mean(column * row) - across * down)
    middle = (xx + yy) / 2
    return np.asarray(np.sqrt(np.maximum(middle - apart, 0) / (middle + apart)))


class OfThePast(NamedTuple):
    """The statistic of a frame, 0 to 1, and the share of the camera's picture that was compared for it.

    `lights` (L,), 0 to 1, is what each of the lights that are tried shows in this frame alone, in the order of
    `_lights`.
    """

    statistic: float
    looked_share: float
    lights: Floats


class _ShownCells(NamedTuple):
    """Cells of the picture now, by what their points show: weights (C,), residuals (C,) and where they lie (C, 2).

    They have so many `points` (C,), of which so many are `saturated` (C,) now, and so many of these `fading` (C,), and
    so many `were_saturated` (C,) a moment ago, where they lay `before` (C, 2). `blind` (C, 2) are the corners of cells,
    and `blind_weight` (C,) their weights, by the points that saturate in both pictures.
    """

    weight: Floats
    residual: Floats
    points: Floats
    saturated: Floats
    fading: Floats
    were_saturated: Floats
    now: Floats
    before: Floats
    blind: Floats
    blind_weight: Floats


def measure_still_light(
    now: Glimpse, point_m: Matrix, held: Sequence[Glimpse], last: OfThePast | None
) -> OfThePast | None:
    """What the LiDAR's points (M, 3), in the camera's frame, say of light in its picture by earlier ones.

    None where none of those that are `held`, oldest first, is far enough away, or too few points moved. `last` is what
    was found of the frame before, None where it was compared with nothing.
    """
    chosen = _chosen(now, held)
    point_m = point_m[:: max(-(-len(point_m) // STILL_LIGHT.most_points), 1)]
    here = pixels_of(now.intrinsics, point_m).T
    inside = _inside(now, here)
    seen = [
        shown_cells
        for before in chosen
        if (shown_cells := _compared(now, before, point_m[inside], here[:, inside])) is not None
    ]
    if not seen:
        return None
    cells = max(len(one.weight) for one in seen) * _cell_px(now) ** 2
    lights, fading = _shown(now, seen)
    before = np.zeros_like(lights) if last is None else last.lights
    twice = np.sqrt(lights * np.maximum(before, np.maximum(fading, STILL_LIGHT.once_share) * lights))
    return OfThePast(float(twice.max()), min(cells / now.levels.size, 1.0), lights)


def _chosen(now: Glimpse, held: Sequence[Glimpse]) -> list[Glimpse]:
    """The last pictures since which the camera moved far enough, for each of the ways that are asked for."""
    ways = [now.way_m - one.way_m for one in held]
    glimpses: dict[int, Glimpse] = {}
    for asked in STILL_LIGHT.ways_m:
        far = [place for place, way in enumerate(ways) if way >= asked]
        if far:
            glimpses[far[-1]] = held[far[-1]]
    return list(glimpses.values())


def _cell_px(now: Glimpse) -> int:
    width: int = now.levels.shape[1]
    return max(round(width * STILL_LIGHT.cell), 1)


def _rows_apart(row: Indices, column: Indices) -> int:
    """How many pixels lie between the LiDAR's rows: the median of its points (M,) one above the other."""
    height = int(row.max(initial=0)) + 1
    place = np.sort(column * height + row)
    steps = np.diff(place)[np.diff(place // height) == 0]
    steps = steps[steps > 0]
    return min(int(np.median(steps)), STILL_LIGHT.most_apart_px) if steps.size else 1


def _compared(now: Glimpse, before: Glimpse, point_m: Matrix, here: Floats) -> _ShownCells | None:
    """What points (M, 3), `here` (2, M) in the picture now, show in two pictures, by cells of the one now.

    None where too few of them are seen in both.
    """
    motion, K = now.since(before), before.intrinsics
    there_m = K @ motion.rotation @ point_m.T + (K @ motion.translation_m)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        there, depth_m = there_m[:2] / there_m[2], there_m[2]
    moved = (depth_m > LIDAR_PROJECTION.nearest_m) & (np.hypot(*(here - there)) >= STILL_LIGHT.least_px)
    seen = np.flatnonzero(moved & _inside(before, there))
    place = _pixels(before, there[:, seen])
    shown = before.nearest_m.take(place) >= depth_m[seen] * STILL_LIGHT.hidden_share
    seen, place = seen[shown], place[shown]
    here, there = here[:, seen], there[:, seen]
    shown_at = _pixels(now, here)
    residual, saturated, were_saturated = _residual(now, before, shown_at, place)
    if np.count_nonzero(~(saturated & were_saturated)) < STILL_LIGHT.fewest_points:
        return None
    fading = saturated & (now.fading.take(shown_at) > 0)
    return _by_cells(now, here, there, residual, saturated, were_saturated, fading)


def _inside(glimpse: Glimpse, place: Floats) -> Mask:
    """(P,) mask of the places (2, P) that lie in a picture."""
    return np.asarray(((place >= 0) & (place <= np.array(glimpse.levels.shape[::-1])[:, None] - 1)).all(axis=0))


def _pixels(glimpse: Glimpse, place: Floats) -> Indices:
    """(P,) the pixels of a picture, row by row, that are the nearest to places (2, P): levels are means already."""
    column, row = np.rint(place).astype(np.intp)
    return np.asarray(row * glimpse.levels.shape[1] + column)


def _residual(now: Glimpse, before: Glimpse, here: Indices, there: Indices) -> tuple[Floats32, Mask, Mask]:
    """(P,) by what share points are brighter than all predicted nearby, or darker; which saturate now, and did before.

    They are at pixels `here` (P,) and were `there` (P,). What was saturated may be brighter by any amount, and what is
    saturated is not darker.
    """
    level, was = now.levels.take(here), before.levels.take(there)
    highest, lowest = before.highest.take(there), before.lowest.take(there)
    saturated, was_saturated = level >= now.saturation, was >= before.saturation
    fitted = ~saturated & ~was_saturated
    curve = tone_curve(was[fitted], level[fitted]).astype(np.float32)
    upper = np.where(highest >= before.saturation, np.float32(_WHITE), curve.take(highest))
    lower = np.where(saturated, np.float32(0), curve.take(lowest))
    value = level.astype(np.float32)
    nearest = np.minimum(np.maximum(value, lower), np.maximum(upper, lower))
    residual = (value - nearest) / (np.float32(STILL_LIGHT.level) + np.float32(STILL_LIGHT.share) * nearest)
    return np.clip(residual, -1, 1), saturated, was_saturated


def _by_cells(
    now: Glimpse, here: Floats, there: Floats, residual: Floats32, saturated: Mask, were_saturated: Mask, fading: Mask
) -> _ShownCells:
    cell_px = _cell_px(now)
    columns = -(-now.levels.shape[1] // cell_px)
    column, row = (here / cell_px).astype(np.intp)
    place = row * columns + column
    blind = saturated & were_saturated
    blind_count = np.bincount(place[blind])
    of_blind = np.flatnonzero(blind_count)
    corners = np.stack([of_blind % columns, of_blind // columns], axis=1) * float(cell_px)
    told = ~blind
    place = place[told]
    count = np.bincount(place)
    held = np.flatnonzero(count)

    def total(values: Floats | Floats32 | Mask) -> Floats:
        return np.asarray(np.bincount(place, weights=values[told])[held])

    points = count[held].astype(np.float64)
    where, was = (np.stack([total(axis) for axis in one], axis=1) / points[:, None] for one in (here, there))
    return _ShownCells(
        _weight(points),
        total(residual) / points,
        points,
        total(saturated),
        total(fading),
        total(were_saturated),
        where,
        was,
        corners,
        _weight(blind_count[of_blind]),
    )


def _weight(points: Floats | Indices) -> Floats:
    """(C,) of cells of so many points."""
    return np.asarray(np.minimum(points / STILL_LIGHT.full_points, 1.0))


def _shown(now: Glimpse, seen: Sequence[_ShownCells]) -> tuple[Floats, Floats]:
    """(L,) for each round light the mean of what its two sides show, 0 to 1, and less where too few points saturate.

    Beside it (L,) the share of the points in it that saturate now which are of patches that fade.

    A side is of the points that moved into the light, or out of it: the mean of their residuals, weighed by how much
    the light changes along their way. A share of the light's own area counts as showing nothing, so that a light of
    which a corner alone is in view needs more; what saturates in both pictures counts less there.
    """
    strengths, faded, cell_px = [], [], _cell_px(now)
    height, width = now.levels.shape
    for sigma_px, across, down in _lights(height, width):
        count = down.size * across.size
        blind, weights, came, left = np.zeros(count), np.zeros((2, count)), np.zeros((count, 4)), np.zeros((count, 3))
        for cells in seen:
            # Not by BLAS: on some processors it flags invalid values here, and scans printed the warning.
            lit, weight = _lit(cells.blind, sigma_px, across, down), cells.blind_weight.astype(np.float32)
            blind += np.einsum("lc,c->l", lit, weight)
            added = _lit(cells.now, sigma_px, across, down) - _lit(cells.before, sigma_px, across, down)
            changes = np.clip(added * np.float32(STILL_LIGHT.strength), -1, 1)
            shown, weight = cells.weight * cells.residual, cells.weight.astype(np.float32)
            inside, outside = np.maximum(changes, 0), np.maximum(-changes, 0)
            weights += [np.square(side) @ weight for side in (inside, outside)]
            came += inside @ np.stack([shown, cells.points, cells.saturated, cells.fading], axis=1, dtype=np.float32)
            left += outside @ np.stack([-shown, cells.points, cells.were_saturated], axis=1, dtype=np.float32)
        (into, of_inside, saturated, fading), (out, of_outside, were_saturated) = came.T, left.T
        area = 2 * np.pi * sigma_px**2 / cell_px**2 * len(seen)
        nothing = STILL_LIGHT.unseen_share * np.maximum(area - (1 - STILL_LIGHT.blind_counts) * blind, 0)
        shown_by = (into / (weights[0] + nothing) + out / (weights[1] + nothing)) / 2
        came_bright = saturated / np.maximum(of_inside, 1)
        left_bright = were_saturated / np.maximum(of_outside, 1)
        # What left a light that is not there any more says nothing of now.
        bright = np.maximum(came_bright, np.minimum(left_bright, blind / area))
        outshines = np.minimum(bright / STILL_LIGHT.saturated_share, 1)
        strengths.append(np.clip(shown_by * outshines, 0, 1))
        faded.append(np.divide(fading, saturated, out=np.zeros_like(fading), where=saturated > 0))
    return np.concatenate(strengths), np.concatenate(faded)


def _lit(place: Floats, sigma_px: float, across: Floats, down: Floats) -> Floats32:
    """(lights, C) how bright each light of one size is at places (C, 2), 1 in its middle."""
    columns, rows = (
        np.exp(-np.square(middles[:, None] - at) / (2 * sigma_px**2)).astype(np.float32)
        for middles, at in ((across, place[:, 0]), (down, place[:, 1]))
    )
    return (rows[:, None] * columns[None]).reshape(across.size * down.size, len(place))


@lru_cache(maxsize=8)
def _lights(height: int, width: int) -> list[tuple[float, Floats, Floats]]:
    """The sizes of lights that are tried, and the columns and rows of their middles."""
    lights = []
    for share in STILL_LIGHT.sizes:
        sigma_px = share * width
        step = STILL_LIGHT.apart * sigma_px
        lights.append((sigma_px, np.arange(0, width + step / 2, step), np.arange(0, height + step / 2, step)))
    return lights
