"""A kind of attack stands in one place: help, choices, documents and the verb take it from there."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from auditor.cli import run
from auditor.lab.attacks.catalogue import KINDS
from tests.attack_table import DOCUMENT, table
from tests.making.small_drives import THREE_CAMERAS, write_drive

ROOT = Path(__file__).resolve().parents[3]
ADDED = """    "inverted": CameraKind("light becomes dark", "share of it", 1.0, lambda _d, _, x: DimmedCamera(1 - x)),
"""


def test_the_document_has_the_table_of_the_catalogue() -> None:
    assert table() in DOCUMENT.read_text(encoding="utf-8"), "python -m tests.attack_table writes it"


def test_help_says_what_each_kind_does_and_what_its_size_is(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["attack", "--help"]) == 0
    shown = " ".join(capfd.readouterr().out.split())
    assert all(f" {name} {kind.in_words}" in shown for name, kind in KINDS.items())


def test_a_mistyped_kind_names_the_nearest(capfd: pytest.CaptureFixture[str]) -> None:
    assert run(["attack", "a.mcap", "b.mcap", "--on", "S_1", "--kind", "facla"]) == 2
    assert "did you mean 'facula'? auditor attack --help lists all" in capfd.readouterr().err


def test_a_kind_that_is_added_in_one_place_is_offered_explained_and_made(tmp_path: Path) -> None:
    """In a copy of the package, of which the catalogue alone is changed."""
    for name in ("auditor", "schemas", "queries", "reports"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    catalogue = tmp_path / "auditor" / "lab" / "attacks" / "catalogue.py"
    text = catalogue.read_text(encoding="utf-8")
    before = '    "shifted": CameraKind('
    assert text.count(before) == 1
    catalogue.write_text(text.replace(before, ADDED + before), encoding="utf-8")
    drive = write_drive(tmp_path / "drive.mcap", 2, positions_m=THREE_CAMERAS)
    [packages] = [folder for folder in sys.path if Path(folder).name == "site-packages"]

    def auditor(*words: object) -> str:
        command = [sys.executable, "-S", "-m", "auditor", *map(str, words)]  # no .pth file says where a checkout is
        environment = {**os.environ, "PYTHONPATH": packages}
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
        return done.stdout

    assert "light becomes dark: share of it [1]" in " ".join(auditor("attack", "--help").split())
    auditor("attack", drive, tmp_path / "attacked.mcap", "--on", "S_1", "--kind", "inverted")
    assert b"inverted" in (tmp_path / "attacked.mcap").read_bytes(), "the ground truth names it"
