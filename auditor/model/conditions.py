"""How often clean drives are raised under a condition: by night, in rain, in one vehicle."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ConditionRate:
    """The windows with findings of the drives under one condition, each judged by others.

    `share` and its 95 % interval are drawn towards the share of all drives: few windows say little. `enough` says
    whether drives and windows suffice to say anything of this condition.
    """

    condition: str
    value: str
    drives: int
    windows: int
    raised_windows: int
    share: float
    low: float
    high: float
    enough: bool
