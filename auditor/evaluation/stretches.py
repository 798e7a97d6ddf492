"""Runs of frames that are finished together, so that a killed evaluation goes on where it was."""

import itertools
from collections import deque
from collections.abc import Callable, Iterator, Sequence

from auditor.evaluation.further import DELAYS
from auditor.frames import Frame, Skipped

STRETCH_FRAMES = 20
"""Frames that are finished together: a killed evaluation loses no more than these."""


class Stretches:
    """Runs of frames by number. `past` holds the frames before the one that is being looked at, the latest last."""

    def __init__(self, frames: Iterator[Frame | Skipped]) -> None:
        self._frames = frames
        self._next = next(frames, None)
        self.past: deque[Frame] = deque(maxlen=max(DELAYS))

    def __iter__(self) -> Iterator[tuple[int, Iterator[Frame | Skipped]]]:
        for stretch in itertools.count():
            end = (stretch + 1) * STRETCH_FRAMES
            yield stretch, self._below(end)
            for _ in self._below(end):  # what the caller left unread
                pass
            if self.ended:
                return

    @property
    def ended(self) -> bool:
        """True once the last frame has been read."""
        return self._next is None

    def _below(self, end: int) -> Iterator[Frame | Skipped]:
        while self._next is not None and self._next.number < end:
            frame, self._next = self._next, next(self._frames, None)
            yield frame
            if isinstance(frame, Frame):
                self.past.append(frame)


def all_finished(parts: Callable[[int], Sequence[bool | None]], *, share: int, of: int) -> bool:
    """True where every stretch of a share, each `of`-th, is there, and the last one is known.

    `parts` are those of a stretch: None where one is not finished, else whether the recording ends in it.
    """
    for stretch in itertools.count():
        found = parts(stretch)
        if (stretch % of == share and None in found) or all(part is None for part in found):
            return False
        if any(found):
            return True
    raise AssertionError  # counting has no end
