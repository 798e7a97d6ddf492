"""How well damaged portions are found: `OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.localisation [--every 1]`.

Every so many-th frame of drive 0009 of the folder AUDITOR_TEST_DATA (LiDAR, cam1, cam3, reference cam2) under faculas
of each strength on each camera and walls of each width, each drawn anew for every frame; with --synthetic SCENES
also streets of each style. Intersection over union with the truth, 0 where no region was made of the attacked sensor:
pixels that the facula changed by more than 45 grey levels; pixels of the LiDAR's view with a point of the wall.
Judged by thresholds of drive 0001 (streets: of the other styles) the frame must name the sensor, else it is 0 too;
each frame is judged by itself, without causes that are not attacks and frozen sensors.
"""

import argparse
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from auditor.identification.scores import standing_out
from auditor.identification.statistics import sensor_statistics
from auditor.lab.attacks.paper import STRENGTHS, BogusWall, Facula, draw_facula, draw_wall
from auditor.lab.simulation.drives import make_drive
from auditor.lab.simulation.streets import STYLES
from auditor.measurement import measure, use_one_thread
from auditor.measurement.disparity.matchers import find_matcher
from auditor.measurement.localisation.regions import localise
from auditor.model.checks import rig_sensor_checks
from auditor.model.frames import Frame
from auditor.model.measurement import REGION_STEP, Region
from auditor.model.rig import LIDAR, Rig
from tests.benchmarks.real_drives import frames
from tests.benchmarks.single_frames import judge_alone

MATCHER = find_matcher("sgbm")
CHANGED = 45
WALLS_M = (0.5, 1.0, 1.5, 2.5)
FRAMES_A_SCENE = 5

Drive = list[tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class Found:
    """One attacked frame: its statistics, and the intersection over union of the region of the attacked sensor."""

    kind: str
    sensor: int
    statistics: tuple[float, ...]
    iou: float
    solid_error_m: float


def attacks(frame: Frame, rig: Rig, seed: int) -> Iterator[tuple[str, int, Facula | BogusWall]]:
    """One draw of each attack."""
    rng = np.random.default_rng([seed, frame.number])
    for camera in rig.cameras:
        for strength in STRENGTHS:
            yield strength, camera.number, draw_facula(rng, camera.width_px, camera.height_px, strength)
    wall = draw_wall(rng)
    for width in WALLS_M:
        yield f"wall {width} m", LIDAR, replace(wall, width_m=width)


def attacked(frame: Frame, rig: Rig, sensor: int, attack: Facula | BogusWall) -> Frame:
    """The frame with the attack on one sensor."""
    if isinstance(attack, BogusWall):
        assert frame.cloud is not None
        return replace(frame, cloud=attack.apply(frame.cloud, rig))
    return replace(frame, images={**frame.images, sensor: attack.apply(frame.images[sensor])})


def statistics_of(frame: Frame, rig: Rig) -> tuple[tuple[float, ...], tuple[Region, ...], object]:
    """Statistics of the sensor checks, NaN where not measured, the regions, and the evidence."""
    sensor_checks = rig_sensor_checks(rig)
    measurement, evidence = measure(frame, rig, MATCHER)
    found = sensor_statistics(sensor_checks, measurement.cells, measurement.shares)
    regions = localise(evidence, standing_out(sensor_checks, found).sensors, rig)
    return tuple(np.nan if value is None else value for value in found), regions, evidence


def measured(stream: Iterable[Frame], rig: Rig, seed: int) -> Iterator[Found]:
    """Every frame under every attack."""
    for frame in stream:
        for kind, sensor, attack in attacks(frame, rig, seed):
            changed = attacked(frame, rig, sensor, attack)
            statistics, regions, evidence = statistics_of(changed, rig)
            region = next((r for r in regions if r.sensor == sensor), None)
            iou, error = 0.0, np.nan
            if region is not None and sensor == LIDAR:
                iou, error = lidar_iou(region, evidence, frame), solid_error_m(region, attack, rig)
            elif region is not None:
                iou = image_iou(region, changed, frame)
            yield Found(kind, sensor, statistics, iou, error)


def unpacked(region: Region, height: int, width: int) -> np.ndarray:
    """The mask at full resolution."""
    mask = cv2.imdecode(np.frombuffer(region.mask, np.uint8), cv2.IMREAD_GRAYSCALE) > 0
    return mask.repeat(REGION_STEP, axis=0).repeat(REGION_STEP, axis=1)[:height, :width]


def image_iou(region: Region, changed: Frame, clean: Frame) -> float:
    """Against the pixels that changed by more than 45 grey levels in any channel."""
    before, after = (f.images[region.sensor].pixels.astype(np.int16) for f in (clean, changed))
    truth = np.abs(after - before)
    truth = (truth.max(axis=2) if truth.ndim == 3 else truth) > CHANGED
    found = unpacked(region, *truth.shape)
    return float(np.count_nonzero(truth & found) / max(np.count_nonzero(truth | found), 1))


def lidar_iou(region: Region, evidence: object, clean: Frame) -> float:
    """Over the LiDAR pixels of the view: those whose point the clean cloud does not hold are the wall's."""
    view = evidence.lidar[region.view]
    points, known = (
        np.ascontiguousarray(xyz, np.float32).view("f4,f4,f4").ravel() for xyz in (view.point_m, clean.cloud.xyz_m)
    )
    truth = ~np.isin(points, known)
    camera = evidence.rig.camera(region.view)
    found = unpacked(region, camera.height_px, camera.width_px)[view.row, view.column]
    return float(np.count_nonzero(truth & found) / max(np.count_nonzero(truth | found), 1))


def solid_error_m(region: Region, wall: BogusWall, rig: Rig) -> float:
    """How far the middle of the 3-D box lies from the wall's, ahead and to the side."""
    right, _, forward = rig.lidar.rig_SE3_lidar[:3, :3] @ np.array(region.solid.centre_m)
    return float(np.hypot(right - wall.lateral_m, forward - wall.range_m))


def report(title: str, rig: Rig, parts: Sequence[tuple[Sequence[Drive], Sequence[Found]]]) -> None:
    """Print the means of each attack, over all frames and over those whose verdict names the sensor.

    Each part is judged by thresholds of clean drives.
    """
    print(title)
    rows: dict[str, list[tuple[float, float, float]]] = defaultdict(list)
    for drives, part in parts:
        verdicts = judge_alone(rig, drives, [found.statistics for found in part])
        for found, verdict in zip(part, verdicts, strict=True):
            named = found.iou if found.sensor in verdict.attacked else 0.0
            for row in {found.kind, "all faculas" if found.sensor else "all walls", f"{found.kind} S_{found.sensor}"}:
                rows[row].append((found.iou, named, found.solid_error_m))
    for row, values in sorted(rows.items()):
        iou, named, error = np.array(values).T
        spread = 1.96 * named.std() / np.sqrt(len(named))
        text = f"  {row:16} n {len(named):4}  named {named.mean():.3f} +-{spread:.3f}  any {iou.mean():.3f}"
        text += f"  worst tenth below {np.quantile(named, 0.1):.2f}, zero in {np.count_nonzero(named == 0)}"
        print(text + (f", box off by {np.nanmedian(error):.2f} m" if not np.isnan(error).all() else ""))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--every", type=int, default=1)
    parser.add_argument("--synthetic", type=int, default=0, metavar="SCENES", help="scenes of each style")
    parser.add_argument("--first", type=int, default=0, help="number of each style's first scene")
    parser.add_argument("--streets-only", action="store_true")
    options = parser.parse_args()
    use_one_thread()
    if not options.streets_only:
        rig, stream = frames("0001", colour=True)
        clean = [statistics_of(frame, rig)[0] for frame in stream]
        rig, stream = frames("0009", colour=True)
        kept = [frame for frame in stream if frame.number % options.every == 0]
        report("drive 0009, thresholds of 0001", rig, [([clean], list(measured(kept, rig, 0)))])
    if options.synthetic:
        streets(range(options.first, options.first + options.synthetic))


def streets(scenes: range) -> None:
    """These scenes of each style, each style judged by the others' thresholds."""
    quiet: dict[str, list[Drive]] = defaultdict(list)
    found_by_style: dict[str, list[Found]] = defaultdict(list)
    for s, style in enumerate(STYLES):
        for scene in scenes:
            number = 1000 * (s + 1) + scene
            drive = make_drive(number, FRAMES_A_SCENE, style=style, vehicle=number)
            quiet[style].append([])
            for frame in drive.frames():
                quiet[style][-1].append(statistics_of(frame, drive.rig)[0])
                found_by_style[style].extend(measured([frame], drive.rig, scene))
    parts = [
        ([drive for other in STYLES if other != style for drive in quiet[other]], found_by_style[style])
        for style in STYLES
    ]
    report("synthetic streets, thresholds of the other styles", drive.rig, parts)


if __name__ == "__main__":
    main()
