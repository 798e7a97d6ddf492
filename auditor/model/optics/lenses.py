"""Lens distortion: where a ray that a pinhole would show at (x, y) appears behind a real lens.

Coordinates are those of the image plane at z = 1 in the camera frame: x right, y down, without a unit.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from auditor.errors import RigError
from auditor.model.arrays import Floats
from auditor.model.parameters import LENS_REACH

PINHOLE = "none"
POLYNOMIAL = "plumb_bob"
RATIONAL = "rational_polynomial"
FISHEYE = "equidistant"

MODELS = {
    PINHOLE: PINHOLE,
    "": POLYNOMIAL,
    POLYNOMIAL: POLYNOMIAL,
    "radtan": POLYNOMIAL,
    RATIONAL: RATIONAL,
    FISHEYE: FISHEYE,
    "fisheye": FISHEYE,
    "kannala_brandt": FISHEYE,
    **dict.fromkeys(("pinhole", "perspective", "rectified", "undistorted", "no_distortion"), PINHOLE),
    **dict.fromkeys(("inverse_brown_conrady", "modified_brown_conrady"), PINHOLE),  # of a lens that bends nothing
    **dict.fromkeys(("plumbbob", "brown_conrady", "radial_tangential", "opencv"), POLYNOMIAL),
    "rational": RATIONAL,
    **dict.fromkeys(("equi", "kannala_brandt4", "opencv_fisheye"), FISHEYE),
}
"""What ROS, Kalibr, foxglove and others call them -> what they are called here; no name at all is ROS's default.

Blanks and hyphens are as underscores.
"""

_SIZES = {PINHOLE: (0,), POLYNOMIAL: (0, 4, 5), RATIONAL: (8, 12), FISHEYE: (4,)}
_ROUNDS = 60


@dataclass(frozen=True)
class Lens:
    """A distortion model and its coefficients.

    `plumb_bob` (k1 k2 p1 p2 [k3]) and `rational_polynomial` (k1 k2 p1 p2 k3 k4 k5 k6 [s1 s2 s3 s4]) as OpenCV's camera
    calibration defines them, `equidistant` (k1 k2 k3 k4) as its fisheye module does. Other names are translated, see
    MODELS. Raises RigError for a model that is not known, or coefficients that do not fit it.
    """

    model: str = PINHOLE
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        model = MODELS.get(self.model.strip().lower().replace("-", "_").replace(" ", "_"))
        if model is None:
            known = ", ".join(name for name in MODELS if name)
            raise RigError(f"the distortion model {self.model!r} is not known", where="lens", remedy=f"use {known}")
        # Zeros at the end are not said: models without a tilted sensor are often written with those of one.
        given = self.coefficients
        fitting = [size for size in _SIZES[model] if size <= len(given) and not any(given[size:])]
        if not fitting or not np.isfinite(given).all():
            raise RigError(f"{len(given)} coefficients do not fit the model {self.model or model}", where="lens")
        given = tuple(float(value) for value in given[: fitting[0]])
        straight = model != FISHEYE and not any(given)
        object.__setattr__(self, "model", PINHOLE if straight else model)
        object.__setattr__(self, "coefficients", () if straight else given)

    def distort(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """Where the ray (x, y, 1) appears. Rays further off the axis than `reach` come out as NaN."""
        inside = x * x + y * y <= self.reach * self.reach
        x, y = np.where(inside, x, np.nan), np.where(inside, y, np.nan)
        if self.model == PINHOLE:
            return x, y
        ratio = self._ratio(x * x + y * y)
        dx, dy = self._sideways(x, y)
        return x * ratio + dx, y * ratio + dy

    def undistort(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """The ray that appears at (x, y): what `distort` takes there; NaN where none does."""
        if self.model == PINHOLE:
            return x, y
        radii = np.linspace(0, self.reach, LENS_REACH.steps)
        seen = radii * self._ratio(radii * radii)
        ideal_x, ideal_y = x, y
        for _ in range(_ROUNDS):
            dx, dy = self._sideways(ideal_x, ideal_y)
            across, down = x - dx, y - dy
            distorted = np.hypot(across, down)
            radius = np.interp(distorted, seen, radii, right=np.nan)
            scale = np.divide(radius, distorted, out=np.ones_like(distorted), where=distorted > 0)
            before, ideal_x, ideal_y = ideal_x, across * scale, down * scale
            if self.model == FISHEYE or not np.any(np.abs(ideal_x - before) > 1e-9):
                break
        return ideal_x, ideal_y

    @cached_property
    def reach(self) -> float:
        """How far off the axis, as a tangent, the model can be trusted: beyond it polynomials turn back inwards."""
        radii = np.linspace(0, LENS_REACH.widest, LENS_REACH.steps)
        with np.errstate(all="ignore"):
            seen = radii * self._ratio(radii * radii)
        turns = np.flatnonzero(~(np.diff(seen) > 0))
        return float(radii[turns[0]]) if turns.size else LENS_REACH.widest

    def _ratio(self, r2: Floats) -> Floats:
        """Distorted over ideal distance from the axis, by the square of the ideal one."""
        k = self.coefficients
        if self.model == FISHEYE:
            r = np.sqrt(r2)
            theta = np.arctan(r)
            t2 = theta * theta
            bent = theta * (1 + t2 * (k[0] + t2 * (k[1] + t2 * (k[2] + t2 * k[3]))))
            return np.divide(bent, r, out=np.ones_like(r), where=r > 0)
        if not k:
            return np.ones_like(r2)
        k3 = k[4] if len(k) > 4 else 0.0
        above = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k3))
        return above / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))) if self.model == RATIONAL else above

    def _sideways(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """The part that does not point away from the axis: decentring, and thin prisms."""
        if self.model in {PINHOLE, FISHEYE}:
            return np.zeros_like(x), np.zeros_like(y)
        r2 = x * x + y * y
        p1, p2 = self.coefficients[2:4]
        dx, dy = 2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        if len(self.coefficients) == 12:
            s1, s2, s3, s4 = self.coefficients[8:]
            dx, dy = dx + r2 * (s1 + r2 * s2), dy + r2 * (s3 + r2 * s4)
        return dx, dy


NO_LENS = Lens()
"""A camera that does not bend rays, or whose images were freed from it."""
