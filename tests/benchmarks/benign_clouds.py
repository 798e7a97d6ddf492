"""How often weather, dirt in the air and mirrors make the LiDAR a finding: `python -m tests.benchmarks.benign_clouds`.

Each happens in all frames of a real drive (AUDITOR_TEST_DATA), or from its middle on, in its cloud alone, as the
cameras show little of it: rain, wet roads, dust, exhaust, multi-path at panes and puddles, the sun, other LiDARs. Of
streets cars cut in before the vehicle, in clouds and pictures. Real drives are judged by the two others and by the
prior, streets by the prior: printed are the frames that are raised, those that name the LiDAR, and the drives found.
With --alone 4 camera S_4 and the LiDAR are measured.

    python -m tests.benchmarks.benign_clouds --into FOLDER [--streets 6] [--only dust exhaust] [--alone 4]
"""

import argparse
import os
import zlib
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from auditor.lab.attacks.faults import Rain, lidar_axes
from auditor.lab.attacks.paper import road_below_m
from auditor.lab.simulation.drives import make_drive
from auditor.measurement import FaultFeatures, use_one_thread
from auditor.model.arrays import Floats, Mask, Points
from auditor.model.frames import Frame, PointCloud
from auditor.model.rig import LIDAR, Rig
from auditor.model.verdict import FINDINGS
from tests.benchmarks.clean_statistics import case_of, kinds_of, measure_all, sources_of
from tests.benchmarks.cloud_series import Change, R, measured
from tests.benchmarks.incident_series import MEASURED_HZ, RIGS, Drive, drives_of
from tests.benchmarks.scenes import Case, Scene, keep, load

_WATER = 1.33
_WAVES, _WAVES_M = 24, (1.5, 6.0)
_DARKER = 0.4
"""What a wet road under no mirror returns of what a dry one does."""
_REACH_M = 70.0
"""How far away a dry road's echo is the faintest that is detected."""
_FEWER = 0.6
"""Of the mirrored beams, that meet something bright enough."""
_CELL = np.deg2rad(0.3)
_STEPS = 64
_TRACK_M, _HIGH_M = 0.8, 0.4


def fresnel(cosine: Floats) -> Floats:
    """The share of unpolarised light that water mirrors, by the cosine of its angle to the upright."""
    inside = np.sqrt(1 - (1 - cosine**2) / _WATER**2)
    across = (cosine - _WATER * inside) / (cosine + _WATER * inside)
    along = (_WATER * cosine - inside) / (_WATER * cosine + inside)
    return np.asarray((across**2 + along**2) / 2)


def film(right_m: Floats, ahead_m: Floats, wet: float, rng: np.random.Generator) -> Mask:
    """Which places of the road water covers: a share of about `wet`, in patches."""
    total = np.zeros(len(right_m))
    for _ in range(_WAVES):
        angle, phase = rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi)
        wave = 2 * np.pi / rng.uniform(*_WAVES_M)
        total += np.cos(wave * (right_m * np.cos(angle) + ahead_m * np.sin(angle)) + phase)
    return np.asarray(total > np.quantile(total, 1 - wet)) if len(total) else np.zeros(0, dtype=np.bool_)


def wet_ground(points: Points, rng: np.random.Generator, place: np.random.Generator) -> Points:
    """Water covers two to nine tenths of the road: it returns less, and mirrors what stands beyond."""
    down_m, range_m = road_below_m(points), np.maximum(np.linalg.norm(points, axis=1), 0.1)
    on_road = np.flatnonzero(np.abs(down_m - points[:, 1]) < 0.15)
    far = range_m[on_road]
    mirrored = fresnel(np.clip(down_m / far, 0, 1))
    water = film(points[on_road, 0], points[on_road, 2], place.uniform(0.2, 0.9), rng)
    echo = np.maximum(rng.lognormal(0, 0.7, far.size) * (_REACH_M / far) ** 3, 1)
    below = echo * np.where(water, _DARKER * (1 - mirrored) ** 2, 1) >= 1
    image_m = _images_m(points, down_m, on_road)
    shown = water & (image_m > far + 0.3) & (rng.random(far.size) < _FEWER * mirrored**2)
    seen_m = range_m.copy()
    seen_m[on_road] = np.where(shown, image_m + rng.normal(0, 0.03, far.size), far)
    kept = np.ones(len(points), dtype=np.bool_)
    kept[on_road] = below | shown
    return np.asarray(points * (seen_m / range_m)[:, None], dtype=np.float32)[kept]


def _images_m(points: Points, down_m: float, asked: np.ndarray) -> Floats:
    """How far the mirror image of something lies in the directions of the points asked about; 0 where none does."""
    standing = points[(down_m - points[:, 1] > 0.3) & (points[:, 2] > 1)]
    images = standing * np.array([1, -1, 1]) + np.array([0, 2 * down_m, 0])
    order = np.argsort(-np.linalg.norm(images, axis=1), kind="stable")  # the nearest one is written last
    images = images[order]
    nearest = dict(zip(_cells(images), np.linalg.norm(images, axis=1).tolist(), strict=True))
    return np.array([nearest.get(cell, 0.0) for cell in _cells(points[asked])])


def _cells(points: Points) -> list[int]:
    right, down, ahead = points.T
    around, below = np.arctan2(right, ahead), np.arctan2(down, np.hypot(right, ahead))
    return (np.floor(around / _CELL).astype(int) * 10000 + np.floor(below / _CELL).astype(int)).tolist()


def spray(points: Points, rng: np.random.Generator, place: np.random.Generator) -> Points:
    """Spray behind the wheels of a car 12 to 30 m ahead, 4 to 10 m long: the lower, the denser."""
    down_m, range_m = road_below_m(points), np.maximum(np.linalg.norm(points, axis=1), 0.1)
    car_m, aside_m, long_m = place.uniform(12, 30), place.uniform(-3, 3), place.uniform(4, 10)
    denser = place.uniform(0.05, 0.4)
    direction = points / range_m[:, None]
    near = np.flatnonzero(np.abs(points[:, 0] / np.maximum(points[:, 2], 0.1) - aside_m / car_m) < 0.4)
    near = near[points[near, 2] > 1]
    at_m = np.linspace(max(car_m - long_m, 2), car_m, _STEPS)
    step_m = at_m[1] - at_m[0]
    depth, ends_m = rng.exponential(1, near.size), np.full(near.size, np.inf)
    passed = np.zeros(near.size)
    for away_m in at_m:
        right, down, ahead = direction[near].T * away_m
        behind = np.clip((car_m - ahead) / long_m, 0, 1)
        wide_m = 0.25 + 0.6 * behind
        tracks = sum(np.exp(-0.5 * ((right - aside_m - side) / wide_m) ** 2) for side in (-_TRACK_M, _TRACK_M))
        low = np.exp(-np.clip(down_m - down, 0, None) / _HIGH_M)
        clumps = rng.gamma(0.5, 2, near.size)
        passed += denser * tracks * low * (1 - behind) * clumps * step_m
        ends_m = np.where((passed > depth) & np.isinf(ends_m), away_m + rng.uniform(0, step_m, near.size), ends_m)
    found_m = range_m.copy()
    found_m[near] = np.minimum(range_m[near], ends_m)
    return np.asarray(points * (found_m / range_m)[:, None], dtype=np.float32)


CUT_IN = "car cuts in"
LASTED = ("all", "a half")
_RAGGED = 0.2
"""Of a plume's edge, as a logarithm of its size from beam to beam."""
_STREET_SCALE, _STREET_FRAMES = 0.5, 10
_ASIDE_M, _AHEAD_M, _ACROSS_M_S = 3.2, 9.0, 2.0


def _ranges(points: Points) -> tuple[Floats, Floats]:
    """The range and the azimuth to the right, in degrees, of points (N, 3) right, down, ahead."""
    return np.linalg.norm(points, axis=1), np.rad2deg(np.arctan2(points[:, 0], points[:, 2]))


def _returned(points: Points, some: Mask, range_m: Floats) -> Points:
    """The points, of which some return from elsewhere along their beams."""
    scale = np.where(some, range_m / np.maximum(np.linalg.norm(points, axis=1), 0.1), 1.0)
    return np.asarray(points * scale[:, None], dtype=np.float32)


def wet_road(points: Points, rng: np.random.Generator, _place: np.random.Generator) -> Points:
    """The road's returns are lost, the more the farther; of those left one in twenty shows a mirror image below."""
    range_m, _ = _ranges(points)
    road = points[:, 1] > road_below_m(points) - 0.15
    lost = road & (rng.random(len(points)) < np.clip((range_m - 6) / 20, 0, 0.95))
    mirrored = road & (rng.random(len(points)) < 0.05)
    return _returned(points, mirrored, range_m + rng.uniform(0.5, 12, len(points)))[~lost]


def puddle(points: Points, _rng: np.random.Generator, place: np.random.Generator) -> Points:
    """A puddle of some metres mirrors what stands behind it: its returns lie below the road, or are lost."""
    x, z, across, along = place.uniform(-3, 3), place.uniform(6, 14), place.uniform(0.7, 2), place.uniform(1, 3)
    down_m = road_below_m(points)
    road = (points[:, 1] > down_m - 0.15) & (((points[:, 0] - x) / across) ** 2 + ((points[:, 2] - z) / along) ** 2 < 1)
    farther_m = place.uniform(3, 12)
    kept = ~road | (place.random(len(points)) < 0.6)
    return np.asarray(_returned(points, road, _ranges(points)[0] + farther_m)[kept])


def pane(points: Points, rng: np.random.Generator, place: np.random.Generator) -> Points:
    """A pane of 2 by 1.5 m beside the road mirrors: half of its beams return from as far again as something else is."""
    side, ahead = place.choice([-1, 1]), place.uniform(8, 20)
    range_m, azimuth = _ranges(points)
    middle = np.rad2deg(np.arctan2(side * place.uniform(4, 8), ahead))
    above = road_below_m(points) - points[:, 1]
    on = (np.abs(azimuth - middle) < np.rad2deg(1.0 / ahead)) & (above > 0.6) & (above < 2.1) & (range_m > 5)
    some = on & (rng.random(len(points)) < 0.5)
    return _returned(points, some, range_m + place.uniform(3, 15) + rng.normal(0, 0.02, len(points)))


def _plume(
    points: Points, rng: np.random.Generator, middle_m: Sequence[float], half_m: Sequence[float], optical_depth: float
) -> Points:
    """Beams through a plume end in it by Beer and Lambert's law, which is exponential from its near edge on.

    It is an ellipsoid of half the lengths `half_m` right, down and ahead, as dense everywhere, whose edge is ragged. Of
    the longest way through it ahead the optical depth is `optical_depth`.
    """
    centre, half = np.array(middle_m), np.array(half_m) * rng.lognormal(0, _RAGGED, (len(points), 1))
    range_m = np.maximum(np.linalg.norm(points, axis=1), 0.1)
    direction = points / range_m[:, None]
    squared = ((direction / half) ** 2).sum(axis=1)
    along = (direction * centre / half**2).sum(axis=1) / squared
    off = (((direction * along[:, None] - centre) / half) ** 2).sum(axis=1)
    within = np.sqrt(np.maximum(1 - off, 0) / squared)
    deep = rng.exponential(2 * half_m[2] / optical_depth, len(points))
    ends = along - within + deep
    some = (along > 0) & (deep < 2 * within) & (ends < range_m)
    return _returned(points, some, np.maximum(ends, 1.0))


def dust(points: Points, rng: np.random.Generator, place: np.random.Generator) -> Points:
    """Dust that a vehicle ahead throws up: some metres, in whose middle a beam in twenty to nine in twenty ends."""
    middle = place.uniform(-2, 2), road_below_m(points) - 0.8, place.uniform(8, 18)
    half = place.uniform(1, 2.5), place.uniform(0.5, 1.2), place.uniform(1, 4)
    return _plume(points, rng, middle, half, place.uniform(0.05, 0.6))


def exhaust(points: Points, rng: np.random.Generator, place: np.random.Generator) -> Points:
    """The steam of an exhaust on a cold day: 1 to 3 m long, of the beams through its middle a quarter or more end."""
    middle = place.uniform(-2, 2) + rng.normal(0, 0.1), road_below_m(points) - 0.4, place.uniform(6, 14)
    half = place.uniform(0.3, 0.7), place.uniform(0.15, 0.5), place.uniform(0.5, 1.5)
    return _plume(points, rng, middle, half, place.uniform(0.3, 1.5))


def sun(points: Points, rng: np.random.Generator, place: np.random.Generator) -> Points:
    """A low sun: within four degrees two fifths of the far returns are lost, and one beam in fifty returns noise."""
    range_m, azimuth = _ranges(points)
    near = np.hypot(azimuth - place.uniform(-25, 25), np.rad2deg(np.arcsin(-points[:, 1] / range_m)) - 3) < 4
    noise = near & (rng.random(len(points)) < 0.02)
    lost = near & (range_m > 10) & (rng.random(len(points)) < 0.4)
    return np.asarray(_returned(points, noise, rng.uniform(1, 100, len(points)))[~lost | noise])


def other_lidars(points: Points, rng: np.random.Generator, _place: np.random.Generator) -> Points:
    """Pulses of other LiDARs: one beam in two thousand anywhere, and thirty in a row of one passing by."""
    anywhere = rng.random(len(points)) < 0.0005
    middle = rng.uniform(-40, 40)
    beside = np.flatnonzero(np.abs(_ranges(points)[1] - middle) < 2)
    anywhere[rng.choice(beside, min(30, beside.size), replace=False)] = True
    return _returned(points, anywhere, rng.uniform(2, 80, len(points)))


HAPPENINGS = {
    "wet road": wet_road,
    "wet ground": wet_ground,
    "spray": spray,
    "puddle that mirrors": puddle,
    "pane that mirrors": pane,
    "dust": dust,
    "exhaust": exhaust,
    "low sun": sun,
    "other LiDARs": other_lidars,
}
RAIN_MM_H = (5, 25)


def changes(places: int, seed: int, only: Sequence[str]) -> Mapping[str, Change]:
    """What happens to clouds, by name, some of it at so many places each."""

    def happen(what: str, place: int, cloud: PointCloud, rig: Rig) -> PointCloud:
        rotation = lidar_axes(rig)
        points = cloud.xyz_m @ rotation.T
        rng, still = np.random.default_rng([seed, place, cloud.stamp_ns]), np.random.default_rng([seed, place])
        return PointCloud(cloud.stamp_ns, np.asarray(HAPPENINGS[what](points, rng, still) @ rotation, dtype=np.float32))

    rains = {f"rain {rate} mm/h #0": Rain(rate, seed).apply for rate in RAIN_MM_H}
    every = rains | {f"{what} #{place}": partial(happen, what, place) for what in HAPPENINGS for place in range(places)}
    return {name: change for name, change in every.items() if name.startswith(tuple(only))}


def cut_in(seed: int) -> Scene:
    """A street on which the car ahead comes from beside the vehicle into its way, 9 m ahead."""
    drive = make_drive(
        seed, _STREET_FRAMES, n_cameras=4, width_px=round(1242 * _STREET_SCALE), height_px=round(375 * _STREET_SCALE)
    )
    ahead = drive.surfaces.speed > 0
    first_m = drive.surfaces.corner[ahead, 2].min()
    side = 1 if seed % 2 else -1

    def frames() -> Iterator[Frame]:
        for number in range(_STREET_FRAMES):
            corner = drive.surfaces.corner.copy()
            aside = max(_ASIDE_M - _ACROSS_M_S * number / MEASURED_HZ, 0.0)
            corner[ahead] += np.array([side * aside, 0, _AHEAD_M - first_m], dtype=np.float32)
            yield replace(drive, surfaces=replace(drive.surfaces, corner=corner)).frame(number)

    kept = list(frames())
    features, cases = FaultFeatures(), list[Case]()
    for measurement, arrays in measure_all(kept, drive.rig):
        cases.append(case_of(replace(measurement, fault_features=features.update(arrays)), drive.rig))
    return Scene(f"{CUT_IN} {seed}", f"{CUT_IN} {seed}", drive.rig, kinds_of(kept[0]), tuple(cases))


def counted(drive: Drive) -> Iterator[tuple[str, int, int, int, int]]:
    """What happened in a drive: frames, those raised, those that name the LiDAR, and whether it is found."""
    every = [(name, of[LIDAR,]) for name, of in drive.attacks.items()]
    for name, cases in every or [(CUT_IN if drive.scene.name.startswith(CUT_IN) else "none|", {})]:
        verdicts = drive.judged(drive.series(cases, MEASURED_HZ))
        yield (
            ", ".join([name.partition(" #")[0], *name.split("|")[1:2]]),
            len(cases) or len(verdicts),
            sum(one.kind in FINDINGS for one in verdicts),
            sum(LIDAR in one.attacked for one in verdicts),
            any(one.finding for one in verdicts),
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--into", type=Path, required=True)
    parser.add_argument("--places", type=int, default=4)
    parser.add_argument("--only", nargs="+", default=[*HAPPENINGS, "rain"], help="of what happens")
    parser.add_argument("--alone", type=int, help="the camera that is measured with the LiDAR alone")
    parser.add_argument("--streets", type=int, default=6, help="on which a car cuts in")
    options = parser.parse_args()
    use_one_thread()
    real, streets = options.into / "real", options.into / "streets"
    for name, family, source in sources_of(Path(os.environ["AUDITOR_TEST_DATA"]), range(0), 0):
        happen = changes(options.places, zlib.crc32(name.encode()), options.only)
        keep(real, name, partial(measured, source, name, family, happen, lasts=LASTED, camera=options.alone))
    for seed in range(60000, 60000 + options.streets):
        keep(streets, str(seed), partial(cut_in, seed))
    for cameras in RIGS if options.alone is None else ((1,),):
        for how, prior in (("learnt from other drives", False), ("by the prior", True)):
            print(f"\nLiDAR and {len(cameras)} cameras, {how}: frames raised / that name S_0, of; drives found")
            drives = drives_of(load(real), cameras, R, prior=prior)
            drives += drives_of(load(streets), cameras, R, prior=True) if streets.exists() else []
            total: dict[str, Floats] = defaultdict(lambda: np.zeros(5))
            for drive in drives:
                for name, *counts in counted(drive):
                    total[name] += [*counts, 1]
            for name, sums in total.items():
                frames, raised, named, found, series = sums.astype(int).tolist()
                print(f"{name:36} {raised:4} / {named:4} of {frames:5} frames; {found} of {series} drives", flush=True)


if __name__ == "__main__":
    main()
