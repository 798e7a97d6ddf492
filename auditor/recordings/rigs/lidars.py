"""LiDARs at their places in rigs, and the rigs of those alone."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from auditor.model.optics.geometry import Matrix, motion
from auditor.model.rig import LIDAR, Lidar, Rig
from auditor.recordings.rigs.cameras import sensor_name
from auditor.recordings.rigs.frame_tree import FrameTree
from auditor.recordings.rigs.reasons import Reason
from auditor.recordings.synchronisation.sectors import sweep_of
from auditor.recordings.synchronisation.survey import CloudTopic, Survey

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
    """The topics of points, less those whose points were put into a frame in which the vehicle moves.

    Such points are no sensor's own: where its LiDAR was is not known of them. `reasons` gets a sentence for each.
    """
    if not survey.moving:
        return survey.clouds
    frame_ids = [info.header.frame_id for info in survey.camera_infos.values()]
    frame_ids += [*(image.frame_id for image in survey.images), *(cloud.frame_id for cloud in survey.clouds), *_BODIES]
    kept = []
    for cloud in survey.clouds:
        chains = (frames.chain(cloud.frame_id, other) for other in {*frame_ids} - {"", cloud.frame_id})
        moves = [not survey.moving.isdisjoint(pairwise(chain)) for chain in chains if chain is not None]
        if moves and all(moves) and cloud.frame_id not in _BODIES:
            topic, frame = cloud.topic.name, cloud.frame_id
            why = f"the points of {topic} were put into the frame {frame!r}, in which the vehicle moves"
            reasons.append(Reason(f"{why}: record those of the LiDAR itself", topic))
        else:
            kept.append(cloud)
    return tuple(kept)


def lidars_alone(rigs: Sequence[Rig], survey: Survey, frames: FrameTree) -> Iterator[Rig]:
    """A rig of each LiDAR that is in none of some rigs; further topics of one LiDAR, by their frame, are left out.

    Its axes are those of the vehicle's body where tf knows that, else the LiDAR's own, x ahead and z up (REP 103).
    """
    taken = {rig.topic(LIDAR) for rig in rigs}
    held = {cloud.frame_id for cloud in survey.clouds if cloud.topic.name in taken} - {""}
    for cloud in sorted(survey.clouds, key=lambda cloud: -cloud.points):
        if cloud.topic.name in taken or cloud.frame_id in held:
            continue
        held.update({cloud.frame_id} - {""})
        body = next((place for name in _BODIES if (place := frames.between(name, cloud.frame_id)) is not None), None)
        turn = _OPTICAL_SO3_BODY if body is None else _OPTICAL_SO3_BODY @ body[:3, :3]
        yield Rig(lidar_of(cloud, motion(turn, np.zeros(3)), np.array([0.0, 0.0, 1.0])), ())
