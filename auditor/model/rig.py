"""Rigs: the LiDAR and the cameras of a vehicle, their triples and pairs."""

import hashlib
import math
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, pairwise, product
from typing import Any, NamedTuple

import numpy as np

from auditor.errors import RigError
from auditor.model.canonical import canonical_json
from auditor.model.fields import Fields
from auditor.model.optics.geometry import Matrix, beside_line_m
from auditor.model.optics.sensors import LIDAR, MOST_BITS, PINHOLE, PIXEL_BITS, Camera, Lens, Lidar, Sweep
from auditor.model.parameters import PAIR_DEPTH, RIG_GEOMETRY
from auditor.model.rig_kind import RigKind

__all__ = (
    "LIDAR",
    "MOST_BITS",
    "MOST_OFF_PX",
    "PIXEL_BITS",
    "Camera",
    "Lidar",
    "Rig",
    "Sweep",
    "Triple",
    "fallback_of",
    "triples_of",
)

MOST_OFF_PX = RIG_GEOMETRY.most_off_line_px
"""A camera beside the line of the others sees what is 10 m away on other rows: more than this and matching fails."""


class Triple(NamedTuple):
    """Sensors i < j < k whose disparity maps are compared in the view of camera k; j = k is a lone camera's past."""

    i: int
    j: int
    k: int


@dataclass(frozen=True, eq=False)
class Rig:
    """One LiDAR or none and the cameras that overlap it, S_1..S_n from right to left; of LiDARs alone there are none.

    `others` are the LiDARs S_1.. that overlap a LiDAR S_0 without cameras. Raises RigError where there are cameras as
    well, where the cameras are not numbered 1..n, or rectified ones not in that order. That of others shows in the
    views they are rectified to.
    """

    lidar: Lidar | None
    cameras: tuple[Camera, ...]
    others: tuple[Lidar, ...] = ()

    def __post_init__(self) -> None:
        if self.others and (self.cameras or self.lidar is None):
            raise RigError("several LiDARs are a rig without cameras, the first of them S_0", where="rig")
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
        return {lidar.topic: lidar.unit_m for lidar in self.lidars.values() if lidar.unit_m is not None}

    @property
    def n(self) -> int:
        """Number of cameras."""
        return len(self.cameras)

    @property
    def sensors(self) -> tuple[int, ...]:
        """Numbers of all sensors, ascending."""
        return ((LIDAR,) if self.lidar else ()) + tuple(range(1, self.n + len(self.others) + 1))

    @cached_property
    def lidars(self) -> dict[int, Lidar]:
        """All LiDARs by their numbers."""
        return dict(enumerate((self.lidar, *self.others), LIDAR)) if self.lidar else {}

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
        if sensor in self.lidars:
            return self.lidars[sensor].name
        return self.camera(sensor).name if sensor != LIDAR else ""

    def topic(self, sensor: int) -> str:
        """The topic that carries a sensor's data."""
        if sensor in self.lidars:
            return self.lidars[sensor].topic
        return self.camera(sensor).topic if sensor != LIDAR else ""

    @property
    def offsets_ns(self) -> dict[int, int]:
        """By sensor how far its stamps lie behind the leftmost camera's, in nanoseconds, where that is known."""
        offsets = {camera.number: camera.offset_ns for camera in self.cameras}
        offsets |= {sensor: lidar.offset_ns for sensor, lidar in self.lidars.items()}
        return {sensor: offset_ns for sensor, offset_ns in sorted(offsets.items()) if offset_ns is not None}

    def baseline_m(self, i: int, k: int) -> float:
        """Distance b_{i,k} in metres, positive, between cameras i < k; of rectified ones that along their rows."""
        right, left = self.camera(i), self.camera(k)
        if right.rectified and left.rectified:
            return float(right.centre_m[0] - left.centre_m[0])
        return float(np.linalg.norm(right.centre_m - left.centre_m))

    def beside_m(self, i: int, k: int) -> Matrix:
        """(3,) where LiDAR k lies as seen from LiDAR i, in the axes of the rig."""
        return np.asarray(self.lidars[k].rig_SE3_lidar[:3, 3] - self.lidars[i].rig_SE3_lidar[:3, 3])

    def alone(self, sensor: int) -> "Rig":
        """One of the LiDARs as a rig of its own, in which it is S_0."""
        return Rig(self.lidars[sensor], ())

    def lone(self, number: int) -> "Rig":
        """A camera as a rig of its own, in which it is S_1, with the LiDAR if there is one."""
        return Rig(self.lidar, (replace(self.camera(number), number=1),))

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
        apart_m = tuple(float(np.linalg.norm(self.beside_m(i, i + 1))) for i in range(len(self.others)))
        return RigKind(
            lidar=self.lidar is not None,
            sizes_px=tuple((camera.width_px, camera.height_px) for camera in self.cameras),
            focals_px=tuple(camera.focal_px for camera in self.cameras),
            baselines_m=apart_m or tuple(self.baseline_m(*pair) for pair in pairs),
        )

    @cached_property
    def rig_id(self) -> str:
        """sha256 (hex) of the rig's description."""
        return hashlib.sha256(self.description.encode()).hexdigest()

    @property
    def description(self) -> str:
        """The rig as canonical JSON, as the store keeps it."""
        return canonical_json(self.to_dict())

    def to_dict(self) -> dict[str, Any]:
        """A plain description that `from_dict` reads back; every number survives exactly."""
        others = {"others": [_lidar_to_dict(lidar) for lidar in self.others]} if self.others else {}
        return {
            "lidar": _lidar_to_dict(self.lidar) if self.lidar else None,
            **others,
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
        others = fields.tables("others", "LiDAR") if "others" in fields else ()
        return cls(lidar, tuple(map(_camera, cameras)), tuple(map(_lidar, others)))


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


def _lidar_to_dict(lidar: Lidar) -> dict[str, Any]:
    return {
        "name": lidar.name,
        "topic": lidar.topic,
        "rig_SE3_lidar": lidar.rig_SE3_lidar.tolist(),
        **_given(offset_ns=lidar.offset_ns, unit_m=lidar.unit_m),
        **_sweep_to_dict(lidar.sweep),
    }


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
        rule = f"{fields.of} needs three angles, a step of at most pi, a direction of 1 or -1, and parts"
        raise RigError(rule, where="rig")
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
