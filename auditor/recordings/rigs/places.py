"""Where rigs and other sensors of a recording are, in one frame: for pictures, not for measuring."""

from collections.abc import Collection, Sequence

import numpy as np

from auditor.model.optics.geometry import Matrix, invert, motion
from auditor.model.rig import Rig
from auditor.recordings.rigs.cameras import sensor_name
from auditor.recordings.rigs.frame_tree import FrameTree
from auditor.recordings.synchronisation.survey import Survey


def rig_places(survey: Survey, rigs: Sequence[Rig]) -> list[Matrix | None]:
    """common_SE3_rig (4, 4) of each rig, in the frame that tf begins with; None where tf does not place it.

    The first rig is at the origin where tf does not place it.
    """
    frames, root = FrameTree(survey.transforms), _root(survey)
    frame_ids = {image.topic.name: image.frame_id for image in survey.images}
    frame_ids |= {cloud.topic.name: cloud.frame_id for cloud in survey.clouds}
    found = [_place(rig, frame_ids, frames, root) for rig in rigs]
    return [np.eye(4), *(None for _ in found[1:])] if found and found[0] is None else found


def unused_lidars(survey: Survey, rigs: Sequence[Rig], no_sensors: Collection[str] = ()) -> dict[str, Matrix | None]:
    """The centres (3,) of the LiDARs that no rig has, in metres, by their names; None where tf does not place them.

    Topics that are declared to be no sensors are left out.
    """
    frames, root = FrameTree(survey.transforms), _root(survey)
    topics = {lidar.topic for rig in rigs for lidar in rig.lidars.values()}
    used = {cloud.frame_id for cloud in survey.clouds if cloud.topic.name in topics}
    others = [one for one in survey.clouds if one.topic.name not in {*topics, *no_sensors}]
    others = [one for one in others if one.frame_id not in used]
    places = {sensor_name(one.topic.name): frames.between(root, one.frame_id) for one in others}
    return {name: None if place is None else place[:3, 3] for name, place in places.items()}


def _root(survey: Survey) -> str:
    """The frame above all others that the first sensor's chain leads to."""
    above = {transform.child: transform.parent for transform in survey.transforms}
    sensors = [cloud.frame_id for cloud in survey.clouds] + [image.frame_id for image in survey.images]
    frame = next(iter(sensors), "")
    seen = {frame}
    while frame in above and above[frame] not in seen:
        frame = above[frame]
        seen.add(frame)
    return frame


def _place(rig: Rig, frame_ids: dict[str, str], frames: FrameTree, root: str) -> Matrix | None:
    if rig.lidar is not None:
        topic, rig_SE3_sensor = rig.lidar.topic, rig.lidar.rig_SE3_lidar
    else:
        camera = rig.cameras[0]
        topic, rig_SE3_sensor = camera.topic, motion(camera.rotation.T, camera.centre_m)
    common_SE3_sensor = frames.between(root, frame_ids.get(topic, ""))
    return None if common_SE3_sensor is None else np.asarray(common_SE3_sensor @ invert(rig_SE3_sensor))
