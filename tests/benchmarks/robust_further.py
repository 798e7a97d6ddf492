"""Attacks beyond the paper's, each kind by itself: `python -m tests.benchmarks.robust_further [--patterns FOLDER]`.

Every fourth frame of drive 0009 of the folder AUDITOR_TEST_DATA with thresholds at r = 1 % from the clean frames of
0001, and streets with those of the streets of the other styles; single frames. Prints how many are detected and how
many name exactly the attacked sensor, with 95 % Wilson intervals.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from auditor.evaluation.attacked_frame import Attack, AttackedFrame
from auditor.lab.attacks.faults import HiddenSector
from auditor.lab.attacks.light_patterns import LaserPattern, Stripes
from auditor.lab.simulation.drives import make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.measurement import use_one_thread
from auditor.model.frames import CameraImage, Frame, PointCloud
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import VerdictKind
from tests.benchmarks.real_drives import frames
from tests.benchmarks.robust_judging import clean_of, robust, wilson
from tests.benchmarks.robust_measuring import MATCHER, Sample, measured

EVERY = 4
SCENES, FRAMES = 4, 12
SECTOR_DEG = 30.0
STRIPES_PX = 40.0


@dataclass(frozen=True)
class MovedSector:
    """All points within 30 degrees around an azimuth, in degrees to the left, moved along their rays."""

    azimuth_deg: float
    factor: float

    name = "moved sector"

    @property
    def parameters(self) -> dict[str, object]:
        """Everything that decides its effect."""
        return {"azimuth_deg": self.azimuth_deg, "factor": self.factor}

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud with the sector moved."""
        del rig
        azimuth_deg = np.rad2deg(np.arctan2(cloud.xyz_m[:, 1], cloud.xyz_m[:, 0]))
        inside = np.abs(azimuth_deg - self.azimuth_deg) < SECTOR_DEG / 2
        scale = np.where(inside, np.float32(self.factor), np.float32(1))
        return PointCloud(cloud.stamp_ns, cloud.xyz_m * scale[:, None])


@dataclass(frozen=True)
class Sideways:
    """The whole picture moved to the right by so many pixels."""

    pixels: int

    name = "sideways"

    @property
    def parameters(self) -> dict[str, object]:
        """Everything that decides its effect."""
        return {"pixels": self.pixels}

    def apply(self, image: CameraImage) -> CameraImage:
        """The image moved; what leaves it on the right comes back on the left."""
        return CameraImage(image.sensor, image.stamp_ns, np.roll(image.pixels, self.pixels, axis=1))


def kinds(rig: Rig, patterns: Sequence[LaserPattern], rng: np.random.Generator) -> Iterator[tuple[str, int, Attack]]:
    """Every kind once on every sensor that it can befall."""
    aside = float(rng.uniform(-25, 25))
    for width_deg in (10, 20, 30):
        yield f"{width_deg} degrees hidden", LIDAR, HiddenSector(width_deg, aside)
    for factor in (1.2, 1.1, 0.85):
        yield f"{SECTOR_DEG:g} degrees moved to {factor:g} of their range", LIDAR, MovedSector(aside, factor)
    for camera in rig.cameras:
        for amplitude in (60.0, 120.0):
            stripes = Stripes(amplitude, STRIPES_PX, float(rng.uniform(0, STRIPES_PX)))
            yield f"stripes of {amplitude:g} grey levels", camera.number, stripes
        for pattern in patterns:
            yield f"pattern {pattern.title}", camera.number, pattern
        role = "reference" if camera.number == rig.n else "witness"
        yield f"{role} moved sideways by 12 px", camera.number, Sideways(12)


def samples(name: str, rig: Rig, stream: Sequence[Frame], patterns: Sequence[LaserPattern]) -> Iterator[Sample]:
    """Each frame clean and under every kind."""
    for frame in stream:
        attacked_frame = AttackedFrame(frame, rig, MATCHER)
        yield Sample(name, frame.number, frame.stamp_ns, "clean", (), 0, *measured(attacked_frame, {}))
        for kind, sensor, attack in kinds(rig, patterns, np.random.default_rng([1, frame.number])):
            found = measured(attacked_frame, {sensor: attack})
            yield Sample(name, frame.number, frame.stamp_ns, kind, (sensor,), 0, *found)
            attacked_frame.forget_attacks()


def report(rig: Rig, splits: Sequence[tuple[list[Sample], list[Sample]]]) -> None:
    """Print what is detected and named, the splits pooled."""
    outcome: dict[str, list[tuple[bool, bool]]] = defaultdict(list)
    for clean, tested in splits:
        for sample, verdict in zip(tested, robust(None)(rig, clean, tested), strict=True):
            exact = verdict.kind is VerdictKind.ATTACKED and verdict.attacked == sample.attacked
            outcome[sample.kind].append((verdict.kind is not VerdictKind.CLEAN, exact))
    for kind, told in outcome.items():
        found, exact = (sum(column) for column in zip(*told, strict=True))
        print(f"  {kind:45} detected {wilson(found, len(told))}   named {wilson(exact, len(told))}")


def _picture(file: Path) -> NDArray[np.uint8]:
    return np.asarray(cv2.imread(str(file), cv2.IMREAD_COLOR), dtype=np.uint8)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--patterns", type=Path, help="folder of pictures of laser patterns")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    use_one_thread()
    files = sorted(options.patterns.rglob("*.png")) if options.patterns else []
    patterns = [LaserPattern(str(file.relative_to(options.patterns)), _picture(file)) for file in files]
    rig, stream = frames("0001")
    learnt = [
        Sample("0001", f.number, f.stamp_ns, "clean", (), 0, *measured(AttackedFrame(f, rig, MATCHER), {}))
        for f in stream
    ]
    rig, stream = frames("0009")
    print("drive 0009, thresholds of 0001")
    report(rig, [(learnt, list(samples("0009", rig, list(stream)[::EVERY], patterns)))])
    streets: dict[str, list[Sample]] = defaultdict(list)
    for place, style in enumerate(STYLES, start=1):
        for scene in range(SCENES):
            number = 100_000 * options.seed + 10_000 * place + scene
            drive = make_drive(number, FRAMES, style=style, vehicle=number)
            chosen = [drive.frame(n) for n in range(0, FRAMES, EVERY)]
            streets[style] += samples(f"{style} {scene}", drive.rig, chosen, patterns)
    print("streets, each style by thresholds of the others")
    others = {style: [s for other in streets if other != style for s in streets[other]] for style in streets}
    report(drive.rig, [(clean_of(others[style]), part) for style, part in streets.items()])


if __name__ == "__main__":
    main()
