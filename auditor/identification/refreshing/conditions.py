"""The conditions that drives were recorded under, and whether a calibration holds under each of them."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from decimal import Decimal

from auditor.identification.cross_validation import wilson
from auditor.identification.refresh_parameters import CONDITIONS, GATE
from auditor.identification.refreshing.drives import Shown
from auditor.model.conditions import ConditionRate


def rates_by_condition(conditions: Sequence[Mapping[str, str | None]], shown: Sequence[Shown]) -> list[ConditionRate]:
    """The rates of all conditions, by name and value; `conditions` are those of each drive, None where not known."""
    windows, raised = sum(one.windows for one in shown), sum(one.raised_windows for one in shown)
    of_all = raised / windows if windows else 0.0
    groups: dict[tuple[str, str], list[Shown]] = defaultdict(list)
    for of_drive, one in zip(conditions, shown, strict=True):
        for name, value in of_drive.items():
            if value is not None:
                groups[name, value].append(one)
    return [_rate(*key, drives, of_all) for key, drives in sorted(groups.items())]


def doubtful(rates: Sequence[ConditionRate], r: Decimal) -> Iterator[str]:
    """The conditions under which clean drives are raised too often."""
    for one in rates:
        if one.enough and one.low > GATE.most_false_alarms * float(r):
            yield (
                f"{one.condition} {one.value}: {one.raised_windows} of {one.windows} windows are raised, more than "
                f"{GATE.most_false_alarms:g} times r = {r}"
            )


def _rate(condition: str, value: str, drives: Sequence[Shown], of_all: float) -> ConditionRate:
    windows, raised = sum(one.windows for one in drives), sum(one.raised_windows for one in drives)
    weight = CONDITIONS.windows_of_all
    k, n = raised + weight * of_all, windows + weight
    enough = len(drives) >= CONDITIONS.fewest_drives and windows >= CONDITIONS.fewest_windows
    return ConditionRate(condition, value, len(drives), windows, raised, k / n, *wilson(k, n), enough)
