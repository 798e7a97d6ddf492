"""The numbers of what a camera's own past says that can change a count; part of `checks.found.MEASURING`."""

from dataclasses import dataclass

from auditor.model.parameters import BY_HAND, parameter

_DRIVES = "62 frames of KITTI drives 0009, 0001 and odometry 04, each camera alone: chosen on them (docs/decisions.md)"

_POINTS = "walls and clean frames of the same drives, and streets 2000 to 2023 (docs/decisions.md)"

_STEPS = "walls and clean frames of the same drives, chosen on them (docs/decisions.md)"


_THROWN = "patterns thrown into a lone camera, three drives and streets (docs/decisions.md)"


@dataclass(frozen=True)
class EgoMotion:
    """How a camera moved between two pictures, from corners that both show and the LiDAR's range at them."""

    corner_px: int = parameter(3, unit="half px, window of a corner", source=BY_HAND)
    corner_block_px: int = parameter(10, unit="half px, width of a block that gives one corner at most", source=BY_HAND)
    most_corners: int = parameter(300, unit="corners", source="walls: 200 tried on three drives (docs/decisions.md)")
    flow_window_px: int = parameter(11, unit="half px", source=BY_HAND)
    guessed_from_px: float = parameter(
        24.0,
        unit="half px that corners should move, the median, beyond which they are sought where they should be",
        source="cameras that look aside, rendered rings: docs/decisions.md",
    )
    returns_px: float = parameter(0.3, unit="half px by which a corner misses itself, there and back", source=BY_HAND)
    inlier_px: float = parameter(0.75, unit="half px by which a corner misses the motion", source=BY_HAND)
    fewest: int = parameter(20, unit="corners that fit the motion", source=BY_HAND)
    least_share: float = parameter(
        0.3, unit="share of the corners followed that fit the motion", source="0.55 to 0.9 on three drives; by hand"
    )
    moved_px: float = parameter(1.0, unit="half px by which a corner moved", source=_THROWN)
    upright_m: float = parameter(1.0, unit="m below the LiDAR, above which points are not of the road", source=BY_HAND)
    as_far_m: float = parameter(0.2, unit="m of depth between points that are as far away", source=_THROWN)
    ranges_gain: float = parameter(
        0.05, unit="share of points more that are as far away by another motion than by most corners", source=_THROWN
    )
    stays: float = parameter(0.8, unit="NCC above which two pictures show the same at one place", source=_THROWN)
    fastest_m_s: float = parameter(40.0, unit="m/s, motions that are tried by the ranges alone", source=BY_HAND)
    most_upright: int = parameter(2500, unit="points whose ranges are compared", source="bounds the work; by hand")


@dataclass(frozen=True)
class ParallaxConflict:
    """Where a camera's pictures of two moments agree with each other and not with the LiDAR."""

    most_s: float = parameter(0.35, unit="s between the two pictures", source="two frames of 10 Hz lost; by hand")
    most_held: int = parameter(2, unit="pictures that are held", source="bounds the memory; 1, 2 and 3 tried on 0009")
    enough_m: float = parameter(
        1.2, unit="m that the camera moved since a picture; else the one before it is taken", source=_DRIVES
    )
    least_px: float = parameter(2.0, unit="px of parallax at the LiDAR's range", source=_DRIVES)
    halved_from_px: float = parameter(
        64.0,
        unit="px of parallax beyond which points are compared at half resolution, beyond twice as many at a quarter",
        source="cameras that look aside, rendered rings: docs/decisions.md",
    )
    most_halved: int = parameter(3, unit="times that pictures are halved", source=BY_HAND)
    first_points: int = parameter(800, unit="points that are compared first", source=_POINTS)
    fewest: int = parameter(50, unit="of them apart from conflicts, that say which share is unmatched", source=BY_HAND)
    around_px: int = parameter(
        25, unit="half px, width of the square around one found elsewhere in which all points are", source=_POINTS
    )
    patch_px: int = parameter(9, unit="px, width and height of a patch", source=_DRIVES)
    farther_px: int = parameter(32, unit="px of parallax less that are tried at most", source=BY_HAND)
    nearer_px: int = parameter(6, unit="px of parallax more that are tried", source=BY_HAND)
    step_px: int = parameter(3, unit="px between those that are tried first", source=_STEPS)
    smooth_px: int = parameter(3, unit="px over which the pictures' levels are means for that", source=_STEPS)
    promising: float = parameter(0.5, unit="NCC at the best of them, beyond which those around it are", source=_STEPS)
    beside_px: int = parameter(1, unit="px either way that count as at the LiDAR's range", source=_DRIVES)
    consistent: float = parameter(0.85, unit="NCC above which the two pictures show the same elsewhere", source=_DRIVES)
    clearly_less: float = parameter(
        0.2, unit="NCC elsewhere less that at the LiDAR's range, of a patch and of each half", source=_DRIVES
    )
    alike_px: float = parameter(
        2.0,
        unit="px of parallax by which neighbouring conflicts are found otherwise, at most",
        source="as alike_share: 1, 1.5 and 3 tried",
    )
    alike_share: float = parameter(
        0.7,
        unit="share of the conflicts within a patch that are found as far away, at least",
        source="drives 0009, 0001 and 04 and rendered rings: docs/decisions.md; 0.5 tried",
    )
    agreeing: float = parameter(0.6, unit="NCC at the LiDAR's range above which a point agrees", source=_DRIVES)
    most_white_share: float = parameter(
        0.25,
        unit="share of the LiDAR's points on what saturates, at most: else nothing was looked at",
        source="drives 0009, 0001 and 04: 0.07 and, by a gain of 1.4, 0.22; opaque faculas (docs/decisions.md)",
    )
    nearby_px: tuple[int, int] = parameter(
        (3, 5), unit="half px, rows and columns in which the LiDAR's nearest point is taken", source=BY_HAND
    )
    most_grown: float = parameter(2.0, unit="times its size now that a patch was a moment ago, at most", source=BY_HAND)
    cluster_px: int = parameter(12, unit="px, cells in which neighbouring conflicts are one thing", source=BY_HAND)
    changed_alike_m: float = parameter(
        0.3, unit="m by which the depths of one thing change otherwise, from one point to the next", source=BY_HAND
    )
    moving_px: float = parameter(
        0.6, unit="px by which what moves as a whole misses where it is found, the median", source=_DRIVES
    )


_FACULAS = (
    "KITTI drives 0009, 0001 and odometry 04, each camera alone, and 24 streets: chosen on them (docs/decisions.md)"
)


@dataclass(frozen=True)
class StillLight:
    """Light that stays at its place in the picture while the scene moves; sizes are shares of the picture's width."""

    ways_m: tuple[float, ...] = parameter(
        (1.0, 3.2, 5.4), unit="m that the camera moved since the pictures that are compared", source=_FACULAS
    )
    apart_m: float = parameter(0.5, unit="m of way between pictures that are held, at least", source=BY_HAND)
    most_s: float = parameter(2.0, unit="s that a picture is held", source=BY_HAND)
    most_points: int = parameter(6000, unit="points", source="bounds the work; no experiment recorded")
    fewest_points: int = parameter(200, unit="points that two pictures show", source=BY_HAND)
    least_px: float = parameter(1.0, unit="quarter px that a point moved", source=BY_HAND)
    hidden_share: float = parameter(
        0.93, unit="share of a point's depth, within which something nearer hides it", source=BY_HAND
    )
    most_apart_px: int = parameter(
        12, unit="quarter px to the LiDAR's next row, out to which something nearer hides it, at most", source=BY_HAND
    )
    mean_px: int = parameter(3, unit="quarter px over which levels are means", source="as the light of two cameras")
    nearby_px: int = parameter(3, unit="quarter px in which levels and depths are nearby, at least", source=BY_HAND)
    level: float = parameter(30.0, unit="grey levels of a residual of 1, and", source=_FACULAS)
    share: float = parameter(0.25, unit="share of the prediction that is added to them", source=_FACULAS)
    cell: float = parameter(0.02, unit="of the width: cells over which points are means", source=BY_HAND)
    full_points: int = parameter(4, unit="points of a cell that weighs 1", source=BY_HAND)
    sizes: tuple[float, ...] = parameter((0.05, 0.09, 0.16), unit="of the width: sigma of lights", source=_FACULAS)
    apart: float = parameter(0.8, unit="sigma between the middles of lights that are tried", source=BY_HAND)
    strength: float = parameter(4.0, unit="residual in the middle of a light, 1 being the most", source=_FACULAS)
    unseen_share: float = parameter(0.2, unit="share of a light's area that shows nothing", source=_FACULAS)
    blind_counts: float = parameter(
        0.25,
        unit="of it where its points saturate in both pictures",
        source="opaque faculas all along and clean frames on drives 0009, 0001 and 04: 0.25, 0.5 and 1 tried",
    )
    saturated_share: float = parameter(
        0.04,
        unit="share of the points that moved into a light that saturate, at least",
        source="faculas and mud on drives 0009, 0001 and 04: 0.02 and 0.04 tried (docs/decisions.md)",
    )
    once_share: float = parameter(
        0.1,
        unit="of what a light shows: as much it counts to have shown a frame before, at least",
        source="rendered rings, drives 0009, 0001 and 04: 0, 0.1 and 1 tried (docs/decisions.md)",
    )
    fades: float = parameter(
        16.0,
        unit="levels a quarter px, at most, at half of the edge of a patch that saturates: it counts as shown before,",
        source="rendered rings, drives 0009, 0001 and 04: 12, 16, 20 and 24 tried (docs/decisions.md)",
    )
    round: float = parameter(
        0.3,
        unit="where its shorter axis is so many of its longer one, at least",
        source="rendered rings, drives 0009, 0001 and 04: roofs have 0.05 to 0.21 (docs/decisions.md)",
    )


EGO_MOTION = EgoMotion()
PARALLAX_CONFLICT = ParallaxConflict()
STILL_LIGHT = StillLight()
