"""The kinds of attacks and faults that can be put on a sensor: those that the modules of this folder declare.

A module with an attack has it in a mapping ON_CAMERA or ON_LIDAR, by the name of its kind. Help, choices and documents
are made of these.
"""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from auditor.errors import SettingError
from auditor.lab.attacks.faults import DelayedCamera, DelayedLidar
from auditor.lab.attacks.kinds import AttackKind, CameraKind, LidarKind
from auditor.model.frames import CameraImage, PointCloud

PATTERN, DELAYED, FROZEN = "pattern", "delayed", "frozen"
"""Kinds that need further input: a picture file, the data of some frames ago, the data at the attack's start."""

_FIRST = "paper"
_OTHERS = {_FIRST, "catalogue", "kinds", "schedule", "__init__"}
_MODULES = (_FIRST, *sorted({path.stem for path in Path(__file__).parent.glob("*.py")} - _OTHERS))


def _declared(name: str) -> dict[str, Any]:
    """What the modules declare under a name, those of the paper first."""
    modules = (import_module(f"{__package__}.{module}") for module in _MODULES)
    return {kind: one for module in modules for kind, one in getattr(module, name, {}).items()}


ON_CAMERA: Mapping[str, CameraKind] = _declared("ON_CAMERA")
"""The kinds that are put on a camera, by name."""

ON_LIDAR: Mapping[str, LidarKind] = _declared("ON_LIDAR")
"""The kinds that are put on the LiDAR, as ON_CAMERA."""

OF_INPUT: Mapping[str, AttackKind] = {
    PATTERN: AttackKind("the picture of a laser's pattern, from --pattern, over a camera's images", "", None),
    DELAYED: AttackKind("a fault: what the sensor saw before", "frames", 1),
    FROZEN: AttackKind("a fault: what the sensor saw when it began", "", None),
}

KINDS: Mapping[str, AttackKind] = {**ON_CAMERA, **ON_LIDAR, **OF_INPUT}
"""All of them, in the order of help and documents."""


def check_kind(kind: str, *, lidar: bool) -> None:
    """Raise SettingError where a kind cannot be put on this sort of sensor."""
    if kind in (DELAYED, FROZEN) or kind in (ON_LIDAR if lidar else (*ON_CAMERA, PATTERN)):
        return
    kinds = [*(ON_LIDAR if lidar else (*ON_CAMERA, PATTERN)), DELAYED, FROZEN]
    sensor = "the LiDAR" if lidar else "a camera"
    raise SettingError(f"{kind} cannot be done to {sensor}", where="--kind", remedy=f"use {', '.join(kinds)}")


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
