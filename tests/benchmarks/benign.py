"""How often faults of a camera that are no attack are called one: `python -m tests.benchmarks.benign --into FOLDER`.

Clean frames of real drives (--drives, each camera in turn) and of streets (--streets, the cameras in turn) under a gain,
a gamma, a white balance, dirt, drops, blur or glare that lasts, by thresholds of the clean frames of other drives:
--learn names folders of `clean_statistics`, of which the drive's own family is left out; without any, streets are
judged by three drives of their vehicle elsewhere, real drives by the two others. --without CAMERA judges without it.
Counts frames in which a sensor was accused (`attacked`), which sensors, those not clean, and those whose likeliest cause
is the fault. What is in the folder is not measured again.
"""

import argparse
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from auditor.evaluation.sources import Recorded, Street
from auditor.lab.attacks.faults import SoiledLens
from auditor.lab.simulation.stray_light import Lens, SunSeen, draw_lens, with_stray_light
from auditor.measurement import use_one_thread
from auditor.model.calibration import RobustThresholds
from auditor.model.frames import CameraImage, Frame
from auditor.model.rig import Rig
from auditor.model.verdict import Cause, Verdict, VerdictKind
from tests.benchmarks.clean_statistics import DRIVES, Scene, load
from tests.benchmarks.lasting_faults import CLEAN, Happening, on
from tests.benchmarks.measured_series import (
    Drive,
    Watched,
    clean_of,
    elsewhere,
    judged,
    kept_drive,
    learn,
    measured_drive,
)

EVERY = {"0009": 4}
WHITE = 255
LISTED = 0.5

Pixels = np.ndarray


@dataclass(frozen=True)
class Toned:
    """A camera whose levels follow another curve: (L / 255)^gamma times a gain, by channel where there are several."""

    gain: float | tuple[float, float, float] = 1.0
    gamma: float = 1.0

    def apply(self, image: CameraImage) -> CameraImage:
        light = (image.pixels / np.float32(WHITE)) ** np.float32(self.gamma) * np.float32(self.gain)
        return replace(image, pixels=np.rint(np.clip(light, 0, 1) * WHITE).astype(np.uint8))


@dataclass(frozen=True)
class Blurred:
    """A lens out of focus."""

    sigma_px: float

    def apply(self, image: CameraImage) -> CameraImage:
        return replace(image, pixels=cv2.GaussianBlur(image.pixels, (0, 0), self.sigma_px))


@dataclass(frozen=True)
class WetLens:
    """Drops of water on a lens: each shows a picture of its own, upside down, blurred and somewhat darker."""

    drops: int
    seed: int

    def apply(self, image: CameraImage) -> CameraImage:
        height, width = image.pixels.shape[:2]
        rng = np.random.default_rng([self.seed, image.sensor])
        share = np.zeros((height, width), dtype=np.float32)
        for _ in range(self.drops):
            u, v, radius = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(0.01, 0.04) * width
            distance = np.hypot(np.arange(width) - u, np.arange(height)[:, None] - v) / radius
            share = np.maximum(share, np.clip((1 - distance) / 0.3, 0, 1).astype(np.float32))
        turned = cv2.GaussianBlur(image.pixels[::-1, ::-1], (0, 0), 0.02 * width).astype(np.float32) * np.float32(0.9)
        share = share.reshape(height, width, *[1] * (image.pixels.ndim - 2))
        pixels = np.rint(image.pixels * (1 - share) + turned * share)
        return replace(image, pixels=pixels.astype(np.uint8))


@dataclass(frozen=True)
class Glare:
    """The sun in a lens: its glare and ghosts, the lens of each camera with flaws of its own."""

    sun: SunSeen
    seed: int

    def apply(self, image: CameraImage) -> CameraImage:
        lens: Lens = draw_lens(np.random.default_rng([self.seed, image.sensor]))
        channels = image.pixels[..., None] if image.pixels.ndim < 3 else image.pixels
        light = np.ascontiguousarray(channels.transpose(2, 0, 1), dtype=np.float32) / np.float32(WHITE)
        seen = np.clip(with_stray_light(light, lens, self.sun), 0, 1).transpose(1, 2, 0)
        return replace(image, pixels=np.rint(seen * WHITE).astype(np.uint8).reshape(image.pixels.shape))


@dataclass(frozen=True)
class Fault:
    """A fault, the cause that it should be called (None where there is none for it), and whether all cameras have it."""

    name: str
    cause: Cause | None
    what: object
    together: bool = False
    coloured: bool = False


def faults(seed: int, width_px: int, height_px: int) -> Iterator[Fault]:
    """Every fault of a camera."""
    for gain in (0.6, 0.8, 1.2, 1.4):
        yield Fault(f"gain {gain}", Cause.EXPOSURE, Toned(gain))
    for gamma in (0.7, 1.4):
        yield Fault(f"gamma {gamma}", Cause.EXPOSURE, Toned(gamma=gamma))
    yield Fault("white balance 1.25 / 0.8", Cause.EXPOSURE, Toned((0.8, 1.0, 1.25)), coloured=True)
    yield Fault("five drops of mud", Cause.SOILED, SoiledLens(5, seed))
    yield Fault("fifteen drops of water", Cause.SOILED, WetLens(15, seed))
    yield Fault("blur, 1.5 px", None, Blurred(1.5))
    yield Fault("blur, 3 px", None, Blurred(3.0))
    sun = SunSeen(0.6 * width_px, 0.1 * height_px, 1.0)
    yield Fault("glare of the sun, one camera", Cause.GLARE, Glare(sun, seed))
    yield Fault("glare of the sun, all", Cause.GLARE, Glare(sun, seed), together=True)
    yield Fault("gain 1.4, all", None, Toned(1.4), together=True)
    yield Fault("gain 0.6, all", None, Toned(0.6), together=True)


def happenings(kept: Sequence[Frame], rig: Rig, *, seed: int, each: bool) -> Iterator[Happening]:
    """Clean frames, and every fault: of each camera, or of one camera in turn."""
    yield Happening(CLEAN, None, None, kept)
    cameras = [camera.number for camera in rig.cameras]
    coloured = [number for number, image in kept[0].images.items() if image.pixels.ndim > 2]
    for place, fault in enumerate(faults(seed, rig.cameras[0].width_px, rig.cameras[0].height_px)):
        able = coloured if fault.coloured else cameras
        if fault.together:
            yield Happening(fault.name, fault.cause, None, [_on_all(frame, fault.what, able, rig) for frame in kept])
        elif able:
            for camera in able if each else [able[(seed + place) % len(able)]]:
                yield Happening(fault.name, fault.cause, camera, map(on(camera, fault.what, rig), kept))


def _on_all(frame: Frame, what: object, cameras: Sequence[int], rig: Rig) -> Frame:
    for camera in cameras:
        frame = on(camera, what, rig)(frame)
    return frame


def real(name: str, path: Path) -> Drive:
    """A real drive, each camera in turn."""
    with Recorded(path).open(colour=True) as [drive]:
        kept = [frame for frame in drive.frames if isinstance(frame, Frame)][:: EVERY.get(name, 1)]
        return measured_drive(name, name, drive.rig, kept, lambda k, rig: happenings(k, rig, seed=1, each=True))


def street(source: Street) -> Drive:
    """A street, the cameras in turn, and drives of its vehicle elsewhere."""
    with source.open(colour=True) as [drive]:
        kept = [frame for frame in drive.frames if isinstance(frame, Frame)]
        parts: Callable[..., Iterator[Happening]] = lambda k, rig: happenings(k, rig, seed=source.seed, each=False)  # noqa: E731
        found = measured_drive(str(source), source.family, drive.rig, kept, parts)
    return replace(found, elsewhere=tuple(elsewhere(source.seed, source.frames, source.cameras)))


def calibrated_by(drive: Drive, drives: Sequence[Drive], learnt: Sequence[Scene]) -> list[Watched]:
    """The clean frames that a drive is judged by."""
    others = [clean_of(scene) for scene in learnt if scene.family != drive.family]
    if others:
        return others
    clean = [one.series[0].frames for one in drives if not one.elsewhere and one.family != drive.family]
    return list(drive.elsewhere) or clean


def count(
    drive: Drive, learnt: RobustThresholds, absent: Sequence[int], rows: Mapping[tuple[bool, str], Counter[str]]
) -> None:
    """Add the verdicts on a drive to the rows."""
    for one in drive.series:
        if one.sensor in absent:
            continue
        for verdict in judged(one.frames, learnt, drive.rig, absent):
            row = rows[bool(drive.elsewhere), one.name]
            row.update(outcome(verdict, one.cause, one.sensor))


def outcome(verdict: Verdict, cause: Cause | None, sensor: int | None) -> Counter[str]:
    """What one verdict counts for."""
    first = verdict.causes[0] if verdict.causes and verdict.causes[0].score >= LISTED else None
    accused = verdict.kind is VerdictKind.ATTACKED
    return Counter(
        {
            "frames": 1,
            "accused": accused,
            "others": accused and verdict.attacked != (sensor,),
            "not clean": verdict.kind is not VerdictKind.CLEAN,
            "suspect": verdict.kind is VerdictKind.SUSPECT,
            "right": first is not None and (first.cause, first.sensor) == (cause, sensor),
            "another cause": first is not None and (first.cause, first.sensor) != (cause, sensor),
            **({f"by {verdict.evidence[0].check_name}": 1} if accused else {}),
        }
    )


def report(rows: Mapping[tuple[bool, str], Counter[str]]) -> Iterator[str]:
    """A line for each fault, real drives and streets apart."""
    for (synthetic, name), n in sorted(rows.items(), key=lambda row: row[0][0]):
        of = n["frames"]
        checks = ", ".join(f"{key} {value}" for key, value in sorted(n.items()) if key.startswith("by "))
        yield (
            f"{'street' if synthetic else 'real':6} {name:30} accused {n['accused']:3}/{of:<3} (others {n['others']:3}), "
            f"not clean {n['not clean']:3}, suspect {n['suspect']:3}, right cause {n['right']:3}, "
            f"another {n['another cause']:3} {checks}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--into", type=Path, required=True)
    parser.add_argument("--drives", type=Path, help="the folder of the test data")
    parser.add_argument("--streets", type=int, default=0)
    parser.add_argument("--first", type=int, default=4000)
    parser.add_argument("--frames", type=int, default=5)
    parser.add_argument("--cameras", type=int, default=4)
    parser.add_argument("--learn", type=Path, nargs="*", default=[], help="folders of clean scenes")
    parser.add_argument("--without", type=int, nargs="*", default=[], help="cameras that take no part")
    options = parser.parse_args()
    use_one_thread()
    options.into.mkdir(parents=True, exist_ok=True)
    drives: list[Drive] = []
    for name, path in DRIVES.items() if options.drives else ():
        drives.append(
            kept_drive(options.into / f"{name}.series", lambda name=name, path=path: real(name, options.drives / path))
        )
    for seed in range(options.first, options.first + options.streets):
        source = Street(seed, options.frames, options.cameras)
        drives.append(kept_drive(options.into / f"{source}.series", lambda source=source: street(source)))
    rows: dict[tuple[bool, str], Counter[str]] = defaultdict(Counter)
    scenes = [scene for folder in options.learn for scene in load(folder)]
    for drive in drives:
        learnt = learn(calibrated_by(drive, drives, scenes), drive.rig, absent=options.without)
        count(drive, learnt, options.without, rows)
    print(*report(rows), sep="\n")


if __name__ == "__main__":
    from tests.benchmarks import benign  # pickled classes must not belong to __main__

    benign.main()
