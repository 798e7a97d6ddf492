"""Plans of attacks: the sensor, the kind and size of the attack, and its time."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from auditor.errors import SettingError
from auditor.lab.attacks.catalogue import (
    DELAYED,
    FROZEN,
    ON_CAMERA,
    ON_LIDAR,
    PATTERN,
    Memory,
    check_kind,
)
from auditor.lab.attacks.interference import LaserPattern
from auditor.lab.attacks.kinds import AttackDraw, OnCamera, OnLidar
from auditor.model.frames import CameraImage, PointCloud
from auditor.model.rig import Rig
from auditor.model.verdict import AttackLabel

_DELAY_FRAMES = 1


@dataclass(frozen=True)
class AttackPlan:
    """One sensor under attack or at fault: a facula on a camera, a bogus wall in the LiDAR's cloud, or another `kind`.

    `size` is in the unit of the kind, see `catalogue`; `options` are its own, by name; `pattern` is laid over a
    camera's images. The attack holds still, or is drawn anew for every frame (`moving`). It is on from `from_ns` to
    `to_ns`, both included, in stamps of the sensor; None is the recording's own end.
    """

    sensor: int
    strength: str = "opaque"
    seed: int = 0
    moving: bool = False
    from_ns: int | None = None
    to_ns: int | None = None
    kind: str | None = None
    size: float | None = None
    pattern: LaserPattern | None = None
    options: Mapping[str, float] = field(default_factory=dict)

    def covers(self, stamp_ns: int) -> bool:
        """True while the attack is on."""
        return (self.from_ns is None or stamp_ns >= self.from_ns) and (self.to_ns is None or stamp_ns <= self.to_ns)

    def attack_at(self, stamp_ns: int, rig: Rig) -> OnCamera | OnLidar:
        """The attack at one moment, drawn from the seed (and the stamp where it is moving).

        It does not apply to kinds that replay a sensor's past: their effect depends on earlier data.
        """
        rng = np.random.default_rng([self.seed, self.sensor, stamp_ns if self.moving else 0])
        drawing = AttackDraw(rng, self.strength, self.size, self.options)
        if self.sensor in rig.lidars:
            return ON_LIDAR[self.kind or "wall"](drawing)
        return self.pattern or ON_CAMERA[self.kind or "facula"](drawing, rig.camera(self.sensor))


@dataclass
class Attacker:
    """Carries out a plan on the data of one sensor in order of time, and records the ground truth.

    Raises SettingError where the rig lacks the sensor or the plan's kind does not apply to it.
    """

    plan: AttackPlan
    rig: Rig
    _memory: Memory | None = field(default=None, init=False)
    _first_ns: int | None = field(default=None, init=False)
    _last_ns: int | None = field(default=None, init=False)
    _newest_ns: int | None = field(default=None, init=False)
    _done: str = field(default="", init=False)
    _parameters: dict[str, object] = field(default_factory=dict, init=False)

    def __post_init__(self) -> None:
        plan = self.plan
        if plan.sensor not in self.rig.sensors:
            names = ", ".join(f"S_{sensor}" for sensor in self.rig.sensors)
            raise SettingError(f"the rig has no S_{plan.sensor}", where="--on", remedy=f"it has {names}")
        if plan.kind is not None:
            check_kind(plan.kind, lidar=plan.sensor in self.rig.lidars)
        if plan.kind == PATTERN and plan.pattern is None:
            raise SettingError("a pattern needs the picture of one", where="--kind", remedy="name it with --pattern")
        if plan.kind in (DELAYED, FROZEN):
            self._memory = Memory(round(plan.size or _DELAY_FRAMES) if plan.kind == DELAYED else None)

    def change_image(self, image: CameraImage) -> CameraImage:
        """The image, attacked within the plan's time."""
        attack = cast("OnCamera | None", self._attack_on(image))
        return image if attack is None else attack.apply(image)

    def change_cloud(self, cloud: PointCloud) -> PointCloud:
        """The cloud, attacked within the plan's time."""
        attack = cast("OnLidar | None", self._attack_on(cloud))
        return (
            cloud
            if attack is None
            else attack.apply(cloud, self.rig.alone(self.plan.sensor) if self.rig.others else self.rig)
        )

    @property
    def label(self) -> AttackLabel | None:
        """The ground truth of the attack; None where no data was changed."""
        if self._first_ns is None or self._last_ns is None:
            return None
        plan = self.plan
        asked = {"strength": plan.strength, "size": plan.size, "range_m": None, **plan.options}
        drawn = asked if plan.moving else self._parameters
        parameters = {"seed": plan.seed, "moving": plan.moving, **drawn}
        return AttackLabel(self.rig.topic(plan.sensor), self._done, self._first_ns, self._last_ns, parameters)

    @property
    def newest_ns(self) -> int | None:
        """The newest stamp of the sensor's data, attacked or not; None where there was no data."""
        return self._newest_ns

    def _attack_on(self, data: CameraImage | PointCloud) -> OnCamera | OnLidar | None:
        """The attack on the sensor's next data; None outside the plan's time."""
        on = self.plan.covers(data.stamp_ns)
        self._newest_ns = data.stamp_ns if self._newest_ns is None else max(self._newest_ns, data.stamp_ns)
        if self._memory:
            self._memory.note(data, on=on)
        attack = self._memory.attack() if self._memory else self.plan.attack_at(data.stamp_ns, self.rig)
        if not on or attack is None:
            return None
        self._first_ns = data.stamp_ns if self._first_ns is None else min(self._first_ns, data.stamp_ns)
        self._last_ns = data.stamp_ns if self._last_ns is None else max(self._last_ns, data.stamp_ns)
        self._done, self._parameters = self.plan.kind or attack.name, attack.parameters
        return attack
