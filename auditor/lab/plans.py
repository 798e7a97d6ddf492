"""Which sensor is attacked, with what, and when."""

from dataclasses import dataclass, field

import numpy as np

from auditor.errors import SettingError
from auditor.frames import CameraImage, PointCloud
from auditor.lab.attacks import BogusWall, Facula, draw_facula, draw_wall
from auditor.results import AttackLabel
from auditor.rig import LIDAR, Rig


@dataclass(frozen=True)
class AttackPlan:
    """One sensor under attack: a facula where it is a camera, a bogus wall where it is the LiDAR.

    The attack holds still, or is drawn anew for every frame (`moving`). It is on from `from_ns` to `to_ns`, both
    included, in stamps of the sensor; None is the recording's own end.
    """

    sensor: int
    strength: str = "opaque"
    seed: int = 0
    moving: bool = False
    from_ns: int | None = None
    to_ns: int | None = None

    def covers(self, stamp_ns: int) -> bool:
        """True while the attack is on."""
        return (self.from_ns is None or stamp_ns >= self.from_ns) and (self.to_ns is None or stamp_ns <= self.to_ns)

    def attack_at(self, stamp_ns: int, rig: Rig) -> Facula | BogusWall:
        """The attack at one moment, drawn from the seed (and the stamp where it is moving)."""
        rng = np.random.default_rng([self.seed, self.sensor, stamp_ns if self.moving else 0])
        if self.sensor == LIDAR:
            return draw_wall(rng)
        camera = rig.camera(self.sensor)
        return draw_facula(rng, camera.width_px, camera.height_px, self.strength)


@dataclass
class Attacker:
    """Carries a plan out on one sensor's data as it comes by, and remembers what it did."""

    plan: AttackPlan
    rig: Rig
    _first_ns: int | None = field(default=None, init=False)
    _last_ns: int | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        if self.plan.sensor not in self.rig.sensors:
            known = ", ".join(f"S_{sensor}" for sensor in self.rig.sensors)
            raise SettingError(f"the rig has no S_{self.plan.sensor}", where="--on", remedy=f"it has {known}")

    def change_image(self, image: CameraImage) -> CameraImage:
        """The image, attacked while the plan says so."""
        if not self._notes(image.stamp_ns):
            return image
        attack = self.plan.attack_at(image.stamp_ns, self.rig)
        assert isinstance(attack, Facula)
        return attack.apply(image)

    def change_cloud(self, cloud: PointCloud) -> PointCloud:
        """The cloud, attacked while the plan says so."""
        if not self._notes(cloud.stamp_ns):
            return cloud
        attack = self.plan.attack_at(cloud.stamp_ns, self.rig)
        assert isinstance(attack, BogusWall)
        return attack.apply(cloud, self.rig)

    @property
    def label(self) -> AttackLabel | None:
        """The ground truth of what was done; None where nothing was."""
        if self._first_ns is None or self._last_ns is None:
            return None
        attack = self.plan.attack_at(self._first_ns, self.rig)
        drawn = {"strength": self.plan.strength} if self.plan.moving else attack.parameters
        parameters = {"seed": self.plan.seed, "moving": self.plan.moving, **drawn}
        return AttackLabel(self.rig.topic(self.plan.sensor), attack.name, self._first_ns, self._last_ns, parameters)

    def _notes(self, stamp_ns: int) -> bool:
        if not self.plan.covers(stamp_ns):
            return False
        self._first_ns = stamp_ns if self._first_ns is None else min(self._first_ns, stamp_ns)
        self._last_ns = stamp_ns if self._last_ns is None else max(self._last_ns, stamp_ns)
        return True
