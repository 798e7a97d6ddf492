"""The picture of the package: rooms that do not know one another, what stands above them, the words they share.

Replace the tables when the tree changes; the rules below them stay. A box is a folder of the package or a module beside
them; `__init__` and `__main__` are its two doors and none.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from statistics import median

PACKAGE = Path(__file__).resolve().parent.parent / "auditor"

ABOVE = (("cli",), ("lab", "casefile"), ("pipeline", "reporting"))
"""Layers over the rooms, the highest first: a box imports from lower ones only."""

ROOMS = ("recordings", "measurement", "identification", "store")
"""Rooms import words only."""

WORDS = ("model", "safety", "errors", "resources")
"""Words import words only."""

LAB_VERBS = ("attack", "demo", "evaluate", "train_matcher")
"""The verbs that load the lab; nothing else of the product does."""

MADE_DATA = ("auditor.lab.attacks", "auditor.lab.simulation")
"""Folders of the lab that make data and do not know how attacks are found: they import words only, as a room does."""

VAGUE = {"one", "found", "known", "its", "what"}
"""Names of variables that say nothing; in a comprehension, which is read at once, they may stand."""

MOST_BOXES = 13
MOST_LEVELS = 6
MOST_FILES = 20  # in a folder, the verbs of the command line apart
MOST_LINES = 400
MEDIAN_FUNCTION_LINES = 8

PARTICIPLE = re.compile(
    "_?([A-Z][a-z]*ed|Chosen|Drawn|Found|Given|Held|Kept|Known|Lost|Made|Met|Seen|Shown|Told|Written)"
)
"""A name of one word that says what became of a thing, and not what it is."""

HOMES = {
    "torch": (
        "measurement/disparity/matchers/psmnet/",
        "lab/evaluation/object_baseline/detectors/streets/",
        "lab/training/",
    ),
    "onnxruntime": ("measurement/disparity/matchers/onnx_models.py",),
    "cv2": ("measurement/", "recordings/", "lab/evaluation/object_baseline/detectors/"),
    "duckdb": ("store/",),
    "pyarrow": ("store/", "recordings/formats/datasets/argoverse.py"),
    "mcap": ("recordings/",),
    "rosbags": ("recordings/",),
    "jinja2": ("reporting/",),
    "click": ("cli/",),
    "rich": ("cli/",),
    "cryptography": ("store/log/signatures.py", "store/maintenance/verify.py"),
    "obstore": ("pipeline/remote/object_store.py",),
    "boto3": ("pipeline/remote/object_store.py",),
    "ray": ("pipeline/remote/ray_cluster.py",),
    "subprocess": ("safety/launching.py",),
    "multiprocessing": ("pipeline/workers.py", "pipeline/fork_server.py"),
    "zipfile": ("safety/", "casefile/", "lab/training/samples.py"),
}
"""Where each heavy library lives, and what starts processes or unpacks."""


@cache
def modules() -> dict[str, Path]:
    """The modules of the package by their dotted names."""
    paths = sorted(PACKAGE.rglob("*.py"))
    return {".".join(p.relative_to(PACKAGE.parent).with_suffix("").parts).removesuffix(".__init__"): p for p in paths}


@cache
def nodes(path: Path) -> tuple[ast.AST, ...]:
    """What a module consists of: it is parsed and walked through once for all rules."""
    return tuple(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


def place(path: Path) -> str:
    return path.relative_to(PACKAGE).as_posix()


@cache
def imports(path: Path) -> tuple[str, ...]:
    """What a module imports anywhere in it; of names that are modules themselves, those."""
    return tuple(_imports(path))


def _imports(path: Path) -> Iterator[str]:
    for node in nodes(path):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                yield whole if whole in modules() else node.module or ""


def box(module: str) -> str | None:
    """The box of a dotted name; None of the doors and of what is not the package's."""
    package, _, rest = module.partition(".")
    name = rest.partition(".")[0]
    return name if package == PACKAGE.name and name not in ("", "__main__") else None


def boxes_of(module: str) -> set[str]:
    """The other boxes that a module imports."""
    return {other for name in imports(modules()[module]) if (other := box(name)) not in (None, box(module))}


def is_lab(name: str) -> bool:
    return box(name) == "lab"


@cache
def arrows() -> dict[str, set[str]]:
    """The boxes that each box imports."""
    found: dict[str, set[str]] = {}
    for module in modules():
        if (own := box(module)) is not None:
            found.setdefault(own, set()).update(boxes_of(module))
    return found


def test_every_box_has_its_place_in_the_picture() -> None:
    drawn = {name for layer in (*ABOVE, ROOMS, WORDS) for name in layer}
    assert arrows().keys() == drawn


def test_a_box_imports_lower_ones_only_rooms_no_other_room_and_words_only_words() -> None:
    depth = {name: number for number, layer in enumerate((*ABOVE, ROOMS, WORDS)) for name in layer}
    wrong = [
        f"{module} imports {other}"
        for module in modules()
        if (own := box(module)) is not None
        for other in sorted(boxes_of(module))
        if depth[other] <= depth[own] and not {own, other} <= set(WORDS)
    ]
    assert not wrong


def test_nothing_but_its_own_verbs_and_itself_names_the_lab() -> None:
    own = ("lab/", *(f"cli/verbs/{verb}.py" for verb in LAB_VERBS))
    others = {place(path): path for path in modules().values() if not place(path).startswith(own)}
    strays = [f"{name} imports {other}" for name, path in others.items() for other in imports(path) if is_lab(other)]
    strays += [
        f"{name}:{node.lineno} names {node.value}"
        for name, path in others.items()
        for node in nodes(path)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and is_lab(node.value)
    ]
    assert not strays


def test_each_verb_of_the_lab_needs_it() -> None:
    assert [verb for verb in LAB_VERBS if "lab" not in boxes_of(f"auditor.cli.verbs.{verb}")] == []


def test_attacks_and_streets_are_made_without_knowing_how_attacks_are_found() -> None:
    wrong = [
        f"{module} imports {other}"
        for own in MADE_DATA
        for module, path in modules().items()
        if module.startswith(own)
        for other in sorted(imports(path))
        if box(other) not in (None, *WORDS) and not other.startswith(own)
    ]
    assert not wrong


def test_a_heavy_library_is_imported_only_where_it_lives() -> None:
    strays = [
        f"{place(path)} imports {name}"
        for path in modules().values()
        for name in imports(path)
        if not place(path).startswith(HOMES.get(name.partition(".")[0], ""))
    ]
    assert not strays


def test_nothing_outside_the_command_line_prints_or_exits() -> None:
    loud = [
        f"{place(path)}:{node.lineno} {ast.unparse(node.func)}"
        for path in modules().values()
        if not place(path).startswith(("cli/", "__main__.py"))
        for node in nodes(path)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name | ast.Attribute)
        if ast.unparse(node.func) in ("print", "sys.exit")
    ]
    assert not loud


def test_no_modules_and_no_boxes_import_each_other_in_a_circle() -> None:
    circles = []
    # The front door names the API for type checkers only: it imports nothing until a name is used.
    between_modules = {module: set(imports(path)) for module, path in modules().items() if module != PACKAGE.name}
    for graph in (between_modules, arrows()):
        try:
            TopologicalSorter(graph).prepare()
        except CycleError as error:
            circles.append(" imports ".join(reversed(error.args[1])))
    assert not circles


def test_the_boxes_are_few_and_stand_on_few_levels() -> None:
    level: dict[str, int] = {}
    for name in TopologicalSorter(arrows()).static_order():
        level[name] = 1 + max((level[below] for below in arrows()[name]), default=0)
    assert len(level) <= MOST_BOXES, sorted(level)
    assert max(level.values()) <= MOST_LEVELS, level


def test_folders_modules_and_functions_are_small() -> None:
    paths = list(modules().values())
    files = {folder: sum(path.parent == folder for path in paths) for folder in {path.parent for path in paths}}
    files.pop(PACKAGE / "cli" / "verbs")
    assert not [f"{place(folder)}: {count} files" for folder, count in files.items() if count > MOST_FILES]
    lines = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in paths}
    assert not [f"{place(path)}: {count} lines" for path, count in lines.items() if count > MOST_LINES]
    functions = [node for path in paths for node in nodes(path) if isinstance(node, ast.FunctionDef)]
    assert median(node.end_lineno - node.lineno + 1 for node in functions) <= MEDIAN_FUNCTION_LINES


def test_a_name_of_a_class_is_a_thing_and_has_one_owner() -> None:
    defined = [node.name for path in modules().values() for node in nodes(path) if isinstance(node, ast.ClassDef)]
    assert [name for name, count in Counter(defined).items() if count > 1 and not name.startswith("_")] == []
    assert [name for name in defined if PARTICIPLE.fullmatch(name)] == []


def test_a_variable_says_what_it_holds() -> None:
    vague = [(place(path), name) for path in modules().values() for name in sorted(_bound(path) & VAGUE)]
    assert vague == [("errors.py", "what")], "of an error it is what happened, beside where and the remedy"


def _bound(path: Path) -> set[str]:
    """The parameters and variables of a module's functions, but for those of comprehensions and lambdas."""
    functions = [node for node in nodes(path) if isinstance(node, ast.FunctionDef)]
    within = [node.target for node in nodes(path) if isinstance(node, ast.comprehension)]
    within += [node.args for node in nodes(path) if isinstance(node, ast.Lambda)]
    passing = {id(part) for node in within for part in ast.walk(node)}
    parts = (part for function in functions for part in ast.walk(function) if id(part) not in passing)
    return {
        part.arg if isinstance(part, ast.arg) else part.id
        for part in parts
        if isinstance(part, ast.arg) or (isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store))
    }


def test_processes_start_in_one_place_and_are_forked_in_one() -> None:
    starting = {"fork", "forkpty", "popen", "posix_spawn", "posix_spawnp", "startfile", "system"}
    strays = [
        f"{place(path)}:{node.lineno} {ast.unparse(node)}"
        for path in modules().values()
        for node in nodes(path)
        if isinstance(node, ast.Attribute)
        and (node.attr in starting or node.attr.startswith(("exec", "spawn")))
        and ast.unparse(node.value) == "os"
        and not (node.attr == "fork" and place(path) == "pipeline/fork_server.py")
    ]
    assert not strays
