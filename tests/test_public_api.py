"""What `import auditor` offers, and what it does not load before it is used."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import auditor
from tests.making.small_drives import THREE_CAMERAS, write_drive

HEAVY = ("click", "cv2", "duckdb", "jinja2", "mcap", "numpy", "pyarrow", "rich", "rosbags", "torch")


def imported_by(program: str) -> set[str]:
    """The heavy packages that a program imports, in a process of its own."""
    lines = f"import sys\n{program}\nprint('imported:', *({set(HEAVY)} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", lines], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split()[1:])


def test_importing_auditor_loads_no_heavy_package() -> None:
    assert imported_by("import auditor; dir(auditor)") == set()


def test_neither_the_api_nor_a_scan_loads_the_lab(tmp_path: Path) -> None:
    write_drive(tmp_path / "drive.mcap", 4, positions_m=THREE_CAMERAS)
    program = f"""
import sys
import auditor, auditor.pipeline.many, auditor.pipeline.measure, auditor.pipeline.warm
[getattr(auditor, name) for name in auditor.__all__]
from auditor.cli import run
for recorded in auditor.scan({str(tmp_path / "drive.mcap")!r}, store={str(tmp_path / "api")!r}, jobs=1):
    assert recorded.error is None, recorded.error
run(["scan", {str(tmp_path / "drive.mcap")!r}, "--store", {str(tmp_path / "verb")!r}, "--jobs", "1"])
print("of the lab:", *(name for name in sys.modules if name.startswith("auditor.lab")))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1:] == ["of the lab:"], done.stderr


def test_the_help_of_the_command_line_loads_click_and_no_other_heavy_package() -> None:
    assert imported_by("from auditor.cli import run; run(['--help'])") == {"click"}


def test_every_name_of_the_api_is_there_and_listed() -> None:
    assert [name for name in auditor.__all__ if getattr(auditor, name, None) is None] == []
    assert set(auditor.__all__) <= set(dir(auditor))


def test_a_name_that_is_none_of_the_api_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'judge_everything'"):
        _ = auditor.judge_everything


def test_type_checkers_see_the_names_where_they_are_imported_from() -> None:
    tree = ast.parse(Path(auditor.__file__).read_text(encoding="utf-8"))
    typed = {
        alias.name: node.module
        for block in tree.body
        if isinstance(block, ast.If)
        for node in ast.walk(block)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    names = [name for name in auditor.__all__ if name != "__version__"]
    assert sorted(typed) == sorted(names)
    for name, module in typed.items():
        assert getattr(auditor, name) is getattr(sys.modules[str(module)], name), name


def test_every_function_and_class_of_the_api_is_documented() -> None:
    undocumented = [name for name in auditor.__all__ if callable(one := getattr(auditor, name)) and not one.__doc__]
    assert undocumented == []
