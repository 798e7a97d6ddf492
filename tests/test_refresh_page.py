"""docs/refresh.md: its units are whole, and it names the numbers that decide."""

import re
import shutil
import subprocess
from configparser import ConfigParser
from pathlib import Path

from auditor.identification.refresh_parameters import CLEAN_DRIVE, GATE, INFLUENCE

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
    assert (CLEAN_DRIVE.most_raised, "more than a quarter" in text) == (0.25, True)
    assert (INFLUENCE.fewest_first, "at least three recordings" in text) == (3, True)
    assert (INFLUENCE.most_of_a_day, "Of one vehicle and day three" in text) == (3, True)
    assert (INFLUENCE.most_drives, "of all a hundred" in text) == (100, True)
    assert (GATE.most_step, "half a standard deviation" in text) == (0.5, True)
    assert (GATE.most_creep, "more than one standard deviation" in text) == (1.0, True)
    assert (GATE.most_lost, "more than 3 %" in text) == (0.03, True)
    assert (GATE.most_false_alarms, "three times r" in text) == (3.0, True)
