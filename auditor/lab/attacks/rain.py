"""Rain between the LiDAR and its targets."""

from dataclasses import dataclass

import numpy as np

from auditor.errors import SettingError
from auditor.lab.attacks.paper import Described
from auditor.model.arrays import Floats
from auditor.model.frames import PointCloud
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
class Rain(Described):
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
