"""Rigs: the LiDAR and the cameras of a vehicle, their triples and pairs."""

import hashlib
import json
import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise, product
from typing import Any, NamedTuple

import numpy as np

from auditor.errors import RigError
from auditor.model.fields import Fields
from auditor.model.optics.geometry import Matrix, beside_line_m, camera_centre, intrinsics_and_rotation
from auditor.model.optics.lenses import NO_LENS, PINHOLE, Lens
from auditor.model.parameters import PAIR_DEPTH, RIG_GEOMETRY
from auditor.model.rig_kind import RigKind

LIDAR = 0
"""The number of the LiDAR S_0."""

PIXEL_BITS, MOST_BITS = 8, 16
"""The bits of a pixel that is measured, and the most that a recorded value has."""

MOST_OFF_PX = RIG_GEOMETRY.most_off_line_px
"""A camera beside the line of the others sees what is 10 m away on other rows: more than this and matching fails."""


class Triple(NamedTuple):
    """Sensors i < j < k whose disparity maps are compared in the view of camera k; j = k is a lone camera's past."""

    i: int
    j: int
    k: int


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


@dataclass(frozen=True, eq=False)
class Rig:
    """One LiDAR or none and the cameras that overlap it, S_1..S_n from right to left; of a LiDAR alone there are none.

    Raises RigError where the cameras are not numbered 1..n, or rectified ones not in that order. That of others shows
    in the views they are rectified to.
    """

    lidar: Lidar | None
    cameras: tuple[Camera, ...]

    def __post_init__(self) -> None:
        if [camera.number for camera in self.cameras] != list(range(1, len(self.cameras) + 1)):
            raise RigError("cameras must be numbered 1..n", where="rig")
        rectified = all(camera.rectified for camera in self.cameras)
        positions = [float(camera.centre_m[0]) for camera in self.cameras]
        if rectified and any(right <= left for right, left in pairwise(positions)):
            order = ", ".join(f"{c.name} at x = {x:+.3f} m" for c, x in zip(self.cameras, positions, strict=True))
            raise RigError(f"cameras must be ordered from right to left, but are {order}", where="rig")

    @property
    def units_m(self) -> dict[str, float]:
        """By topic the unit of the points of a LiDAR that are in no metres."""
        return {self.lidar.topic: self.lidar.unit_m} if self.lidar and self.lidar.unit_m is not None else {}

    @property
    def n(self) -> int:
        """Number of cameras."""
        return len(self.cameras)

    @property
    def sensors(self) -> tuple[int, ...]:
        """Numbers of all sensors, ascending."""
        return ((LIDAR,) if self.lidar else ()) + tuple(range(1, self.n + 1))

    @property
    def by_time(self) -> bool:
        """Whether its sensors are compared with their own past: it has a LiDAR, and no two cameras."""
        return self.lidar is not None and self.n <= 1

    @property
    def max_attacked(self) -> int:
        """How many attacked sensors can be identified at once: N - 3 (the paper's n - 2, where N = n + 1)."""
        return max(len(self.sensors) - 3, 0)

    @property
    def references(self) -> tuple[int, ...]:
        """Reference cameras, leftmost first."""
        return tuple(dict.fromkeys(triple.k for triple in self.triples))

    @cached_property
    def triples(self) -> tuple[Triple, ...]:
        """The triples that e and Algorithm 2 are of, in the store's fixed order."""
        return triples_of(self.n, lidar=self.lidar is not None)

    @cached_property
    def fallback(self) -> Triple | None:
        """The triple that a frame is judged by in which none of `triples` was measured; None where there is none."""
        return fallback_of(self.n, lidar=self.lidar is not None)

    @cached_property
    def measured_triples(self) -> tuple[Triple, ...]:
        """All triples that are measured in every frame: `triples`, then the fallback."""
        return self.triples if self.fallback is None else (*self.triples, self.fallback)

    @cached_property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Cameras (i, k) that are compared in the view of k: all that measured triples name, in their order."""
        return self.required_pairs if self.fallback is None else (*self.required_pairs, self.fallback[1:])

    @cached_property
    def required_pairs(self) -> tuple[tuple[int, int], ...]:
        """`pairs` without that of the fallback, without which a rig is measured too."""
        named = ((source, t.k) for t in self.triples for source in t[:2] if source not in (LIDAR, t.k))
        return tuple(dict.fromkeys(named))

    def camera(self, number: int) -> Camera:
        """Camera S_number, number in 1..n."""
        return self.cameras[number - 1]

    def name(self, sensor: int) -> str:
        """The recording's own name of a sensor."""
        if sensor == LIDAR:
            return self.lidar.name if self.lidar else ""
        return self.camera(sensor).name

    def topic(self, sensor: int) -> str:
        """The topic that carries a sensor's data."""
        if sensor == LIDAR:
            return self.lidar.topic if self.lidar else ""
        return self.camera(sensor).topic

    @property
    def offsets_ns(self) -> dict[int, int]:
        """By sensor how far its stamps lie behind the leftmost camera's, in nanoseconds, where that is known."""
        known = {camera.number: camera.offset_ns for camera in self.cameras}
        known[LIDAR] = self.lidar.offset_ns if self.lidar else None
        return {sensor: offset_ns for sensor, offset_ns in sorted(known.items()) if offset_ns is not None}

    def baseline_m(self, i: int, k: int) -> float:
        """Distance b_{i,k} in metres, positive, between cameras i < k; of rectified ones that along their rows."""
        right, left = self.camera(i), self.camera(k)
        if right.rectified and left.rectified:
            return float(right.centre_m[0] - left.centre_m[0])
        return float(np.linalg.norm(right.centre_m - left.centre_m))

    def pair(self, i: int, k: int) -> "Rig":
        """Cameras i < k as a rig of their own, in which they are S_1 and S_2, with the LiDAR if there is one."""
        return Rig(self.lidar, (replace(self.camera(i), number=1), replace(self.camera(k), number=2)))

    @cached_property
    def is_rectified(self) -> bool:
        """Whether all cameras, if any, are rectified and share size, focal length and principal point."""
        return all(
            camera.rectified
            and (camera.width_px, camera.height_px) == (first.width_px, first.height_px)
            and np.allclose(camera.intrinsics, first.intrinsics, atol=RIG_GEOMETRY.same_intrinsics * first.focal_px)
            for first, camera in product(self.cameras[:1], self.cameras)
        )

    @cached_property
    def off_line_px(self) -> dict[int, float]:
        """By camera the rows by which it misses what is 10 m away, if it is rectified with those on the best line."""
        per_metre = min(camera.focal_px for camera in self.cameras) / PAIR_DEPTH.distance_m
        missed_m = beside_line_m([camera.centre_m for camera in self.cameras])
        return {camera.number: float(by * per_metre) for camera, by in zip(self.cameras, missed_m, strict=True)}

    @cached_property
    def shares_view(self) -> bool:
        """Whether one view does for all cameras: they are rectified already, or stand on one line."""
        return self.is_rectified or max(self.off_line_px.values()) <= MOST_OFF_PX

    @cached_property
    def kind(self) -> RigKind:
        """What this rig shares with the other vehicles of its model."""
        pairs = list(pairwise(range(1, self.n + 1)))
        if not self.shares_view:
            pairs += [pair for pair in combinations(range(1, self.n + 1), 2) if pair not in pairs]
        return RigKind(
            lidar=self.lidar is not None,
            sizes_px=tuple((camera.width_px, camera.height_px) for camera in self.cameras),
            focals_px=tuple(camera.focal_px for camera in self.cameras),
            baselines_m=tuple(self.baseline_m(*pair) for pair in pairs),
        )

    @cached_property
    def rig_id(self) -> str:
        """sha256 (hex) of the rig's canonical description."""
        text = json.dumps(self.to_dict(), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()

    def to_dict(self) -> dict[str, Any]:
        """A plain description that `from_dict` reads back; every number survives exactly."""
        lidar = None
        if self.lidar:
            lidar = {
                "name": self.lidar.name,
                "topic": self.lidar.topic,
                "rig_SE3_lidar": self.lidar.rig_SE3_lidar.tolist(),
                **_given(offset_ns=self.lidar.offset_ns, unit_m=self.lidar.unit_m),
                **_sweep_to_dict(self.lidar.sweep),
            }
        return {
            "lidar": lidar,
            "cameras": [
                {
                    "number": camera.number,
                    "name": camera.name,
                    "topic": camera.topic,
                    "width_px": camera.width_px,
                    "height_px": camera.height_px,
                    "rectified": camera.rectified,
                    "projection": camera.projection.tolist(),
                    **_lens_to_dict(camera.lens),
                    **_given(offset_ns=camera.offset_ns, depth_bits=camera.depth_bits),
                }
                for camera in self.cameras
            ],
        }

    @classmethod
    def from_dict(cls, description: dict[str, Any]) -> "Rig":
        """Read what `to_dict` wrote. Raises RigError that names a missing or ill-formed field and what it should be."""
        fields = Fields("the rig", description)
        lidar = _lidar(fields.table("lidar", "the LiDAR")) if "lidar" in fields else None
        cameras = fields.tables("cameras", "camera") if lidar is None or "cameras" in fields else ()
        return cls(lidar, tuple(map(_camera, cameras)))


def triples_of(n: int, *, lidar: bool) -> tuple[Triple, ...]:
    """All triples of a rig with n cameras, in fixed order: k = n downwards, then i < j < k.

    References are cameras with two lower-numbered sensors at least; with a LiDAR k = 2 is one only where n = 2, since
    Algorithm 2 never descends below k = 3. With a lone camera its own past is the third of a triple.
    """
    if lidar and n == 1:
        return (Triple(LIDAR, 1, 1),)
    lowest = 0 if lidar else 1
    last_reference = 2 if lidar and n == 2 else 3
    return tuple(
        Triple(i, j, k) for k in range(n, last_reference - 1, -1) for i, j in combinations(range(lowest, k), 2)
    )


def fallback_of(n: int, *, lidar: bool) -> Triple | None:
    """The LiDAR with S_1 and S_2, which no triple of `triples_of` compares where there are three cameras or more.

    It is the paper's Scenario 1 for frames without any other reference: with it every three sensors can be compared.
    """
    return Triple(LIDAR, 1, 2) if lidar and n >= 3 else None


def _lidar(fields: Fields) -> Lidar:
    return Lidar(
        name=fields.text("name"),
        topic=fields.text("topic"),
        rig_SE3_lidar=fields.matrix("rig_SE3_lidar", 4, 4),
        offset_ns=_offset(fields),
        sweep=_sweep(fields.table("sweep", "the LiDAR's sweep")) if "sweep" in fields else None,
        unit_m=fields.positive("unit_m") if "unit_m" in fields else None,
    )


def _sweep(fields: Fields) -> Sweep:
    angles = fields.numbers("seam_step_time_rad")
    direction, parts = fields.whole("direction"), fields.whole("parts")
    if len(angles) != 3 or not 0 < angles[1] <= math.pi or direction not in (-1, 1) or parts < 1:
        what = f"{fields.of} needs three angles, a step of at most pi, a direction of 1 or -1, and parts"
        raise RigError(what, where="rig")
    return Sweep(*angles, direction, parts)


def _camera(fields: Fields) -> Camera:
    return Camera(
        number=fields.whole("number"),
        name=fields.text("name"),
        topic=fields.text("topic"),
        width_px=fields.whole("width_px"),
        height_px=fields.whole("height_px"),
        rectified=fields.flag("rectified"),
        projection=_projection(fields),
        lens=_lens(fields),
        offset_ns=_offset(fields),
        depth_bits=_depth(fields),
    )


def _projection(fields: Fields) -> Matrix:
    projection = fields.matrix("projection", 3, 4)
    if np.linalg.matrix_rank(projection[:, :3]) < 3:
        raise RigError(f"projection of {fields.of} is not K [R | t]: its first three columns are singular", where="rig")
    return projection


def _lens(fields: Fields) -> Lens:
    model = fields.text("distortion_model") if "distortion_model" in fields else PINHOLE
    try:
        return Lens(model, fields.numbers("distortion") if "distortion" in fields else ())
    except RigError as error:
        raise RigError(f"{error.what} (distortion of {fields.of})", where="rig", remedy=error.remedy) from error


def _offset(fields: Fields) -> int | None:
    return fields.whole("offset_ns") if "offset_ns" in fields else None


def _depth(fields: Fields) -> int | None:
    if "depth_bits" not in fields:
        return None
    bits = fields.whole("depth_bits")
    if not PIXEL_BITS <= bits <= MOST_BITS:
        raise RigError(f"depth_bits of {fields.of} is {bits}, not {PIXEL_BITS} to {MOST_BITS}", where="rig")
    return bits


def _given(**values: float | None) -> dict[str, Any]:
    """The values that are there, so that the ids of rigs without them do not depend on them."""
    return {name: value for name, value in values.items() if value is not None}


def _sweep_to_dict(sweep: Sweep | None) -> dict[str, Any]:
    """Empty where each cloud is a whole sweep, so that the ids of such rigs do not depend on it."""
    if sweep is None:
        return {}
    angles = [sweep.seam_rad, sweep.step_rad, sweep.time_rad]
    return {"sweep": {"seam_step_time_rad": angles, "direction": sweep.direction, "parts": sweep.parts}}


def _lens_to_dict(lens: Lens) -> dict[str, Any]:
    """Empty where there is no distortion, so that the ids of rectified rigs do not depend on lenses."""
    return {"distortion_model": lens.model, "distortion": list(lens.coefficients)} if lens.model != PINHOLE else {}
