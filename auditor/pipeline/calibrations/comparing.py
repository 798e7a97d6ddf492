"""Two calibrations of one rig kind side by side: how far each threshold lies from that of the other."""

from decimal import Decimal

from auditor.errors import ThresholdsError
from auditor.identification.cross_validation import thresholds_of
from auditor.identification.refreshing.gate import Step, steps
from auditor.identification.systems import System
from auditor.model.calibration import Calibration


def steps_between(a: Calibration, b: Calibration, r: Decimal) -> list[Step]:
    """The steps of the checks that count, the largest rise first. Raises ThresholdsError where rig kinds differ."""
    if not a.rig_kind.matches(b.rig_kind):
        raise ThresholdsError(
            f"they are of two rig kinds: {a.rig_kind}, and {b.rig_kind}",
            where=f"calibrations {a.calibration_id[:12]} and {b.calibration_id[:12]}",
            remedy="compare two of one rig kind",
        )
    system = system_of_calibration(a)
    return steps(thresholds_of(a.clean, system, r), thresholds_of(b.clean, system, r), system)


def system_of_calibration(calibration: Calibration) -> System:
    """What the frames of a calibration's rig kind are judged by: its own sensor checks and triples."""
    kind = calibration.rig_kind
    sensors = tuple(range(0 if kind.lidar else 1, len(kind.sizes_px) + 1))
    checks = dict.fromkeys(check for one in calibration.clean for check in one.statistics)
    triples = dict.fromkeys(triple for one in calibration.clean for _, triple in one.errors)
    return System(tuple(checks), tuple(triples), sensors)
