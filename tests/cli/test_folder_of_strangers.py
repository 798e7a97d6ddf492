"""A shell that stands in a folder of logs: no file there becomes code, whichever verb is run."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from auditor.cli import VERBS
from auditor.safety.launching import environment
from tests.making.case_stores import AttackedStore
from tests.making.small_drives import DAY_NS, START_NS, THREE_CAMERAS, write_drive

AUDITOR = Path(sys.executable).with_name("auditor")

STORE, OWN = ["--store", "audit"], ["--store", "own"]
SHORT_TRAINING = ["--steps", "1", "--frames", "1", "--batch", "1", "--width", "2", "--max-disparity", "64"]
COMMANDS: dict[str, list[str]] = {
    "demo": ["made", "--jobs", "1"],
    "inspect": ["drive.mcap"],
    "convert": ["drive.mcap", "converted.bag"],
    "attack": ["drive.mcap", "attacked.mcap", "--on", "S_1"],
    "calibrate": ["drive.mcap", *OWN],
    "calibration": ["list", *STORE],
    "refresh": ["drive.mcap", "--clean", "--measure-again", *OWN],
    "drift": STORE,
    "scan": ["drive.mcap", *OWN],
    "judge": ["own", "--method", "paper"],
    "label": ["drive.mcap", "--list", *STORE],
    "review": ["list", *STORE],
    "evaluate": ["drive.mcap", "--attack-every", "12", "--time-limit", "1", *OWN],
    "query": ["--sql", "SELECT count(*) FROM verdicts", *STORE],
    "views": [],
    "report": ["--out", "page.html", *STORE],
    "show": ["drive.mcap", "1", *STORE],
    "case": ["INCIDENT", "--into", "case", *STORE],
    "parameters": [],
    "store": ["check", "audit"],
    "verify": ["audit"],
    "weights": ["inspect", "drive.mcap"],
    "train-matcher": ["drive.mcap", "--validate", "other.mcap", "--out", "network", *SHORT_TRAINING],
}
"""Each verb with what makes it start its child processes, where it has any."""


@cache
def modules() -> frozenset[str]:
    """More than any start imports: all modules of Python, and of every package that is installed."""
    return sys.stdlib_module_names | packages_distributions().keys() | {"auditor", "sitecustomize", "usercustomize"}


@pytest.fixture(scope="module")
def incident(attacked: AttackedStore, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """A folder with drives, a store, and a planted module of every name; an incident of that store."""
    folder = tmp_path_factory.mktemp("logs")
    write_drive(folder / "drive.mcap", 3, positions_m=THREE_CAMERAS)
    write_drive(folder / "other.mcap", 3, positions_m=THREE_CAMERAS, start_ns=START_NS + DAY_NS)
    shutil.copytree(attacked.folder, folder / "audit")
    shutil.copytree(attacked.folder, folder / "own")
    for name in modules():
        text = f"with open({str(folder / 'markers')!r}, 'a') as file:\n    file.write({name!r} + '\\n')\n"
        (folder / f"{name}.py").write_text(text, encoding="utf-8")
    return folder, attacked.incident(0)


def ran(folder: Path) -> list[str]:
    markers = folder / "markers"
    names = markers.read_text().split() if markers.exists() else []
    markers.unlink(missing_ok=True)
    return names


ONE_AFTER_THE_OTHER = """
import json, os, sys
from auditor.__main__ import main
for words in json.loads(sys.argv[1]):
    sys.argv = ["auditor", *words]
    try:
        main()
    except SystemExit:
        pass
    searched = [folder for folder in sys.path if os.path.realpath(folder) == os.getcwd()]
    print("ended:", words[0], searched, os.path.exists("markers"), file=sys.stderr)
"""
"""Each verb as the installed script calls it, and how it left the process for the next one."""


def test_no_verb_runs_a_module_of_the_working_folder(incident: tuple[Path, str], tmp_path: Path) -> None:
    """All verbs but the demo in one process: what they start is started anew, and searches what this one searches."""
    folder, whole_id = incident
    wanted = [verb for verb in VERBS if verb != "demo"]
    commands = [[verb, *(whole_id if word == "INCIDENT" else word for word in COMMANDS[verb])] for verb in wanted]
    program = tmp_path / "verbs.py"
    program.write_text(ONE_AFTER_THE_OTHER)
    done = subprocess.run(
        [sys.executable, program, json.dumps(commands)], cwd=folder, capture_output=True, text=True, check=False
    )
    ended = [line for line in done.stderr.splitlines() if line.startswith("ended: ")]
    assert ended == [f"ended: {verb} [] False" for verb in wanted], done.stderr
    assert ran(folder) == []
    assert not {"ModuleNotFoundError", "defect of auditor"} & set(done.stderr.replace("\n", ": ").split(": "))


def test_the_installed_script_runs_no_module_of_the_working_folder(incident: tuple[Path, str]) -> None:
    folder, _ = incident
    done = subprocess.run([AUDITOR, "inspect", "drive.mcap"], cwd=folder, capture_output=True, check=False)
    assert ran(folder) == []
    assert b"cam" in done.stdout


def test_the_demo_runs_no_module_of_the_working_folder(incident: tuple[Path, str]) -> None:
    """It is ended when its children have written the first drive: it would take a minute."""
    folder, _ = incident
    with subprocess.Popen([AUDITOR, "demo", *COMMANDS["demo"]], cwd=folder, stderr=subprocess.DEVNULL) as process:
        while process.poll() is None and not [*folder.glob("made/**/*.mcap*")]:
            time.sleep(0.1)
        process.send_signal(signal.SIGTERM)
    assert ran(folder) == []


def loaded_before_the_first_line() -> set[str]:
    """What Python itself imports for `python -m auditor`, before any line of the program could prevent it."""
    program = "import runpy, sys, auditor.__main__; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return {"auditor", *done.stdout.split()}


def test_python_m_auditor_imports_nothing_more_from_the_working_folder(
    incident: tuple[Path, str], tmp_path: Path
) -> None:
    folder, _ = incident
    shutil.copy(folder / "drive.mcap", tmp_path)
    for name in modules() - loaded_before_the_first_line():
        shutil.copy(folder / f"{name}.py", tmp_path)
    done = subprocess.run(
        [sys.executable, "-m", "auditor", "inspect", "drive.mcap"], cwd=tmp_path, capture_output=True, check=False
    )
    assert ran(folder) == []
    assert b"cam" in done.stdout


def test_a_checkout_runs_from_its_own_root(incident: tuple[Path, str], tmp_path: Path) -> None:
    """Nothing but the working folder says where the package is."""
    root = Path(__file__).parents[2]
    for name in ("auditor", "schemas", "queries", "reports"):
        shutil.copytree(root / name, tmp_path / name)
    [packages] = [folder for folder in sys.path if Path(folder).name == "site-packages"]
    folder, _ = incident
    # with -S no .pth file says where this checkout is
    done = subprocess.run(
        [sys.executable, "-S", "-m", "auditor", "inspect", folder / "drive.mcap"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": packages},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stderr.splitlines() == []
    assert "cam" in done.stdout


def test_a_child_gets_few_variables_and_no_relative_folder(monkeypatch: pytest.MonkeyPatch) -> None:
    given = {
        "AUDITOR_STORE": "kept",
        "HOME": "/home/somebody",
        "OMP_NUM_THREADS": "1",
        "LD_LIBRARY_PATH": ":",
        "LD_PRELOAD": "planted.so",
        "MALLOC_TRIM_THRESHOLD_": "1000",
        "PATH": os.pathsep.join(["/usr/bin", "", ".", "bin"]),
        "PYTHONPATH": "planted",
        "PYTHONINSPECT": "1",
        "PYTHONSTARTUP": "planted.py",
    }
    for name in os.environ:
        monkeypatch.delenv(name)
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    assert environment() == {
        "AUDITOR_STORE": "kept",
        "HOME": "/home/somebody",
        "MALLOC_MMAP_THRESHOLD_": "16777216",
        "MALLOC_TRIM_THRESHOLD_": "1000",
        "OMP_NUM_THREADS": "1",
        "PATH": "/usr/bin",
    }
