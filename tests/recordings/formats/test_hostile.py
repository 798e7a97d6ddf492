"""Hostile files: readable messages are recovered and the rest is reported, within 5 s and 300 MB, by our own errors.

The seconds are those of a quiet machine: where a fixed piece of work takes longer, reading may.
"""

import re
from collections.abc import Callable
from pathlib import Path
from struct import Struct
from time import process_time

import pytest

from tests.making.hostile_files import Hostile
from tests.making.hostile_packed import ALL, forget_peak, memory_mb
from tests.making.reading_all import read_all

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


MAX_S = 5.0
MAX_MB = 300.0


def test_there_are_at_least_forty_kinds() -> None:
    assert len({hostile.name for hostile in ALL}) == len(ALL) >= 40


@pytest.mark.parametrize("hostile", ALL, ids=lambda hostile: hostile.name)
def test_a_hostile_file_costs_little_and_its_damage_is_reported(hostile: Hostile, tmp_path: Path) -> None:
    path = hostile.make(tmp_path)
    forget_peak()
    idle_mb, started = memory_mb("VmRSS"), process_time()
    outcome = read_all(path)
    seconds, peak_mb = process_time() - started, memory_mb("VmHWM") - idle_mb
    print(f"{outcome.messages} messages, {seconds:.2f} s, {peak_mb:.0f} MB: {outcome.text[:120]}")
    assert outcome.messages >= hostile.messages
    assert re.search(hostile.damage, outcome.text)
    assert seconds < MAX_S or min(paced_s(lambda: read_all(path)) for _ in range(3)) < MAX_S
    assert peak_mb < MAX_MB
