"""The interface of attacks on clean frames, and the sets of attacks that a case makes."""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

from auditor.model.checks import Pair
from auditor.model.frames import CameraImage, PointCloud
from auditor.model.rig import LIDAR, Rig


@runtime_checkable
class CameraAttack(Protocol):
    """Changes the data of one camera. It is hashable, and equal attacks do the same."""

    @property
    def name(self) -> str: ...  # noqa: D102 - the kind of attack
    @property
    def parameters(self) -> dict[str, object]: ...  # noqa: D102 - everything that decides its effect
    def apply(self, image: CameraImage) -> CameraImage: ...  # noqa: D102


@runtime_checkable
class LidarAttack(Protocol):
    """Changes the data of the LiDAR. It is hashable, and equal attacks do the same."""

    @property
    def name(self) -> str: ...  # noqa: D102 - the kind of attack
    @property
    def parameters(self) -> dict[str, object]: ...  # noqa: D102 - everything that decides its effect
    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud: ...  # noqa: D102


Attack = CameraAttack | LidarAttack
Attacks = Mapping[int, Attack]
"""The attack on each attacked sensor."""


def parameters_of(attacks: Attacks) -> dict[str, dict[str, object]]:
    """Everything that decides the effect of some attacks, by sensor."""
    return {f"S_{s}": {"attack": a.name, **a.parameters} for s, a in sorted(attacks.items())}


def of_two(attacks: Attacks, pair: Pair) -> Attacks:
    """The attacks on the LiDAR and on a pair's cameras, under the numbers that these have in a rig of two."""
    return {number: attacks[sensor] for number, sensor in enumerate((LIDAR, *pair)) if sensor in attacks}
