"""One view for all cameras of a rig: how ideal cameras at the same places would look, and how much they would see.

All cameras get one orientation (z as near as can be to where they look, x along the line of their centres; where they
do not stand on one, upright) and one focal length, the shortest there is. Of the plane that they all look at, the
largest rectangle is kept that every camera sees whole: no pixel of a rectified image lies outside the recorded one,
and none needs a mask. What is counted are patches and windows of pixels, so pictures of cameras with few pixels are
enlarged: then a pixel is about as wide an angle for all.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from auditor.errors import RigError
from auditor.model.optics.geometry import Matrix, compose, motion
from auditor.model.optics.sensors import NO_LENS
from auditor.model.parameters import COMMON_VIEW
from auditor.model.rig import Camera, Rig

FARTHEST_PX = 4096
"""From the principal point; any focal length may be given, so it bounds the work."""
CELL_PX = 8
"""Between the rays that are tried: it bounds the work."""
_SHORTEST_AXIS = 0.1  # of a mean of unit vectors: cameras that look apart have none
NEAREST_AHEAD = 0.05
"""Of z of a ray (x, y, 1) in a camera's frame: it guards a division."""
_ENLARGED_IN_STEPS = 0.25  # of the pixels of the view a recorded one, so that like cameras have one view
_FEWEST_PX = 32  # of a view's sides: a matcher's windows do not fit into less

_STEP = 4
"""Pixels of a view from one ray to the next that is asked what of a picture is compared."""
_LOOKED_PX = 32
"""Width of the cells of a picture in which a compared ray counts for the whole cell."""


@dataclass(frozen=True, eq=False)
class IdealView:
    """`rig` is the ideal rig: same sensors, same numbers, cameras of one size and focal length that look the same way.

    They are rectified if they stand on one line. `view_SO3_rig` (3, 3) rotates the recorded rig's frame to its frame.
    `x` (width) and `y` (height) are the rays (x, y, 1) of its pictures' columns and rows. All cameras see
    `seen_px` of its pixels. A pixel of the shortest focal length is `scale` of them wide.
    """

    rig: Rig
    view_SO3_rig: Matrix
    focal_px: float
    x: Matrix
    y: Matrix
    seen_px: int
    scale: float


SharedView = tuple[IdealView, tuple[Camera, ...]]
"""A view, and the cameras of a rig that are compared in it."""


@cache
def view_scale(rig: Rig) -> float:
    """How many pixels of the view a recorded pixel of the shortest focal length is wide; 1 where it is not enlarged."""
    focal_px, widths_px = min(camera.focal_px for camera in rig.cameras), [camera.width_px for camera in rig.cameras]
    if min(widths_px) < COMMON_VIEW.fewest_enlarged_px:
        return 1.0
    by_width = COMMON_VIEW.usual_width_px / max(widths_px)
    scale = min(COMMON_VIEW.usual_focal_px / focal_px, by_width, COMMON_VIEW.most_enlarged)
    # Of simple ratios, so that pixels of one picture lie evenly among those of the other.
    return max(round(float(scale) / _ENLARGED_IN_STEPS) * _ENLARGED_IN_STEPS, 1.0)


@cache
def measured_view(rig: Rig) -> IdealView | None:
    """The view in which a rig is measured; None where that is of the pictures as they are recorded.

    Raises RigError where its cameras have none in common.
    """
    if not rig.is_rectified:
        return common_view(rig)
    scale = view_scale(rig) if rig.cameras else 1
    return None if scale == 1 else _enlarged(rig, scale)


def _enlarged(rig: Rig, scale: float) -> IdealView:
    """The view of a rectified rig whose pictures are enlarged."""
    ideal = resized(rig, scale)
    first = ideal.cameras[0]
    K = first.intrinsics
    x, y = (np.arange(first.width_px) - K[0, 2]) / K[0, 0], (np.arange(first.height_px) - K[1, 2]) / K[1, 1]
    return IdealView(ideal, np.eye(3), K[0, 0], x, y, first.width_px * first.height_px, scale)


def resized(rig: Rig, scale: float) -> Rig:
    """The rig whose cameras have `scale` times the pixels across and down, rounded."""
    return Rig(rig.lidar, tuple(_resized(camera, scale) for camera in rig.cameras))


def _resized(camera: Camera, scale: float) -> Camera:
    width, height = round(camera.width_px * scale), round(camera.height_px * scale)
    # The outer edges of both pictures coincide: pixel 0 is centred half a pixel from them.
    across, down = width / camera.width_px, height / camera.height_px
    pixels = np.array([[across, 0, (across - 1) / 2], [0, down, (down - 1) / 2], [0, 0, 1]])
    return replace(camera, width_px=width, height_px=height, projection=pixels @ camera.projection)


def common_view(rig: Rig, *, widest: bool = False, cell_px: int = CELL_PX) -> IdealView:
    """The view of all cameras: what they all see whole, or the `widest` that holds all they see.

    Rays `cell_px` apart are tried. Raises RigError where they have none in common.
    """
    view_SO3_rig, scale = _orientation(rig), view_scale(rig)
    focal = min(camera.focal_px for camera in rig.cameras) * scale
    left, top, width, height, seen_px = _window(rig, view_SO3_rig, focal, cell_px, scale, widest=widest)
    K = np.array([[focal, 0, -left], [0, focal, -top], [0, 0, 1]])
    x, y = (np.arange(width) + left) / focal, (np.arange(height) + top) / focal
    cameras = tuple(
        replace(
            camera,
            width_px=width,
            height_px=height,
            projection=K @ np.column_stack([np.eye(3), -(view_SO3_rig @ camera.centre_m)]),
            rectified=rig.shares_view,
            lens=NO_LENS,
        )
        for camera in rig.cameras
    )
    lidar = rig.lidar
    if lidar is not None:
        rotated = compose(motion(view_SO3_rig, np.zeros(3)), lidar.rig_SE3_lidar)
        lidar = replace(lidar, rig_SE3_lidar=rotated)
    return IdealView(Rig(lidar, cameras), view_SO3_rig, focal, x, y, seen_px, scale)


@cache
def compared_views(rig: Rig) -> tuple[SharedView, ...]:
    """The views in which cameras are compared, each with these cameras; of none that see nothing in common.

    Cameras that stand on one line are compared in the view that all of them see whole, others pair by pair in what
    both see.
    """
    if rig.n == 1 or rig.shares_view:
        return _whole_view(rig)
    views: list[SharedView] = []
    for i, k in rig.pairs:
        with suppress(RigError):
            views.append((common_view(rig.pair(i, k), widest=True), (rig.camera(i), rig.camera(k))))
    return tuple(views)


def _whole_view(rig: Rig) -> tuple[SharedView, ...]:
    with suppress(RigError):
        return ((measured_view(rig) or common_view(rig), rig.cameras),)
    return ()


@cache
def compared_shares(rig: Rig) -> dict[int, float]:
    """The share of each camera's picture, by its number, that is compared with another camera's.

    Cameras that see nothing in common have a share of 0, and so has a lone one.
    """
    if rig.n == 1:
        return {1: 0.0}
    return shown_shares(rig) if rig.shares_view else _shares(rig, compared_views(rig))


@cache
def shown_shares(rig: Rig) -> dict[int, float]:
    """The share of each camera's picture, by its number, that the view shows which all cameras see whole."""
    return dict.fromkeys(range(1, rig.n + 1), 1.0) if rig.is_rectified else _shares(rig, _whole_view(rig))


def _shares(rig: Rig, views: Sequence[SharedView]) -> dict[int, float]:
    """The share of each camera's picture that all cameras of a view see."""
    looked = {camera.number: np.zeros(_cells(camera), dtype=np.bool_) for camera in rig.cameras}
    for view, cameras in views:
        places = [recorded_pixels(c, view.view_SO3_rig, view.x[::_STEP], view.y[::_STEP]) for c in cameras]
        step = _STEP / view.scale
        seen = np.logical_and.reduce([sees(at, c, step) for at, c in zip(places, cameras, strict=True)])
        for camera, (u, v) in zip(cameras, places, strict=True):
            looked[camera.number][v[seen].astype(np.intp) // _LOOKED_PX, u[seen].astype(np.intp) // _LOOKED_PX] = True
    return {number: float(cells.mean()) for number, cells in looked.items()}


def _cells(camera: Camera) -> tuple[int, int]:
    """Rows and columns of the cells of a camera's picture."""
    return -(-camera.height_px // _LOOKED_PX), -(-camera.width_px // _LOOKED_PX)


@cache
def view_size_px(rig: Rig) -> tuple[int, int]:
    """Width and height of the largest image that a rig's counts can be of: recorded, or rectified; else 0."""
    cameras = list(rig.cameras)
    with suppress(RigError):  # nothing is measured in a view that does not exist
        view = measured_view(rig)
        cameras += () if view is None else view.rig.cameras
    sizes = [(camera.width_px, camera.height_px) for camera in cameras] or [(0, 0)]
    return max(width for width, _ in sizes), max(height for _, height in sizes)


def _orientation(rig: Rig) -> Matrix:
    """(3, 3) rotation to the view's axes: z as near as can be to where the cameras look, x along their line if any."""
    centres = np.array([camera.centre_m for camera in rig.cameras])
    if rig.n == 1 or not rig.shares_view:
        return upright(rig.cameras)
    along = np.linalg.svd(centres - centres.mean(axis=0))[2][0]
    x = along * np.sign(along @ (centres[0] - centres[-1]))  # S_1 is the rightmost
    z = np.sum([camera.rotation[2] for camera in rig.cameras], axis=0)
    z = z - x * (x @ z)
    if np.linalg.norm(z) < _SHORTEST_AXIS:
        raise RigError(f"{_names(rig)} look along the line they stand on", where="rig")
    z = z / np.linalg.norm(z)
    return np.stack([x, np.cross(z, x), z])


def upright(cameras: Sequence[Camera]) -> Matrix:
    """(3, 3) rotation to axes that suit cameras wherever they stand: z where they look on average, x to their right."""
    across, _, ahead = np.sum([camera.rotation for camera in cameras], axis=0)
    if np.linalg.norm(ahead) < _SHORTEST_AXIS * len(cameras):
        raise RigError("the cameras look in opposite directions", where="rig")
    z = ahead / np.linalg.norm(ahead)
    x = across - z * (z @ across)
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _names(rig: Rig) -> str:
    return ", ".join(camera.name for camera in rig.cameras)


def _window(
    rig: Rig, view_SO3_rig: Matrix, focal: float, cell_px: int, scale: float, *, widest: bool
) -> tuple[int, int, int, int, int]:
    """Left and top from the principal point, width and height, in pixels; and how many of them every camera sees."""
    # A damaged calibration may see next to nothing.
    reach = max(int(min(COMMON_VIEW.widest * focal, FARTHEST_PX) / cell_px), 1)
    places = np.arange(-reach, reach + 1) * cell_px / focal
    seen = np.ones((places.size, places.size), dtype=np.bool_)
    for camera in rig.cameras:
        seen &= sees(recorded_pixels(camera, view_SO3_rig, places, places), camera, cell_px / scale)
    top, left, rows, columns = _bounds(seen) if widest else largest_rectangle(seen)
    width, height = (columns - 1) * cell_px + 1, (rows - 1) * cell_px + 1
    if min(width, height) < _FEWEST_PX:
        raise RigError(
            f"{_names(rig)} have no view in common", where="rig", remedy="leave out the one that looks elsewhere"
        )
    seen_px = int(np.count_nonzero(seen)) * cell_px**2 if widest else width * height
    return (left - reach) * cell_px, (top - reach) * cell_px, width, height, seen_px


def sees(recorded: tuple[Matrix, Matrix], camera: Camera, step_px: float) -> NDArray[np.bool_]:
    """(rows, columns) mask of the `recorded_pixels` that lie in the camera's picture, not too near each other.

    They are those of rays that are `step_px` pixels of the shortest focal length apart.
    """
    u, v = recorded
    with np.errstate(invalid="ignore"):
        seen = (u >= 0) & (u <= camera.width_px - 1) & (v >= 0) & (v <= camera.height_px - 1)
        for axis in (0, 1):
            seen &= np.hypot(np.gradient(u, axis=axis), np.gradient(v, axis=axis)) > COMMON_VIEW.finest * step_px
    return seen


def _bounds(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Top, left, rows and columns of the smallest rectangle that holds all that is True; all 0 where nothing is."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if rows.size == 0:
        return 0, 0, 0, 0
    return int(rows[0]), int(columns[0]), int(rows[-1] - rows[0]) + 1, int(columns[-1] - columns[0]) + 1


def recorded_pixels(camera: Camera, view_SO3_rig: Matrix, x: Matrix, y: Matrix) -> tuple[Matrix, Matrix]:
    """Where a camera shows the view's rays (x, y, 1): (rows, columns) of recorded pixels, NaN behind its lens."""
    K, R = camera.intrinsics, camera.rotation @ view_SO3_rig.T
    across, down = np.meshgrid(x, y)
    ahead = R[2, 0] * across + R[2, 1] * down + R[2, 2]
    ahead = np.where(ahead > NEAREST_AHEAD, ahead, np.nan)
    bent_x, bent_y = camera.lens.distort(
        (R[0, 0] * across + R[0, 1] * down + R[0, 2]) / ahead, (R[1, 0] * across + R[1, 1] * down + R[1, 2]) / ahead
    )
    return K[0, 0] * bent_x + K[0, 1] * bent_y + K[0, 2], K[1, 1] * bent_y + K[1, 2]


def largest_rectangle(mask: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Top, left, rows and columns of the largest rectangle that is True all over; all 0 where nothing is."""
    best = (0, 0, 0, 0)
    heights = np.zeros(mask.shape[1], dtype=np.intp)
    for row, line in enumerate(mask):
        heights = np.where(line, heights + 1, 0)
        left, height, width = _under(heights.tolist())
        if height * width > best[2] * best[3]:
            best = (row - height + 1, left, height, width)
    return best


def _under(heights: list[int]) -> tuple[int, int, int]:
    """Left, height and width of the largest rectangle under a row of heights; each is pushed and popped once."""
    best, rising = (0, 0, 0), [(0, 0)]
    for place, height in enumerate([*heights, 0]):
        start = place
        while rising[-1][1] > height:
            start, taller = rising.pop()
            if taller * (place - start) > best[1] * best[2]:
                best = (start, taller, place - start)
        if height > rising[-1][1]:
            rising.append((start, height))
    return best
