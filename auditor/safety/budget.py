"""The limits of everything that is unpacked or decoded: a small file of somebody else must not become a large one.

Whatever unpacks asks a `Budget` with the sizes that a file declares, before anything is allocated, and stops at them.
"""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

MAX_BYTES = 64 * 2**20
"""Bytes of a record, chunk or unpacked chunk: a scan may use 300 MB of memory, and real chunks have 1 to 10 MB."""

MAX_PIXELS = 24 * 10**6
"""Pixels of an image: cameras of vehicles have up to 12 million; a PNG may take 12 bytes a pixel to decode."""

MAX_WAVELET_PIXELS = 12 * 10**6
"""Pixels of a JPEG 2000, whose decoder takes 15 bytes a pixel."""

MAX_POINTS = 10**7
"""Points of a cloud: a sweep has 0.3 million at most, and a map is no sweep."""

MAX_TRANSFORMS = 10_000
"""Transforms between frames of a recording: vehicles have a hundred."""

MAX_TRANSFORM_BYTES = 2**20
"""Bytes of one message of tf: enough for 10,000 transforms."""

MAX_TRANSFORMS_BYTES = 16 * 2**20
"""Bytes of tf before a rig is known: a minute of 2,000 transforms a second, and 6 s of work."""

MAX_DESCRIPTION_BYTES = 4 * 2**20
"""Characters of a robot's description (URDF): those of vehicles have 10 to 200 kB, and meshes lie in other files."""

MAX_MODEL_BYTES = 2**30
"""Bytes of a network's file, and of what is unpacked from it; published stereo networks have 20 to 500 MB."""


@dataclass(frozen=True)
class Budget:
    """What one file may unpack to.

    Beyond `free_bytes` it is at most `most_ratio` times the packed bytes; `most_bytes` bounds one part, `total_bytes`
    all of them, and `most_parts` their number.
    """

    most_bytes: int
    total_bytes: int | None = None
    free_bytes: int = 32 * 2**20
    most_ratio: int = 100
    most_parts: int | None = None

    def bound(self, packed: int) -> int:
        """The bytes that so many packed ones may unpack to."""
        by_ratio = self.free_bytes + self.most_ratio * packed
        return by_ratio if self.total_bytes is None else min(by_ratio, self.total_bytes)


CHUNKS = Budget(MAX_BYTES)
"""Chunks and messages of a recording: images and points shrink to a half or a tenth, bombs to a ten-thousandth."""

CASE = Budget(64 * 2**30, total_bytes=64 * 2**30, most_parts=100_000)
"""A case's zip: its clip has minutes of a drive. It is hashed and never held in memory."""

CHECKPOINT = Budget(MAX_MODEL_BYTES, total_bytes=MAX_MODEL_BYTES, most_ratio=2, most_parts=100_000)
"""A checkpoint of torch, which writes its members without compression: it is loaded into memory as a whole."""

MODEL = Budget(MAX_MODEL_BYTES, total_bytes=4 * MAX_MODEL_BYTES, free_bytes=512 * 2**20, most_ratio=4)
"""The memory in which an ONNX model is opened: its file, its parameters, and a copy that is laid out to run."""

SAMPLE = Budget(8 * MAX_PIXELS, total_bytes=8 * MAX_PIXELS, most_parts=8)
"""A sample to train on: two images and a disparity map, of at most 8 bytes a pixel."""


class OverBudgetError(Exception):
    """What is over its budget, as a sentence without its subject."""


class Spending:
    """What one file has unpacked so far, part by part."""

    def __init__(self, budget: Budget) -> None:
        self._budget = budget
        self._packed = 0
        self._unpacked = 0
        self._parts = 0

    def allow(self, packed: int, size: int) -> None:
        """Count one part. Raises OverBudgetError where it is too large, or the file unpacks to too much with it."""
        budget = self._budget
        if size > budget.most_bytes:
            raise OverBudgetError(f"declares {size} unpacked bytes; at most {budget.most_bytes} are accepted")
        if self._unpacked + size > budget.bound(self._packed + packed):
            raise OverBudgetError(f"would unpack {packed} bytes to {size}, and the file has unpacked too much already")
        if budget.most_parts is not None and self._parts == budget.most_parts:
            raise OverBudgetError(f"is one of more than {budget.most_parts} parts")
        self._packed += packed
        self._unpacked += size
        self._parts += 1


_DATA_PAGES = 5  # in /proc/self/statm


@contextmanager
def at_most(more_bytes: int) -> Iterator[None]:
    """Let this process take so many bytes more inside the block: then allocations fail, as where memory is short.

    It holds for all threads. The limit of before holds again behind the block.
    """
    before, hard = resource.getrlimit(resource.RLIMIT_DATA)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[_DATA_PAGES])
    wanted = pages * resource.getpagesize() + more_bytes
    limits = [limit for limit in (wanted, before, hard) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_DATA, (min(limits), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (before, hard))
