"""Coordinate frames and the transforms between them (tf)."""

from collections.abc import Sequence

import numpy as np

from auditor.model.geometry import Matrix, invert
from auditor.recordings.decoding import Transform


class FrameTree:
    """Coordinate frames connected by transforms, in any direction."""

    def __init__(self, transforms: Sequence[Transform]) -> None:
        self._edges: dict[str, dict[str, Matrix]] = {}
        for transform in transforms:
            self._edges.setdefault(transform.parent, {})[transform.child] = transform.parent_SE3_child
            self._edges.setdefault(transform.child, {})[transform.parent] = invert(transform.parent_SE3_child)

    def between(self, dst: str, src: str) -> Matrix | None:
        """dst_SE3_src along the shortest chain, or None where the frames are not connected."""
        if dst == src:
            return np.eye(4)
        reached, front = {dst: np.eye(4)}, [dst]
        while front:
            following = []
            for frame in front:
                for neighbour, frame_SE3_neighbour in self._edges.get(frame, {}).items():
                    if neighbour not in reached:
                        reached[neighbour] = reached[frame] @ frame_SE3_neighbour
                        following.append(neighbour)
            if src in reached:
                return reached[src]
            front = following
        return None
