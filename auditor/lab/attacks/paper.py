"""The paper's two attacks: a Gaussian facula on a camera, a bogus wall in a point cloud.

Both are frozen descriptions that change a copy of the data they are given. All that determines their effect is in
`parameters`: the ground truth that goes with the changed recording.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import numpy as np

from auditor.errors import SettingError
from auditor.lab.attacks.kinds import AttackDraw, CameraKind, LidarKind, place
from auditor.model.arrays import Floats, Floats32, Mask, Points
from auditor.model.frames import CameraImage, PointCloud
from auditor.model.rig import Camera, Rig

STRENGTHS = {"mild": 255.0, "strong": 510.0, "opaque": 2000.0}
"""Amplitude A of a facula in grey levels. The paper does not give its value, and the rates depend on it."""

PAPER_WIDTH_PX = 1242
"""The width of the paper's images: sizes in pixels are of such an image."""

_RADII_PX = (187.0, 375.0)  # at the nominal width
_RANGES_M = (6.0, 10.0)
_LATERALS_M = (-3.0, 3.0)
_BOTTOMS_M = (0.0, 0.6)
_RANGE_NOISE_M = 0.02
_LIDAR_HEIGHT_M = 1.73  # of the vehicle that KITTI was recorded with; used where a cloud shows no road
_ROAD_BELOW_M = (0.5, 4.0)
_ROAD_BIN_M = 0.05
_FAINTEST = 0.5  # grey levels: a smaller addition cannot change a pixel
_FEW_POINTS = 50
_NEAREST_M = 0.1
_DENSITY_CELL = 0.02  # radians: an HDL-64 has about 15 directions in a cell
_DENSITY_CELLS = 40
_USUAL_STEPS = (0.003, 0.008)  # radians, where a cloud is too small to tell


@dataclass(frozen=True)
class DescribedEffect:
    """An attack or fault whose fields are all that determines its effect."""

    @property
    def parameters(self) -> dict[str, object]:
        """All that determines its effect: the ground truth that goes with changed data."""
        return asdict(self)


def with_levels(image: CameraImage, levels: Floats | Floats32) -> CameraImage:
    """The image with other grey levels, rounded and clipped to those of a byte."""
    return replace(image, pixels=np.clip(np.rint(levels), 0, 255).astype(np.uint8))


@dataclass(frozen=True)
class RoundLight(DescribedEffect):
    """Light that fades from a centre: `amplitude` A in levels; `radius_px` R, `u_px` and `v_px` in the image's px."""

    amplitude: float
    radius_px: float
    u_px: float
    v_px: float


@dataclass(frozen=True)
class Facula(RoundLight):
    """A round Gaussian facula: I' = clip(I + A exp(-rho^2 / 2 sigma^2)), sigma = `sigma_share` R.

    The paper counts pi R^2 as the contaminated area; its light fades beyond R, and does not end there.
    """

    sigma_share: float = 0.5

    name = "facula"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image with the facula on it; colours are brightened alike."""
        height, width = image.pixels.shape[:2]
        sigma = self.sigma_share * self.radius_px
        reach = sigma * np.sqrt(2 * np.log(max(self.amplitude / _FAINTEST, 1)))
        columns, rows = _span(self.u_px, reach, width), _span(self.v_px, reach, height)
        across = np.exp(-((np.arange(columns.start, columns.stop) - self.u_px) ** 2) / (2 * sigma**2))
        down = np.exp(-((np.arange(rows.start, rows.stop) - self.v_px) ** 2) / (2 * sigma**2))
        light = self.amplitude * down[:, None] * across[None, :]
        if image.pixels.ndim == 3:
            light = light[:, :, None]
        pixels = image.pixels.copy()
        pixels[rows, columns] = np.clip(np.rint(pixels[rows, columns] + light), 0, 255).astype(np.uint8)
        return CameraImage(image.sensor, image.stamp_ns, pixels)


@dataclass(frozen=True)
class BogusWall(DescribedEffect):
    """Relayed pulses that show a wall facing the LiDAR and hide what is behind it.

    `range_m` ahead of the LiDAR along the cameras' viewing direction, its middle `lateral_m` to the right, its lower
    edge `bottom_m` above the road. `seed` determines the noise of its ranges.
    """

    range_m: float
    lateral_m: float
    bottom_m: float = 0.0
    width_m: float = 2.5
    height_m: float = 1.5
    seed: int = 0

    name = "wall"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud with the wall in it; its points keep their order, added ones come last.

        Beams that would have passed through the wall's outline return from it instead, so that it has the LiDAR's own
        pattern; points nearer than the wall stay. Where no pulse had returned, points are added at the cloud's
        own density. Raises SettingError for a rig without a LiDAR.
        """
        if rig.lidar is None:
            raise SettingError("a bogus wall needs a LiDAR, and the rig has none", where="S_0")
        rotation = rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32)
        points = cloud.xyz_m @ rotation.T  # right, down, forward of the LiDAR
        lower_m = road_below_m(points) - self.bottom_m
        hidden, outline = self._through(points, lower_m)
        rng = np.random.default_rng([self.seed, cloud.stamp_ns])
        on_wall = points[hidden] * (np.float32(self.range_m) / points[hidden, 2:])
        xyz = cloud.xyz_m.copy()
        xyz[hidden] = _noisy(on_wall, rng) @ rotation
        added = _noisy(self._unreturned(points, outline, lower_m), rng) @ rotation
        return PointCloud(cloud.stamp_ns, np.concatenate([xyz, added]))

    def _through(self, points: Points, lower_m: float) -> tuple[Mask, Mask]:
        """Which points lie behind the wall as the LiDAR sees it, and which lie inside its outline at any distance."""
        ahead = points[:, 2] > _NEAREST_M
        scale = np.float32(self.range_m) / np.where(ahead, points[:, 2], np.float32(np.inf))
        right, down = points[:, 0] * scale, points[:, 1] * scale
        inside = ahead & (np.abs(right - np.float32(self.lateral_m)) <= self.width_m / 2)
        inside &= (down >= lower_m - self.height_m) & (down <= lower_m)
        return inside & (points[:, 2] > self.range_m), inside

    def _unreturned(self, points: Points, outline: Mask, lower_m: float) -> Points:
        """(M, 3) points on the wall, on a grid as fine as the cloud, in those directions where the cloud has none."""
        step_right, step_down = (step * self.range_m for step in angular_steps(points))
        left_m, upper_m = self.lateral_m - self.width_m / 2, lower_m - self.height_m
        columns, rows = max(round(self.width_m / step_right), 1), max(round(self.height_m / step_down), 1)
        seen = points[outline] * (np.float32(self.range_m) / points[outline, 2:])
        column = np.minimum(((seen[:, 0] - left_m) / step_right).astype(np.intp), columns - 1)
        row = np.minimum(((seen[:, 1] - upper_m) / step_down).astype(np.intp), rows - 1)
        taken = np.zeros((rows + 2, columns + 2), dtype=bool)
        # A beam's neighbours are not on the grid's own lines, so that a cell beside a taken one is not a gap.
        for down, right in np.ndindex(3, 3):
            taken[row + down, column + right] = True
        row, column = np.nonzero(~taken[1:-1, 1:-1])
        across, below = left_m + (column + 0.5) * step_right, upper_m + (row + 0.5) * step_down
        return np.stack([across, below, np.full(row.size, self.range_m)], axis=1).astype(np.float32)


def draw_facula(rng: np.random.Generator, width_px: int, height_px: int, strength: str) -> Facula:
    """A facula of the paper's size, its centre anywhere in the image. Raises SettingError for an unknown strength."""
    if strength not in STRENGTHS:
        raise SettingError(f"{strength!r} is not a strength", where="facula", remedy=f"use {', '.join(STRENGTHS)}")
    radius = rng.uniform(*_RADII_PX) * width_px / PAPER_WIDTH_PX
    return Facula(STRENGTHS[strength], radius, rng.uniform(0, width_px), rng.uniform(0, height_px))


def draw_wall(rng: np.random.Generator) -> BogusWall:
    """A wall of the paper's size, at its distance, within three metres of straight ahead."""
    return BogusWall(
        range_m=rng.uniform(*_RANGES_M),
        lateral_m=rng.uniform(*_LATERALS_M),
        bottom_m=rng.uniform(*_BOTTOMS_M),
        seed=int(rng.integers(1 << 31)),
    )


def _span(centre: float, reach: float, size: int) -> slice:
    """The pixels of an axis within reach; empty where there are none."""
    first = int(np.clip(np.floor(centre - reach), 0, size))
    return slice(first, int(np.clip(np.ceil(centre + reach) + 1, first, size)))


def road_below_m(points: Points) -> float:
    """How far the road lies below the LiDAR, in metres: the most frequent height near and ahead.

    `points` is (N, 3): right, down, forward of the LiDAR.
    """
    low_m, high_m = _ROAD_BELOW_M
    right, down, forward = points.T
    near = down[(forward > 4) & (forward < 15) & (np.abs(right) < 4) & (down > low_m) & (down < high_m)]
    if near.size < _FEW_POINTS:
        return _LIDAR_HEIGHT_M
    counts, edges = np.histogram(near, bins=round((high_m - low_m) / _ROAD_BIN_M), range=_ROAD_BELOW_M)
    usual = edges[int(np.argmax(counts))]
    return float(np.median(near[(near > usual - _ROAD_BIN_M) & (near < usual + 2 * _ROAD_BIN_M)]))


def angular_steps(points: Points) -> tuple[float, float]:
    """Steps between neighbouring directions of a cloud, right and down, in radians; `points` as in `road_below_m`.

    The nearest neighbour of a direction is the next one of the same beam; the number of directions in a cell
    then gives the step between beams.
    """
    ahead = points[(points[:, 2] > _NEAREST_M) & (np.abs(points[:, 0]) < points[:, 2])]
    if len(ahead) < _FEW_POINTS:
        return _USUAL_STEPS
    direction = np.arctan2(ahead[:, :2], np.stack([ahead[:, 2], np.hypot(ahead[:, 0], ahead[:, 2])], axis=1))
    cell = np.floor(direction / _DENSITY_CELL).astype(np.int64) @ np.array([1, 1000])
    cells, counts = np.unique(cell, return_counts=True)
    usual = float(np.median(counts))
    sampled = cells[np.abs(counts - usual) <= 1][:_DENSITY_CELLS]
    if usual < 2 or sampled.size == 0:
        return _USUAL_STEPS
    right = float(np.median(np.concatenate([_nearest(direction[cell == one]) for one in sampled])))
    return right, max(_DENSITY_CELL**2 / (usual * right), right)


def _nearest(directions: Points) -> Points:
    """(N,) distance of each of (N, 2) directions to the nearest other one."""
    apart = directions[:, None] - directions
    distance = np.hypot(apart[..., 0], apart[..., 1])
    np.fill_diagonal(distance, np.inf)
    return np.asarray(distance.min(axis=1))


def _noisy(points: Points, rng: np.random.Generator) -> Points:
    """The (N, 3) points with noise along their beams."""
    distance = np.linalg.norm(points, axis=1, keepdims=True)
    return np.asarray(points * (1 + rng.normal(0, _RANGE_NOISE_M, distance.shape) / distance), dtype=np.float32)


RADIUS = "radius, px of an image 1242 px wide"
_SPOT_STRENGTH = "opaque"


def scaled(length: float, camera: Camera) -> float:
    """A length in px of an image as wide as the paper's, in px of this camera's."""
    return length * camera.width_px / PAPER_WIDTH_PX


def drawn_facula(draw: AttackDraw, camera: Camera, radius: float | None) -> Facula:
    """A facula anywhere in a camera's image, of a radius or a drawn one."""
    drawn = draw_facula(draw.rng, camera.width_px, camera.height_px, draw.strength)
    return drawn if radius is None else replace(drawn, radius_px=scaled(radius, camera))


def _spot(draw: AttackDraw, camera: Camera, radius: float) -> Facula:
    return Facula(STRENGTHS[_SPOT_STRENGTH], scaled(radius, camera), *place(draw, camera))


def _wall(draw: AttackDraw, width_m: float | None) -> BogusWall:
    drawn = draw_wall(draw.rng)
    return replace(drawn, width_m=drawn.width_m if width_m is None else width_m)


def _far_wall(draw: AttackDraw, range_m: float) -> BogusWall:
    return replace(draw_wall(draw.rng), range_m=range_m)


ON_CAMERA: Mapping[str, CameraKind] = {
    "facula": CameraKind("a round light, brightest at its centre", RADIUS, None, drawn_facula),
    "spot": CameraKind("a small facula, opaque", RADIUS, 40.0, _spot, evaluated=True),
}
ON_LIDAR: Mapping[str, LidarKind] = {
    "wall": LidarKind("a bogus wall near the vehicle", "width, m", None, _wall),
    "far-wall": LidarKind("a bogus wall farther away", "range, m", 30.0, _far_wall),
}
