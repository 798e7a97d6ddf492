"""The transforms of a recording's beginning: where sensors are mounted, and which frames move against each other."""

from collections.abc import Iterator

import numpy as np

from auditor.model.frames import Message
from auditor.recordings.decoding import Transform
from auditor.recordings.decoding.interface import TransformsDecoder
from auditor.recordings.parameters import MOVING_FRAMES
from auditor.safety.budget import MAX_TRANSFORM_BYTES, MAX_TRANSFORMS, MAX_TRANSFORMS_BYTES

_FIXED_TO_THE_WORLD = frozenset({"map", "odom", "earth"})
"""Frames in which vehicles move, by their names in REP 105."""


class Mountings:
    """The first transform between each two frames: mountings do not move."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], Transform] = {}
        self._last: dict[tuple[str, str], Transform] = {}
        self._steps: dict[tuple[str, str], int] = {}
        self._static: set[tuple[str, str]] = set()
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._known)

    def all(self) -> tuple[Transform, ...]:
        """The transforms, in the order in which they came."""
        return tuple(self._known.values())

    def moving(self) -> frozenset[tuple[str, str]]:
        """The frames, as parent and child, that move against each other, or may as one of them is the world's."""
        moved = {link for link, steps in self._steps.items() if steps >= MOVING_FRAMES.fewest_steps}
        return frozenset(moved | {one for one in self._known.keys() - self._static if _FIXED_TO_THE_WORLD & {*one}})

    def take(self, message: Message, decoder: TransformsDecoder) -> Iterator[str]:
        """Take the transforms of a message, and give the problems. Raises DecodingError where it has none."""
        size = len(message.data)
        if size > MAX_TRANSFORM_BYTES:
            yield f"a message of {size} bytes of transforms is left out; at most {MAX_TRANSFORM_BYTES} are accepted"
        elif len(self._known) >= MAX_TRANSFORMS:
            yield f"more than {MAX_TRANSFORMS} transforms: the rest of tf is left out"
        elif self._bytes + size > MAX_TRANSFORMS_BYTES:
            yield f"more than {MAX_TRANSFORMS_BYTES} bytes of transforms: the rest of tf is left out"
        else:
            self._bytes += size
            for transform in decoder.transforms(message):
                if transform.problem:
                    yield f"{transform.parent} to {transform.child}: {transform.problem}"
                else:
                    self._place(transform, static=message.topic.endswith("tf_static"))

    def _place(self, transform: Transform, *, static: bool) -> None:
        link = transform.parent, transform.child
        self._known.setdefault(link, transform)
        if static:
            self._static.add(link)
        elif _apart(self._last.setdefault(link, transform), transform):
            self._last[link] = transform
            self._steps[link] = self._steps.get(link, 0) + 1


def _apart(a: Transform, b: Transform) -> bool:
    """Whether a frame went from one place to another, and was not measured anew where it is."""
    difference = np.abs(a.parent_SE3_child - b.parent_SE3_child)
    return bool(difference[:3, 3].max() > MOVING_FRAMES.step_m or difference[:3, :3].max() > MOVING_FRAMES.step_rad)
