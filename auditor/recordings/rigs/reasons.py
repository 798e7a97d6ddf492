"""Why a camera or a LiDAR is no part of a rig: a sentence for people, and what decisions need of it."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Reason:
    """A sentence that says why; `of` is the name or topic of the one sensor that is left out for it, if it is one.

    `others` are names of sensors that it is a reason for as well: those of a group, or the one that `of` does not fit.
    """

    text: str
    of: str = ""
    others: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.text

    def tells_of(self, *names: str) -> bool:
        """Whether it is a reason for the sensor that has one of these names."""
        return not {self.of, *self.others}.isdisjoint(names)


class TooFew(Reason):
    """Cameras that look the same way are too few for a rig."""


class AtOnePlace(Reason):
    """A camera is at the place of another: they may be two topics of one."""

    def __init__(self, name: str, other: str) -> None:
        super().__init__(f"{name} lies where {other} lies", name, (other,))
