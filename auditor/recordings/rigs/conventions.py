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


class Axes(StrEnum):
    """How the frames of cameras lie in tf.

    OPTICAL: x right, y down, z ahead, as ROS has it for frames of pictures. BODY: x ahead, y left, z up, as it has it
    for everything else.
    """

    OPTICAL = "optical"
    BODY = "body"


class ZeroLens(StrEnum):
    """What a lens by the angle (`equidistant`) is whose coefficients are all 0.

    NAMED: such a lens, as simulators have it. NONE: no lens, as drivers mean that name it and know no coefficients.
    LEFT_OUT: not known; the camera is left out.
    """

    NAMED = "named"
    NONE = "none"
    LEFT_OUT = "left out"


@dataclass(frozen=True)
class Conventions:
    """How camera infos and tf are read. The first values are those of the standard (sensor_msgs/CameraInfo)."""

    positions: Positions = Positions.P
    scale: Scale = Scale.DECLARED
    axes: Axes = Axes.OPTICAL
    zero_lens: ZeroLens = ZeroLens.NAMED

    def __str__(self) -> str:
        """What differs from the standard, in words; empty where nothing does."""
        positions = {
            Positions.P: "",
            Positions.TF: "the camera positions of tf were taken",
            Positions.NEGATED: "the camera positions of P were negated",
        }
        scales = {Scale.DECLARED: "", Scale.RECORDED: "K and P were taken as those of the recorded pictures"}
        axes = {Axes.OPTICAL: "", Axes.BODY: "x of their frames was taken to look ahead"}
        return " and ".join(filter(None, (positions[self.positions], scales[self.scale], axes[self.axes])))


STANDARD = Conventions()
