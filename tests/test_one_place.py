"""A check, a kind of attack and a stored column are added by docs/architecture.md alone, in a copy of the package."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.check_tables import tables
from tests.making.small_drives import THREE_CAMERAS, write_drive

ROOT = Path(__file__).resolve().parent.parent

KIND = '''
"""Ink: a kind of attack."""

from dataclasses import dataclass

from auditor.lab.attacks.kinds import CameraKind, Option
from auditor.lab.attacks.paper import DescribedEffect
from auditor.model.frames import CameraImage


@dataclass(frozen=True)
class Inked(DescribedEffect):
    share: float
    level: int

    name = "inked"

    def apply(self, image):
        pixels = image.pixels.copy()
        pixels[: round(self.share * len(pixels))] = self.level
        return CameraImage(image.sensor, image.stamp_ns, pixels)


LEVEL = Option("ink", "ink_level", "its grey level", least=0)
ON_CAMERA = {
    "inked": CameraKind(
        "ink on the upper rows",
        "share of the rows",
        0.3,
        lambda draw, _, size: Inked(size, round(draw.options.get("ink_level", 200))),
        options=(LEVEL,),
    )
}
'''
CHECK = """
    INKED_ROWS = (
        "inked_rows",
        CheckKind(
            Of.CAMERAS,
            Words("inked rows", "rows are of one level", "has ink that the others lack", "S_{i} is inked"),
            (PriorOf("inked_rows", (-3.9, 0.2, 0.1, 1.0), "a test"),),
            vote=Vote.SMALLEST,
        ),
    )
"""
MEASURED = '''
"""Rows of one level."""

from dataclasses import dataclass

from auditor.model.parameters import parameter


@dataclass(frozen=True)
class InkedRows:
    level: int = parameter(77, unit="grey levels", source="a test")


NUMBERS = InkedRows()


def measure_inked_rows(seen, i, k):
    inked = [float((seen.half_res[camera] == NUMBERS.level).all(axis=1).mean()) for camera in (i, k)]
    return max(inked[0] - inked[1], 0.0), max(inked[1] - inked[0], 0.0)
'''
COLUMN = """
[columns.half_level]
type = "DOUBLE[]"
sentence = "By sensor: half of its level."
"""
FIELD = """
    @property
    def half_level(self) -> float | None:
        return self.level and self.level / 2

"""
USED = """
import json
from auditor.cli import run
from auditor.measurement.checks.found import MEASURING
from auditor.model.parameters import list_parameters
from auditor.identification.parameters import JUDGING
from auditor.store.queries import run_sql
from auditor.store.store import Store

assert run(["attack", "--help"]) == 0
inked = ["--on", "S_2", "--kind", "inked", "--size", "0.4", "--ink", "77", "--from", "0.2", "--to", "1.4"]
assert run(["attack", "drive.mcap", "inked.mcap", *inked]) == 0
assert run(["scan", "inked.mcap", "--store", "audit", "--jobs", "1"]) in (0, 1)
store = Store.open("audit")
ask = lambda text: run_sql(store, text).to_pylist()
numbers = {f"{one.group}.{one.name}": one.value for one in list_parameters(*MEASURING, *JUDGING)}
found = {
    "statistics": ask("SELECT frame, max(statistic) AS t FROM statistics WHERE check_name = 'inked_rows' AND sensor = 2"
        " GROUP BY frame ORDER BY frame"),
    "declared": ask("SELECT label, says FROM checks WHERE check_name = 'inked_rows'"),
    "evidence": ask("SELECT evidence FROM incidents"),
    "levels": ask("SELECT level, half_level FROM frames"),
    "numbers": [numbers["inked_rows.level"], numbers["check_priors.inked_rows"]],
}
open("found.json", "w").write(json.dumps(found, default=str))
assert run(["report", "--store", "audit", "--out", "page.html"]) == 0
"""


def added(path: Path, before: str, text: str) -> None:
    """Add a text to a file, before another one that it has once."""
    old = path.read_text(encoding="utf-8")
    assert old.count(before) == 1
    path.write_text(old.replace(before, text + before), encoding="utf-8")


def test_documents_have_the_tables_of_checks() -> None:
    for document, (_, table) in tables().items():
        assert table in document.read_text(encoding="utf-8"), "python -m tests.check_tables writes it"


def test_each_is_declared_in_two_files_at_most_and_is_measured_judged_stored_and_shown(tmp_path: Path) -> None:
    for name in ("auditor", "schemas", "queries", "reports"):
        shutil.copytree(ROOT / name, tmp_path / name)
    package = tmp_path / "auditor"
    (package / "lab/attacks/inked.py").write_text(KIND.lstrip(), encoding="utf-8")
    (package / "measurement/checks/inked_rows.py").write_text(MEASURED.lstrip(), encoding="utf-8")
    with (package / "model/checks/kinds.py").open("a", encoding="utf-8") as declared:
        declared.write(CHECK)
    with (tmp_path / "schemas/frames.toml").open("a", encoding="utf-8") as schema:
        schema.write(COLUMN)
    added(package / "model/measurement.py", '\n\nCASE_BRIGHTNESS = ("level"', FIELD)
    write_drive(tmp_path / "drive.mcap", 16, positions_m=THREE_CAMERAS)
    (tmp_path / "used.py").write_text(USED, encoding="utf-8")
    [packages] = [folder for folder in sys.path if Path(folder).name == "site-packages"]
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{packages}"}
    command = [sys.executable, "-S", "used.py"]  # no .pth file says where a checkout is
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr + done.stdout

    shown = " ".join(done.stdout.split())
    assert "ink on the upper rows: share of the rows [0.3]" in shown
    assert "With --kind inked: its grey level" in shown
    assert b"inked" in (tmp_path / "inked.mcap").read_bytes(), "the ground truth names it"
    found = json.loads((tmp_path / "found.json").read_text(encoding="utf-8"))
    of_frames = {row["frame"]: row["t"] for row in found["statistics"]}
    assert [frame for frame, t in of_frames.items() if t > 0.3] == [*range(2, 15)]
    assert of_frames[4] == pytest.approx(0.4, abs=0.02)
    assert found["declared"] == [{"label": "inked rows", "says": "rows are of one level"}]
    assert any("S_2 is inked" in str(row["evidence"]) for row in found["evidence"])
    assert found["numbers"] == [77, [-3.9, 0.2, 0.1, 1.0]]
    levels = [pair for row in found["levels"] for pair in zip(row["level"], row["half_level"], strict=True)]
    assert all(half == level / 2 for level, half in levels if level is not None)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "has ink that the others lack" in page
    assert "inked rows" in page
