"""Stretches of a recording's time, in which one rig is in force."""

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Stretch:
    """The time from `from_ns` to before `until_ns`; None is the recording's beginning or end.

    With a `reason` its frames cannot be audited, and are skipped.
    """

    from_ns: int | None = None
    until_ns: int | None = None
    reason: str = ""

    def holds(self, time_ns: int) -> bool:
        """True for a time in the stretch."""
        begun = self.from_ns is None or time_ns >= self.from_ns
        return begun and (self.until_ns is None or time_ns < self.until_ns)


WHOLE = (Stretch(),)
"""All of a recording."""


def stretch_at(stretches: Sequence[Stretch], time_ns: int) -> int | None:
    """The place of the stretch that a time lies in; None where another rig is in force."""
    return next((place for place, stretch in enumerate(stretches) if stretch.holds(time_ns)), None)
