"""The sets of attacks that a case makes."""

from collections.abc import Mapping

from auditor.lab.attacks.catalogue import OnCamera, OnLidar
from auditor.model.checks import Pair
from auditor.model.rig import LIDAR

Attack = OnCamera | OnLidar
Attacks = Mapping[int, Attack]
"""The attack on each attacked sensor. Attacks are hashable, and equal ones do the same."""


def parameters_of(attacks: Attacks) -> dict[str, dict[str, object]]:
    """Everything that decides the effect of some attacks, by sensor."""
    return {f"S_{s}": {"attack": a.name, **a.parameters} for s, a in sorted(attacks.items())}


def of_two(attacks: Attacks, pair: Pair) -> Attacks:
    """The attacks on the LiDAR and on a pair's cameras, under the numbers that these have in a rig of two."""
    return {number: attacks[sensor] for number, sensor in enumerate((LIDAR, *pair)) if sensor in attacks}
