"""docs/refresh.md: its units are whole, and it names the numbers that decide."""

import re
import shutil
import subprocess
from configparser import ConfigParser
from pathlib import Path

from auditor.identification.refresh_parameters import CLEAN_DRIVE, CONDITIONS, GATE, INFLUENCE, TWO_SAMPLES

PAGE = (Path(__file__).parents[1] / "docs" / "refresh.md").read_text(encoding="utf-8")


def test_the_units_are_whole_and_systemd_takes_them_where_it_is(tmp_path: Path) -> None:
    units = [tmp_path / f"auditor-refresh.{kind}" for kind in ("service", "timer")]
    for path, text in zip(units, re.findall(r"```ini\n(.*?)```", PAGE, re.DOTALL), strict=True):
        path.write_text(text)
        ConfigParser(interpolation=None).read_string(text)
    if tool := shutil.which("systemd-analyze"):
        ended = subprocess.run([tool, "verify", *map(str, units)], capture_output=True, text=True, check=False)
        assert (ended.returncode, ended.stderr) == (0, "")


def test_the_numbers_of_the_page_are_those_of_the_program() -> None:
    text = " ".join(PAGE.split())
    assert f"fewer than {CLEAN_DRIVE.fewest_frames} frames" in text
    assert f"no incident at r = {CLEAN_DRIVE.raised_r:g}" in text
    assert (CLEAN_DRIVE.most_raised, "more than half of the new recordings" in text) == (0.5, True)
    assert (INFLUENCE.fewest_first, "at least three recordings" in text) == (3, True)
    assert (INFLUENCE.most_of_a_day, "Of one vehicle and day three" in text) == (3, True)
    assert (INFLUENCE.most_drives, "of all a hundred" in text) == (100, True)
    assert (GATE.most_step, "half a standard deviation" in text) == (0.5, True)
    assert (GATE.most_creep, "more than one standard deviation" in text) == (1.0, True)
    assert (GATE.most_lost, "more than 3 %" in text) == (0.03, True)
    assert (GATE.most_lost_in_all, "more than 5 % of planted attacks" in text) == (0.05, True)
    assert (GATE.most_false_alarms, "eight times r" in text) == (8.0, True)
    assert (INFLUENCE.share, "of one vehicle or one day a third" in text) == (0.34, True)
    assert (INFLUENCE.most_of_a_place, "of one road five" in text) == (5, True)
    assert (INFLUENCE.cell_m, "cells of 100 m" in text) == (100.0, True)
    assert f"with chance {TWO_SAMPLES.chance:g}" in text
    assert (TWO_SAMPLES.fewest_drives, "Fewer than eight others" in text) == (8, True)
    assert f"as if {CONDITIONS.windows_of_all:.0f} windows more" in text
    assert (
        CONDITIONS.fewest_drives,
        f"fewer than three recordings or {CONDITIONS.fewest_windows} windows" in text,
    ) == (
        3,
        True,
    )
