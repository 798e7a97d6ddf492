"""Coordinate frames and the transforms between them (tf)."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from auditor.model.optics.geometry import Matrix, invert
from auditor.recordings.decoding import Transform

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
