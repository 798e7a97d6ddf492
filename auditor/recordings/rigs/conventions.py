"""How a recording's calibrations are to be read where they contradict themselves.

Camera infos and tf say some things twice. Where the two disagree each is a candidate, and only the recorded images and
points can tell which one is right.
"""

from dataclasses import dataclass
from enum import StrEnum


class Positions(StrEnum):
    """Where the positions of a group of cameras come from.

    P: the fourth columns of P wherever one has an offset, else tf. TF: tf alone. NEGATED: P with the sign of those
    columns changed.
    """

    P = "P"
    TF = "tf"
    NEGATED = "-P"


class Scale(StrEnum):
    """Of which pixels K and P are.

    DECLARED: of the size that the camera info declares; region and binning, or the ratio of the two sizes, lead to the
    pictures. RECORDED: of the pictures as they were recorded, whatever the camera info declares.
    """

    DECLARED = "declared"
    RECORDED = "recorded"


@dataclass(frozen=True)
class Conventions:
    """How camera infos and tf are read. The first values are those of the standard (sensor_msgs/CameraInfo)."""

    positions: Positions = Positions.P
    scale: Scale = Scale.DECLARED

    def __str__(self) -> str:
        """What differs from the standard, in words; empty where nothing does."""
        positions = {
            Positions.P: "",
            Positions.TF: "the camera positions of tf were taken",
            Positions.NEGATED: "the camera positions of P were negated",
        }
        scales = {Scale.DECLARED: "", Scale.RECORDED: "K and P were taken as those of the recorded pictures"}
        return " and ".join(filter(None, (positions[self.positions], scales[self.scale])))


STANDARD = Conventions()
