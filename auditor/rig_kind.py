"""What two vehicles of one model share, so that thresholds learnt with one hold for the other."""

from dataclasses import dataclass

from auditor.shared_parameters import RIG_KIND_TOLERANCE

KIND_TOLERANCE_SHARE = RIG_KIND_TOLERANCE.share
KIND_TOLERANCE_M = RIG_KIND_TOLERANCE.baseline_m


@dataclass(frozen=True)
class RigKind:
    """What two vehicles of one model share: sensors and order, image sizes, focal lengths and baselines.

    `baselines_m` are those of neighbouring cameras, right to left; where cameras do not stand on one line, those of all
    other pairs follow.
    """

    lidar: bool
    sizes_px: tuple[tuple[int, int], ...]
    focals_px: tuple[float, ...]
    baselines_m: tuple[float, ...]

    def matches(self, other: "RigKind") -> bool:
        """True where sensors and sizes are equal and lengths agree within 2 % or 5 mm."""
        return (
            self.lidar == other.lidar
            and self.sizes_px == other.sizes_px
            and len(self.baselines_m) == len(other.baselines_m)
            and all(_close(a, b, 0.0) for a, b in zip(self.focals_px, other.focals_px, strict=True))
            and all(_close(a, b, KIND_TOLERANCE_M) for a, b in zip(self.baselines_m, other.baselines_m, strict=True))
        )

    def __str__(self) -> str:
        sizes = "/".join(dict.fromkeys(f"{width}x{height}" for width, height in self.sizes_px))
        focals = "/".join(dict.fromkeys(f"{focal:.0f}" for focal in self.focals_px))
        baselines = ",".join(f"{baseline:.2f}" for baseline in self.baselines_m)
        return f"{'LiDAR + ' if self.lidar else ''}{len(self.sizes_px)} cameras {sizes} f={focals}px b={baselines}m"


def _close(a: float, b: float, tolerance: float) -> bool:
    return abs(a - b) <= max(tolerance, KIND_TOLERANCE_SHARE * max(abs(a), abs(b)))
