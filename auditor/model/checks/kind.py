"""What is declared of a check: whom it is of, how it is counted and voted on, its prior, and its words."""

from dataclasses import dataclass
from enum import Enum, StrEnum
from typing import Self


class Of(Enum):
    """Which sensor a check is of, and by which others; the value says it in words."""

    PAIRS = "LiDAR", "all cameras of the pairs that are compared with it, or all but one or two"
    SEVERAL_PAIRS = "LiDAR", "as lidar_conflict, but never one pair alone: what it mismatches looks like a surface"
    VIEW = "LiDAR", "the camera in whose view its points are"
    OWN_SCANS = "LiDAR", "its own last scan, in the view of a camera; of a LiDAR alone, all around"
    SURROUNDINGS = "LiDAR", "its own last scan, all around; of a LiDAR beside cameras"
    OTHER_SCANS = "LiDAR", "all LiDARs that overlap it, all but one or two of them, and each alone"
    LONE_CAMERA = "LiDAR", "the lone camera whose past is compared with it"
    CAMERAS = "camera", "all cameras that it is matched with, all but one or two of them, and each alone"
    LIDAR = "camera", "the LiDAR, 0, by which a lone camera is compared with its past"

    @property
    def sensor(self) -> str:
        """The sort of sensor that is checked."""
        return self.value[0]

    @property
    def by(self) -> str:
        """By whom, in words."""
        return self.value[1]


class CellUnit(Enum):
    """What is measured of a pair: counts in cells of its grids, or the statistic itself."""

    POINTS = "LiDAR points by its directions"
    SURFACES = "samples of surfaces by the LiDAR's directions"
    PIXELS = "pixels of both images"
    LIGHT = "residuals of pixels of both images"
    NOTHING = "the statistic itself"


class Vote(Enum):
    """How those that a sensor is checked by decide together; the value says it, of more than two, in words."""

    MEAN = "mean"
    SMALLEST = "smallest"
    LIGHT = "root of mean times smallest"
    RANGES = "mean; of a shift the smallest"
    NONE = "-"


@dataclass(frozen=True)
class PriorOf:
    """A parameter: mean, deviations within and between drives, and tail of the log odds of a clean statistic."""

    name: str
    values: tuple[float, float, float, float]
    source: str


@dataclass(frozen=True)
class Words:
    """What readers are told of a check: its `label`, and what it `says`, for the tables of documents.

    `found` is that it fires, on a page, of the sensor beside it; `evidence` is a sentence of its own, in which {i} is
    the sensor: "the LiDAR" and what was found, where it is empty. `found_by_two` and `evidence_by_two` are of two
    sensors, {i} and {k}, where it does not tell which.
    """

    label: str
    says: str
    found: str
    evidence: str = ""
    found_by_two: str = ""
    evidence_by_two: str = ""


@dataclass(frozen=True)
class CheckKind:
    """A check as it is declared.

    `priors` are those of one other sensor, of two, and of more; of any number where there is one. `where` is the module
    that measures it, that of its own name unless told. `of_colours`: only colour cameras take part, and two tell which
    of them it is. `of_light`: darkness makes it never fire. `of_aerosol`: dust, steam or exhaust explain what it finds.
    `opposite_of` is the check whose counts it takes, with the other sign. `common`: clean frames exceed limits by it as
    its prior says, so that it makes the limit of all checks together higher; by others they hardly ever do.
    `never_of_two`: two cameras beside others find nothing by it, as where one lacks light the other has some.
    `by_two_others`: two others say together what a camera has to show; each pair of its voters that can says it.
    `by_all_but_one`: a frame is raised as well by what all voters but one say, clearly beyond the limit.
    """

    of: Of
    words: Words
    priors: tuple[PriorOf, ...]
    counted: CellUnit = CellUnit.NOTHING
    vote: Vote = Vote.NONE
    where: str = ""
    of_colours: bool = False
    of_light: bool = False
    of_aerosol: bool = False
    opposite_of: str = ""
    common: bool = False
    never_of_two: bool = False
    by_two_others: bool = False
    by_all_but_one: bool = False

    @property
    def adds(self) -> bool:
        """Whether it finds light that was added to a sensor: what lacks light never shows it."""
        return self.of_light and not self.opposite_of


class DeclaredCheck(StrEnum):
    """A check by its name, and its `kind` as it is declared."""

    _value_: str
    kind: CheckKind

    def __new__(cls, name: str, *declared: CheckKind) -> Self:
        """A check of a name, as it is declared."""
        made = str.__new__(cls, name)
        made._value_, [made.kind] = name, declared
        return made

    @property
    def counted_as(self) -> Self:
        """The check under which its counts are kept."""
        return type(self)(self.kind.opposite_of or self)

    @property
    def where(self) -> str:
        """The module of `measurement/checks` that measures it."""
        return self.kind.where or self.value
