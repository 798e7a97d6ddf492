"""Chunks of frames that are finished together, so that a killed evaluation goes on where it was."""

import itertools
from collections import deque
from collections.abc import Callable, Iterator, Sequence

from auditor.lab.evaluation.experiments import DELAYS
from auditor.model.frames import Frame, Skipped

CHUNK_FRAMES = 20
"""Frames of a chunk: a killed evaluation loses no more than these."""


class Chunks:
    """Chunks of frames by number. `past` holds the frames before the current one, the latest last."""

    def __init__(self, frames: Iterator[Frame | Skipped]) -> None:
        self._frames = frames
        self._ahead: deque[Frame | Skipped] = deque()
        self.past: deque[Frame] = deque(maxlen=max(DELAYS))

    def __iter__(self) -> Iterator[tuple[int, Iterator[Frame | Skipped]]]:
        for chunk in itertools.count():
            end = (chunk + 1) * CHUNK_FRAMES
            yield chunk, self._below(end)
            for _ in self._below(end):  # the frames that the caller left unread
                pass
            if self.ended:
                return

    @property
    def ended(self) -> bool:
        """True once the last frame has been given."""
        return self._next is None

    @property
    def following(self) -> Frame | None:
        """The frame after the current one; skipped frames between them are given later."""
        for item in self._ahead:
            if isinstance(item, Frame):
                return item
        for item in self._frames:
            self._ahead.append(item)
            if isinstance(item, Frame):
                return item
        return None

    @property
    def _next(self) -> Frame | Skipped | None:
        if not self._ahead:
            self._ahead.extend(itertools.islice(self._frames, 1))
        return self._ahead[0] if self._ahead else None

    def _below(self, end: int) -> Iterator[Frame | Skipped]:
        while (frame := self._next) is not None and frame.number < end:
            self._ahead.popleft()
            yield frame
            if isinstance(frame, Frame):
                self.past.append(frame)


def all_finished(parts: Callable[[int], Sequence[bool | None]], *, share: int, of: int) -> bool:
    """True where every chunk of a share, each `of`-th, is finished, and the last one is known.

    `parts` gives the parts of a chunk: None where one is not finished, else whether the recording ends in it.
    """
    for chunk in itertools.count():
        found = parts(chunk)
        if (chunk % of == share and None in found) or all(part is None for part in found):
            return False
        if any(found):
            return True
    raise AssertionError  # counting has no end
