"""The rig kind that vehicles of one model share, and how alike two of them are."""

from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

from auditor.model.parameters import RIG_KIND_TOLERANCE


class Similarity(StrEnum):
    """How alike two rigs are: of one kind, of similar kinds as two production years are, or of other kinds."""

    SAME = "same"
    SIMILAR = "similar"
    OTHER = "other"


class ComparedTo(StrEnum):
    """What is compared in a rig: cameras with others, a lone one with its own past, or scans.

    Those of a LiDAR alone, or of several LiDARs without cameras.
    """

    CAMERAS = "cameras"
    PAST = "past"
    SCANS = "scans"
    LIDARS = "lidars"


class Tolerance(NamedTuple):
    """How far two rigs may differ: by shares of an image's size and of a length, and by metres of a baseline."""

    size: float
    length: float
    baseline_m: float

    def sizes(self, a: tuple[int, int], b: tuple[int, int]) -> bool:
        """Whether two image sizes (width, height) in pixels agree."""
        return all(_close(one, other, self.size) for one, other in zip(a, b, strict=True))

    def focals(self, a: float, b: float) -> bool:
        """Whether two focal lengths in pixels agree."""
        return _close(a, b, self.length)

    def baselines(self, a: float, b: float) -> bool:
        """Whether two baselines in metres agree."""
        return _close(a, b, self.length) or abs(a - b) <= self.baseline_m


TOLERANCES = {
    Similarity.SAME: Tolerance(0.0, RIG_KIND_TOLERANCE.share, RIG_KIND_TOLERANCE.baseline_m),
    Similarity.SIMILAR: Tolerance(
        RIG_KIND_TOLERANCE.similar_share, RIG_KIND_TOLERANCE.similar_share, RIG_KIND_TOLERANCE.similar_baseline_m
    ),
}
"""The tolerances of those that are alike, the closer first."""


@dataclass(frozen=True)
class RigKind:
    """What two vehicles of one model share: sensors and order, image sizes, focal lengths and baselines.

    `baselines_m` are those of neighbouring cameras, right to left; where cameras do not stand on one line, those of all
    other pairs follow. Of several LiDARs without cameras they are the distances from each to the next.
    """

    lidar: bool
    sizes_px: tuple[tuple[int, int], ...]
    focals_px: tuple[float, ...]
    baselines_m: tuple[float, ...]

    @property
    def compared_to(self) -> ComparedTo:
        """What is compared: with one camera and a LiDAR there is no other camera, and a LiDAR alone has none."""
        if not self.lidar or len(self.sizes_px) > 1:
            return ComparedTo.CAMERAS
        if self.sizes_px:
            return ComparedTo.PAST
        return ComparedTo.LIDARS if self.baselines_m else ComparedTo.SCANS

    def similarity(self, other: "RigKind") -> Similarity:
        """SAME where sizes are equal and lengths agree within 2 % or 5 mm, SIMILAR within 5 % or 2 cm.

        Kinds with other sensors are never alike.
        """
        for similarity, tolerance in TOLERANCES.items():
            if self._agrees(other, tolerance):
                return similarity
        return Similarity.OTHER

    def matches(self, other: "RigKind") -> bool:
        """True where both are one kind."""
        return self.similarity(other) is Similarity.SAME

    def _agrees(self, other: "RigKind", tolerance: Tolerance) -> bool:
        return (
            self.lidar == other.lidar
            and len(self.sizes_px) == len(other.sizes_px)
            and len(self.baselines_m) == len(other.baselines_m)
            and all(tolerance.sizes(a, b) for a, b in zip(self.sizes_px, other.sizes_px, strict=True))
            and all(tolerance.focals(a, b) for a, b in zip(self.focals_px, other.focals_px, strict=True))
            and all(tolerance.baselines(a, b) for a, b in zip(self.baselines_m, other.baselines_m, strict=True))
        )

    def __str__(self) -> str:
        baselines = ",".join(f"{baseline:.2f}" for baseline in self.baselines_m)
        if not self.sizes_px:
            return f"{len(self.baselines_m) + 1} LiDARs {baselines} m apart" if self.baselines_m else "LiDAR alone"
        sizes = "/".join(dict.fromkeys(f"{width}x{height}" for width, height in self.sizes_px))
        focals = "/".join(dict.fromkeys(f"{focal:.0f}" for focal in self.focals_px))
        if len(self.sizes_px) == 1:
            return f"LiDAR + 1 camera {sizes} f={focals}px"
        return f"{'LiDAR + ' if self.lidar else ''}{len(self.sizes_px)} cameras {sizes} f={focals}px b={baselines}m"


def _close(a: float, b: float, share: float) -> bool:
    return abs(a - b) <= share * max(abs(a), abs(b))
