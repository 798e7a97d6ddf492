"""Why a camera or a LiDAR is no part of a rig: a sentence for people, and what decisions need of it."""

from dataclasses import dataclass
from enum import Enum, auto


class Kind(Enum):
    """What is decided by a reason."""

    AT_ONE_PLACE = auto()
    """A camera is at the place of another: they may be two topics of one."""

    TOO_FEW = auto()
    """Cameras that look the same way are too few for a rig."""

    OTHER = auto()
    """Nothing."""


@dataclass(frozen=True)
class Reason:
    """A sentence that says why; `of` is the name or topic of the one sensor that is left out for it, if it is one.

    `others` are names of sensors that it is a reason for as well: those of a group, or the one that `of` does not fit.
    """

    text: str
    of: str = ""
    others: tuple[str, ...] = ()
    kind: Kind = Kind.OTHER

    def __str__(self) -> str:
        return self.text

    def tells_of(self, *names: str) -> bool:
        """Whether it is a reason for the sensor that has one of these names."""
        return not {self.of, *self.others}.isdisjoint(names)


def at_one_place(name: str, other: str) -> Reason:
    """That a camera is at the place of another."""
    return Reason(f"{name} lies where {other} lies", name, (other,), Kind.AT_ONE_PLACE)
