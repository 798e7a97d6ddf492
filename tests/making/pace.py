"""How fast this process is here and now: what a limit of processor time is measured against."""

from collections.abc import Callable
from struct import Struct
from time import process_time

_STEPS = 900_000
_USUAL_S = 0.1
_RECORD = Struct("<IQ")


def paced_s(work: Callable[[], object]) -> float:
    """The processor time that some work takes, as on a quiet machine."""
    before, started = _slowness(), process_time()
    work()
    seconds = process_time() - started
    return seconds / max(before, _slowness())


def _slowness() -> float:
    """How many times as long a fixed piece of work takes now as on a quiet machine of two cores, 1 at least.

    On a busy machine a second of processor time does less: caches and cores are shared.
    """
    record, total, started = _RECORD.pack(1, 2), 0, process_time()
    for _ in range(_STEPS):
        low, high = _RECORD.unpack(record)
        total += low + high
    return max((process_time() - started) / _USUAL_S, 1.0)
