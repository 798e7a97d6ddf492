"""Statistics of sensor checks as clean drives have them, and as attacks raise them."""

from collections.abc import Collection

import numpy as np

from auditor.identification.prior import prior_of_check, statistic_at
from auditor.model.checks import SensorCheck, rig_sensor_checks
from auditor.model.rig import Rig

ATTACKED = 0.95


def drawn_statistics(
    rng: np.random.Generator,
    rig: Rig,
    attacked: Collection[int] = (),
    *,
    seen: float = 1.0,
    unmeasured: float = 0.0,
    spread: float = 1.0,
) -> list[float | None]:
    """What the prior expects of a frame of a clean drive; high of most checks that name an attacked sensor.

    `seen` is the share of these that are high, `unmeasured` that of all checks that have none; `spread` multiplies the
    deviation of clean ones.
    """

    def drawn(check: SensorCheck) -> float | None:
        prior = prior_of_check(check)
        clean = statistic_at(rng.normal(prior.mean, spread * prior.within))
        chances = rng.random(2)
        if chances[0] < unmeasured:
            return None
        return ATTACKED if set(attacked) & set(check.nameable) and chances[1] < seen else clean

    return [drawn(check) for check in rig_sensor_checks(rig)]
