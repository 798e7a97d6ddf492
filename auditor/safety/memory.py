"""A bound on the memory of a library that unpacks by itself, and says only afterwards to how much."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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
