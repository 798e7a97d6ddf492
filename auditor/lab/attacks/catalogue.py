"""The kinds of attacks and faults that can be put on a sensor, each with its main size."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from auditor.errors import SettingError
from auditor.lab.attacks.coloured_light import COLOURS, ColouredFacula, InfraredFacula, ProjectedObject, Veil
from auditor.lab.attacks.faults import (
    DelayedCamera,
    DelayedLidar,
    DimmedCamera,
    HiddenSector,
    Rain,
    ScatteredPoints,
    ShiftedCamera,
    SoiledLens,
    TurnedLidar,
)
from auditor.lab.attacks.interference import AcousticBlur, ElectromagneticStripes, LaserPattern, Stripes
from auditor.lab.attacks.paper import PAPER_WIDTH_PX, STRENGTHS, BogusWall, Facula, draw_facula, draw_wall
from auditor.lab.attacks.spoofing import ChangedRanges, GhostCar, RandomRanges, RemovedObject
from auditor.model.frames import CameraImage, PointCloud
from auditor.model.rig import Camera

OfLight = Facula | LaserPattern | Stripes | ColouredFacula | InfraredFacula | Veil | ProjectedObject
OnCamera = OfLight | AcousticBlur | ElectromagneticStripes | DimmedCamera | ShiftedCamera | SoiledLens | DelayedCamera
Spoofed = BogusWall | GhostCar | RemovedObject | RandomRanges | ChangedRanges
OnLidar = Spoofed | HiddenSector | ScatteredPoints | TurnedLidar | Rain | DelayedLidar

_STRIPES_PX = 40.0
_SHUTTER_LEVEL, _SHUTTER_DUTY = 120.0, 0.1
_SPOT_PX, _SPOT_STRENGTH = 40.0, "opaque"
_VEIL_LEVEL = 60.0
_SIGN_PX, _SIGN_LEVEL = 120.0, 120.0
_BLUR_PX = 15.0
_LOST_STRIPES, _LOST_STRIPE_SHARE = 4, 0.08  # of the image's height
_AZIMUTHS_DEG = (-25.0, 25.0)
_FAR_WALL_M, _OBJECT_M, _BEHIND_M = 30.0, 20.0, 60.0
_SECTOR_DEG = 20.0
_SATURATED_LOST, _NOISE_M = 0.7, 100.0
_GHOST_POINTS, _GHOST_M = 60.0, 8.0
_LATERALS_M = (-3.0, 3.0)
_JITTER_M, _SHIFT_M = 0.3, 1.0
_JITTERY_DEG = 10.0
_PULSES_M = 150.0  # a pulse each microsecond

PATTERN, DELAYED, FROZEN = "pattern", "delayed", "frozen"
"""Kinds that need further input: a picture file, the data of some frames ago, the data at the attack's start."""


@dataclass(frozen=True)
class Drawing:
    """The inputs of a drawn attack: a random generator, a facula's strength, the kind's size, and a ghost's range."""

    rng: np.random.Generator
    strength: str
    size: float | None
    range_m: float | None = None

    def sized(self, usual: float) -> float:
        """The requested size, or the usual one."""
        return usual if self.size is None else self.size

    @property
    def seed(self) -> int:
        """A seed for attacks that make draws of their own."""
        return int(self.rng.integers(1 << 31))


def _facula(draw: Drawing, camera: Camera) -> Facula:
    drawn = draw_facula(draw.rng, camera.width_px, camera.height_px, draw.strength)
    return drawn if draw.size is None else replace(drawn, radius_px=draw.size * camera.width_px / PAPER_WIDTH_PX)


def _place(draw: Drawing, camera: Camera) -> tuple[float, float]:
    """A place anywhere in the image."""
    return float(draw.rng.uniform(0, camera.width_px)), float(draw.rng.uniform(0, camera.height_px))


def _spot(draw: Drawing, camera: Camera) -> Facula:
    radius = draw.sized(_SPOT_PX) * camera.width_px / PAPER_WIDTH_PX
    return Facula(STRENGTHS[_SPOT_STRENGTH], radius, *_place(draw, camera))


def _coloured(colour: str) -> Callable[[Drawing, Camera], ColouredFacula]:
    def draw_one(draw: Drawing, camera: Camera) -> ColouredFacula:
        drawn = _facula(draw, camera)
        return ColouredFacula(drawn.amplitude, drawn.radius_px, drawn.u_px, drawn.v_px, colour)

    return draw_one


def _infrared(draw: Drawing, camera: Camera) -> InfraredFacula:
    drawn = _facula(draw, camera)
    return InfraredFacula(drawn.amplitude, drawn.radius_px, drawn.u_px, drawn.v_px)


def _projected(draw: Drawing, camera: Camera) -> ProjectedObject:
    height = draw.sized(_SIGN_PX) * camera.width_px / PAPER_WIDTH_PX
    return ProjectedObject(_SIGN_LEVEL, height, *_place(draw, camera))


def _lost_rows(draw: Drawing, camera: Camera) -> ElectromagneticStripes:
    height = round(_LOST_STRIPE_SHARE * camera.height_px)
    return ElectromagneticStripes(round(draw.sized(_LOST_STRIPES)), height, int(draw.rng.integers(camera.height_px)))


def _wall(draw: Drawing) -> BogusWall:
    drawn = draw_wall(draw.rng)
    return replace(drawn, width_m=draw.sized(drawn.width_m))


def _sector(draw: Drawing, lost: float, farthest_m: float) -> RandomRanges:
    azimuth_deg = float(draw.rng.uniform(*_AZIMUTHS_DEG))
    return RandomRanges(draw.sized(_SECTOR_DEG), azimuth_deg, lost, farthest_m, draw.seed)


def _ghost(draw: Drawing) -> GhostCar:
    range_m = _GHOST_M if draw.range_m is None else draw.range_m
    return GhostCar(round(draw.sized(_GHOST_POINTS)), range_m, float(draw.rng.uniform(*_LATERALS_M)), draw.seed)


def _changed(draw: Drawing, width_deg: float, shift_m: float, noise_m: float) -> ChangedRanges:
    return ChangedRanges(width_deg, float(draw.rng.uniform(*_AZIMUTHS_DEG)), shift_m, noise_m, draw.seed)


ON_CAMERA: Mapping[str, Callable[[Drawing, Camera], OnCamera]] = {
    "facula": _facula,
    "spot": _spot,
    **{colour: _coloured(colour) for colour in COLOURS},
    "infrared": _infrared,
    "veil": lambda draw, _: Veil(draw.sized(_VEIL_LEVEL)),
    "projected": _projected,
    "stripes": lambda draw, _: Stripes(draw.sized(120), _STRIPES_PX, float(draw.rng.uniform(0, _STRIPES_PX))),
    "shutter": lambda draw, _: Stripes(
        _SHUTTER_LEVEL, _STRIPES_PX, float(draw.rng.uniform(0, _STRIPES_PX)), draw.sized(_SHUTTER_DUTY)
    ),
    "blur": lambda draw, _: AcousticBlur(draw.sized(_BLUR_PX), float(draw.rng.uniform(0, 180))),
    "electromagnetic": _lost_rows,
    "dimmed": lambda draw, _: DimmedCamera(draw.sized(0.2)),
    "soiled": lambda draw, _: SoiledLens(round(draw.sized(4)), draw.seed),
    "shifted": lambda draw, _: ShiftedCamera(round(draw.sized(4))),
}
"""By name and size: radius in px of an image 1242 px wide of faculas and the spot; grey levels of veil and stripes;
height in px of such an image of what is projected; share of the rows that the shutter's stripes light; px of blur;
number of electromagnetic stripes; share of light; blobs; rows."""

ON_LIDAR: Mapping[str, Callable[[Drawing], OnLidar]] = {
    "wall": _wall,
    "far-wall": lambda draw: replace(draw_wall(draw.rng), range_m=draw.sized(_FAR_WALL_M)),
    "ghost": _ghost,
    "jitter": lambda draw: _changed(draw, _JITTERY_DEG, 0.0, draw.sized(_JITTER_M)),
    "shift": lambda draw: _changed(draw, _SECTOR_DEG, draw.sized(_SHIFT_M), 0.0),
    "removed": lambda draw: RemovedObject(draw.sized(_OBJECT_M)),
    "seen-through": lambda draw: RemovedObject(draw.sized(_OBJECT_M), _BEHIND_M),
    "saturated": lambda draw: _sector(draw, _SATURATED_LOST, _NOISE_M),
    "pulses": lambda draw: _sector(draw, 0.0, _PULSES_M),
    "hidden": lambda draw: HiddenSector(draw.sized(_SECTOR_DEG), float(draw.rng.uniform(*_AZIMUTHS_DEG))),
    "scattered": lambda draw: ScatteredPoints(round(draw.sized(2000)), draw.seed),
    "turned": lambda draw: TurnedLidar(draw.sized(1)),
    "rain": lambda draw: Rain(draw.sized(25), draw.seed),
}
"""By name and size: width of a wall, range of a far one and of an object in m; points of a ghost; m of jitter and of
shift; degrees of a sector; points; degrees of yaw; mm/h."""


KINDS = (*ON_CAMERA, PATTERN, *ON_LIDAR, DELAYED, FROZEN)


def check_kind(kind: str, *, lidar: bool) -> None:
    """Raise SettingError where a kind cannot be put on this sort of sensor."""
    if kind in (DELAYED, FROZEN) or kind in (ON_LIDAR if lidar else (*ON_CAMERA, PATTERN)):
        return
    known = [*(ON_LIDAR if lidar else (*ON_CAMERA, PATTERN)), DELAYED, FROZEN]
    sensor = "the LiDAR" if lidar else "a camera"
    raise SettingError(f"{kind} cannot be done to {sensor}", where="--kind", remedy=f"use {', '.join(known)}")


class Memory:
    """The past data of one sensor, for attacks that replay it: of `frames` ago, or of the attack's start (None)."""

    def __init__(self, frames: int | None) -> None:
        self._frames = frames
        self._past: list[CameraImage | PointCloud] = []

    def note(self, data: CameraImage | PointCloud, *, on: bool) -> None:
        """Take the sensor's next data, and whether the attack is on."""
        if self._frames is not None:
            self._past = [*self._past[-self._frames :], data]
        elif on and not self._past:
            self._past = [data]

    def attack(self) -> DelayedCamera | DelayedLidar | None:
        """The attack that replays the past; None where there is not enough of it yet."""
        if len(self._past) < (self._frames or 0) + 1:
            return None
        earlier = self._past[0]
        frames = self._frames or 0
        if isinstance(earlier, CameraImage):
            return DelayedCamera(frames, earlier)
        return DelayedLidar(frames, earlier)
