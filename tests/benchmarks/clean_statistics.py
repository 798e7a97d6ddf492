"""Measures clean and attacked frames of real drives and streets, and keeps all that judging needs, scene by scene.

The prior of the thresholds is fitted to these (`python -m tests.benchmarks.prior`), and the published rates are counted
from them (`python -m tests.benchmarks.rates`). A scene that is there already is not measured again:

    python -m tests.benchmarks.clean_statistics --into FOLDER --drives DATA [--attacked [--constant]]
    python -m tests.benchmarks.clean_statistics --into FOLDER --streets 36 --first 2000 --frames 10 [--attacked]

With --scale 0.5 their pictures have half the size, with --altered jpeg30 (ALTERATIONS) they are compressed, noisy, dim
or of unlike cameras: what is found must not depend on it.
With --stretch 40 80 frames 40 to 79 of each source are measured alone; with --alone 4 camera S_4 and the LiDAR, of
which each attacked frame follows one that is attacked alike.
"""

import argparse
import os
import zlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from decimal import Decimal
from functools import partial
from itertools import islice
from pathlib import Path

import cv2
import numpy as np

from auditor.identification.statistics import sensor_statistics
from auditor.lab.attacks.paper import Facula, draw_facula, draw_wall
from auditor.lab.attacks.spoofing import RandomRanges
from auditor.lab.evaluation.sources import CleanFrameSource, RecordingSource, Street
from auditor.measurement import FaultFeatures, measure_stream, use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.frame import MeasuredFrame
from auditor.measurement.time_parameters import PARALLAX_CONFLICT
from auditor.model.arrays import Floats, Image
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import Frame, SkippedFrame
from auditor.model.measurement import BRIGHTNESS, Measurement, Statistic
from auditor.model.optics.common_view import resized
from auditor.model.rig import LIDAR, Rig
from tests.benchmarks.scenes import Case, Scene, keep, load

MATCHER = find_matcher("sgbm")
DRIVES = {
    "0009": "kitti_raw_2011_09_26_drive_0009/2011_09_26/2011_09_26_drive_0009_sync",
    "0001": "kitti_raw_2011_09_26_drive_0001/2011_09_26/2011_09_26_drive_0001_sync",
    "04": "kitti_odometry_04/sequences/04",
}
_SECTOR_DEG = 8.0
_WALLS_M = {"wall 2.5 m": 2.5, "wall 1 m": 1.0}
_FACULAS = {
    "R 50 mild": (50.0, 255.0),
    "R 75 mild": (75.0, 255.0),
    "R 75 opaque": (75.0, 2000.0),
    "R 112 mild": (112.0, 255.0),
}


def case_of(measurement: Measurement, rig: Rig, attack: str = "", attacked: tuple[int, ...] = ()) -> Case:
    """What judging needs of a measured frame."""
    statistics = sensor_statistics(rig_sensor_checks(rig), measurement.cells, measurement.shares)
    errors = [None if one is None else one.disparity_error(Statistic.GATED) for one in measurement.counts]
    coverage = measurement.coverage
    return Case(
        measurement.number,
        measurement.stamp_ns,
        attack,
        attacked,
        np.array(statistics, dtype=np.float64),
        np.array(errors, dtype=np.float64),
        {pair: one.values for pair, one in measurement.fault_features.items()},
        {sensor: one.level for sensor, one in coverage.items()},
        {sensor: one.saturated_share for sensor, one in coverage.items()},
        coverage[LIDAR].returns if LIDAR in coverage else None,
        {name: {sensor: getattr(one, name) for sensor, one in coverage.items()} for name in BRIGHTNESS},
    )


def attacks_on(frame: Frame, rig: Rig, rng: np.random.Generator) -> Iterator[tuple[str, tuple[int, ...], Frame]]:
    """The paper's attacks, and weaker ones, on each sensor of a frame, and on two cameras."""
    cameras = [camera.number for camera in rig.cameras]

    def lit(numbers: Iterable[int], faculas: Iterable[Facula]) -> Frame:
        changed = {n: facula.apply(frame.images[n]) for n, facula in zip(numbers, faculas, strict=True)}
        return replace(frame, images={**frame.images, **changed})

    def drawn(number: int) -> Facula:
        camera = rig.camera(number)
        return draw_facula(rng, camera.width_px, camera.height_px, "mild")

    for number in cameras:
        camera = rig.camera(number)
        scale = camera.width_px / 1242
        for name, (radius, amplitude) in _FACULAS.items():
            place = rng.uniform(0, camera.width_px), rng.uniform(0, camera.height_px)
            yield name, (number,), lit([number], [Facula(amplitude, radius * scale, *place)])
        yield "paper's facula", (number,), lit([number], [drawn(number)])
    if len(cameras) > 3:
        two = tuple(sorted(rng.choice(cameras, 2, replace=False).tolist()))
        yield "two faculas", two, lit(two, [drawn(number) for number in two])
    if frame.cloud is not None:
        wall = draw_wall(rng)
        walls = {name: replace(wall, width_m=width) for name, width in _WALLS_M.items()}
        walls["wall 2.5 m at 20 m"] = replace(wall, range_m=20.0)
        for name, one in walls.items():
            yield name, (LIDAR,), replace(frame, cloud=one.apply(frame.cloud, rig))
        gone = RandomRanges(_SECTOR_DEG, rng.uniform(-15, 15), lost=1.0, farthest_m=100.0)
        yield "sector of 8 deg gone", (LIDAR,), replace(frame, cloud=gone.apply(frame.cloud, rig))


def measured(
    frames: Iterable[Frame], rig: Rig, *, attacked: bool, seed: int, every: int = 1, constant: bool = False
) -> Iterator[Case]:
    """The cases of a drive: every frame as it is, and every so many under attacks, drawn anew unless `constant`."""
    features, rng = FaultFeatures(), np.random.default_rng(seed)
    before: deque[Frame] = deque(maxlen=PARALLAX_CONFLICT.most_held)
    for place, frame in enumerate(frames):
        rng = np.random.default_rng(seed) if constant else rng
        clean, arrays = _last([*before, frame], rig)
        yield case_of(replace(clean, fault_features=features.update(arrays)), rig)
        if attacked and place % every == 0:
            # Earlier frames are attacked alike.
            series = [attacks_on(one, rig, deepcopy(rng)) for one in before]
            for *earlier, (name, sensors, changed) in zip(*series, attacks_on(frame, rig, rng), strict=True):
                yield case_of(_last([*(past for *_, past in earlier), changed], rig)[0], rig, name, sensors)
        if rig.by_time:
            before.append(frame)


def measure_all(frames: Iterable[Frame], rig: Rig) -> Iterator[MeasuredFrame]:
    """What is measured of frames that follow one another."""
    return (one for one in measure_stream(frames, rig, MATCHER) if not isinstance(one, SkippedFrame))


def _last(frames: Sequence[Frame], rig: Rig) -> MeasuredFrame:
    """What is measured of the last of some frames that follow one another."""
    *_, last = measure_all(frames, rig)
    return last


@dataclass(frozen=True)
class Resized:
    """A real drive whose cameras had `scale` times the pixels across."""

    source: RecordingSource
    scale: float

    @contextmanager
    def open(self) -> Iterator[tuple[CleanFrameSource, ...]]:
        """Its frames by each rig."""
        with self.source.open() as drives:
            yield tuple(self._of(drive) for drive in drives)

    def _of(self, drive: CleanFrameSource) -> CleanFrameSource:
        rig = resized(drive.rig, self.scale)

        def shrink(number: int, pixels: Image) -> Image:
            size = rig.camera(number).width_px, rig.camera(number).height_px
            return np.asarray(cv2.resize(pixels, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)

        return replace(drive, rig=rig, frames=(changed(item, shrink) for item in drive.frames))


def changed(item: Frame | SkippedFrame, change: Callable[[int, Image], Image]) -> Frame | SkippedFrame:
    """A frame whose pictures are changed, each by its camera's number."""
    if isinstance(item, SkippedFrame):
        return item
    return replace(item, images={n: replace(one, pixels=change(n, one.pixels)) for n, one in item.images.items()})


def _compressed(quality: int) -> Callable[[int, Image], Image]:
    def compress(_camera: int, pixels: Image) -> Image:
        _, data = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, quality])
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_UNCHANGED), dtype=np.uint8)

    return compress


def _noisy(camera: int, pixels: Image) -> Image:
    noise = np.random.default_rng([camera, int(pixels.sum())]).normal(0, 6, pixels.shape)
    return np.clip(pixels + noise, 0, 255).astype(np.uint8)


def _of_one(camera: int, change: Callable[[Image], Floats]) -> Callable[[int, Image], Image]:
    def alter(number: int, pixels: Image) -> Image:
        return np.clip(change(pixels), 0, 255).astype(np.uint8) if number == camera else pixels

    return alter


def _vignette(pixels: Image) -> Floats:
    height, width = pixels.shape[:2]
    y, x = np.mgrid[:height, :width]
    kept = 1 - 0.4 * ((x - width / 2) ** 2 + (y - height / 2) ** 2) / (width / 2) ** 2
    return np.asarray(pixels * (kept if pixels.ndim == 2 else kept[:, :, None]))


ALTERATIONS: dict[str, Callable[[int, Image], Image]] = {
    "jpeg75": _compressed(75),
    "jpeg30": _compressed(30),
    "noise6": _noisy,
    "dim": lambda _, pixels: (pixels * 0.25).astype(np.uint8),
    "dark1": _of_one(1, lambda pixels: pixels * 0.5),
    "blur2": _of_one(2, lambda pixels: np.asarray(cv2.GaussianBlur(pixels, (0, 0), 1.2), dtype=np.float64)),
    "gamma3": _of_one(3, lambda pixels: 255 * (pixels / 255) ** 0.6),
    "vignette4": _of_one(4, _vignette),
}
"""What becomes of the pictures of each camera, or of the one that is named: levels times a half, blurred by 1.2 px, by
another gamma, or darker by 40 % at the sides."""


@dataclass(frozen=True)
class Altered:
    """A drive whose pictures are altered, before any attack."""

    source: RecordingSource | Resized
    how: str

    @contextmanager
    def open(self) -> Iterator[tuple[CleanFrameSource, ...]]:
        """Its frames by each rig."""
        with self.source.open() as drives:
            alter = ALTERATIONS[self.how]
            yield tuple(replace(drive, frames=(changed(item, alter) for item in drive.frames)) for drive in drives)


def drives_in(data: Path, scale: float, altered: str | None = None) -> dict[str, RecordingSource | Resized | Altered]:
    """The real drives of the test data, by name."""
    drives = {name: RecordingSource(data / path) for name, path in DRIVES.items()}
    resized = {name: drive if scale == 1 else Resized(drive, scale) for name, drive in drives.items()}
    return {name: drive if altered is None else Altered(drive, altered) for name, drive in resized.items()}


Source = RecordingSource | Resized | Altered | Street


def sources_of(
    data: Path | None, streets: range, frames: int, cameras: int = 4, scale: float = 1.0, altered: str | None = None
) -> Iterator[tuple[str, str, Source]]:
    """The name, the family and the source of each real drive, where there are data, and of each street."""
    if data is not None:
        yield from ((name, name, drive) for name, drive in drives_in(data, scale, altered).items())
    for street in (Street(seed, frames, cameras, scale) for seed in streets):
        yield str(street), street.family, street


def alone(frame: Frame, camera: int) -> Frame:
    """What one camera and the LiDAR have of a frame."""
    image, presence = replace(frame.images[camera], sensor=1), {LIDAR: frame.presence[LIDAR], 1: frame.presence[camera]}
    return replace(frame, images={1: image}, presence=presence)


def scene_of(
    source: Source,
    name: str,
    family: str,
    *,
    attacked: bool,
    every: int = 1,
    stretch: tuple[int, int | None] = (0, None),
    constant: bool = False,
    camera: int | None = None,
) -> Scene:
    """Measure a source, or a stretch of it: from a frame to before another."""
    with source.open() as drives:
        drive = drives[0]
        rig = drive.rig if camera is None else drive.rig.lone(camera)
        kinds: dict[int, str] = {}

        def frames() -> Iterator[Frame]:
            for item in islice(drive.frames, *stretch):
                if isinstance(item, Frame):
                    frame = item if camera is None else alone(item, camera)
                    kinds.update({n: "c" if one.pixels.ndim > 2 else "g" for n, one in frame.images.items()})
                    yield frame

        seed = zlib.crc32(name.encode())
        drawn = measured(frames(), rig, attacked=attacked, seed=seed, every=every, constant=constant)
        cases = tuple(drawn)
        return Scene(name, family, rig, "".join(kinds[n] for n in sorted(kinds)), cases)


Measure = Callable[[Source, str, str, int], Scene]
"""The scene of a source with its name and family, and the number of its frames that are attacked."""


def options_of(text: str | None, *, frames: int, attacked: int) -> argparse.ArgumentParser:
    """The options that all of them have; `frames` of each street and those `attacked` of each drive unless told."""
    parser = argparse.ArgumentParser(description=text.splitlines()[0] if text else None)
    parser.add_argument("--into", type=Path, required=True)
    parser.add_argument("--streets", type=int, default=0, help="this many streets in place of the real drives")
    parser.add_argument("--first", type=int, default=6000)
    parser.add_argument("--frames", type=int, default=frames, help="of each street")
    parser.add_argument("--scale", type=float, default=1.0, help="of the pictures")
    parser.add_argument("--attacked", type=int, default=attacked, help="frames of each drive that are attacked")
    parser.add_argument("--r", type=Decimal, default=Decimal("0.01"))
    return parser


def scenes_of(options: argparse.Namespace, measured: Measure) -> list[Scene]:
    """The scenes of the real drives, or of streets; what is in the folder is not measured again."""
    use_one_thread()
    data = None if options.streets else Path(os.environ["AUDITOR_TEST_DATA"])
    streets = range(options.first, options.first + options.streets)
    for name, family, source in sources_of(data, streets, options.frames, scale=options.scale):
        keep(options.into, name, partial(measured, source, name, family, options.attacked))
    return load(options.into)


def spread(frames: Sequence[Frame], count: int) -> set[int]:
    """The numbers of so many frames, evenly spread."""
    return {frames[place].number for place in np.linspace(0, len(frames) - 1, count).astype(int)}


def kinds_of(frame: Frame) -> str:
    """Of each camera in order whether it is grey (g) or has colours (c)."""
    return "".join("c" if frame.images[n].pixels.ndim > 2 else "g" for n in sorted(frame.images))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--into", type=Path, required=True)
    parser.add_argument("--drives", type=Path, help="the folder of the test data")
    parser.add_argument("--streets", type=int, default=0)
    parser.add_argument("--first", type=int, default=2000)
    parser.add_argument("--frames", type=int, default=10)
    parser.add_argument("--cameras", type=int, default=4)
    parser.add_argument("--scale", type=float, default=1.0)
    parser.add_argument("--altered", choices=ALTERATIONS, help="what becomes of the pictures of real drives")
    parser.add_argument("--attacked", action="store_true")
    parser.add_argument("--constant", action="store_true", help="an attack is the same in all frames of a drive")
    parser.add_argument("--every", type=int, default=1, help="frames, of which one is attacked")
    parser.add_argument("--alone", type=int, help="the camera that is measured with the LiDAR alone")
    parser.add_argument("--stretch", type=int, nargs=2, default=(0, None), help="first frame, and one past the last")
    options = parser.parse_args()
    use_one_thread()
    streets = range(options.first, options.first + options.streets)
    sizes = options.cameras, options.scale, options.altered
    how = {"attacked": options.attacked, "every": options.every, "constant": options.constant, "camera": options.alone}
    for name, family, source in sources_of(options.drives, streets, options.frames, *sizes):
        if keep(options.into, name, partial(scene_of, source, name, family, stretch=tuple(options.stretch), **how)):
            print(f"{name}, {family}", flush=True)


if __name__ == "__main__":
    main()
