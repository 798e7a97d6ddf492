"""Scenes measured in parallel, each kept in a file: a run that was stopped goes on where it was."""

import pickle
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Protocol, TypeVar

import auditor
from auditor.measurement import use_one_thread


class Named(Protocol):
    """The parameters of a scene; its name is unique, and is that of its file."""

    @property
    def name(self) -> str: ...


Scene = TypeVar("Scene", bound=Named)


def measure_kept(
    scenes: Sequence[Scene], measure: Callable[[Scene], Any], folder: Path, processes: int
) -> dict[Scene, Any]:
    """What `measure` gives for each scene, from the folder where it has been measured before."""
    folder.mkdir(parents=True, exist_ok=True)
    missing = [scene for scene in scenes if not (folder / scene.name).exists()]
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for done, name in enumerate(pool.map(partial(_keep, measure, folder), missing), start=1):
            print(f"  {done}/{len(missing)} {name}", flush=True)
    return {scene: pickle.loads((folder / scene.name).read_bytes()) for scene in scenes}


def _keep(measure: Callable[[Scene], Any], folder: Path, scene: Scene) -> str:
    use_one_thread()
    unfinished = folder / f"{scene.name}.part"
    unfinished.write_bytes(pickle.dumps(measure(scene)))
    unfinished.replace(folder / scene.name)
    return scene.name


def of_package(*patterns: str) -> list[Path]:
    """The package's sources that match any of the patterns, such as "lab/*.py"; ValueError where none matches one."""
    root = Path(auditor.__file__).parent
    found = {pattern: list(root.glob(pattern)) for pattern in patterns}
    if nothing := [pattern for pattern, paths in found.items() if not paths]:
        raise ValueError(f"no source matches {', '.join(nothing)}")
    return [path for paths in found.values() for path in paths]


def digest(sources: Iterable[Path]) -> str:
    """Of everything that a kept file depends on: a name for the folder of such files."""
    found = sha256()
    for path in sorted(sources):
        found.update(path.read_bytes())
    return found.hexdigest()[:16]
