"""The five rooms never import one another, and each heavy library lives where it belongs."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "auditor"
ROOMS = ("recordings", "evidence", "identification", "store", "lab")
MODULES = sorted(PACKAGE.rglob("*.py"))

HOMES = {
    "torch": ("evidence/matchers/psmnet/", "evidence/matchers/torchscript.py"),
    "onnxruntime": ("evidence/onnx_models.py",),
    "cv2": ("evidence/", "recordings/"),
    "duckdb": ("store/",),
    "pyarrow": ("store/",),
    "mcap": ("recordings/",),
    "rosbags": ("recordings/",),
    "jinja2": ("store/",),
    "click": ("cli/",),
    "rich": ("cli/",),
    "pebble": ("engines/",),
}


def imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or ""


def place(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


@pytest.mark.parametrize("path", MODULES, ids=place)
def test_a_module_of_one_room_imports_no_other_room(path: Path) -> None:
    room = place(path).split("/", maxsplit=1)[0]
    if room in ROOMS:
        named = {name.split(".")[1] for name in imports(path) if name.startswith("auditor.")}
        assert named & set(ROOMS) <= {room}
        assert named <= {
            room,
            "common_view",
            "elements",
            "errors",
            "frames",
            "geometry",
            "lenses",
            "results",
            "parameters",
            "rig",
            "rig_kind",
            "regions",
            "resources",
            "shared_parameters",
            "symptoms",
            "thresholds",
        }


@pytest.mark.parametrize("path", MODULES, ids=place)
def test_a_heavy_library_is_imported_only_where_it_lives(path: Path) -> None:
    for name in imports(path):
        homes = HOMES.get(name.split(".")[0])
        assert homes is None or place(path).startswith(homes), f"{place(path)} imports {name}"


@pytest.mark.parametrize("path", [p for p in MODULES if not place(p).startswith("cli/")], ids=place)
def test_nothing_outside_the_command_line_prints_or_exits(path: Path) -> None:
    calls = [node.func for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
    assert not [call for call in calls if isinstance(call, ast.Name) and call.id == "print"]
    exits = [call for call in calls if isinstance(call, ast.Attribute) and ast.unparse(call) == "sys.exit"]
    assert not exits or place(path) == "__main__.py"
