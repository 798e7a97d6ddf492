"""Every block of docs/python.md runs, in the order of the page, and prints what the page says."""

import gzip
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.making.small_drives import THREE_CAMERAS, write_drive

ROOT = Path(__file__).resolve().parent.parent
PAGE = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
RUNNER = """
import runpy, sys
for script in sys.argv[1:]:
    print("##", script, flush=True)
    try:
        runpy.run_path(script, run_name="__main__")
    except SystemExit as end:
        print("exit", end.code)
"""


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)


def install(folder: Path, project: str) -> None:
    """What pip leaves of a package of single modules: its entry points, beside them."""
    described = tomllib.loads(project)["project"]
    installed = folder / f"{described['name'].replace('-', '_')}-{described['version']}.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text(f"Name: {described['name']}\nVersion: {described['version']}\n")
    groups = described["entry-points"].items()
    lines = [f"[{group}]\n" + "\n".join(f"{name} = {what}" for name, what in one.items()) for group, one in groups]
    (installed / "entry_points.txt").write_text("\n".join(lines))


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What each block prints, by the name of its file."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "clean_logs").mkdir()
    (folder / "logs").mkdir()
    for number in range(2):
        write_drive(folder / "clean_logs" / f"day{number}.mcap", count=4, seed=number, positions_m=THREE_CAMERAS)
    write_drive(folder / "logs" / "night.mcap", count=8, seed=1, positions_m=THREE_CAMERAS, attacked={2: range(2, 6)})
    (folder / "logs" / "broken.mcap").touch()
    (folder / "packed_logs").mkdir()
    old = write_drive(folder / "old.mcap", count=1)
    (folder / "packed_logs" / "old.mcap.gz").write_bytes(gzip.compress(old.read_bytes()))
    install(folder, *blocks("toml"))
    scripts = []
    for number, block in enumerate(blocks("python")):
        named = re.match(r"# (\w+\.py)\n", block)
        scripts.append(named[1] if named else f"block{number}.py")
        (folder / scripts[-1]).write_text(block, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{folder}"}
    done = subprocess.run(
        [sys.executable, "-c", RUNNER, *scripts],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    parts = re.split(r"^## (\S+)\n", done.stdout, flags=re.MULTILINE)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def lines(printed: dict[str, str], number: int) -> list[str]:
    return printed[f"block{number}.py"].splitlines()


def test_the_frames_of_a_recording_are_read(printed: dict[str, str]) -> None:
    rig, *frames = lines(printed, 0)
    assert "LiDAR + 3 cameras" in rig
    assert len(frames) == 8


def test_the_disparity_errors_of_a_frame_are_printed(printed: dict[str, str]) -> None:
    found = dict(line.split(" = ") for line in lines(printed, 1))
    assert {"E_0,1,3", "E_1,2,3"} <= found.keys()
    assert all(0 <= float(E) <= 1 for E in found.values())


def test_thresholds_are_made_from_both_clean_recordings(printed: dict[str, str]) -> None:
    [line] = lines(printed, 2)
    assert line.endswith("from 2 recordings")


def test_a_scheduler_gets_findings_and_errors_as_values(printed: dict[str, str]) -> None:
    shown = lines(printed, 3)
    assert any("broken.mcap: the file is empty" in line for line in shown)
    assert any(line.endswith("night.mcap: attacked") for line in shown)
    assert shown[-1] == "exit 1"


def test_a_store_is_judged_again_at_another_r(printed: dict[str, str]) -> None:
    assert len(lines(printed, 4)) == 3
    assert all("at r = 0.05" in line for line in lines(printed, 4))


def test_incidents_are_rows_and_the_page_is_written(printed: dict[str, str]) -> None:
    *incidents, columns, page = lines(printed, 5)
    assert any(line.startswith("night.mcap ['S_2 camera_2'] ") for line in incidents)
    assert columns == "['name', 'frames'] 3"
    assert page == "written: incident.html"


def test_a_notebook_gets_pandas_polars_and_a_connection(printed: dict[str, str]) -> None:
    shown = lines(printed, 6)
    assert any(re.search(r"night\.mcap +\d+ +[1-9]\d* ", line) for line in shown)
    assert any(re.fullmatch(r"attacked [1-9]\d*", line) for line in shown)


def test_the_plug_ins_are_found_and_used(printed: dict[str, str]) -> None:
    [counts] = lines(printed, 9)
    assert counts.startswith("Counts(valid_px=")
