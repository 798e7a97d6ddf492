"""Whether faults are told from attacks: `python -m tests.benchmarks.robust_causes [--synthetic 2]`.

All frames of drive 0009 of the folder AUDITOR_TEST_DATA (LiDAR, cam1, cam3, reference cam2) under each fault, which
lasts, and under each attack, drawn anew for every frame; thresholds at r = 1 % from the clean frames of drive 0001.
With --synthetic SCENES also streets of each style by thresholds of the other two, eight frames a scene. Of faults:
how often the verdict's likeliest cause is the fault in that sensor, how often the frame is `suspect` for it, and
how often a sensor was accused without doubt; of attacks how often the verdict is only `suspect`.
"""

import argparse
import os
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from itertools import chain, pairwise
from pathlib import Path

import cv2
import numpy as np

from auditor.elements import rig_elements
from auditor.evidence import Watch, measure, use_one_thread
from auditor.evidence.matchers import find_matcher
from auditor.frames import Frame, PointCloud
from auditor.identification.accusing import System
from auditor.identification.causes import suspicions
from auditor.identification.local_ratio import local_ratios
from auditor.identification.margins import strength_yardsticks, yardsticks
from auditor.identification.robust import Heard, judge_heard
from auditor.identification.strengths import Observed, strengths
from auditor.lab.attacks import STRENGTHS, draw_facula, draw_wall
from auditor.lab.drives import make_drive
from auditor.lab.faults import (
    DimmedCamera,
    HiddenSector,
    ScatteredPoints,
    ShiftedCamera,
    SoiledLens,
    TurnedLidar,
)
from auditor.lab.patterns import LaserPattern
from auditor.lab.rain import Rain
from auditor.lab.streets import STYLES
from auditor.results import FINDINGS, Cause, CauseIn, Measurement, Verdict, VerdictKind
from auditor.rig import LIDAR, Rig
from auditor.symptoms import COLUMNS
from auditor.thresholds import Yardstick
from tests.benchmarks.intervals import wilson_percent
from tests.benchmarks.real_drives import frames
from tests.benchmarks.robust_further import MovedSector

MATCHER = find_matcher("sgbm")
FRAMES_A_SCENE = 8
DEGREE_PX = 13  # at a focal length of 720 px
DARKER = 0.2
RATES_MM_H = (1, 2, 5, 10, 25, 50, 100)
WALLS_M = (0.5, 1.0, 2.5)

Change = Callable[[Frame], Frame]


@dataclass(frozen=True, eq=False)
class Series:
    """Frames in which one thing happened all the time: a fault, with its cause and sensor (None: all), or an attack."""

    name: str
    cause: Cause | None
    sensor: int | None
    frames: Sequence[Measurement]


def on(sensor: int, what: object, rig: Rig) -> Change:
    """Apply an attack or fault to one sensor."""

    def change(frame: Frame) -> Frame:
        if sensor == LIDAR:
            return replace(frame, cloud=what.apply(frame.cloud, rig))
        return replace(frame, images={**frame.images, sensor: what.apply(frame.images[sensor])})

    return change


def drawn(sensor: int, draw: Callable[[np.random.Generator], object], rig: Rig) -> Change:
    """Apply an attack drawn anew for each frame."""
    return lambda frame: on(sensor, draw(np.random.default_rng([sensor, frame.number])), rig)(frame)


def taken(frame: Frame, other: Frame, sensor: int) -> Frame:
    """The frame with one sensor's data of another."""
    if sensor == LIDAR:
        return replace(frame, cloud=other.cloud)
    return replace(frame, images={**frame.images, sensor: other.images[sensor]})


def dimmed(frame: Frame, rig: Rig) -> Frame:
    """All cameras at a fifth of the light."""
    for camera in rig.cameras:
        frame = on(camera.number, DimmedCamera(DARKER), rig)(frame)
    return frame


def faults(kept: Sequence[Frame], rig: Rig) -> Iterator[tuple[str, Cause, int | None, Iterable[Frame]]]:
    """Every fault."""
    for sensor in rig.sensors:
        # The first frame has none before it: it is left out.
        late = (taken(frame, before, sensor) for before, frame in pairwise(kept))
        yield "late by one frame", Cause.LATE, sensor, late
        yield "frozen", Cause.FROZEN, sensor, (taken(frame, kept[0], sensor) for frame in kept)
    for rate in RATES_MM_H:
        yield f"rain, {rate} mm/h", Cause.RAIN, LIDAR, map(on(LIDAR, Rain(rate, seed=7), rig), kept)
    for yaw, pitch in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        turned = on(LIDAR, TurnedLidar(yaw, pitch), rig)
        yield "turned by 1 degree", Cause.DISPLACED, LIDAR, map(turned, kept)
    for camera in rig.cameras:
        for rows, columns in ((DEGREE_PX, 0), (-DEGREE_PX, 0), (0, DEGREE_PX), (0, -DEGREE_PX)):
            shifted = on(camera.number, ShiftedCamera(rows, columns), rig)
            yield "turned by 1 degree", Cause.DISPLACED, camera.number, map(shifted, kept)
        for seed in range(2):
            dirty = on(camera.number, SoiledLens(5, seed), rig)
            yield "five drops of mud", Cause.SOILED, camera.number, map(dirty, kept)
    yield "all dark, a fifth of the light", Cause.DARK, None, (dimmed(frame, rig) for frame in kept)


def attacks(kept: Sequence[Frame], rig: Rig) -> Iterator[tuple[str, int, Iterable[Frame]]]:
    """Every attack."""
    yield "wall", LIDAR, map(drawn(LIDAR, draw_wall, rig), kept)
    for name, draw in lidar_attacks():
        yield name, LIDAR, map(drawn(LIDAR, draw, rig), kept)
    for width in WALLS_M:
        walls = [drawn(LIDAR, lambda rng, width=width: replace(draw_wall(rng), width_m=width), rig)(f) for f in kept]
        yield f"wall of {width} m", LIDAR, walls
        for rate in RATES_MM_H[1::2]:
            yield f"wall of {width} m, rain {rate} mm/h", LIDAR, map(on(LIDAR, Rain(rate, seed=7), rig), walls)
    for camera in rig.cameras:
        size = camera.width_px, camera.height_px
        for strength in STRENGTHS:
            faculas = drawn(camera.number, lambda rng, size=size, of=strength: draw_facula(rng, *size, of), rig)
            yield f"facula, {strength}", camera.number, map(faculas, kept)
        mild = list(map(drawn(camera.number, lambda rng, size=size: draw_facula(rng, *size, "mild"), rig), kept))
        for rate in RATES_MM_H[1::2]:
            yield f"facula, mild, rain {rate} mm/h", camera.number, map(on(LIDAR, Rain(rate, seed=7), rig), mild)
        for pattern in patterns():
            yield f"pattern, {pattern.title}", camera.number, map(on(camera.number, pattern, rig), kept)


def lidar_attacks() -> Iterator[tuple[str, Callable[[np.random.Generator], object]]]:
    """Attacks on the LiDAR beside the wall, some of which are points here and there, as drops are."""
    for width in (10, 20, 30):
        yield f"hidden, {width} degrees", lambda rng, width=width: HiddenSector(width, rng.uniform(-25, 25))
    for factor in (0.85, 1.2):
        yield f"moved to {factor} of its range", lambda rng, of=factor: MovedSector(rng.uniform(-25, 25), of)
    for count in (500, 2000, 8000, 20000):
        yield f"scattered, {count}", lambda rng, count=count: ScatteredPoints(count, int(rng.integers(1 << 31)))
    yield "scattered in 40 degrees", lambda rng: ScatteredInSector(20000, int(rng.integers(1 << 31)), 40)


@dataclass(frozen=True)
class ScatteredInSector:
    """Spoofed points in a sector straight ahead only."""

    count: int
    seed: int
    width_deg: float

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud with those of the scattered points that lie in the sector."""
        xyz = ScatteredPoints(self.count, self.seed).apply(cloud, rig).xyz_m
        azimuth_deg = np.rad2deg(np.arctan2(xyz[:, 1], xyz[:, 0]))
        kept = (np.arange(len(xyz)) < len(cloud.xyz_m)) | (np.abs(azimuth_deg) < self.width_deg / 2)
        return PointCloud(cloud.stamp_ns, xyz[kept])


def patterns() -> list[LaserPattern]:
    """The captured laser patterns, as bright as their transparency lets them be."""
    found = []
    folder = Path(os.environ["AUDITOR_TEST_DATA"]) / "laser_patterns"
    for path in sorted(folder.rglob("*.png")):
        pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        if pixels.shape[2] == 4:
            pixels = (pixels[:, :, :3] * (pixels[:, :, 3:] / 255)).astype(np.uint8)
        found.append(LaserPattern("/".join(path.relative_to(folder).parts[:-1]), pixels))
    return found


def measured(stream: Iterable[Frame], rig: Rig) -> list[Measurement]:
    """A series as a scan would measure it."""
    watch, found = Watch(), []
    for frame in stream:
        measurement, evidence = measure(frame, rig, MATCHER)
        found.append(replace(measurement, symptoms=watch.observe(evidence)))
    return found


def all_series(kept: Sequence[Frame], rig: Rig) -> Iterator[Series]:
    """Clean frames, then every fault and attack."""
    yield Series("clean", None, None, measured(kept, rig))
    for name, cause, sensor, stream in faults(kept, rig):
        yield Series(name, cause, sensor, measured(stream, rig))
    for name, sensor, stream in attacks(kept, rig):
        yield Series(name, None, sensor, measured(stream, rig))


def ratios(part: Sequence[Measurement], rig: Rig) -> np.ndarray:
    """(F, M) local ratios."""
    elements = rig_elements(rig)
    found = [local_ratios(elements, m.cells, m.shares) for m in part]
    return np.array([[np.nan if ratio is None else ratio for ratio in row] for row in found])


def told(part: Sequence[Measurement], rig: Rig) -> dict[CauseIn, np.ndarray]:
    """(F,) strength of each cause."""
    pairs = tuple(part[0].symptoms)
    values = np.array([[m.symptoms[pair].values for pair in pairs] for m in part])
    cameras = tuple(camera.number for camera in rig.cameras)
    covered = [[m.coverage[c] for c in cameras] for m in part]
    level = np.array([[c.level for c in row] for row in covered])
    saturated = np.array([[c.saturated_share for c in row] for row in covered])
    observed = Observed(pairs, {name: values[:, :, n] for n, name in enumerate(COLUMNS)}, cameras, level, saturated)
    return strengths(observed, np.array([m.stamp_ns for m in part], dtype=np.int64), rig.sensors)


@dataclass(frozen=True, eq=False)
class Learnt:
    """What clean recordings teach."""

    scales: Sequence[Yardstick | None]
    causes: Mapping[CauseIn, Yardstick]


def learn(recordings: Sequence[Sequence[Measurement]], rig: Rig) -> Learnt:
    """Thresholds at r = 1 %."""
    r = Decimal("0.01")
    strong = [told(part, rig) for part in recordings]
    samples = {key: np.concatenate([one[key] for one in strong]) for key in strong[0]}
    known = {key: np.sort(values[~np.isnan(values)]).tolist() for key, values in samples.items()}
    clean = np.concatenate([ratios(part, rig) for part in recordings])
    return Learnt(yardsticks(clean, rig_elements(rig), r), strength_yardsticks(known, r))


def judged(part: Sequence[Measurement], learnt: Learnt, rig: Rig) -> list[Verdict]:
    """The verdicts of the robust method."""
    stamps_ns = np.array([m.stamp_ns for m in part], dtype=np.int64)
    prints = np.array([[m.fingerprints[s] for s in rig.sensors] for m in part], dtype=np.int64)
    heard = Heard(stamps_ns, ratios(part, rig), np.ones(prints.shape, dtype=np.bool_), prints)
    system = System(rig_elements(rig), rig.triples, rig.sensors)
    return judge_heard(heard, system, learnt.scales, 0.0, suspicions(told(part, rig), learnt.causes))


def outcome(series: Series, verdict: Verdict) -> Counter[str]:
    """What one verdict counts for."""
    first = verdict.causes[0] if verdict.causes and verdict.causes[0].score >= 0.5 else None
    named = first is not None and (first.cause, first.sensor) == (series.cause, series.sensor)
    raised = verdict.kind in FINDINGS
    return Counter(
        all=1,
        raised=raised,
        named=named,
        raised_named=raised and named,
        suspect_named=verdict.kind is VerdictKind.SUSPECT and named,
        accused=verdict.kind is VerdictKind.ATTACKED,
        right=verdict.kind is VerdictKind.ATTACKED and verdict.attacked == (series.sensor,),
        suspect=verdict.kind is VerdictKind.SUSPECT,
        clean=verdict.kind is VerdictKind.CLEAN,
    )


def report(title: str, parts: Sequence[tuple[Rig, Learnt, Sequence[Series]]]) -> None:
    """Print every row, all sensors apart, then all faults and attacks."""
    rows: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for rig, learnt, happened in parts:
        for series in happened:
            kind = "fault" if series.cause else "clean" if series.sensor is None else "attack"
            who = "" if series.sensor is None else f" S_{series.sensor}"
            for verdict in judged(series.frames, learnt, rig):
                counted = outcome(series, verdict)
                for name in {f"{series.name}{who}": 0, series.name: 0, "all": 0}:
                    rows[kind, name].update(counted)
    print(title)
    for (kind, name), n in rows.items():
        text = f"  {kind:6} {name:36} raised {n['raised']:4}/{n['all']:<4}"
        if kind == "fault":
            text += f" named {share(n['named'], n['all'])}, suspect for it {share(n['suspect_named'], n['all'])};"
            text += f" of those raised named {n['raised_named']};"
        elif kind == "attack":
            text += f" named {share(n['right'], n['all'])};"
        print(f"{text} accused {share(n['accused'], n['all'])}; suspect {share(n['suspect'], n['all'])}")


def share(k: int, n: int) -> str:
    """k of n with the 95 % interval in per cent."""
    low, high = wilson_percent(k, n)
    return f"{k:4}/{n:<4} [{low:.0f}, {high:.0f}]"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--synthetic", type=int, default=0, metavar="SCENES", help="scenes of each style")
    parser.add_argument("--first", type=int, default=0, help="number of each style's first scene")
    parser.add_argument("--streets-only", action="store_true")
    options = parser.parse_args()
    use_one_thread()
    if not options.streets_only:
        rig, stream = frames("0001")
        learnt = learn([measured(stream, rig)], rig)
        rig, stream = frames("0009")
        report("drive 0009, thresholds of 0001", [(rig, learnt, list(all_series(list(stream), rig)))])
    if options.synthetic:
        streets(range(options.first, options.first + options.synthetic))


def streets(scenes: range) -> None:
    """These scenes of each style, each style judged by the others' thresholds."""
    happened: dict[str, list[list[Series]]] = defaultdict(list)
    for s, style in enumerate(STYLES):
        for scene in scenes:
            number = 1000 * (s + 1) + scene
            drive = make_drive(number, FRAMES_A_SCENE, style=style, vehicle=number)
            happened[style].append(list(all_series(list(drive.frames()), drive.rig)))
    rig = drive.rig
    parts = []
    for style in STYLES:
        clean = [scene[0].frames for other in STYLES if other != style for scene in happened[other]]
        parts += [(rig, learn(clean, rig), list(chain.from_iterable(happened[style])))]
    report("synthetic streets, thresholds of the other styles", parts)


if __name__ == "__main__":
    main()
