"""The transforms (tf) of a recording's beginning, within limits: to decode one takes 40 microseconds."""

from collections.abc import Iterator

from auditor.model.frames import Message
from auditor.recordings.decoding import Transform
from auditor.recordings.decoding.interface import TransformsDecoder
from auditor.safety.budget import MAX_TRANSFORM_BYTES, MAX_TRANSFORMS, MAX_TRANSFORMS_BYTES


class Mountings:
    """The first transform between each two frames: mountings do not move."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, str], Transform] = {}
        self._bytes = 0

    def __len__(self) -> int:
        return len(self._known)

    def all(self) -> tuple[Transform, ...]:
        """The transforms, in the order in which they came."""
        return tuple(self._known.values())

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
                    self._known.setdefault((transform.parent, transform.child), transform)
