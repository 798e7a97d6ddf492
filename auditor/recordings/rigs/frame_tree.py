"""Coordinate frames and the transforms between them (tf)."""

from collections.abc import Collection, Sequence
from itertools import pairwise

import numpy as np

from auditor.model.optics.geometry import Matrix, invert, motion
from auditor.model.rig import Rig
from auditor.recordings.decoding import Transform
from auditor.recordings.rigs.cameras import sensor_name
from auditor.recordings.synchronisation.survey import Survey

_MOST_CHAINS = 64
"""Frames whose chains are remembered."""


class FrameTree:
    """Coordinate frames connected by transforms, in any direction."""

    def __init__(self, transforms: Sequence[Transform]) -> None:
        self._edges: dict[str, dict[str, Matrix]] = {}
        self._chains: dict[str, dict[str, str]] = {}
        for transform in transforms:
            self._edges.setdefault(transform.parent, {})[transform.child] = transform.parent_SE3_child
            self._edges.setdefault(transform.child, {})[transform.parent] = invert(transform.parent_SE3_child)

    def between(self, dst: str, src: str) -> Matrix | None:
        """dst_SE3_src along the shortest chain, or None where the frames are not connected."""
        chain = self.chain(dst, src)
        if chain is None:
            return None
        dst_SE3_src = np.eye(4)
        for frame, neighbour in pairwise(chain):
            dst_SE3_src = dst_SE3_src @ self._edges[frame][neighbour]
        return dst_SE3_src

    def chain(self, dst: str, src: str) -> list[str] | None:
        """The frames of the shortest chain from `dst` to `src`, or None where they are not connected."""
        chain = [src]
        before = self._chains_to(dst)
        while chain[-1] != dst:
            if chain[-1] not in before:
                return None
            chain.append(before[chain[-1]])
        return chain[::-1]

    def _chains_to(self, dst: str) -> dict[str, str]:
        """By frame the next one on its shortest chain to `dst`; found once for each frame that is asked for often."""
        if dst not in self._chains:
            if len(self._chains) >= _MOST_CHAINS:
                self._chains.clear()
            before, front = {}, [dst]
            while front:
                following = []
                for frame in front:
                    for neighbour in self._edges.get(frame, ()):
                        if neighbour not in before and neighbour != dst:
                            before[neighbour] = frame
                            following.append(neighbour)
                front = following
            self._chains[dst] = before
        return self._chains[dst]


def rig_places(survey: Survey, rigs: Sequence[Rig]) -> list[Matrix | None]:
    """common_SE3_rig (4, 4) of each rig, in the frame that tf begins with; None where tf does not place it.

    The first rig is at the origin where tf does not place it.
    """
    frames, root = FrameTree(survey.transforms), _root(survey)
    frame_ids = {image.topic.name: image.frame_id for image in survey.images}
    frame_ids |= {cloud.topic.name: cloud.frame_id for cloud in survey.clouds}
    places = [_place(rig, frame_ids, frames, root) for rig in rigs]
    return [np.eye(4), *(None for _ in places[1:])] if places and places[0] is None else places


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
