"""The prior of the network that comes with auditor: where the statistics of its disparities are not those of SGBM's.

Checks that are not named here have the prior that is declared with them. The network gives every pixel a disparity,
also where nothing matches: clean images are as inconsistent by it as attacked ones are by SGBM, light by two others and
conflicts with the LiDAR vary more from frame to frame, and false ranges are seen now and then. Tails are SGBM's.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import StrEnum

from auditor.model.checks import Check
from auditor.model.measurement import Procedure
from auditor.model.parameter import parameter

_PSMNET = "benchmark matcher_prior: three real drives and streets 2000 to 2017, by both matchers (docs/decisions.md)"
_FALSE = "widened by hand: 0.46 in a clean frame of drive 0009 with four cameras (docs/psmnet.md)"
_UNIT = "mean, deviation within and between drives; the tail is that of check_priors"
_DECLARED = {one.name: one.values for check in Check for one in check.kind.priors}


class FittedOn(StrEnum):
    """The matcher whose disparities a prior was fitted on."""

    SGBM = "sgbm"
    PSMNET = "psmnet"


@dataclass(frozen=True)
class PsmnetPriors:
    """Of the log odds of a statistic, as `check_priors`, by the weights that come with auditor."""

    light_of_two: tuple[float, ...] = parameter((-2.2, 0.41, 0.33), unit=_UNIT, source=_PSMNET)
    conflict: tuple[float, ...] = parameter((-1.4, 0.71, 0.33), unit=_UNIT, source=_PSMNET)
    inconsistency_of_one: tuple[float, ...] = parameter((-0.53, 0.66, 0.4), unit=_UNIT, source=_PSMNET)
    inconsistency_of_two: tuple[float, ...] = parameter((-0.87, 0.65, 0.31), unit=_UNIT, source=_PSMNET)
    inconsistency: tuple[float, ...] = parameter((-1.08, 0.61, 0.3), unit=_UNIT, source=_PSMNET)
    false_ranges: tuple[float, ...] = parameter((-3.88, 0.65, 0.15), unit=_UNIT, source=_FALSE)
    scattered_ranges: tuple[float, ...] = parameter((-3.88, 0.65, 0.15), unit=_UNIT, source="as false_ranges, by hand")


PSMNET_PRIORS = PsmnetPriors()

OTHERS: Mapping[FittedOn, Mapping[str, tuple[float, float, float, float]]] = {
    FittedOn.SGBM: {},
    FittedOn.PSMNET: {
        one.name: (*getattr(PSMNET_PRIORS, one.name), _DECLARED[one.name][-1]) for one in fields(PSMNET_PRIORS)
    },
}
"""By matcher and name the priors that are not those declared with the checks, tails included."""

SHIPPED: Mapping[str, object] = {
    "align_corners": False,
    "colour": False,
    "precision": "fp32",
    "range_px": 192,
    "step": 2,
    "weights_sha256": "33ddd15e26eda19eb3c906a9fe5ed97dfc358d5548b3bc970cebed1f575a5f4d",
}
"""The settings of PSMNet that its prior was fitted on: the weights that come with auditor, as they are used unasked."""


def fitted_on(procedure: Procedure) -> FittedOn:
    """The matcher whose prior the statistics of a procedure have: SGBM's where there is none of its own."""
    if procedure.matcher == FittedOn.PSMNET and SHIPPED.items() <= json.loads(procedure.settings).items():
        return FittedOn.PSMNET
    return FittedOn.SGBM


def has_prior(procedure: Procedure) -> bool:
    """Whether the prior judges what was measured so: it was fitted on disparities of the same matcher."""
    return procedure.matcher == FittedOn.SGBM or fitted_on(procedure) is FittedOn.PSMNET
