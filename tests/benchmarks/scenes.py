"""Measured scenes as `clean_statistics` keeps them: a module of its own, since pickles name the module of a class."""

import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from auditor.model.rig import Rig

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Case:
    """One measured frame: `attack` is empty where it is clean. `statistics` follow the scene's sensor checks."""

    frame: int
    stamp_ns: int
    attack: str
    attacked: tuple[int, ...]
    statistics: Floats
    errors: Floats
    features: Mapping[tuple[int, int], tuple[float, ...]] = field(default_factory=dict)
    level: Mapping[int, float | None] = field(default_factory=dict)
    saturated: Mapping[int, float | None] = field(default_factory=dict)
    returns: int | None = None
    further: Mapping[str, Mapping[int, float | None]] | None = None

    def brightness(self, name: str) -> Mapping[int, float | None]:
        """One of BRIGHTNESS by sensor; nothing in files of before more of them than two was kept."""
        known = {"level": self.level, "saturated_share": self.saturated}
        return known.get(name) or (self.further or {}).get(name, {})


@dataclass(frozen=True, eq=False)
class Scene:
    """The cases of one drive, of a rig and a family; `kinds` says of each camera whether it is grey or colour."""

    name: str
    family: str
    rig: Rig
    kinds: str
    cases: tuple[Case, ...]


def keep(folder: Path, name: str, make: Callable[[], Scene]) -> bool:
    """Make the scene of this name where the folder has none, and keep it; whether it was made."""
    path = folder / f"{name}.scene"
    if path.exists():
        return False
    folder.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(make()))
    return True


def load(folder: Path) -> list[Scene]:
    """The scenes of a folder, in the order of their names."""
    return [pickle.loads(path.read_bytes()) for path in sorted(folder.glob("*.scene"))]
