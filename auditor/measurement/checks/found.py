"""What checks have in their modules, found by their names: the functions that measure them, and their numbers."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from auditor.measurement.parameters import OF_ANY_RIG, OF_PAIRS, OF_THE_PAST
from auditor.model.checks import Check
from auditor.model.checks.kind import Of
from auditor.model.parameters import digest
from auditor.model.rig_kind import ComparedTo

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_MODULES = {check: import_module(f"{__package__}.{check.where}") for check in Check}


def measuring(check: Check) -> Callable[..., Any]:
    """The function that measures a check: `measure_` and its name, in its module; AttributeError where it has none."""
    made: Callable[..., Any] = getattr(_MODULES[check], f"measure_{check}")
    return made


def _numbers(*of: Of) -> tuple["DataclassInstance", ...]:
    """The groups of numbers that checks of these sorts have in their modules, as NUMBERS."""
    groups = (getattr(_MODULES[check], "NUMBERS", None) for check in Check if check.kind.of in of)
    return tuple(group for group in groups if group is not None)


_IN_VIEWS = _numbers(Of.VIEW, Of.OWN_SCANS)
_BY_PAIRS = _numbers(Of.PAIRS, Of.SEVERAL_PAIRS, Of.CAMERAS)
_BY_THE_PAST = _numbers(Of.LONE_CAMERA, Of.LIDAR)

_OF_CHECKS = (*_IN_VIEWS, *_BY_PAIRS, *_BY_THE_PAST, *_numbers(Of.OTHER_SCANS))

MEASURED_BY: Mapping[ComparedTo, tuple["DataclassInstance", ...]] = {
    ComparedTo.CAMERAS: (*OF_ANY_RIG, *OF_PAIRS, *_IN_VIEWS, *_BY_PAIRS),
    ComparedTo.PAST: (*OF_ANY_RIG, *OF_THE_PAST, *_IN_VIEWS, *_BY_THE_PAST),
    ComparedTo.SCANS: _numbers(Of.OWN_SCANS),
    ComparedTo.LIDARS: _numbers(Of.OWN_SCANS, Of.OTHER_SCANS),
}
"""All that can change a count or a measured statistic, by what a rig compares."""

MEASURING: tuple["DataclassInstance", ...] = (*OF_ANY_RIG, *OF_PAIRS, *OF_THE_PAST, *_OF_CHECKS)


def measuring_digest(compared_to: ComparedTo) -> str:
    """The digest of what measures such rigs: equal digests measure a frame alike, given the same matcher."""
    return digest(*MEASURED_BY[compared_to])
