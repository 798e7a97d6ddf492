"""Every number that decides what drift is named. None of them changes a verdict."""

from dataclasses import dataclass

from auditor.model.parameter import BY_HAND, parameter


@dataclass(frozen=True)
class Drifting:
    """When levels of a sensor are said to drift or to have changed over the days."""

    false_alarms: float = parameter(
        0.01, unit="chance, a night, that anything is named in a fleet without drift", source=BY_HAND
    )
    rougher: float = parameter(
        10.0,
        unit="times a chance by the normal distribution: days are rougher",
        source="docs/drift.md, figures: without it another vehicle is named on 3 of 24 drawn evenings",
    )
    days: int = parameter(60, unit="days that are looked at", source=BY_HAND)
    fewest_frames: int = parameter(20, unit="measured frames of a vehicle's day", source=BY_HAND)
    margin: float = parameter(
        1.2, unit="over the root of the days of a pool: its deviation is larger by that", source="its standard error"
    )
    most_alike: float = parameter(0.9, unit="correlation of a day with the next that is believed", source=BY_HAND)
    days_around: int = parameter(5, unit="days whose median an odd day is drawn to", source=BY_HAND)
    extreme: float = parameter(2.0, unit="deviations that an odd day may differ from it", source=BY_HAND)
    days_beside: int = parameter(7, unit="days beside a change whose medians are before and after", source=BY_HAND)


@dataclass(frozen=True)
class LeastDeviations:
    """The smallest deviation of a day's levels by chance that is believed; less is nobody's concern."""

    log_odds: float = parameter(0.05, unit="log odds of what is not named below", source=BY_HAND)
    row_offset: float = parameter(0.02, unit="px", source=BY_HAND)
    depth_bias: float = parameter(0.1, unit="px", source=BY_HAND)
    brightness: float = parameter(0.005, unit="logarithm of a ratio of levels", source=BY_HAND)
    texture: float = parameter(0.02, unit="log odds", source=BY_HAND)
    returns: float = parameter(0.005, unit="logarithm of a ratio of counts", source=BY_HAND)

    def of(self, check: str) -> float:
        """That of the levels of a check."""
        return float(getattr(self, check, self.log_odds))


DRIFT = Drifting()
LEAST_DEVIATIONS = LeastDeviations()

DRIFTING = (DRIFT, LEAST_DEVIATIONS)
"""All that can change what is named."""
