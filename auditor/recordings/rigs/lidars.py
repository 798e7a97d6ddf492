"""LiDARs at their places in rigs: the one that a group of cameras is compared with, and the rigs of LiDARs alone."""

from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise

import numpy as np

from auditor.model.arrays import Points
from auditor.model.optics.geometry import Matrix, motion
from auditor.model.rig import LIDAR, Lidar, Rig
from auditor.recordings.parameters import LIDAR_CHOICE, LIDAR_OVERLAP, RIG_LIMITS
from auditor.recordings.rigs.cameras import View, sensor_name
from auditor.recordings.rigs.frame_tree import FrameTree
from auditor.recordings.rigs.left_out import Reason, without_renamed
from auditor.recordings.rigs.ordering import PlacedViews
from auditor.recordings.synchronisation.clocks import usual_period_ns
from auditor.recordings.synchronisation.sectors import sweep_of
from auditor.recordings.synchronisation.survey import CloudTopic, Survey


def best_lidar(placed: PlacedViews, clouds: Sequence[tuple[CloudTopic, Matrix]]) -> tuple[CloudTopic, Matrix] | None:
    """Of LiDARs with their places rig_SE3_lidar (4, 4) the one with the most points that covers the cameras' pictures.

    It is passed over where it covers much less of them than another one does.
    """
    by_points = sorted(clouds, key=lambda one: -one[0].points)
    if len(by_points) < 2:
        return by_points[0] if by_points else None
    shares = [_covered(placed, cloud.some_m, rig_SE3_lidar) for cloud, rig_SE3_lidar in by_points]
    enough = LIDAR_CHOICE.least_of_best * max(shares)
    return next(one for one, share in zip(by_points, shares, strict=True) if share >= enough)


def _covered(placed: PlacedViews, some_m: Points | None, rig_SE3_lidar: Matrix) -> float:
    """The share of the cells of the cameras' pictures that some of a LiDAR's points fall into; 0 where not known."""
    if some_m is None:
        return 0.0
    points_m = some_m.astype(np.float64) @ rig_SE3_lidar[:3, :3].T + rig_SE3_lidar[:3, 3]
    cameras = zip(placed.views, placed.rotations, placed.centres_m, strict=True)
    return float(np.mean([_cells(view, (points_m - centre_m) @ rotation.T) for view, rotation, centre_m in cameras]))


def _cells(view: View, points_m: Matrix) -> float:
    """The share of a picture's cells with (N, 3) points of the camera's frame."""
    ahead = points_m[points_m[:, 2] > LIDAR_CHOICE.nearest_m]
    x, y = view.lens.distort(ahead[:, 0] / ahead[:, 2], ahead[:, 1] / ahead[:, 2])
    width, height = view.image.size_px
    rows, columns = LIDAR_CHOICE.cells
    across = columns * (view.K[0, 0] * x + view.K[0, 1] * y + view.K[0, 2]) / width
    down = rows * (view.K[1, 1] * y + view.K[1, 2]) / height
    with np.errstate(invalid="ignore"):
        inside = (across >= 0) & (across < columns) & (down >= 0) & (down < rows)
    cells = down[inside].astype(np.intp) * columns + across[inside].astype(np.intp)
    return np.unique(cells).size / (columns * rows)


_BODIES = ("base_link", "base_footprint")
"""The frames of a vehicle's body, x ahead and z up, by their names in REP 105 and 120."""

_OPTICAL_SO3_BODY = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""From a body's axes to a rig's, whose x is to the right, y down and z ahead."""


def lidar_of(cloud: CloudTopic, rig_SE3_lidar: Matrix, ahead: Matrix) -> Lidar:
    """The LiDAR of a topic at its place in the rig; `ahead` (3,) is where the cameras look."""
    x, y, _ = rig_SE3_lidar[:3, :3].T @ ahead
    name = cloud.topic.name
    return Lidar(sensor_name(name), name, rig_SE3_lidar, sweep=sweep_of(cloud.sectors, float(np.arctan2(y, x))))


def on_vehicle(survey: Survey, frames: FrameTree, reasons: list[Reason]) -> tuple[CloudTopic, ...]:
    """The topics of points, less renamed ones, and those whose points are in a frame in which the vehicle moves.

    Such points are no sensor's own: where its LiDAR was is not known of them. `reasons` gets a sentence for each.
    """
    clouds = without_renamed(survey.clouds, reasons)
    if not survey.moving:
        return tuple(clouds)
    frame_ids = [info.header.frame_id for info in survey.camera_infos.values()]
    frame_ids += [*(image.frame_id for image in survey.images), *(cloud.frame_id for cloud in survey.clouds), *_BODIES]
    kept = []
    for cloud in clouds:
        chains = (frames.chain(cloud.frame_id, other) for other in {*frame_ids} - {"", cloud.frame_id})
        moves = [not survey.moving.isdisjoint(pairwise(chain)) for chain in chains if chain is not None]
        if moves and all(moves) and cloud.frame_id not in _BODIES:
            topic, frame = cloud.topic.name, cloud.frame_id
            why = f"the points of {topic} were put into the frame {frame!r}, in which the vehicle moves"
            reasons.append(Reason(f"{why}: record those of the LiDAR itself", topic))
        else:
            kept.append(cloud)
    return tuple(kept)


def lidars_alone(rigs: Sequence[Rig], survey: Survey, frames: FrameTree, reasons: list[Reason]) -> Iterator[Rig]:
    """The rigs of LiDARs that no camera is needed for: each that is in none of some rigs, and all that overlap others.

    Those that overlap, at places that tf knows, are one rig; so LiDARs of rigs with cameras may be in one as well.
    Further topics of one LiDAR, by their frame, are left out. The axes are those of the vehicle's body where tf knows
    that, else those of the first LiDAR, x ahead and z up (REP 103). `reasons` gets a sentence for each that tf joins to
    no other one.
    """
    taken = {rig.topic(LIDAR) for rig in rigs}
    left = _of_each_lidar(survey, taken)
    reasons.extend(_unplaced(left, frames))
    while left:
        first = left.pop(0)
        together = _overlapping(first, left, frames)
        left = [cloud for cloud in left if cloud not in together]
        if together or first.topic.name not in taken:
            yield _rig_of(first, together, frames)


def is_part_of(cloud: CloudTopic, other: CloudTopic) -> bool:
    """Whether the points of a further topic of one frame lie where another one's do, as those of a thinned cloud.

    Else they are another LiDAR's, which was put into the same frame. Where nothing is known of them they are a part.
    """
    if cloud.some_m is None or other.some_m is None:
        return True
    own, others = (_from_above(one, np.eye(4), LIDAR_CHOICE.part_cell_m) for one in (cloud, other))
    return not own or _beside(own, others) >= LIDAR_CHOICE.part_share


def _unplaced(clouds: Sequence[CloudTopic], frames: FrameTree) -> Iterator[Reason]:
    for cloud in clouds:
        others = [one for one in clouds if one is not cloud]
        if others and all(frames.between(cloud.frame_id, one.frame_id) is None for one in others):
            topic, frame = cloud.topic.name, cloud.frame_id
            why = f"no tf joins the frame {frame!r} of {topic} to that of another LiDAR"
            yield Reason(f"{why}: it is compared with none of them", topic)


def _of_each_lidar(survey: Survey, taken: Collection[str]) -> list[CloudTopic]:
    """One topic of each LiDAR, first those that are not taken, the larger clouds first."""
    by_frame: dict[str, CloudTopic] = {}
    by_points = sorted(survey.clouds, key=lambda cloud: -cloud.points)
    for cloud in sorted(by_points, key=lambda cloud: cloud.topic.name not in taken):
        by_frame.setdefault(cloud.frame_id or cloud.topic.name, cloud)
    return sorted(by_frame.values(), key=lambda cloud: (cloud.topic.name in taken, -cloud.points))


def _rig_of(first: CloudTopic, others: Sequence[CloudTopic], frames: FrameTree) -> Rig:
    body = next((place for name in _BODIES if (place := frames.between(name, first.frame_id)) is not None), None)
    turn = motion(_OPTICAL_SO3_BODY if body is None else _OPTICAL_SO3_BODY @ body[:3, :3], np.zeros(3))
    ahead = np.array([0.0, 0.0, 1.0])
    beside = ((cloud, frames.between(first.frame_id, cloud.frame_id)) for cloud in others)
    placed = tuple(lidar_of(cloud, turn @ place, ahead) for cloud, place in beside if place is not None)
    return Rig(lidar_of(first, turn, ahead), (), placed)


def _overlapping(first: CloudTopic, others: Sequence[CloudTopic], frames: FrameTree) -> list[CloudTopic]:
    """Those of other LiDARs that overlap the first, or one that does."""
    together: list[CloudTopic] = []
    for cloud in others:
        if len(together) + 1 < LIDAR_OVERLAP.most and any(_overlap(one, cloud, frames) for one in (first, *together)):
            together.append(cloud)
    return together


def _overlap(cloud: CloudTopic, other: CloudTopic, frames: FrameTree) -> bool:
    """Whether two LiDARs look at the same things, and often enough, from places that tf knows.

    Points that were put into the frame of the vehicle's body are not compared: where their LiDAR was is not known.
    """
    cloud_SE3_other = frames.between(cloud.frame_id, other.frame_id)
    if cloud_SE3_other is None or not {cloud.frame_id, other.frame_id}.isdisjoint(_BODIES):
        return False
    if np.linalg.norm(cloud_SE3_other[:3, 3]) > RIG_LIMITS.most_apart_m or not (_is_fast(cloud) and _is_fast(other)):
        return False
    places = (cloud, np.eye(4)), (other, cloud_SE3_other)
    a, b = (_from_above(one, place, LIDAR_OVERLAP.cell_m) for one, place in places)
    return max(_beside(a, b), _beside(b, a)) >= LIDAR_OVERLAP.least_share


def _is_fast(cloud: CloudTopic) -> bool:
    period_ns = usual_period_ns(cloud.samples)
    return period_ns is not None and period_ns <= LIDAR_OVERLAP.slowest_s * 1e9


def _from_above(cloud: CloudTopic, common_SE3_lidar: Matrix, cell_m: float) -> list[tuple[int, int]]:
    """The cells from above of some points of a LiDAR within its reach, in its frame or another with z up."""
    some_m = np.zeros((0, 3)) if cloud.some_m is None else cloud.some_m.astype(np.float64)
    away_m = np.linalg.norm(some_m, axis=1)
    some_m = some_m[(away_m > LIDAR_OVERLAP.nearest_m) & (away_m < LIDAR_OVERLAP.farthest_m)]
    placed = some_m @ common_SE3_lidar[:3, :3].T + common_SE3_lidar[:3, 3]
    return [(int(x), int(y)) for x, y in np.floor(placed[:, :2] / cell_m)]


def _beside(cells: Sequence[tuple[int, int]], others: Sequence[tuple[int, int]]) -> float:
    """The share of points, by their cells, in or beside whose cell others lie."""
    near = {(x + right, y + ahead) for x, y in others for right in (-1, 0, 1) for ahead in (-1, 0, 1)}
    return sum(cell in near for cell in cells) / max(len(cells), 1)
