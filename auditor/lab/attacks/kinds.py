"""What is said of a kind of attack or fault where its class stands, and what one is drawn from."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from auditor.model.frames import CameraImage, PointCloud
from auditor.model.rig import Camera, Rig


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
class AttackDraw:
    """The inputs of a drawn attack: a random generator, a facula's strength, the kind's size, and its own options."""

    rng: np.random.Generator
    strength: str
    size: float | None
    options: Mapping[str, float] = field(default_factory=dict)

    @property
    def seed(self) -> int:
        """A seed for attacks that make draws of their own."""
        return int(self.rng.integers(1 << 31))


@dataclass(frozen=True)
class Option:
    """An option of one kind: --`flag`, a number from `least` on, kept by its `name`; `says` what it is, with a unit."""

    flag: str
    name: str
    says: str
    least: float


@dataclass(frozen=True)
class AttackKind:
    """One kind for a person: what it `does`, what its `size` is, and its `usual` size; None where that is drawn."""

    does: str
    size: str
    usual: float | None
    options: tuple[Option, ...] = field(default=(), kw_only=True)

    @property
    def in_words(self) -> str:
        """What it does, what `--size` is of it, and the usual one in brackets."""
        usual = "" if self.usual is None else f" [{self.usual:g}]"
        return f"{self.does}: {self.size}{usual}" if self.size else self.does


@dataclass(frozen=True)
class CameraKind(AttackKind):
    """A kind that is put on a camera: `draw` makes one of a size, which is None where it is to be drawn as well.

    `evaluated`: the further experiment has it at its usual size; a change of that raises EXPERIMENTS_VERSION.
    """

    draw: Callable[[AttackDraw, Camera, Any], OnCamera]
    evaluated: bool = field(default=False, kw_only=True)

    def __call__(self, draw: AttackDraw, camera: Camera) -> OnCamera:
        """One on this camera, of the size that was asked for or the usual one."""
        return self.draw(draw, camera, self.usual if draw.size is None else draw.size)


@dataclass(frozen=True)
class LidarKind(AttackKind):
    """A kind that is put on the LiDAR, as `CameraKind`."""

    draw: Callable[[AttackDraw, Any], OnLidar]

    def __call__(self, draw: AttackDraw) -> OnLidar:
        """One of the size that was asked for, or the usual one."""
        return self.draw(draw, self.usual if draw.size is None else draw.size)


def uniform(draw: AttackDraw, limits: tuple[float, float]) -> float:
    """A number between two."""
    return float(draw.rng.uniform(*limits))


def place(draw: AttackDraw, camera: Camera) -> tuple[float, float]:
    """A place anywhere in the image."""
    return uniform(draw, (0, camera.width_px)), uniform(draw, (0, camera.height_px))
