"""Many synthetic scenes under every attack of the robust benchmarks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from auditor.evaluation.attacked_frame import AttackedFrame
from auditor.lab.simulation.drives import make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.model.rig import Rig
from tests.benchmarks.kept_scenes import digest, measure_kept, of_package
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
    found = measure_kept(scenes, _measure, folder / digest(of_package(*_SOURCES)), processes)
    return next(iter(found.values()))[0], {scene: samples for scene, (_, samples) in found.items()}


def _measure(scene: Scene) -> tuple[Rig, list[Sample]]:
    drive = make_drive(
        scene.number,
        scene.frames,
        n_cameras=scene.cameras,
        style=scene.style,
        vehicle=scene.number,
        positions_m=EVENLY_SPACED_M if scene.cameras == 4 else None,
    )
    benches = (AttackedFrame(frame, drive.rig, MATCHER) for frame in drive.frames())
    return drive.rig, [sample for attacked_frame in benches for sample in _frame(scene, drive.rig, attacked_frame)]


def _frame(scene: Scene, rig: Rig, attacked_frame: AttackedFrame) -> Iterator[Sample]:
    number, stamp_ns = attacked_frame.frame.number, attacked_frame.frame.stamp_ns
    yield Sample(scene.name, number, stamp_ns, "clean", (), 0, *measured(attacked_frame, {}))
    for kind, attacks in cases(rig, np.random.default_rng([scene.number, number])):
        lasts = scene.cameras == LASTING_CAMERAS and lasting(kind, tuple(attacks))
        if lasts or number % scene.period < _ATTACKED_TOGETHER:
            yield Sample(
                scene.name, number, stamp_ns, kind, tuple(sorted(attacks)), 0, *measured(attacked_frame, attacks)
            )


def lasting(kind: str, attacked: tuple[int, ...]) -> bool:
    """Whether every frame of a scene is attacked like this; by all others only some are."""
    return kind in ("wall 2.5 m", "strong") and len(attacked) == 1
