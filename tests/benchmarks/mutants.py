"""How many small changes of the code that makes the numbers do the quick tests notice?

    python -m tests.benchmarks.mutants [--seed 1] [--count 100] [--jobs 2] [--subject windows]

Draws mutants of the modules of each subject in equal parts, puts each into a copy of the repository, and runs the quick
tests of its subject there: a mutant is killed where they fail. `equivalent_mutants.toml` lists those that cannot be
noticed, with the reason; they are not drawn. The real frames that AUDITOR_TEST_DATA names are among the tests.
"""

import argparse
import difflib
import os
import random
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.util import cache_from_source
from itertools import chain, zip_longest
from multiprocessing.pool import ThreadPool
from pathlib import Path
from queue import SimpleQueue

from tests.benchmarks.mutation import Mutant, mutants_of

ROOT = Path(__file__).resolve().parents[2]
EQUIVALENT = Path(__file__).with_name("equivalent_mutants.toml")
DEFAULT_SEED = 1
WITHOUT = "not hash and not digest"
"""Tests of the parameters' hash notice every change of a number: that proves nothing."""

_CPU_SECONDS = 120
_COPIED = ("auditor", "tests", "schemas", "queries", "reports", "docs", "pyproject.toml", "README.md")


@dataclass(frozen=True)
class Subject:
    """Modules of one subject, as globs below the package, and their quick tests below tests/, the most specific first.

    A module belongs to the first subject that names it.
    """

    name: str
    modules: tuple[str, ...]
    tests: tuple[str, ...]


IDENTIFICATION = ("identification", "golden/test_golden.py")
JUDGING = (
    "cross_validation",
    "drive_level",
    "evidence_parameters",
    "likelihood",
    "naming",
    "paper",
    "refresh_parameters",
    "robust",
    "scores",
    "systems",
    "transfer",
)
CHECKS = ("measurement/checks", "golden/test_golden.py")
SUBJECTS = (
    Subject(
        "E",
        ("measurement/disparity/disparity_error.py", "measurement/disparity/stereo.py"),
        ("measurement/disparity/test_disparity_error.py", *CHECKS),
    ),
    Subject(
        "LiDAR projection",
        ("measurement/disparity/lidar.py",),
        ("measurement/disparity/test_lidar.py", "measurement/disparity/test_visibility.py", *CHECKS),
    ),
    Subject(
        "NCC",
        ("measurement/checks/photometric_consistency.py",),
        ("measurement/checks/test_photometric_consistency.py", *CHECKS),
    ),
    Subject(
        "light",
        ("measurement/tone_curve.py", "measurement/checks/light.py", "measurement/disparity/matchers/sgbm.py"),
        (
            "measurement/test_tone_curve.py",
            "measurement/checks/test_light.py",
            "measurement/disparity/test_equalising.py",
            "measurement/matchers/test_sgbm.py",
            *CHECKS,
        ),
    ),
    Subject(
        "count grids",
        ("measurement/count_grid.py",),
        ("measurement/checks/test_count_grid.py", *CHECKS),
    ),
    Subject(
        "LiDAR conflict",
        ("measurement/checks/lidar_conflict.py",),
        ("measurement/checks/test_lidar_conflict.py", *CHECKS),
    ),
    Subject(
        "thresholds",
        ("identification/thresholds.py", "model/calibration.py"),
        ("identification/test_thresholds.py", *IDENTIFICATION),
    ),
    Subject(
        "windows",
        ("identification/statistics.py",),
        ("identification/test_temporal_windows.py", "identification/test_statistics.py", *IDENTIFICATION),
    ),
    Subject(
        "parameters",
        ("measurement/parameters.py", "identification/parameters.py", "model/parameters.py"),
        ("model", *IDENTIFICATION, *CHECKS, "measurement"),
    ),
    Subject("prior", ("identification/prior.py",), ("identification/test_prior.py", *IDENTIFICATION)),
    Subject("identification", tuple(f"identification/{name}.py" for name in JUDGING), IDENTIFICATION),
)


def main() -> None:
    """Draw mutants, run them, print the survivors and the share of those killed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=DEFAULT_SEED)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--subject", choices=[subject.name for subject in SUBJECTS])
    options = parser.parse_args()
    drawn = [
        (subject, mutant)
        for subject, mutant in draw(options.seed, options.count)
        if options.subject in {None, subject.name}
    ]
    killed, total = Counter[str](), Counter[str](subject.name for subject, _ in drawn)
    with tempfile.TemporaryDirectory() as folder:
        for subject, mutant, survived in run(drawn, options.jobs, Path(folder)):
            killed[subject.name] += not survived
            if survived:
                print(
                    f"\nsurvived: {mutant.module}, {mutant.where}: {mutant.operator}\n{difference(mutant)}", flush=True
                )
    for name, count in total.items():
        print(f"{name:20} {killed[name]:3} of {count:3} killed")
    print(f"{'all':20} {killed.total():3} of {total.total():3} killed")


def draw(seed: int, count: int) -> list[tuple[Subject, Mutant]]:
    """So many mutants, from the subjects in turn; none of those known to be equivalent."""
    equivalent = known_equivalent()
    shuffled, every = [], set()
    for subject, modules in modules_by_subject():
        found = [m for module in modules for m in mutants_of(module, (ROOT / module).read_text())]
        every.update(mutant.key for mutant in found)
        random.Random(f"{seed} {subject.name}").shuffle(found)
        shuffled.append([(subject, mutant) for mutant in found if mutant.key not in equivalent])
    if lapsed := sorted(equivalent - every):
        raise ValueError(f"{EQUIVALENT.name} lists what is no mutant:\n" + "\n".join(map(str, lapsed)))
    in_turn = chain.from_iterable(zip_longest(*shuffled))
    return [one for one in in_turn if one is not None][:count]


def known_equivalent() -> set[tuple[str, str, str, str]]:
    """The keys of the mutants that no test can notice; the file says why."""
    return {
        (m["module"], m["where"], m["operator"], m["line"]) for m in tomllib.loads(EQUIVALENT.read_text())["mutants"]
    }


def modules_by_subject() -> Iterator[tuple[Subject, list[str]]]:
    """Each subject with its modules, relative to the repository. Raises ValueError where a glob or test names none."""
    taken: set[Path] = set()
    for subject in SUBJECTS:
        named = [(ROOT / "auditor", glob) for glob in subject.modules] + [
            (ROOT / "tests", test) for test in subject.tests
        ]
        if missing := [glob for folder, glob in named if not any(folder.glob(glob))]:
            raise ValueError(f"subject {subject.name} names what is not there: {', '.join(missing)}")
        mine = sorted({path for glob in subject.modules for path in (ROOT / "auditor").glob(glob)} - taken)
        taken.update(mine)
        yield subject, [path.relative_to(ROOT).as_posix() for path in mine]


def run(drawn: Sequence[tuple[Subject, Mutant]], jobs: int, folder: Path) -> Iterator[tuple[Subject, Mutant, bool]]:
    """Each mutant with whether it survived; each of `jobs` threads has a copy of the repository."""
    copies: SimpleQueue[Path] = SimpleQueue()
    every = list(dict.fromkeys(test for subject, _ in drawn for test in subject.tests))
    for job in range(jobs):
        copy = _copy(folder / str(job))
        unchanged = _test(every, copy)
        if unchanged.returncode:
            sys.exit(f"the tests fail without any mutant\n{unchanged.stdout}")
        copies.put(copy)

    def survives(one: tuple[Subject, Mutant]) -> tuple[Subject, Mutant, bool]:
        copy = copies.get()
        try:
            return *one, _survives(*one, copy)
        finally:
            copies.put(copy)

    with ThreadPool(jobs) as pool:
        yield from pool.imap_unordered(survives, drawn)


def _copy(folder: Path) -> Path:
    folder.mkdir()
    for name in _COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(ROOT / name, folder / name)
    return folder


def _survives(subject: Subject, mutant: Mutant, copy: Path) -> bool:
    path = copy / mutant.module
    original = path.read_text()
    _put(path, mutant.source)
    try:
        tests = (_test_of(mutant.module), *subject.tests)
        return _test(tests, copy).returncode == 0
    finally:
        _put(path, original)


def _put(path: Path, source: str) -> None:
    """Write a module. What was compiled of it goes: Python knows it by size and whole seconds, often the same."""
    path.write_text(source)
    Path(cache_from_source(path)).unlink(missing_ok=True)


def _test_of(module: str) -> str:
    """Where the test of a module stands below tests/, if it has one of its own."""
    folder, name = module.removeprefix("auditor/").rsplit("/", 1)
    return f"{folder}/test_{name}"


def _test(tests: Sequence[str], copy: Path) -> subprocess.CompletedProcess[str]:
    """Run those of the tests that exist in a copy."""
    chosen = dict.fromkeys(f"tests/{name}" for name in tests if (copy / "tests" / name).exists())
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "--hypothesis-seed=0"]
    command += ["-k", WITHOUT, *chosen]
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    limited = ["sh", "-c", f'ulimit -t {_CPU_SECONDS}; exec "$@"', "sh", *command]
    return subprocess.run(limited, cwd=copy, env=environment, capture_output=True, text=True, check=False)


def difference(mutant: Mutant) -> str:
    """The changed lines."""
    before, after = (ROOT / mutant.module).read_text().splitlines(), mutant.source.splitlines()
    lines = list(difflib.unified_diff(before, after, lineterm="", n=0))[2:]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
