"""Many synthetic scenes measured in parallel, each kept in a file: a run that was stopped goes on where it was."""

import pickle
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path

import numpy as np

import auditor
from auditor.evaluation.bench import Bench
from auditor.evidence import use_one_thread
from auditor.lab.drives import make_drive
from auditor.lab.streets import STYLES
from auditor.rig import Rig
from tests.benchmarks.robust_measuring import MATCHER, Sample, cases, measured

EVENLY_SPACED_M = (0.54, 0.36, 0.18, 0.0)

LASTING_CAMERAS = 3
"""Only scenes of so many cameras are attacked throughout."""

_ATTACKED_TOGETHER = 5
_SOURCES = (
    "evidence/*.py",
    "evidence/matchers/*.py",
    "lab/*.py",
    "identification/local_ratio.py",
    "evaluation/bench.py",
)


@dataclass(frozen=True)
class Scene:
    """A street, driven along by a vehicle with a calibration and flaws of its own.

    The first five of every `period` frames are attacked by everything; see `lasting`.
    """

    style: str
    number: int
    cameras: int
    frames: int
    period: int

    @property
    def name(self) -> str:
        """Of its file and its recording."""
        return f"{self.style}-{self.number}-{self.cameras}-{self.frames}-{self.period}"


def scenes_of(each: int, cameras: int, frames: int, seed: int, period: int) -> dict[str, list[Scene]]:
    """So many scenes of each style; no two have a street, a vehicle or an attack in common, whatever the seed."""
    return {
        style: [Scene(style, 100_000 * seed + 1000 * place + number, cameras, frames, period) for number in range(each)]
        for place, style in enumerate(STYLES, start=1)
    }


def measure_scenes(scenes: Sequence[Scene], folder: Path, processes: int) -> tuple[Rig, dict[Scene, list[Sample]]]:
    """Their samples, from the folder where they have been measured before by the same code."""
    kept = folder / _code()
    kept.mkdir(parents=True, exist_ok=True)
    missing = [scene for scene in scenes if not (kept / scene.name).exists()]
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        for done, scene in enumerate(pool.map(_measure, missing, [kept] * len(missing)), start=1):
            print(f"  {done}/{len(missing)} {scene}", flush=True)
    found = {scene: pickle.loads((kept / scene.name).read_bytes()) for scene in scenes}
    return next(iter(found.values()))[0], {scene: samples for scene, (_, samples) in found.items()}


def _measure(scene: Scene, folder: Path) -> str:
    use_one_thread()
    drive = make_drive(
        scene.number,
        scene.frames,
        n_cameras=scene.cameras,
        style=scene.style,
        vehicle=scene.number,
        positions_m=EVENLY_SPACED_M if scene.cameras == 4 else None,
    )
    benches = (Bench(frame, drive.rig, MATCHER) for frame in drive.frames())
    samples = [sample for bench in benches for sample in _frame(scene, drive.rig, bench)]
    unfinished = folder / f"{scene.name}.part"
    unfinished.write_bytes(pickle.dumps((drive.rig, samples)))
    unfinished.replace(folder / scene.name)
    return scene.name


def _frame(scene: Scene, rig: Rig, bench: Bench) -> Iterator[Sample]:
    number, stamp_ns = bench.frame.number, bench.frame.stamp_ns
    yield Sample(scene.name, number, stamp_ns, "clean", (), 0, *measured(bench, {}))
    for kind, attacks in cases(rig, np.random.default_rng([scene.number, number])):
        lasts = scene.cameras == LASTING_CAMERAS and lasting(kind, tuple(attacks))
        if lasts or number % scene.period < _ATTACKED_TOGETHER:
            yield Sample(scene.name, number, stamp_ns, kind, tuple(sorted(attacks)), 0, *measured(bench, attacks))


def lasting(kind: str, attacked: tuple[int, ...]) -> bool:
    """Whether every frame of a scene is attacked like this; by all others only some are."""
    return kind in ("wall 2.5 m", "strong") and len(attacked) == 1


def _code() -> str:
    """Of everything that a sample depends on."""
    digest = sha256()
    root = Path(auditor.__file__).parent
    for path in sorted(path for part in _SOURCES for path in root.glob(part)):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
