"""Attacks on the LiDAR beyond the paper's wall, and faults: sensors that hide, invent, delay or have moved."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from auditor.errors import SettingError
from auditor.lab.attacks.kinds import AttackDraw, CameraKind, LidarKind, uniform
from auditor.lab.attacks.paper import DescribedEffect, with_levels
from auditor.model.arrays import Floats, Points
from auditor.model.frames import CameraImage, PointCloud
from auditor.model.rig import Rig

_DROPS = 8000.0  # a cubic metre and millimetre of diameter
_SLOPE, _SLOPE_EXPONENT = 4.1, -0.21  # Lambda in 1/mm
_SMALLEST_MM = 0.2  # the LiDAR does not detect a smaller drop at any distance
_REACH_M = 12.0  # and no drop farther away
_NEAREST_M = 1.5
_DIVERGENCE = 3.0  # mm of beam diameter a metre
_FRESNEL = ((1.328 - 1) / (1.328 + 1)) ** 2
_FAINTEST = 0.9 / 200**2  # a target that returns nine tenths is detected up to 200 m away
_REFLECTIVITY = (0.05, 0.6)
_RANGE_NOISE_M = 0.09


@dataclass(frozen=True)
class Rain(DescribedEffect):
    """Rain of `rate_mm_h` on the whole view, its drops anew in every cloud: a fault of the weather, not an attack.

    Drops are Marshall and Palmer's (J. Meteorology 5, 1948): 8000 exp(-Lambda D) a cubic metre and mm of diameter D,
    Lambda = 4.1 R^-0.21 per mm. Echoes and the sensor are those of LISA (Kilic et al., arXiv:2107.07004): a surface of
    reflectivity rho at r returns rho exp(-2 alpha r) / r^2; a drop the Fresnel share 0.02 in place of rho, times the
    share that it fills of a beam 3 mm wide a metre; the faintest echo is that of rho = 0.9 at 200 m. Fainter echoes are
    lost, and the ranges of others get noise of 0.09 m / sqrt(2 SNR). Unlike LISA's the sensor reports the first echo
    and not the strongest, which is the worse case: at 10 mm/h 5 % of the beams of drive 0009 end at a drop, 1.5 to 6 m
    away, in place of 0.06 %. Drops are large beside the wavelength: alpha = pi 8000 / Lambda^3 mm^2/m^3, 0.37 R^0.63
    per km.

    Clouds hold no reflectivities: each point draws one with which it could be seen when dry. Spray, wet roads, drops on
    the sensor's window, and drops in beams that return nothing when dry are left out.
    """

    rate_mm_h: float
    seed: int

    name = "rain"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud in the rain, its points in their order. Raises SettingError for a rig without a LiDAR."""
        if rig.lidar is None:
            raise SettingError("rain needs a LiDAR, and the rig has none", where="S_0")
        if self.rate_mm_h <= 0:
            return cloud
        rng = np.random.default_rng([self.seed, cloud.stamp_ns])
        slope = _SLOPE * self.rate_mm_h**_SLOPE_EXPONENT
        extinction = np.pi * _DROPS / slope**3 * 1e-6
        distance = np.maximum(np.linalg.norm(cloud.xyz_m, axis=1), 1e-3).astype(np.float64)
        dimmest = np.maximum(_FAINTEST * distance**2, _REFLECTIVITY[0])
        reflectivity = rng.uniform(dimmest, np.maximum(dimmest, _REFLECTIVITY[1]))
        echo = reflectivity * np.exp(-2 * extinction * distance) / distance**2
        noisy = distance + rng.normal(0, _RANGE_NOISE_M / np.sqrt(2 * echo / _FAINTEST))
        drop = _first_drops(distance, slope, extinction, rng)
        wet = np.isfinite(drop)
        detected = wet | (echo >= _FAINTEST)
        scale = (np.where(wet, drop, noisy) / distance)[detected, None]
        return PointCloud(cloud.stamp_ns, np.asarray(cloud.xyz_m[detected] * scale, dtype=np.float32))


def _first_drops(distance: Floats, slope: float, extinction: float, rng: np.random.Generator) -> Floats:
    """(N,) distance of the first drop that each beam detects before its point; infinite where there is none."""
    reach = np.minimum(distance, _REACH_M)
    cone_m3 = np.pi / 3 * reach * (_DIVERGENCE / 2 * 1e-3 * reach) ** 2
    count = rng.poisson(_DROPS / slope * np.exp(-slope * _SMALLEST_MM) * cone_m3)
    beam = np.repeat(np.arange(distance.size), count)
    r = reach[beam] * np.cbrt(rng.random(beam.size))  # drops fill the cone evenly
    diameter = _SMALLEST_MM + rng.exponential(1 / slope, beam.size)
    filled = np.minimum(diameter / (_DIVERGENCE * np.maximum(r, _NEAREST_M)), 1) ** 2
    echo = _FRESNEL * filled * np.exp(-2 * extinction * r) / np.maximum(r, _NEAREST_M) ** 2
    detected = (r >= _NEAREST_M) & (echo >= _FAINTEST)
    first = np.full(distance.size, np.inf)
    np.minimum.at(first, beam[detected], r[detected])
    return first


_SECTORS_DEG = (-25.0, 25.0)
_AZIMUTHS_DEG = (-35.0, 35.0)
_ELEVATIONS_DEG = (-12.0, 1.0)
_RANGES_M = (4.0, 40.0)
_BLOB_RADII = (0.05, 0.12)  # of the image's width
_OPAQUE = 0.95
_SOFT_EDGE = 0.5  # of the radius
_MUD_LEVEL = 30.0  # grey levels


@dataclass(frozen=True)
class HiddenSector(DescribedEffect):
    """All points of a sector are gone: `width_deg` wide, its middle `azimuth_deg` to the right of straight ahead."""

    width_deg: float
    azimuth_deg: float

    name = "hidden sector"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud without the sector. Raises SettingError for a rig without a LiDAR."""
        right, _, forward = (cloud.xyz_m @ lidar_axes(rig).T).T
        aside = np.rad2deg(np.arctan2(right, forward)) - self.azimuth_deg
        return PointCloud(cloud.stamp_ns, cloud.xyz_m[np.abs(aside) > self.width_deg / 2])


@dataclass(frozen=True)
class ScatteredPoints(DescribedEffect):
    """`count` spoofed points anywhere in the cameras' view, 4 to 40 m away."""

    count: int
    seed: int

    name = "scattered points"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud with the points added last. Raises SettingError for a rig without a LiDAR."""
        rng = np.random.default_rng([self.seed, cloud.stamp_ns])
        azimuth, elevation = (
            np.deg2rad(rng.uniform(*limits, self.count)) for limits in (_AZIMUTHS_DEG, _ELEVATIONS_DEG)
        )
        ahead = np.cos(elevation)
        direction = np.stack([np.sin(azimuth) * ahead, -np.sin(elevation), np.cos(azimuth) * ahead], axis=1)
        points = direction * rng.uniform(*_RANGES_M, (self.count, 1))
        spoofed = np.asarray(points @ lidar_axes(rig), dtype=np.float32)
        return PointCloud(cloud.stamp_ns, np.concatenate([cloud.xyz_m, spoofed]))


@dataclass(frozen=True)
class TurnedLidar(DescribedEffect):
    """The LiDAR has turned on its mount since it was calibrated: a fault, not an attack."""

    yaw_deg: float
    pitch_deg: float = 0.0

    name = "turned LiDAR"

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud as the turned LiDAR reports it. Raises SettingError for a rig without a LiDAR."""
        cosine, sine = np.cos(np.deg2rad(self.yaw_deg)), np.sin(np.deg2rad(self.yaw_deg))
        yaw = np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]])
        cosine, sine = np.cos(np.deg2rad(self.pitch_deg)), np.sin(np.deg2rad(self.pitch_deg))
        turn = np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]]) @ yaw
        rotation = lidar_axes(rig)
        xyz = cloud.xyz_m @ (rotation.T @ turn @ rotation).T
        return PointCloud(cloud.stamp_ns, np.asarray(xyz, dtype=np.float32))


@dataclass(frozen=True)
class ShiftedCamera(DescribedEffect):
    """The camera has turned since it was calibrated: its image stands `rows_px` lower and `columns_px` to the right.

    A fault, not an attack. One degree is 13 px where the focal length is 720 px.
    """

    rows_px: int
    columns_px: int = 0

    name = "shifted camera"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image moved, its edges repeated where nothing moved in."""
        height, width = image.pixels.shape[:2]
        row = np.clip(np.arange(height) - self.rows_px, 0, height - 1)
        column = np.clip(np.arange(width) - self.columns_px, 0, width - 1)
        return CameraImage(image.sensor, image.stamp_ns, np.ascontiguousarray(image.pixels[row[:, None], column]))


@dataclass(frozen=True)
class DimmedCamera(DescribedEffect):
    """The camera gets a share `light` of its light: dusk, a tunnel, a closed aperture. Not an attack by itself."""

    light: float

    name = "dimmed"

    def apply(self, image: CameraImage) -> CameraImage:
        """The darker image."""
        return with_levels(image, image.pixels * np.float32(self.light))


@dataclass(frozen=True)
class SoiledLens(DescribedEffect):
    """Drops of mud on the lens: `blobs` soft-edged discs at places that do not move, dark and opaque in the middle."""

    blobs: int
    seed: int

    name = "soiled lens"

    def apply(self, image: CameraImage) -> CameraImage:
        """The image behind the dirt."""
        height, width = image.pixels.shape[:2]
        rng = np.random.default_rng([self.seed, image.sensor])
        clear = np.ones((height, width), dtype=np.float32)
        row, column = np.arange(height)[:, None], np.arange(width)
        for _ in range(self.blobs):
            u, v, radius = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(*_BLOB_RADII) * width
            distance = np.hypot(row - v, column - u) / radius
            clear *= 1 - _OPAQUE * np.clip((1 - distance) / _SOFT_EDGE, 0, 1).astype(np.float32)
        clear = clear.reshape(height, width, *[1] * (image.pixels.ndim - 2))
        return with_levels(image, image.pixels * clear + _MUD_LEVEL * (1 - clear))


@dataclass(frozen=True, eq=False)
class _DelayedFault:
    frames: int

    name = "delay"

    @property
    def parameters(self) -> dict[str, object]:
        """All that determines its effect."""
        return {"frames": self.frames}


@dataclass(frozen=True, eq=False)
class DelayedCamera(_DelayedFault):
    """The camera shows what it saw `frames` ago: a replay, or a camera that has been frozen since then."""

    earlier: CameraImage = field(repr=False)

    def apply(self, image: CameraImage) -> CameraImage:
        """The earlier image under the stamp of this one."""
        return CameraImage(image.sensor, image.stamp_ns, self.earlier.pixels)


@dataclass(frozen=True, eq=False)
class DelayedLidar(_DelayedFault):
    """The LiDAR reports what it saw `frames` ago."""

    earlier: PointCloud = field(repr=False)

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:  # noqa: ARG002 - as every attack on a LiDAR
        """The earlier cloud under the stamp of this one."""
        return PointCloud(cloud.stamp_ns, self.earlier.xyz_m)


def lidar_axes(rig: Rig) -> Points:
    """(3, 3): the LiDAR's points to right, down, forward of it."""
    if rig.lidar is None:
        raise SettingError("this attack needs a LiDAR, and the rig has none", where="S_0")
    return rig.lidar.rig_SE3_lidar[:3, :3].astype(np.float32)


def azimuth(draw: AttackDraw) -> float:
    """The middle of a sector, in most cameras' view."""
    return uniform(draw, _SECTORS_DEG)


ON_CAMERA: Mapping[str, CameraKind] = {
    "dimmed": CameraKind("a fault: less light", "share of the light", 0.2, lambda _draw, _, size: DimmedCamera(size)),
    "soiled": CameraKind("a fault: dirt on the lens", "blobs", 4, lambda draw, _, n: SoiledLens(round(n), draw.seed)),
    "shifted": CameraKind("a fault: a camera that was knocked", "rows", 4, lambda _draw, _, n: ShiftedCamera(round(n))),
}
ON_LIDAR: Mapping[str, LidarKind] = {
    "hidden": LidarKind(
        "a sector without points", "degrees", 20.0, lambda draw, size: HiddenSector(size, azimuth(draw))
    ),
    "scattered": LidarKind("points anywhere", "points", 2000, lambda draw, n: ScatteredPoints(round(n), draw.seed)),
    "turned": LidarKind("a fault: a LiDAR that was turned", "degrees", 1, lambda _, size: TurnedLidar(size)),
    "rain": LidarKind("points of rain, and fewer others", "mm/h", 25, lambda draw, size: Rain(size, draw.seed)),
}
