"""Faults that last, and attacks drawn anew for each frame, as the benchmark of causes puts them on a recording."""

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from auditor.lab.attacks.faults import (
    DimmedCamera,
    HiddenSector,
    Rain,
    ScatteredPoints,
    ShiftedCamera,
    TurnedLidar,
)
from auditor.lab.attacks.interference import LaserPattern
from auditor.lab.attacks.paper import STRENGTHS, draw_facula, draw_wall
from auditor.model.frames import Frame, PointCloud
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import Cause

CLEAN = "clean"
DEGREE_PX = 13  # at a focal length of 720 px
DISPLACED_DEG = (0.3, 1.0)
DARKER = 0.2
RATES_MM_H = (2, 10, 50)
WALLS_M = (1.0, 2.5)
WALL_RAIN_MM_H = 10
SECTOR_DEG = 30.0

Change = Callable[[Frame], Frame]


class Happening(NamedTuple):
    """A fault, with its cause and sensor (None: all), an attack, without a cause, or neither; and its frames."""

    name: str
    cause: Cause | None
    sensor: int | None
    frames: Iterable[Frame]


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


def faults(kept: Sequence[Frame], rig: Rig) -> Iterator[Happening]:
    """Every fault."""
    for sensor in rig.sensors:
        # The first frame has none before it: it is left out.
        late = (taken(frame, before, sensor) for before, frame in pairwise(kept))
        yield Happening("late by one frame", Cause.LATE, sensor, late)
        yield Happening("frozen", Cause.FROZEN, sensor, (taken(frame, kept[0], sensor) for frame in kept))
    for rate in RATES_MM_H:
        yield Happening(f"rain, {rate} mm/h", Cause.RAIN, LIDAR, map(on(LIDAR, Rain(rate, seed=7), rig), kept))
    for degrees in DISPLACED_DEG:
        name = f"displaced by {degrees:g} degrees"
        for right, down in ((1, 0), (0, -1)):
            turned = on(LIDAR, TurnedLidar(right * degrees, down * degrees), rig)
            yield Happening(f"LiDAR {name}", Cause.DISPLACED, LIDAR, map(turned, kept))
            for camera in rig.cameras:
                rows, columns = (round(way * degrees * DEGREE_PX) for way in (down, right))
                shifted = on(camera.number, ShiftedCamera(rows, columns), rig)
                yield Happening(f"camera {name}", Cause.DISPLACED, camera.number, map(shifted, kept))
    yield Happening("all dark, a fifth of the light", Cause.DARK, None, (dimmed(frame, rig) for frame in kept))


def attacks(kept: Sequence[Frame], rig: Rig) -> Iterator[Happening]:
    """Every attack."""
    yield Happening("wall", None, LIDAR, map(drawn(LIDAR, draw_wall, rig), kept))
    for name, draw in lidar_attacks():
        yield Happening(name, None, LIDAR, map(drawn(LIDAR, draw, rig), kept))
    for width in WALLS_M:
        walls = [drawn(LIDAR, lambda rng, width=width: replace(draw_wall(rng), width_m=width), rig)(f) for f in kept]
        yield Happening(f"wall of {width} m", None, LIDAR, walls)
        wet = map(on(LIDAR, Rain(WALL_RAIN_MM_H, seed=7), rig), walls)
        yield Happening(f"wall of {width} m, rain {WALL_RAIN_MM_H} mm/h", None, LIDAR, wet)
    for camera in rig.cameras:
        size = camera.width_px, camera.height_px
        for strength in STRENGTHS:
            faculas = drawn(camera.number, lambda rng, size=size, of=strength: draw_facula(rng, *size, of), rig)
            yield Happening(f"facula, {strength}", None, camera.number, map(faculas, kept))
        for pattern in patterns():
            changed = map(on(camera.number, pattern, rig), kept)
            yield Happening(f"pattern, {pattern.title}", None, camera.number, changed)


def lidar_attacks() -> Iterator[tuple[str, Callable[[np.random.Generator], object]]]:
    """Attacks on the LiDAR beside the wall, some of which are points here and there, as drops are."""
    for width in (10, 30):
        yield f"hidden, {width} degrees", lambda rng, width=width: HiddenSector(width, rng.uniform(-25, 25))
    for factor in (0.85, 1.2):
        yield f"moved to {factor} of its range", lambda rng, of=factor: MovedSector(rng.uniform(-25, 25), of)
    for count in (500, 2000, 8000):
        yield f"scattered, {count}", lambda rng, count=count: ScatteredPoints(count, int(rng.integers(1 << 31)))
    yield "scattered in 40 degrees", lambda rng: ScatteredInSector(20000, int(rng.integers(1 << 31)), 40)


@dataclass(frozen=True)
class MovedSector:
    """All points within 30 degrees around an azimuth, in degrees to the left, moved along their rays."""

    azimuth_deg: float
    factor: float

    def apply(self, cloud: PointCloud, rig: Rig) -> PointCloud:
        """The cloud with the sector moved."""
        del rig
        azimuth_deg = np.rad2deg(np.arctan2(cloud.xyz_m[:, 1], cloud.xyz_m[:, 0]))
        inside = np.abs(azimuth_deg - self.azimuth_deg) < SECTOR_DEG / 2
        scale = np.where(inside, np.float32(self.factor), np.float32(1))
        return PointCloud(cloud.stamp_ns, cloud.xyz_m * scale[:, None])


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
