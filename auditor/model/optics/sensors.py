"""The sensors of a vehicle: cameras and LiDARs, each at its place, and the lenses of cameras.

A lens says where a ray that a pinhole would show at (x, y) appears behind it. Coordinates are those of the image plane
at z = 1 in the camera frame: x right, y down, without a unit. K is that of the pinhole that shows the middle of the
picture alike: of some models other focal lengths are published (`of_camera`).

Sources: OpenCV's camera calibration and its fisheye module; Usenko, Demmel and Cremers, The Double Sphere Camera Model
(3DV 2018), Eq. 40 to 45; Mei and Rives, Single View Point Omnidirectional Camera Calibration (ICRA 2007), section II,
as Kalibr writes it (`omni`); NVIDIA DriveWorks, f-theta.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from auditor.errors import RigError
from auditor.model.arrays import Floats
from auditor.model.optics.geometry import Matrix, camera_centre, intrinsics_and_rotation

PINHOLE = "none"
POLYNOMIAL = "plumb_bob"
RATIONAL = "rational_polynomial"
FISHEYE = "equidistant"
DOUBLE_SPHERE = "double_sphere"
OMNIDIRECTIONAL = "omnidirectional"
F_THETA = "f_theta"
_WIDEST = 4.0  # tangent of 76 degrees off the axis: farther out no rectified picture reaches
_STEPS = 4000  # radii that are tried up to the widest

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
    **dict.fromkeys((DOUBLE_SPHERE, "doublesphere", "ds"), DOUBLE_SPHERE),
    **dict.fromkeys((OMNIDIRECTIONAL, "omni", "mei", "catadioptric"), OMNIDIRECTIONAL),
    **dict.fromkeys((F_THETA, "ftheta"), F_THETA),
}
"""What ROS, Kalibr, foxglove and others call them -> what they are called here; no name at all is ROS's default.

Blanks and hyphens are as underscores.
"""

_SIZES = {
    PINHOLE: (0,),
    POLYNOMIAL: (0, 4, 5),
    RATIONAL: (8, 12),
    FISHEYE: (4,),
    DOUBLE_SPHERE: (2,),
    OMNIDIRECTIONAL: (5,),
    F_THETA: (4,),
}
_OF_ANGLES = {FISHEYE, F_THETA}
"""Models that are no pinhole where all their coefficients are 0."""

_STRAIGHT = {PINHOLE, FISHEYE, F_THETA, DOUBLE_SPHERE}
"""Models that move rays only away from the axis, or towards it."""

_ROUNDS = 60


@dataclass(frozen=True)
class Lens:
    """A distortion model and its coefficients.

    `plumb_bob` (k1 k2 p1 p2 [k3]) and `rational_polynomial` (k1 k2 p1 p2 k3 k4 k5 k6 [s1 s2 s3 s4]) as OpenCV's camera
    calibration defines them, `equidistant` (k1 k2 k3 k4) as its fisheye module does. `double_sphere` (xi alpha)
    and `omnidirectional` (xi k1 k2 p1 p2) divided by what they are on the axis; `f_theta` (c2 c3 c4 c5): a ray at the
    angle theta appears at theta + c2 theta^2 + ... + c5 theta^5. Other names are translated, see
    MODELS. Raises RigError for a model that is not known, or coefficients that do not fit it.
    """

    model: str = PINHOLE
    coefficients: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        model = _known(self.model)
        if model is None:
            models = ", ".join(name for name in MODELS if name)
            raise RigError(f"the distortion model {self.model!r} is not known", where="lens", remedy=f"use {models}")
        # Zeros at the end are not said: models without a tilted sensor are often written with those of one.
        given = self.coefficients
        fitting = [size for size in _SIZES[model] if size <= len(given) and not any(given[size:])]
        if not fitting or not np.isfinite(given).all():
            raise RigError(f"{len(given)} coefficients do not fit the model {self.model or model}", where="lens")
        given = tuple(float(value) for value in given[: fitting[0]])
        if model in {DOUBLE_SPHERE, OMNIDIRECTIONAL} and not given[0] > -1:
            raise RigError(f"the xi of the model {model} is not above -1", where="lens")
        straight = model not in _OF_ANGLES and not any(given)
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
        radii = np.linspace(0, self.reach, _STEPS)
        seen = radii * self._ratio(radii * radii)
        ideal_x, ideal_y = x, y
        for _ in range(_ROUNDS):
            dx, dy = self._sideways(ideal_x, ideal_y)
            across, down = x - dx, y - dy
            distorted = np.hypot(across, down)
            radius = np.interp(distorted, seen, radii, right=np.nan)
            scale = np.divide(radius, distorted, out=np.ones_like(distorted), where=distorted > 0)
            before, ideal_x, ideal_y = ideal_x, across * scale, down * scale
            if self.model in _STRAIGHT or not np.any(np.abs(ideal_x - before) > 1e-9):
                break
        return ideal_x, ideal_y

    @cached_property
    def reach(self) -> float:
        """How far off the axis, as a tangent, the model can be trusted: beyond it polynomials turn back inwards."""
        radii = np.linspace(0, _WIDEST, _STEPS)
        with np.errstate(all="ignore"):
            seen = radii * self._ratio(radii * radii)
        turns = np.flatnonzero(~(np.diff(seen) > 0))
        return float(radii[turns[0]]) if turns.size else _WIDEST

    def _ratio(self, r2: Floats) -> Floats:
        """Distorted over ideal distance from the axis, by the square of the ideal one."""
        k = self.coefficients
        if self.model in _OF_ANGLES:
            r = np.sqrt(r2)
            theta = np.arctan(r)
            step = theta * theta if self.model == FISHEYE else theta
            bent = theta * (1 + step * (k[0] + step * (k[1] + step * (k[2] + step * k[3]))))
            return np.divide(bent, r, out=np.ones_like(r), where=r > 0)
        if self.model == DOUBLE_SPHERE:
            xi, alpha = k
            z = xi * np.sqrt(1 + r2) + 1
            return (1 + xi) / (alpha * np.sqrt(r2 + z * z) + (1 - alpha) * z)
        if self.model == OMNIDIRECTIONAL:
            mirror = 1 / (1 + k[0] * np.sqrt(1 + r2))
            m2 = r2 * mirror * mirror
            return (1 + k[0]) * mirror * (1 + m2 * (k[1] + m2 * k[2]))
        if not k:
            return np.ones_like(r2)
        k3 = k[4] if len(k) > 4 else 0.0
        above = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k3))
        return above / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]))) if self.model == RATIONAL else above

    def _sideways(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """The part that does not point away from the axis: decentring, and thin prisms."""
        if self.model in _STRAIGHT:
            return np.zeros_like(x), np.zeros_like(y)
        r2 = x * x + y * y
        p1, p2 = self.coefficients[2:4]
        if self.model == OMNIDIRECTIONAL:
            xi, p1, p2 = self.coefficients[0], *self.coefficients[3:]
            mirror = 1 / (1 + xi * np.sqrt(1 + r2))
            x, y, r2 = x * mirror, y * mirror, r2 * mirror * mirror
            p1, p2 = p1 * (1 + xi), p2 * (1 + xi)
        dx, dy = 2 * p1 * x * y + p2 * (r2 + 2 * x * x), p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
        if len(self.coefficients) == 12:
            s1, s2, s3, s4 = self.coefficients[8:]
            dx, dy = dx + r2 * (s1 + r2 * s2), dy + r2 * (s3 + r2 * s4)
        return dx, dy

    def as_published(self, K: Floats) -> tuple[tuple[float, ...], Floats]:
        """The coefficients and the (3, 3) K that `of_camera` takes back to this lens and this K."""
        if self.model == F_THETA:
            focal = float(K[0, 0])
            return (0.0, focal, *(focal * value for value in self.coefficients)), K
        return self.coefficients, K @ np.diag([1 / self._on_axis, 1 / self._on_axis, 1.0])

    @property
    def _on_axis(self) -> float:
        """What the published model, which K multiplies, is on the axis."""
        return 1 / (1 + self.coefficients[0]) if self.model in {DOUBLE_SPHERE, OMNIDIRECTIONAL} else 1.0


def of_camera(model: str, coefficients: tuple[float, ...], K: Floats) -> tuple[Lens, Floats]:
    """The lens of a published calibration, and K of the pinhole that it bends, (3, 3). Raises RigError.

    Double spheres and omnidirectional lenses have focal lengths by which their own formulas are multiplied. The
    coefficients of f-theta are a polynomial from angles to px: 0, the focal length, and those of higher powers.
    """
    if _known(model) == F_THETA:
        if len(coefficients) < 2 or coefficients[0] or not coefficients[1] > 1:
            raise RigError("the f-theta polynomial is not one from angles to px that begins with 0", where="lens")
        focal = coefficients[1]
        higher = tuple(value / focal for value in coefficients[2:])
        lens = Lens(F_THETA, higher + (0.0,) * (_SIZES[F_THETA][0] - len(higher)))
        return lens, np.array([[focal, 0.0, K[0, 2]], [0.0, focal, K[1, 2]], [0.0, 0.0, 1.0]])
    lens = Lens(model, coefficients)
    return lens, K @ np.diag([lens._on_axis, lens._on_axis, 1.0]) if lens._on_axis != 1.0 else K


def _known(model: str) -> str | None:
    return MODELS.get(model.strip().lower().replace("-", "_").replace(" ", "_"))


NO_LENS = Lens()
"""A camera that does not bend rays, or whose images were freed from it."""


LIDAR = 0
"""The number of the LiDAR S_0."""

PIXEL_BITS, MOST_BITS = 8, 16
"""The bits of a pixel that is measured, and the most that a recorded value has."""


@dataclass(frozen=True, eq=False)
class Camera:
    """One camera S_number.

    `projection` is the full (3, 4) matrix P = K [R | t]: points of the rig frame in metres to pixels, if no `lens` bent
    their rays. Images are `rectified` where none does and the camera looks straight along the rig's z axis. `offset_ns`
    is how far its stamps lie behind the leftmost camera's; None: to be learnt from the recording. Of recorded values
    of `depth_bits` (None: 8) the upper 8 are the pixels.
    """

    number: int
    name: str
    topic: str
    width_px: int
    height_px: int
    projection: Matrix
    rectified: bool = True
    lens: Lens = NO_LENS
    offset_ns: int | None = None
    depth_bits: int | None = None

    @property
    def focal_px(self) -> float:
        """Horizontal focal length in pixels."""
        return float(self.intrinsics[0, 0])

    @cached_property
    def intrinsics(self) -> Matrix:
        """K, (3, 3): the camera frame's directions to pixels."""
        return intrinsics_and_rotation(self.projection)[0]

    @cached_property
    def rotation(self) -> Matrix:
        """R, (3, 3): directions of the rig frame to those of the camera frame (x right, y down, z forward)."""
        return intrinsics_and_rotation(self.projection)[1]

    @cached_property
    def centre_m(self) -> Matrix:
        """Optical centre, (3,) metres in the rig frame."""
        return camera_centre(self.projection)


@dataclass(frozen=True)
class Sweep:
    """How the clouds of a LiDAR, of another sector each, make sweeps. Angles are around its z axis, from its x axis.

    A sweep begins at the seam, turns in the `direction` (1: from x to y) by a step a cloud, and has so many `parts` at
    least. Its time is that of the part nearest to `time_rad`, which looks ahead as the cameras do.
    """

    seam_rad: float
    step_rad: float
    time_rad: float
    direction: int
    parts: int


@dataclass(frozen=True, eq=False)
class Lidar:
    """The LiDAR S_0; `rig_SE3_lidar` (4, 4) takes its points into the rig frame. `offset_ns`: see Camera.

    `sweep` says how its clouds are put together; None: each is whole. `unit_m` is that of its points; None: metres.
    """

    name: str
    topic: str
    rig_SE3_lidar: Matrix
    offset_ns: int | None = None
    sweep: Sweep | None = None
    unit_m: float | None = None
