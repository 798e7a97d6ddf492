"""What is measured of a frame: counts of inconsistent pixels, coverage, and the damaged portion of a sensor."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from auditor.model.arrays import Image
from auditor.model.canonical import canonical_json
from auditor.model.checks import CountedPair, Pair, SensorCheck
from auditor.model.fault_features import PairFaultFeatures
from auditor.model.frames import Presence
from auditor.model.parameters import DISPARITY_ERROR_SAMPLES
from auditor.model.rig_kind import ComparedTo
from auditor.model.verdict import Statistic as Statistic  # noqa: PLC0414 - also its home for who counts

REGION_STEP = 4
"""Width of a pixel of a region's mask in full-resolution pixels."""


@dataclass(frozen=True)
class Solid:
    """A box around LiDAR points, upright in the rig.

    `centre_m` is in the LiDAR frame; `size_m` is its width, height and depth, `yaw_deg` how far its depth points to the
    right of straight ahead.
    """

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]
    yaw_deg: float


@dataclass(frozen=True, eq=False)
class Region:
    """The portion of one sensor's data that would be damaged if it is attacked; it is found for every sensor.

    `view` is the camera whose image it lies in: the sensor itself, or a reference camera for the LiDAR. `box_px` is
    (left, top, right, bottom) in full-resolution pixels of that image, right and bottom not included. `share` is that
    of the image's area, or of the LiDAR's points in view. `mask` is a PNG, 255 where damaged, of pixels REGION_STEP
    full-resolution ones wide. `points` and `solid` are the LiDAR's.

    Where no camera looks each thing is a region: `view` is the LiDAR that says it is not there, the sensor itself
    where its last scan does, and there are no pixels: the box is (0, 0, 0, 0) and the mask empty.
    """

    sensor: int
    view: int
    box_px: tuple[int, int, int, int]
    share: float
    mask: bytes
    points: int | None = None
    solid: Solid | None = None


COUNTING_VERSIONS: Mapping[ComparedTo, int] = {
    ComparedTo.CAMERAS: 36,
    ComparedTo.PAST: 39,
    ComparedTo.SCANS: 33,
    ComparedTo.LIDARS: 33,
}
"""The next number of all whenever the same frame would give other counts: thresholds and measurements are bound to it.

Each is of its own: what changes for lone cameras, for LiDARs alone, or for several of them leaves the measurements of
other rigs as they are.
"""


NO_FINGERPRINT = -1
"""Of a sensor that is not there, or whose data cannot show whether it repeats them."""


EXPERIMENTS_VERSION = 4
"""Raised whenever an evaluation would try other cases from the same seed or keep more of them, or an attack changes.

Parts of an evaluation are bound to it: what an earlier version finished is measured again, and never pooled with it.
"""


MIN_VALID_PX = DISPARITY_ERROR_SAMPLES.fewest_valid_px
"""Fewer valid pixels than this and a disparity error is not measured."""


@dataclass(frozen=True)
class Counts:
    """Pixels of one triple in one frame; `gated_*` are those with texture.

    `out_of_range_px` (part of the valid ones) are LiDAR pixels nearer than the matcher can see.
    """

    valid_px: int
    inconsistent_px: int
    gated_valid_px: int
    gated_inconsistent_px: int
    out_of_range_px: int

    def disparity_error(self, statistic: Statistic) -> float | None:
        """E: inconsistent over valid pixels; None where fewer than MIN_VALID_PX are valid."""
        if statistic is Statistic.PLAIN:
            valid, inconsistent = self.valid_px, self.inconsistent_px
        else:
            valid, inconsistent = self.gated_valid_px, self.gated_inconsistent_px
        return inconsistent / valid if valid >= MIN_VALID_PX else None


@dataclass(frozen=True)
class Coverage:
    """How much of one sensor could be used in one frame.

    Cameras: shares of saturated and textureless pixels, and of pixels without a disparity (as source; None for the
    leftmost), or of a lone camera's LiDAR points at which its picture of a moment ago shows something else; their mean
    grey `level`, and of colour cameras the means of blue and red. `saturated_px` are half px that saturate near most of
    the added light, and in most other cameras do not. LiDAR: `returns`, the points that fall into
    the leftmost camera's view. Both: the shares of its picture, or of its points, that another sensor was compared
    with, and that two were.
    """

    saturated_share: float | None = None
    textureless_share: float | None = None
    unmatched_share: float | None = None
    level: float | None = None
    blue_level: float | None = None
    red_level: float | None = None
    saturated_px: float | None = None
    returns: int | None = None
    compared_share: float | None = None
    compared_by_two_share: float | None = None


CASE_BRIGHTNESS = ("level", "saturated_share", "blue_level", "red_level", "saturated_px")
"""What cases of evaluations keep of BRIGHTNESS: none of their attacks blurs a camera, or shows it another scene."""

BRIGHTNESS = (*CASE_BRIGHTNESS, "textureless_share", "unmatched_share")
"""What is judged of each camera's picture: fields of Coverage."""


LIGHT_STEPS = 7
"""Steps of a stored sum of light residuals a unit: the 16 half px of a cell fill a signed byte."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Counts by cell of a grid: (rows, columns) each.

    `valid` (uint8) are the pixels or points that could be compared. `total` (int8) is how many of them are
    inconsistent; of SIGNED_CHECKS the sum of their residuals, -1 to 1 each, in LIGHT_STEPS a unit. Both stop at 127.
    They are stored as the grids' bytes, row by row, which compress to a third of what sparse lists take.
    """

    valid: Image
    total: NDArray[np.int8]


@dataclass(frozen=True)
class Measurement:
    """One frame, measured. `counts` follows `rig.measured_triples`; None where a sensor of the triple was not there.

    `cells` are the counts of the checks on grids, `shares` the statistics of the checks that need none;
    `unmasked_cells` are those that the LiDAR's range masks changed, as they are without it.
    `fingerprints` show by sensor whether its data change from frame to frame; `fault_features` are by matched pair.
    `regions` are the portions of sensors that would be damaged if they are attacked.
    """

    number: int
    stamp_ns: int
    presence: Mapping[int, Presence]
    counts: tuple[Counts | None, ...]
    coverage: Mapping[int, Coverage]
    cells: Mapping[CountedPair, Cells] = field(default_factory=dict)
    shares: Mapping[SensorCheck, float] = field(default_factory=dict)
    unmasked_cells: Mapping[CountedPair, Cells] = field(default_factory=dict)
    fingerprints: Mapping[int, int] = field(default_factory=dict)
    fault_features: Mapping[Pair, PairFaultFeatures] = field(default_factory=dict)
    regions: tuple[Region, ...] = ()


@dataclass(frozen=True)
class Procedure:
    """How disparity errors were measured; thresholds hold for measurements made the same way only.

    `settings` is canonical JSON (sorted keys, no spaces) of everything that can change a count.
    """

    matcher: str
    settings: str
    counting_version: int = COUNTING_VERSIONS[ComparedTo.CAMERAS]


def procedure_of(
    matcher: str, settings: str, compared_to: ComparedTo, *, measuring: str, synchronising: str
) -> Procedure:
    """The procedure of a matcher and its settings (a JSON object), with the digests of all other parameters.

    `measuring` is the digest of what can change a count, `synchronising` that of what makes frames.
    """
    values = {**json.loads(settings), "measuring": measuring, "synchronising": synchronising}
    text = canonical_json(values)
    return Procedure(matcher, text, COUNTING_VERSIONS[compared_to])
