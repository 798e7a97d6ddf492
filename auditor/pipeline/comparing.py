"""Two calibrations of one rig kind side by side: how far each threshold lies from that of the other."""

from dataclasses import dataclass
from decimal import Decimal

from auditor.errors import ThresholdsError
from auditor.identification.prior import statistic_at
from auditor.identification.scores import thresholds_from
from auditor.identification.systems import System
from auditor.model.calibration import Calibration, RobustThresholds
from auditor.model.checks import SensorCheck


@dataclass(frozen=True)
class Step:
    """The thresholds of a sensor check before and after, as statistics, and the rise in deviations of before."""

    check: SensorCheck
    before: float
    after: float
    rise: float


def steps_between(a: Calibration, b: Calibration, r: Decimal) -> list[Step]:
    """The steps of the checks that count, the largest rise first. Raises ThresholdsError where rig kinds differ."""
    if not a.rig_kind.matches(b.rig_kind):
        raise ThresholdsError(
            f"they are of two rig kinds: {a.rig_kind}, and {b.rig_kind}",
            where=f"calibrations {a.calibration_id[:12]} and {b.calibration_id[:12]}",
            remedy="compare two of one rig kind",
        )
    system = system_of_calibration(a)
    return steps(_thresholds(a, system, r), _thresholds(b, system, r), system)


def steps(before: RobustThresholds, after: RobustThresholds, system: System) -> list[Step]:
    """The steps of the checks that count where no sensor is missing, the largest rise first."""
    found = []
    for column in system.counting(frozenset()).tolist():
        check = system.sensor_checks[column]
        old, new = before.expected[check], after.expected[check]
        theta, changed = old.mean + before.limit * old.deviation, new.mean + after.limit * new.deviation
        found.append(Step(check, statistic_at(theta), statistic_at(changed), (changed - theta) / old.deviation))
    return sorted(found, key=lambda step: -step.rise)


def system_of_calibration(calibration: Calibration) -> System:
    """What the frames of a calibration's rig kind are judged by: its own sensor checks and triples."""
    kind = calibration.rig_kind
    sensors = tuple(range(0 if kind.lidar else 1, len(kind.sizes_px) + 1))
    checks = dict.fromkeys(check for one in calibration.clean for check in one.statistics)
    triples = dict.fromkeys(triple for one in calibration.clean for _, triple in one.errors)
    return System(tuple(checks), tuple(triples), sensors)


def _thresholds(calibration: Calibration, system: System, r: Decimal) -> RobustThresholds:
    return thresholds_from(calibration.clean, system.sensor_checks, system.judged_together, r)
