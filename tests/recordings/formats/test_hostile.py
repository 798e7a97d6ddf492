"""Hostile files: readable messages are recovered and the rest is reported, within 5 s and 300 MB, by our own errors.

The seconds are those of a quiet machine: where a fixed piece of work takes longer, reading may.
"""

import re
from pathlib import Path
from time import process_time

import pytest

from tests.making.hostile_files import Hostile
from tests.making.hostile_packed import ALL
from tests.making.memory import forget_peak, memory_mb
from tests.making.pace import paced_s
from tests.making.reading_all import read_all

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
