"""Numbers of thresholds for other LiDARs, and other pairs of cameras, than they were made of."""

from dataclasses import dataclass

from auditor.model.parameters import parameter

_LIKE = "like pairs of three real drives and of streets 7000 to 7059: wider and narrower tried (docs/decisions.md)"


@dataclass(frozen=True)
class OtherLidar:
    """When a LiDAR is not the one that was calibrated, and what is expected of it: half the rings, half the points."""

    factor: float = parameter(
        1.4,
        unit="times the points in view, more or fewer",
        source="three KITTI drives with one LiDAR: medians differ by a factor of 1.1, frames of two drives by 1.25",
    )
    isolated: float = parameter(
        1.35,
        unit="log odds of isolated points more, for half the points",
        source="the same drives with every second and fourth ring: 1.3 to 1.5, and 1.2 for the second halving",
    )
    prior_points: float = parameter(
        13_300.0, unit="points in view a radian of its width: of the prior's LiDARs", source="the same drives, 64 rings"
    )


@dataclass(frozen=True)
class LikeCameras:
    """What the prior expects of two cameras alone that are both grey or both in colour: they predict each other."""

    less_light: float = parameter(0.45, unit="log odds of added and removed light, less", source=_LIKE)
    light: float = parameter(0.86, unit="times the deviations of these", source=_LIKE)
    inconsistency: float = parameter(0.75, unit="times those of photometric inconsistency", source=_LIKE)


OTHER_LIDAR = OtherLidar()
LIKE_CAMERAS = LikeCameras()
