"""The paper's two attacks: a Gaussian facula on a camera, a bogus wall in a point cloud.

Both are frozen descriptions that change a copy of the data they are given. What decides their effect is in
`parameters`: the ground truth that goes with the changed recording.
"""

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from auditor.errors import SettingError
from auditor.frames import CameraImage, PointCloud
from auditor.rig import Rig

STRENGTHS = {"mild": 255.0, "strong": 510.0, "opaque": 2000.0}
"""Amplitude A of a facula in grey levels. The paper does not give its own, and A decides the rates."""

_FAINTEST = 0.5  # grey levels: what adds less cannot change a pixel
_NOMINAL_WIDTH_PX = 1242
_RADII_PX = (187.0, 375.0)  # at the nominal width
_RANGES_M = (6.0, 10.0)
_LATERALS_M = (-3.0, 3.0)
_BOTTOMS_M = (0.0, 0.6)
_RANGE_NOISE_M = 0.02
_AZIMUTH_STEP = np.deg2rad(0.2)
_ELEVATION_STEP = np.deg2rad(0.4)
_LIDAR_HEIGHT_M = 1.73  # of the vehicle that KITTI was recorded with; used where a cloud shows no road


@dataclass(frozen=True)
class Facula:
    """A round Gaussian facula: I' = clip(I + A exp(-rho^2 / 2 sigma^2)), sigma = `sigma_share` R.

    `amplitude` A in grey levels; `radius_px` R, `u_px` and `v_px`, its centre, in pixels of the attacked image.
    """

    amplitude: float
    radius_px: float
    u_px: float
    v_px: float
    sigma_share: float = 0.5

    name = "facula"

    @property
    def parameters(self) -> dict[str, object]:
        """Everything that decides its effect."""
        return asdict(self)

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
class BogusWall:
    """Relayed pulses that show a wall facing the LiDAR and hide what is behind it.

    `range_m` ahead of the LiDAR along the cameras' viewing direction, its middle `lateral_m` to the right, its lower
    edge `bottom_m` above the road. `seed` decides the noise of its ranges.
    """

    range_m: float
    lateral_m: float
    bottom_m: float = 0.0
    width_m: float = 2.5
    height_m: float = 1.5
    seed: int = 0

    name = "wall"

    @property
    def parameters(self) -> dict[str, object]:
        """Everything that decides its effect."""
        return asdict(self)

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud with the wall in it.

        Beams that would have passed through the wall's outline return from it instead, so that it has the LiDAR's own
        density; where none of them had returned, pulses are added. Raises SettingError for a rig without a LiDAR.
        """
        if rig.lidar is None:
            raise SettingError("a bogus wall needs a LiDAR, and the rig has none", where="S_0")
        rotation = rig.lidar.rig_SE3_lidar[:3, :3]
        points = cloud.xyz_m @ rotation.T.astype(np.float32)  # right, down, forward of the LiDAR
        top_m, bottom_m = self._edges_m(_road_m(points))
        hidden, outline = self._through(points, top_m, bottom_m)
        on_wall = points[hidden] * (self.range_m / points[hidden, 2:])
        added = self._unreturned(points[outline], top_m, bottom_m)
        wall = np.concatenate([on_wall, added])
        rng = np.random.default_rng([self.seed, cloud.xyz_m.shape[0]])
        distance = np.linalg.norm(wall, axis=1, keepdims=True)
        wall *= 1 + rng.normal(0, _RANGE_NOISE_M, distance.shape) / distance
        kept = cloud.xyz_m[~hidden]
        return PointCloud(cloud.stamp_ns, np.concatenate([kept, (wall @ rotation).astype(np.float32)]))

    def _edges_m(self, road_m: float) -> tuple[float, float]:
        """Upper and lower edge, metres below the LiDAR."""
        lower = road_m - self.bottom_m
        return lower - self.height_m, lower

    def _through(
        self, points: NDArray[np.float32], top_m: float, bottom_m: float
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which points lie behind the wall as the LiDAR sees it, and which lie inside its outline at any distance."""
        forward = np.maximum(points[:, 2], 1e-3)
        right, down = points[:, 0] / forward * self.range_m, points[:, 1] / forward * self.range_m
        inside = (points[:, 2] > 1e-3) & (np.abs(right - self.lateral_m) <= self.width_m / 2)
        inside &= (down >= top_m) & (down <= bottom_m)
        return inside & (points[:, 2] > self.range_m), inside

    def _unreturned(self, inside: NDArray[np.float32], top_m: float, bottom_m: float) -> NDArray[np.float64]:
        """Points on the wall in those directions, on a grid as fine as a LiDAR's, where the cloud has none."""
        left, right = self.lateral_m - self.width_m / 2, self.lateral_m + self.width_m / 2
        azimuth = np.arange(np.arctan2(left, self.range_m), np.arctan2(right, self.range_m), _AZIMUTH_STEP)
        elevation = np.arange(np.arctan2(top_m, self.range_m), np.arctan2(bottom_m, self.range_m), _ELEVATION_STEP)
        empty = np.ones((elevation.size, azimuth.size), dtype=bool)
        if empty.size == 0:
            return np.empty((0, 3))
        row = (np.arctan2(inside[:, 1], inside[:, 2]) - elevation[0]) / _ELEVATION_STEP
        column = (np.arctan2(inside[:, 0], inside[:, 2]) - azimuth[0]) / _AZIMUTH_STEP
        empty[np.clip(row.astype(int), 0, elevation.size - 1), np.clip(column.astype(int), 0, azimuth.size - 1)] = False
        # A beam's neighbours are not on the grid's own lines, so that a cell beside a taken one is no gap.
        taken = ~empty
        for axis in (0, 1):
            taken |= np.roll(taken, 1, axis) | np.roll(taken, -1, axis)
        rows, columns = np.nonzero(~taken)
        directions = np.stack([np.tan(azimuth[columns]), np.tan(elevation[rows]), np.ones(rows.size)], axis=1)
        return directions * self.range_m


def draw_facula(rng: np.random.Generator, width_px: int, height_px: int, strength: str) -> Facula:
    """A facula of the paper's size, its centre anywhere in the image. Raises SettingError for an unknown strength."""
    if strength not in STRENGTHS:
        raise SettingError(f"{strength!r} is no strength", where="facula", remedy=f"use {', '.join(STRENGTHS)}")
    radius = rng.uniform(*_RADII_PX) * width_px / _NOMINAL_WIDTH_PX
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


def _road_m(points: NDArray[np.float32]) -> float:
    """How far the road lies below the LiDAR, from what is low and near ahead."""
    near = points[(points[:, 2] > 4) & (points[:, 2] < 15) & (np.abs(points[:, 0]) < 4), 1]
    low = near[near > 1.0]
    return float(np.median(low)) if low.size >= 50 else _LIDAR_HEIGHT_M
