"""The kinds of attacks and faults that can be put on a sensor, each with its main size."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

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
from auditor.lab.attacks.interference import AcousticBlur, ElectromagneticStripes, Stripes
from auditor.lab.attacks.paper import PAPER_WIDTH_PX, STRENGTHS, BogusWall, Facula, draw_facula, draw_wall
from auditor.lab.attacks.spoofing import ChangedRanges, GhostCar, RandomRanges, RemovedObject
from auditor.model.frames import CameraImage, PointCloud
from auditor.model.rig import Camera, Rig

_STRIPES_PX = 40.0
_SHUTTER_LEVEL = 120.0
_SPOT_STRENGTH = "opaque"
_SIGN_LEVEL = 120.0
_LOST_STRIPE_SHARE = 0.08  # of the image's height
_AZIMUTHS_DEG = (-25.0, 25.0)
_BEHIND_M = 60.0
_SATURATED_LOST, _NOISE_M = 0.7, 100.0
_GHOST_M = 8.0
_LATERALS_M = (-3.0, 3.0)
_JITTERY_DEG, _SHIFTED_DEG = 10.0, 20.0
_PULSES_M = 150.0  # a pulse each microsecond
_RADIUS, _HEIGHT = "radius, px of an image 1242 px wide", "height, px of an image 1242 px wide"
_AWAY = "range of the object, m"

PATTERN, DELAYED, FROZEN = "pattern", "delayed", "frozen"
"""Kinds that need further input: a picture file, the data of some frames ago, the data at the attack's start."""


class Attack(Protocol):
    """An attack or fault on one sensor, with all that determines its effect. Equal ones do the same."""

    @property
    def name(self) -> str: ...  # noqa: D102 - the class docstring says it
    @property
    def parameters(self) -> dict[str, object]: ...  # noqa: D102


class OnCamera(Attack, Protocol):
    """One on a camera."""

    def apply(self, image: CameraImage) -> CameraImage: ...  # noqa: D102 - the attacked image


class OnLidar(Attack, Protocol):
    """One on the LiDAR."""

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud: ...  # noqa: D102 - the attacked cloud


@dataclass(frozen=True)
class Drawing:
    """The inputs of a drawn attack: a random generator, a facula's strength, the kind's size, and a ghost's range."""

    rng: np.random.Generator
    strength: str
    size: float | None
    range_m: float | None = None

    @property
    def seed(self) -> int:
        """A seed for attacks that make draws of their own."""
        return int(self.rng.integers(1 << 31))


@dataclass(frozen=True)
class Kind:
    """One kind for a person: what it `does`, what its `size` is, and its `usual` size; None where that is drawn."""

    does: str
    size: str
    usual: float | None

    @property
    def in_words(self) -> str:
        """What it does, what `--size` is of it, and the usual one in brackets."""
        usual = "" if self.usual is None else f" [{self.usual:g}]"
        return f"{self.does}: {self.size}{usual}" if self.size else self.does


@dataclass(frozen=True)
class CameraKind(Kind):
    """A kind that is put on a camera: `draw` makes one of a size, which is None where it is to be drawn as well."""

    draw: Callable[[Drawing, Camera, Any], OnCamera]

    def __call__(self, draw: Drawing, camera: Camera) -> OnCamera:
        """One on this camera, of the size that was asked for or the usual one."""
        return self.draw(draw, camera, self.usual if draw.size is None else draw.size)


@dataclass(frozen=True)
class LidarKind(Kind):
    """A kind that is put on the LiDAR, as `CameraKind`."""

    draw: Callable[[Drawing, Any], OnLidar]

    def __call__(self, draw: Drawing) -> OnLidar:
        """One of the size that was asked for, or the usual one."""
        return self.draw(draw, self.usual if draw.size is None else draw.size)


def _facula(draw: Drawing, camera: Camera, radius: float | None) -> Facula:
    drawn = draw_facula(draw.rng, camera.width_px, camera.height_px, draw.strength)
    return drawn if radius is None else replace(drawn, radius_px=_scaled(radius, camera))


def _scaled(length: float, camera: Camera) -> float:
    """A length in px of an image as wide as the paper's, in px of this camera's."""
    return length * camera.width_px / PAPER_WIDTH_PX


def _place(draw: Drawing, camera: Camera) -> tuple[float, float]:
    """A place anywhere in the image."""
    return float(draw.rng.uniform(0, camera.width_px)), float(draw.rng.uniform(0, camera.height_px))


def _spot(draw: Drawing, camera: Camera, radius: float) -> Facula:
    return Facula(STRENGTHS[_SPOT_STRENGTH], _scaled(radius, camera), *_place(draw, camera))


def _of(colour: str) -> Callable[[Drawing, Camera, float | None], ColouredFacula]:
    def draw_one(draw: Drawing, camera: Camera, radius: float | None) -> ColouredFacula:
        drawn = _facula(draw, camera, radius)
        return ColouredFacula(drawn.amplitude, drawn.radius_px, drawn.u_px, drawn.v_px, colour)

    return draw_one


def _infrared(draw: Drawing, camera: Camera, radius: float | None) -> InfraredFacula:
    drawn = _facula(draw, camera, radius)
    return InfraredFacula(drawn.amplitude, drawn.radius_px, drawn.u_px, drawn.v_px)


def _projected(draw: Drawing, camera: Camera, height: float) -> ProjectedObject:
    return ProjectedObject(_SIGN_LEVEL, _scaled(height, camera), *_place(draw, camera))


def _stripes(draw: Drawing, _: Camera, level: float) -> Stripes:
    return Stripes(level, _STRIPES_PX, float(draw.rng.uniform(0, _STRIPES_PX)))


def _shutter(draw: Drawing, _: Camera, duty: float) -> Stripes:
    return Stripes(_SHUTTER_LEVEL, _STRIPES_PX, float(draw.rng.uniform(0, _STRIPES_PX)), duty)


def _blur(draw: Drawing, _: Camera, length: float) -> AcousticBlur:
    return AcousticBlur(length, float(draw.rng.uniform(0, 180)))


def _lost_rows(draw: Drawing, camera: Camera, stripes: float) -> ElectromagneticStripes:
    height = round(_LOST_STRIPE_SHARE * camera.height_px)
    return ElectromagneticStripes(round(stripes), height, int(draw.rng.integers(camera.height_px)))


def _azimuth(draw: Drawing) -> float:
    return float(draw.rng.uniform(*_AZIMUTHS_DEG))


def _wall(draw: Drawing, width_m: float | None) -> BogusWall:
    drawn = draw_wall(draw.rng)
    return replace(drawn, width_m=drawn.width_m if width_m is None else width_m)


def _far_wall(draw: Drawing, range_m: float) -> BogusWall:
    return replace(draw_wall(draw.rng), range_m=range_m)


def _jitter(draw: Drawing, noise_m: float) -> ChangedRanges:
    return ChangedRanges(_JITTERY_DEG, _azimuth(draw), 0.0, noise_m, draw.seed)


def _shift(draw: Drawing, shift_m: float) -> ChangedRanges:
    return ChangedRanges(_SHIFTED_DEG, _azimuth(draw), shift_m, 0.0, draw.seed)


def _noisy(lost: float, farthest_m: float) -> Callable[[Drawing, float], RandomRanges]:
    return lambda draw, width_deg: RandomRanges(width_deg, _azimuth(draw), lost, farthest_m, draw.seed)


def _ghost(draw: Drawing, points: float) -> GhostCar:
    range_m = _GHOST_M if draw.range_m is None else draw.range_m
    return GhostCar(round(points), range_m, float(draw.rng.uniform(*_LATERALS_M)), draw.seed)


ON_CAMERA: Mapping[str, CameraKind] = {
    "facula": CameraKind("a round light, brightest at its centre", _RADIUS, None, _facula),
    "spot": CameraKind("a small facula, opaque", _RADIUS, 40.0, _spot),
    **{
        colour: CameraKind(f"a laser's {colour} light in one channel", _RADIUS, None, _of(colour)) for colour in COLOURS
    },
    "infrared": CameraKind("near infrared, alike in all channels", _RADIUS, None, _infrared),
    "veil": CameraKind("an even light over the image", "grey levels", 60.0, lambda _draw, _, size: Veil(size)),
    "projected": CameraKind("a sign that is thrown into the lens", _HEIGHT, 120.0, _projected),
    "stripes": CameraKind("rows that are brighter in turn", "grey levels", 120, _stripes),
    "shutter": CameraKind("narrow bright rows, as of a pulsed light", "share of the rows", 0.1, _shutter),
    "blur": CameraKind("sound that shakes the stabiliser", "px", 15.0, _blur),
    "electromagnetic": CameraKind("radio waves that lose rows", "stripes", 4, _lost_rows),
    "dimmed": CameraKind("a fault: less light", "share of the light", 0.2, lambda _draw, _, size: DimmedCamera(size)),
    "soiled": CameraKind("a fault: dirt on the lens", "blobs", 4, lambda draw, _, n: SoiledLens(round(n), draw.seed)),
    "shifted": CameraKind("a fault: a camera that was knocked", "rows", 4, lambda _draw, _, n: ShiftedCamera(round(n))),
}
"""The kinds that are put on a camera, by name. Help, choices and documents are made of these."""

ON_LIDAR: Mapping[str, LidarKind] = {
    "wall": LidarKind("a bogus wall near the vehicle", "width, m", None, _wall),
    "far-wall": LidarKind("a bogus wall farther away", "range, m", 30.0, _far_wall),
    "ghost": LidarKind("points of a car that is not there; --range says where", "points", 60, _ghost),
    "jitter": LidarKind("a sector whose ranges jitter", "deviation, m", 0.3, _jitter),
    "shift": LidarKind("a sector that is farther away than it was", "m", 1.0, _shift),
    "removed": LidarKind("an object without its points", _AWAY, 20.0, lambda _, size: RemovedObject(size)),
    "seen-through": LidarKind(
        "an object whose points lie behind it", _AWAY, 20.0, lambda _, size: RemovedObject(size, _BEHIND_M)
    ),
    "saturated": LidarKind("a sector of few and random ranges", "degrees", 20.0, _noisy(_SATURATED_LOST, _NOISE_M)),
    "pulses": LidarKind("a sector of random ranges", "degrees", 20.0, _noisy(0.0, _PULSES_M)),
    "hidden": LidarKind(
        "a sector without points", "degrees", 20.0, lambda draw, size: HiddenSector(size, _azimuth(draw))
    ),
    "scattered": LidarKind("points anywhere", "points", 2000, lambda draw, n: ScatteredPoints(round(n), draw.seed)),
    "turned": LidarKind("a fault: a LiDAR that was turned", "degrees", 1, lambda _, size: TurnedLidar(size)),
    "rain": LidarKind("points of rain, and fewer others", "mm/h", 25, lambda draw, size: Rain(size, draw.seed)),
}
"""The kinds that are put on the LiDAR, as ON_CAMERA."""

OF_INPUT: Mapping[str, Kind] = {
    PATTERN: Kind("the picture of a laser's pattern, from --pattern, over a camera's images", "", None),
    DELAYED: Kind("a fault: what the sensor saw before", "frames", 1),
    FROZEN: Kind("a fault: what the sensor saw when it began", "", None),
}

KINDS: Mapping[str, Kind] = {**ON_CAMERA, **ON_LIDAR, **OF_INPUT}
"""All of them, in the order of help and documents."""


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
